"""Scenes as the numerical core takes them."""

from __future__ import annotations

from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._types import Floats
from ..ground.discretise import Discretisation
from ..scene.conditions import AnyCondition
from ..scene.edges import CompliantBase
from ..scene.region import Region
from ..scene.soils import Material, PM4Sand
from ..scene.stages import AnyStage, Gravity, RunOut, Shaking
from .motions import StageMotions
from .probes import Probe

if TYPE_CHECKING:
    from ..scene.scene import Scene

# Distances over the spacing, in x and y, of the points around a stress point at which the stress at rest is
# taken. They differ, so that none is equally far from two nodes.
BESIDE = (1e-3, 2e-3)

# A stage of grains.
GrainStage = _core.Gravity | _core.Shaking | _core.RunOut


def section_description(scene: Scene, particles: Discretisation) -> _core.Section:
    """The section at rest: nodes, soils, water, edges and numerics."""
    x0, x1, _, _ = particles.bounds
    water = scene.water
    describe = partial(
        _core.Section,
        spacing=particles.spacing,
        position=particles.position,
        volume=particles.volume,
        region=particles.region.astype(np.uint32),
        regions=[_region(scene, region) for region in scene.regions],
        surface_elevation=particles.surface_elevation,
        pore_pressure=np.empty(0) if water is None else particles.pore_pressure0,
        saturation=np.empty(0) if particles.saturation0 is None else particles.saturation0,
        water=None
        if water is None
        else _core.Water(unit_weight=water.unit_weight, bulk_modulus=water.bulk_modulus),
        gravity=scene.gravity,
        period=x1 - x0 if scene.is_periodic else None,
        outline=outline_description(scene),
        numerics=_numerics(scene),
    )
    places = describe(vertical_effective_stress=np.empty(0)).stress_positions()
    # Elsewhere stress points lie inside the cell of their node.
    is_at_corners = scene.numerics.operators == "dual"
    sigma_v_eff = _stress_around(particles, places) if is_at_corners else particles.stress_at(places)[0]
    return describe(vertical_effective_stress=sigma_v_eff)


def _stress_around(particles: Discretisation, places: Floats) -> Floats:
    """Vertical effective stress at rest at stress points, kPa: the mean of four points beside each.

    A point at a corner of cells may lie on a contact of soils or on the edge of a column of nodes.
    """
    aside = np.multiply(BESIDE, particles.spacing)
    around = [particles.stress_at(places + aside * quarter)[0] for quarter in product((-1.0, 1.0), repeat=2)]
    mean: Floats = np.mean(around, axis=0)
    return mean


def outline_description(scene: Scene) -> _core.Outline:
    """Base and sides with their supports in statics."""
    outline, (x0, _, x1, _) = scene.outline, scene.bounds
    left, right = scene.side_kinds
    return _core.Outline(
        base=outline.base,
        base_support=scene.statics.base,
        left=_side(left, x0, outline.left),
        right=_side(right, x1, outline.right),
    )


def _side(kind: str, x: float, extent: tuple[float, float]) -> _core.Side | None:
    """A side with its support in statics; None between periodic sides."""
    if kind == "periodic":
        return None
    bottom, top = extent
    return _core.Side(x=x, bottom=bottom, top=top, support="no-slip" if kind == "fixed" else "free-slip")


def _numerics(scene: Scene) -> _core.Numerics:
    numerics = scene.numerics
    return _core.Numerics(
        operators=numerics.operators,
        smoothing_ratio=numerics.smoothing_ratio,
        velocity_filter=numerics.filter_strength,
        diffusion=numerics.diffusion,
        acceleration_term=numerics.acceleration_term,
        dispersion_correction=numerics.dispersion_correction,
        geometry_strain_limit=numerics.geometry_strain_limit,
        integrator=numerics.integrator,
        integrator_tolerance=numerics.integrator_tolerance,
    )


def _region(scene: Scene, region: Region) -> _core.Region:
    phases = region.resolved(scene)
    poisson = scene.statics.initial_poisson_ratio
    return _core.Region(
        soil=_soil(scene, region.material),
        porosity=phases.porosity,
        solid_density=phases.solid_density,
        hydraulic_conductivity=region.conductivity,
        retention=region.retention.core if region.retention and scene.holds_suction else None,
        earth_pressure_coefficient=region.K0,
        static_poisson_ratio=region.initial_poisson_ratio if poisson is None else poisson,
    )


def _soil(scene: Scene, material: Material) -> _core.Soil:
    """A soil. `gap_memory`, an option of PM4Sand, is given once for the scene, in its numerics."""
    if isinstance(material, PM4Sand):
        return material.core(gap_memory=scene.numerics.gap_memory)
    return material.core()


def stage_description(
    scene: Scene, stage: AnyStage, duration: float | None, motions: StageMotions | None, probes: list[Probe]
) -> GrainStage | None:
    """A stage of grains; None for seepage, which has none.

    `duration` (s) and `motions` are those of the stage, `probes` the places of its histories.
    """
    match stage:
        case Gravity():
            return _core.Gravity(tolerance=stage.tolerance, max_steps=stage.max_steps)
        case Shaking():
            assert motions is not None
            assert duration is not None
            return _shaking(scene, stage, duration, motions, _output(scene, probes))
        case RunOut():
            return _run_out(scene, stage, _output(scene, probes))
        case _:
            return None


def _output(scene: Scene, probes: list[Probe]) -> _core.Output:
    output = scene.output
    return _core.Output(
        probes=np.array([(probe.x, probe.y) for probe in probes]),
        history_interval=output.history_dt,
        stress_histories=output.stress_paths,
        pressure_envelope="r_u" in output.envelopes,
        strain_envelope="gamma_max" in output.envelopes,
    )


def _run_out(scene: Scene, stage: RunOut, output: _core.Output) -> _core.RunOut:
    line = stage.still_water
    return _core.RunOut(
        duration=stage.duration,
        viscosity=stage.viscosity,
        open=("left" in stage.open_sides, "right" in stage.open_sides),
        still_water=None if line is None else np.array(line, dtype=np.float64).reshape(-1, 2),
        local_damping=scene.numerics.local_damping,
        time_step_factor=scene.numerics.time_step_factor,
        output=output,
    )


def _shaking(
    scene: Scene, stage: Shaking, duration: float, motions: StageMotions, output: _core.Output
) -> _core.Shaking:
    left, right = (kind == "free-field" for kind in scene.side_kinds)
    rayleigh = stage.rayleigh
    return _core.Shaking(
        duration=duration,
        base=base_description(scene, stage, motions),
        free_field=(left, right),
        local_damping=scene.numerics.local_damping,
        rayleigh=None
        if rayleigh is None
        else _core.Rayleigh(ratio=rayleigh.ratio, frequencies=rayleigh.frequencies),
        conditions=[]
        if scene.water is None
        else [
            _core.MovingCondition(condition=condition_description(scene, condition), at_rest=at_rest)
            for condition, at_rest in scene.moving_conditions(stage)
        ],
        time_step_factor=scene.numerics.time_step_factor,
        output=output,
    )


def base_description(scene: Scene, stage: Shaking, motions: StageMotions) -> _core.Base:
    """The base of a shaking stage, and the waves that arrive through it."""
    base = stage.base
    waves, wave_of = motions.waves()
    return _core.Base(
        vertical=stage.base_vertical,
        half_space=_half_space(base),
        waves=waves,
        segments=[
            _core.BaseSegment(extent=arrival.x, wave=wave, delay=arrival.delay, slowness=arrival.slowness)
            for arrival, wave in zip(scene.arrivals(stage), wave_of, strict=True)
        ],
    )


def _half_space(base: CompliantBase) -> _core.HalfSpace | None:
    """The half-space of a base that is given by its own properties; None: that of the soil above."""
    if base.Vs is None or base.density is None:
        return None
    return _core.HalfSpace(shear_speed=base.Vs, compression_speed=base.Vp, density=base.density)


def condition_description(scene: Scene, condition: AnyCondition) -> _core.Condition:
    """A hydraulic condition on its line."""
    return _core.Condition(
        kind=condition.kind,
        line=np.array(scene.condition_line(condition).coords),
        time=[time for time, _ in condition.series],
        value=[value for _, value in condition.series],
    )
