"""Key figures of a run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..motion._series import butterworth
from ..run.plan import described_coefficient, pore_pressure_coefficients
from .layout import Stage
from .records import interval_of

if TYPE_CHECKING:
    from .reader import Run

# Corner, Hz, and order of the low-pass filter below which surface accelerations of different codes agree:
# peaks above it are single dilation spikes that depend on mesh and time step.
PGA_CORNER = 10.0
PGA_ORDER = 4
# Name of a stage's counts in its figures.
COUNTS = "counts"


class Summary(dict[str, Any]):
    """Key figures of a run by name; as text, one line for each, without counts of zero."""

    def __str__(self) -> str:
        return "\n".join(_lines(self))


def _lines(figures: dict[str, Any], indent: str = "") -> Iterator[str]:
    """`name  value` for every figure, parts indented below their name."""
    plain = [name for name, value in figures.items() if not isinstance(value, dict)]
    width = max((len(name) for name in plain), default=0)
    for name, value in figures.items():
        if isinstance(value, dict):
            yield f"{indent}{name}"
            shown = {part: n for part, n in value.items() if n != 0} if name == COUNTS else value
            yield from _lines(shown, indent + "  ")
        else:
            yield (
                f"{indent}{name:{width}}  {value:.4g}"
                if isinstance(value, float)
                else (f"{indent}{name:{width}}  {value}")
            )


def summary_of(run: Run) -> Summary:
    figures = Summary(status=run.status, accuracy=run.accuracy)
    if run.resumed:
        figures["resumed, times"] = run.resumed
    if run.message:
        figures["message"] = run.message
    for stage in run.stages:
        figures[stage] = _stage_figures(run, stage)
    if run.scene.water is not None:
        coefficients = pore_pressure_coefficients(run.scene)
        figures["pore pressure coefficient B"] = {
            name: described_coefficient(value) for name, value in coefficients.items()
        }
    return figures


def _stage_figures(run: Run, stage: str) -> dict[str, Any]:
    accounts = run.accounts(stage)
    figures: dict[str, Any] = {
        "time, s": float(accounts.get(Stage.TIME, 0.0)),
        "steps": int(accounts.get(Stage.STEPS, 0)),
        "wall time, s": float(accounts.get(Stage.WALL_TIME, 0.0)),
    }
    if run.scene.stage_names.index(stage) in run._frame_stage:
        dt, limits = run.time_steps(stage)
        if dt.max() > 0.0:
            figures["time step, s"] = f"{dt.min():.4g} to {dt.max():.4g}"
            figures["time step limited by"] = ", ".join(dict.fromkeys(limits))
    figures["pore pressure diffusion"] = str(accounts[Stage.FLOW_SCHEME])
    if run.has_histories(stage):
        figures |= _response_figures(run, stage)
    if stage == "seepage":
        figures |= _water_figures(run)
    figures[COUNTS] = {
        name.removeprefix(Stage.COUNT): int(count)
        for name, count in accounts.items()
        if name.startswith(Stage.COUNT)
    }
    return figures


def _water_figures(run: Run) -> dict[str, Any]:
    numbered = [f"{i} {kind}" for i, (kind, _) in enumerate(run.discharge)]
    inflows = [inflow for _, inflow in run.discharge]
    figures: dict[str, Any] = {"inflow by condition, m3/s per m": dict(zip(numbered, inflows, strict=True))}
    if (balance := run.water_balance) is not None:
        totals = dict(zip(numbered, balance[0], strict=True))
        figures["water in all by condition, m3 per m"] = totals
        figures["gain of stored water, m3 per m"] = balance[1]
    return figures


def _response_figures(run: Run, stage: str) -> dict[str, Any]:
    surface = run.history("acceleration_x", stage=stage, unit="g")
    dt = interval_of(surface)
    figures: dict[str, Any] = {"peak surface acceleration, g": float(np.abs(surface.values).max())}
    if 0.5 / dt > PGA_CORNER:
        smooth = butterworth(surface.values, dt, None, PGA_CORNER, PGA_ORDER)
        figures[f"the same below {PGA_CORNER:g} Hz, g"] = float(np.abs(smooth).max())
    motion = run.motion(stage)
    if motion is not None:
        figures[f"peak of the {motion.kind} motion, g"] = motion.pga_g
    figures["final settlement of the surface, m"] = float(run.settlement(stage=stage).values[-1])
    if run.scene.water is not None:
        figures["largest r_u"] = {
            probe.label: float(run.history("r_u", at=(probe.x, probe.y), stage=stage).values.max())
            for place, probe in enumerate(run.probes)
            if run._sigma_v_eff0[place] > 0.0
        }
    return figures
