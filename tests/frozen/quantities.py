"""What scenes and tests give, read through the public interface: quantities by stage and by name."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import numpy as np
import sandboil as sb
from sandboil import lab

# A number, a text, or the digest of an array.
Value = int | str
# By stage (or part) and name.
Found = dict[str, dict[str, Value]]

# Sixteen digits of the digest: a difference that they miss has one chance in 2^64.
DIGITS = 16


def digest(values: Any) -> str:
    """The first digits of the SHA-256 of an array's bytes, little-endian, every NaN the same."""
    array = np.asarray(values)
    if array.dtype.kind == "f":
        array = np.where(np.isnan(array), np.nan, array).astype("<f8")
    else:
        array = array.astype("<i8")
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()[:DIGITS]


def text_digest(lines: Iterable[object]) -> str:
    """The first digits of the SHA-256 of lines of text."""
    return hashlib.sha256("\n".join(str(line) for line in lines).encode()).hexdigest()[:DIGITS]


def value(given: Any) -> Value:
    """Numbers as they are, floats by all their bits; arrays as digests."""
    if isinstance(given, str):
        return given
    if isinstance(given, (bool, int, np.integer)):
        return int(given)
    if isinstance(given, (float, np.floating)):
        return float(given).hex()
    return digest(given)


def _values(prefix: str, given: dict[str, Any]) -> dict[str, Value]:
    return {f"{prefix} {name}": value(each) for name, each in given.items() if each is not None}


def of_ground(simulation: sb.Simulation) -> dict[str, Value]:
    """The nodes and their geostatic state."""
    names = (
        "position",
        "volume",
        "region",
        "surface_elevation",
        "sigma_v_eff0",
        "pore_pressure0",
        "saturation0",
    )
    return _values("node", {name: getattr(simulation.particles, name) for name in names})


def of_stage(simulation: sb.Simulation) -> dict[str, Value]:
    """All that can be read of a simulation in its present stage. Histories and energy are taken from it."""
    history_time, histories = simulation.take_histories()
    energy_time, energy = simulation.take_energy()
    moves = simulation.can_be_stored
    found = {
        **_values("field", simulation.fields(simulation.field_names)),
        **_values("envelope", {name: simulation.envelope(name) for name in ("r_u", "gamma_max")}),
        **_values("history", {"time": history_time, **histories} if histories else {}),
        **_values("energy", {"time": energy_time, **energy} if energy else {}),
        **_values("count", {name: count for name, count in simulation.counters().items() if count}),
        **_values(
            "stage",
            {
                "time": simulation.time,
                "steps": simulation.steps,
                "time step": simulation.dt,
                "time step without Rayleigh damping": simulation.undamped_dt,
                "base impedance": simulation.base_impedance,
                "residual": simulation.residual if moves else None,
            },
        ),
    }
    if not moves:
        found |= _values("condition", {"discharge": [inflow for _, inflow in simulation.discharge]})
        found |= _values(
            "condition", {f"{i} outlets": simulation.outlets(i) for i in range(len(simulation.discharge))}
        )
        if (balance := simulation.water_balance) is not None:
            found |= _values("condition", {"inflow": balance[0], "stored": balance[1]})
    for column, record in simulation.take_columns():
        found |= _values(f"{column.hand} column", {"impedance": record.impedance, "values": record.values})
    return found


def planned(simulation: sb.Simulation) -> dict[str, Value]:
    """What a plan says of the present stage: sizes, and how it is computed in words."""
    return {
        "arrays": text_digest(simulation.arrays().items()),
        "pairs": simulation.pairs,
        "scheme": simulation.flow_scheme,
        "limit of the time step": simulation.dt_limit,
    }


def of_run(run: sb.Run) -> Found:
    """All that a run's results give, by stage, save times on the clock and what says how it was computed."""
    found: Found = {"nodes": {"position": digest(run.position), "column": digest(run.column())}}
    for stage in run.stages:
        accounts = run.accounts(stage)
        found[stage] = _values(
            "count", {name: n for name, n in accounts.items() if name.startswith("count_") and n}
        )
        found[stage] |= _values(
            "stage", {name: accounts.get(name) for name in ("steps", "time_s", "duration_s")}
        )
        if stage in ("gravity", "seepage"):
            continue
        found[stage] |= _values(
            "series", {name: run.field_series(name, stage=stage) for name in run.field_names}
        )
        found[stage] |= _values(
            "profile", {name: run.profile(name, stage=stage).values for name in run.field_names}
        )
        found[stage] |= _values(
            "envelope", {name: run.envelope(name, stage=stage) for name in run.scene.output.envelopes}
        )
        for probe in run.probes:
            histories = {
                name: run.history(name, at=(probe.x, probe.y), stage=stage) for name in run.history_names
            }
            found[stage] |= _values(
                f"history, {probe.label},", {name: history.values for name, history in histories.items()}
            )
        surface, (time_step, _) = run.surface(stage=stage), run.time_steps(stage)
        found[stage] |= _values("energy", run.energy(stage))
        found[stage] |= _values(
            "run",
            {
                "times": run.frame_times(stage),
                "time steps": time_step,
                "settlement": run.settlement(stage=stage).values,
                "surface": np.stack([surface.x, surface.y]),
            },
        )
    return found


def of_test(test: lab.CyclicTest | Any) -> dict[str, Value]:
    """Every column of a laboratory test, and how it ended."""
    found = _values("column", test.columns())
    if isinstance(test, lab.ShearCell):
        found |= _values("node", test.nodes.columns())
        spared = ("wall_time", "counters")
        found |= _values(
            "report", {name: each for name, each in vars(test.report).items() if name not in spared}
        )
        found |= _values("count", {name: count for name, count in test.report.counters.items() if count})
    return found
