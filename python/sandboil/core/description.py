"""Scenes as the numerical core takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._types import Floats
from ..ground.discretise import Discretisation
from ..scene.conditions import AnyCondition
from ..scene.region import Region
from ..scene.stages import AnyStage, RunOut, Shaking
from .motions import StageMotions, Wave
from .probes import Probe

if TYPE_CHECKING:
    from ..scene.scene import Scene


def stress_node_positions(particles: Discretisation) -> Floats:
    """Initial places of the stress nodes, m, (n, 2, 2): node, first or second, (x, y)."""
    offset = np.array(_core.stress_node_offset(*particles.spacing))
    places: Floats = particles.position[:, None, :] + offset * np.array([[[1.0], [-1.0]]])
    return places


def section_description(scene: Scene, particles: Discretisation) -> dict[str, Any]:
    """The section at rest: nodes, soils, water, edges and numerics."""
    x0, x1, _, _ = particles.bounds
    sigma_v_eff, _ = particles.stress_at(stress_node_positions(particles).reshape(-1, 2))
    water = scene.water
    numerics = scene.numerics.model_dump(exclude={"local_damping", "time_step_factor"})
    numerics["velocity_filter"] = scene.numerics.filter_strength
    return {
        "spacing": particles.spacing,
        "position": particles.position,
        "volume": particles.volume,
        "region": particles.region.astype(np.uint32),
        "regions": [_region(scene, region) for region in scene.regions],
        "surface_elevation": particles.surface_elevation,
        "vertical_effective_stress": sigma_v_eff,
        "pore_pressure": np.empty(0) if water is None else particles.pore_pressure0,
        "saturation": np.empty(0) if particles.saturation0 is None else particles.saturation0,
        "water": None if water is None else (water.unit_weight, water.bulk_modulus),
        "gravity": scene.gravity,
        "period": x1 - x0 if scene.is_periodic else None,
        **_edges(scene),
        "numerics": numerics,
    }


def _edges(scene: Scene) -> dict[str, Any]:
    """Base and sides as the numerical core takes them, and what they are in statics."""
    outline, (x0, _, x1, _) = scene.outline, scene.bounds
    left, right = (
        _side(kind, x, extent)
        for kind, x, extent in zip(scene.side_kinds, (x0, x1), (outline.left, outline.right), strict=True)
    )
    return {
        "base": outline.base,
        "base_support": scene.statics.base,
        "left": left,
        "right": right,
    }


def _side(kind: str, x: float, extent: tuple[float, float]) -> dict[str, Any] | None:
    """A side as a wall of the static stage; None between periodic sides."""
    if kind == "periodic":
        return None
    support = "fixed" if kind == "fixed" else "roller"
    return {"x": x, "bottom": extent[0], "top": extent[1], "support": support}


def stage_description(
    scene: Scene, stage: AnyStage, duration: float | None, motions: StageMotions | None, probes: list[Probe]
) -> dict[str, Any] | None:
    """A stage in which the ground moves; None for another.

    `duration` (s) and `motions` are those of the stage, `probes` the places of its histories.
    """
    match stage:
        case Shaking():
            assert motions is not None
            own = _shaking(scene, stage, *motions.waves())
        case RunOut():
            own = _run_out(scene, stage)
        case _:
            return None
    output = scene.output
    return {
        "duration": duration,
        **own,
        "column_records": (None, None),
        "record_columns": None,
        "local_damping": scene.numerics.local_damping,
        "time_step_factor": scene.numerics.time_step_factor,
        "probes": np.array([(probe.x, probe.y) for probe in probes]),
        "history_interval": output.history_dt,
        "stress_histories": output.stress_paths,
        "pressure_envelope": "r_u" in output.envelopes,
        "strain_envelope": "gamma_max" in output.envelopes,
    }


def _run_out(scene: Scene, stage: RunOut) -> dict[str, Any]:
    """The walls and the water of a run-out. No wave arrives: the base only has a place."""
    x0, _, x1, _ = scene.bounds
    return {
        "waves": [],
        "base": {"vertical": "roller", "half_space": None, "segments": [(x0, x1, None, 0.0, 0.0)]},
        "sides": ("wall", "wall"),
        "conditions": [],
        "rayleigh": None,
        "run_out": {
            "viscosity": stage.viscosity,
            "open": tuple(hand in stage.open_sides for hand in ("left", "right")),
            "still_water": None
            if stage.still_water is None
            else np.array(stage.still_water, dtype=np.float64).reshape(-1, 2),
        },
    }


def _shaking(scene: Scene, stage: Shaking, waves: list[Wave], wave_of: list[int | None]) -> dict[str, Any]:
    """The waves that shake the ground, and its edges; `wave_of` is the wave of each stretch of the base."""
    base, rayleigh = stage.base, stage.rayleigh
    left, right = ("free-field" if kind == "free-field" else "wall" for kind in scene.side_kinds)
    return {
        "waves": waves,
        "base": {
            "vertical": stage.base_vertical,
            "half_space": None if base.Vs is None else (base.Vs, base.Vp, base.density),
            "segments": [
                (*arrival.x, wave, arrival.delay, arrival.slowness)
                for arrival, wave in zip(scene.arrivals(stage), wave_of, strict=True)
            ],
        },
        "sides": (left, right),
        "conditions": [
            condition_description(scene, condition) | {"at_rest": at_rest}
            for condition, at_rest in scene.moving_conditions(stage)
        ]
        if scene.water is not None
        else [],
        "rayleigh": None if rayleigh is None else (rayleigh.ratio, rayleigh.frequencies),
        "run_out": None,
    }


def condition_description(scene: Scene, condition: AnyCondition) -> dict[str, Any]:
    """A hydraulic condition as the numerical core takes it."""
    line = np.array(scene.condition_line(condition).coords)
    series = condition.series
    time, value = zip(*series, strict=True) if series else ((), ())
    return {"kind": condition.kind, "line": line, "series": (list(time), list(value))}


def _region(scene: Scene, region: Region) -> dict[str, Any]:
    soil = region.resolved(scene)
    poisson = scene.statics.initial_poisson_ratio
    return {
        "material": region.material.core(),
        "porosity": soil.porosity,
        "solid_density": soil.solid_density,
        "hydraulic_conductivity": region.conductivity,
        "retention": region.retention.core if region.retention and scene.holds_suction else None,
        "earth_pressure_coefficient": region.K0,
        "static_poisson_ratio": region.initial_poisson_ratio if poisson is None else poisson,
    }
