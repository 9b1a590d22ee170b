"""Scenes that between them use every option there is, each computed within a second or two."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi, sin
from pathlib import Path
from typing import Any

import sandboil as sb

LOOSE = sb.PM4Sand(Dr=0.35, G0=476.0, hpo=0.53)
MEDIUM = sb.PM4Sand(
    Dr=0.55,
    G0=677.0,
    hpo=0.40,
    p_atm=100.0,
    ho=0.42,
    e_max=0.81,
    e_min=0.49,
    nb=0.52,
    nd=0.11,
    Ado=1.3,
    z_max=6.0,
    cz=240.0,
    ce=0.6,
    phi_cv=32.5,
    nu=0.28,
    C_GD=2.1,
    C_DR=9.0,
    C_kaf=5.0,
    Q=9.8,
    R=1.4,
    m=0.011,
    F_sed_min=0.05,
    p_sed_o=19.0,
)
ROCK = sb.Elastic(E=2.0e5, nu=0.3)
BEDROCK = sb.Elastic(G=8.0e4, K=1.7e5)
GRAVEL = sb.PressureElastic(G=4.0e4, K=8.0e4, exponent=0.4, p_ref=90.0)
FILL = sb.PressureElastic(E=6.0e4, nu=0.25)
CLAY = sb.TotalStress(Su=15.0, Sr=5.0, softening_strain=0.05, G=1.5e4, K=4.0e4)
SOFT_CLAY = sb.TotalStress(
    Su=12.0, Sr=6.0, softening_strain=0.1, softening="linear", criterion="von_mises", E=3.2e4, nu=0.33
)
SOFTENING = sb.DruckerPrager(
    c=6.0,
    phi=30.0,
    psi=5.0,
    c_residual=2.0,
    phi_residual=25.0,
    psi_residual=0.0,
    softening_strain=0.1,
    tension_cutoff=3.0,
    matching="general",
    G=2.0e4,
    K=4.0e4,
)
GRAINS = sb.DruckerPrager(E=840.0, nu=0.3, phi=19.8, c=0.0)
WEAK_SILT = sb.MohrCoulomb(c=1.0, phi=28.0, G=8.0e3, K=1.7e4)
SILT = sb.MohrCoulomb(c=5.0, phi=32.0, psi=3.0, tension_cutoff=2.0, E=3.0e4, nu=0.3)
RETENTION = sb.VanGenuchten(2.0, 2.0, residual_saturation=0.05, full_saturation=0.98)

PULSE = sb.Motion.ricker(frequency=4.0, pga_g=0.3)
WEAK_PULSE = sb.Motion.ricker(frequency=5.0, pga_g=0.05)


def _wave(dt: float = 0.01, count: int = 31) -> list[float]:
    """A full wave of 0.3 s that begins and ends at zero."""
    return [0.15 * sin(2.0 * pi * k / (count - 1)) for k in range(count)]


def _column(width: float, soils: Sequence[tuple[Any, float, float, dict[str, Any]]]) -> list[sb.Region]:
    """Level layers of (soil, bottom, top, further options)."""
    return [
        sb.Region(f"layer {k}", sb.box(x=(0, width), y=(bottom, top)), soil, **options)
        for k, (soil, bottom, top, options) in enumerate(soils)
    ]


def level_ground(folder: Path) -> sb.Scene:
    """Liquefying sand under a pulse, an aftershock, and quiet time; enough nodes for every thread to work."""
    porous: dict[str, Any] = {"hydraulic_conductivity": 1e-4, "Gs": 2.67}
    return sb.Scene(
        spacing=0.25,
        gravity=9.8,
        water=sb.Water(unit_weight=9.9, bulk_modulus=9.0e5),
        water_table=sb.WaterTable(depth=0.0),
        regions=_column(4.0, [(MEDIUM, 0, 2, porous), (LOOSE, 2, 4, porous)]),
        stages=[
            sb.Gravity(),
            sb.Shaking(PULSE),
            sb.Shaking(sb.Motion(dt=0.01, acceleration_g=_wave()), duration=0.4),
            sb.Shaking(duration=0.2),
        ],
        output=sb.Output(depths=[1.0, 3.0], points=[(1.0, 0.6)], history_dt=0.004, field_dt=0.2),
    )


def explicit_flow(folder: Path) -> sb.Scene:
    """Explicit diffusion with the water's acceleration, both components of a motion, and every damping."""
    porous: dict[str, Any] = {
        "hydraulic_conductivity": 5e-4,
        "dry_unit_weight": 15.5,
        "saturated_unit_weight": 19.5,
    }
    sand = sb.PM4Sand(Dr=0.5, G0=600.0, hpo=0.4)
    return sb.Scene(
        spacing=0.25,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0.0),
        regions=_column(
            0.5,
            [
                (GRAVEL, 0, 1.5, porous),
                (sand, 1.5, 3, {"hydraulic_conductivity": 5e-4, "saturated_unit_weight": 19.5}),
            ],
        ),
        stages=[
            sb.Gravity(),
            sb.Shaking(
                sb.MotionSpec(ricker={"frequency": 4.0, "pga_g": 0.2, "dt": 0.002}, scale=0.8),
                vertical=sb.MotionSpec(ricker={"frequency": 8.0, "pga_g": 0.05, "dt": 0.002}),
                duration=0.5,
                rayleigh=sb.Rayleigh(ratio=0.01, frequencies=(2.0, 12.0)),
            ),
        ],
        output=sb.Output(depths=[1.0]),
        numerics=sb.Numerics(
            diffusion="explicit",
            acceleration_term="on",
            local_damping=0.03,
            velocity_filter=0.1,
            time_step_factor=0.7,
        ),
    )


def implicit_flow(folder: Path) -> sb.Scene:
    """Implicit diffusion through layers at an angle to a drain and to a base under pressure."""
    layered: dict[str, Any] = {
        "hydraulic_conductivity": sb.Conductivity(2e-3, 5e-4, angle_deg=20.0),
        "Gs": 2.65,
        "K0": 0.45,
    }
    return sb.Scene(
        spacing=0.25,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0.0),
        regions=_column(1.0, [(LOOSE, 0, 3, layered)]),
        stages=[
            sb.Gravity(),
            sb.Shaking(
                PULSE,
                duration=0.6,
                conditions=[
                    sb.Drain([(0.3, 0.9), (0.7, 1.6)]),
                    sb.Head("base", head=[(0.0, 3.0), (0.5, 3.3)]),
                ],
            ),
        ],
        output=sb.Output(depths=[1.5], envelopes=["r_u"]),
        numerics=sb.Numerics(
            diffusion="implicit",
            acceleration_term="off",
            gap_memory=True,
            integrator_tolerance=2.0e-6,
            geometry_strain_limit=1.0e-3,
        ),
    )


def undrained_pond(folder: Path) -> sb.Scene:
    """Clays that let no water through, under a pond, on a half-space that is given."""
    return sb.Scene(
        spacing=0.25,
        water=sb.Water(),
        water_table=sb.WaterTable(elevation=4.0),
        regions=_column(
            0.5,
            [
                (CLAY, 0, 1.5, {"porosity": 0.45, "Gs": 2.7}),
                (SOFT_CLAY, 1.5, 3, {"void_ratio": 0.9, "bulk_unit_weight": 18.5}),
            ],
        ),
        stages=[sb.Gravity(), sb.Shaking(PULSE, base=sb.CompliantBase(400.0, 2.1), duration=0.6)],
        output=sb.Output(depths=[1.0], envelopes=[], stress_paths=False),
    )


def printed_dry(folder: Path) -> sb.Scene:
    """The printed operators in softening soil between rough walls."""
    return sb.Scene(
        spacing=0.5,
        regions=[
            sb.Region("low", sb.box(x=(0, 3), y=(0, 2)), SOFTENING, dry_unit_weight=17.0),
            sb.Region("high", sb.box(x=(0, 3), y=(2, 4)), SILT, porosity=0.4, dry_unit_weight=16.0),
        ],
        sides=sb.Fixed(),
        stages=[
            sb.Gravity(tolerance=2.0e-4, max_steps=100_000, initial_poisson_ratio=0.25),
            sb.Shaking(PULSE, duration=0.6),
        ],
        output=sb.Output(depths=[2.0]),
        numerics=sb.Numerics(
            operators="printed", smoothing_ratio=1.5, integrator="rk4", geometry_strain_limit=0.01
        ),
    )


def printed_wet(folder: Path) -> sb.Scene:
    """The printed operators with water, explicit and without its acceleration."""
    porous: dict[str, Any] = {"hydraulic_conductivity": 1e-3, "Gs": 2.67}
    return sb.Scene(
        spacing=0.25,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0.0),
        regions=_column(0.5, [(LOOSE, 0, 2.5, porous)]),
        sides=sb.Periodic(),
        stages=[sb.Gravity(), sb.Shaking(PULSE, duration=0.4)],
        output=sb.Output(depths=[1.0]),
        numerics=sb.Numerics(operators="printed", diffusion="explicit", acceleration_term="off"),
    )


def corrected(folder: Path) -> sb.Scene:
    """Corrected inertia, the reference integrator and no filter, under an upgoing wave from a file."""
    path = folder / "wave.csv"
    rows = [f"{0.01 * k!r},{0.2 * value!r}" for k, value in enumerate(_wave())]
    path.write_text("\n".join(["t,v", *rows, ""]), encoding="utf-8")
    porous: dict[str, Any] = {"hydraulic_conductivity": 1e-4, "Gs": 2.67}
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0.0),
        regions=_column(1.0, [(ROCK, 0, 1, porous | {"porosity": 0.4}), (LOOSE, 1, 3, porous)]),
        stages=[
            sb.Gravity(),
            sb.Shaking(
                sb.MotionSpec(file=str(path), unit="m/s", column="v", kind="upgoing"),
                base=sb.CompliantBase(vertical="absorbing"),
                duration=0.4,
            ),
        ],
        output=sb.Output(depths=[1.0]),
        numerics=sb.Numerics(dispersion_correction=True, integrator="reference", velocity_filter=0.0),
    )


def free_field(folder: Path) -> sb.Scene:
    """A wet slope on an uneven base between two columns, which waves reach at different times."""
    porous: dict[str, Any] = {"hydraulic_conductivity": 1e-4, "Gs": 2.65}
    base = sb.CompliantBase(
        500.0,
        2.2,
        Vp=900.0,
        segments=[
            sb.BaseSegment((5, 10), delay=0.02, motion=WEAK_PULSE),
            sb.BaseSegment((0, 5), delay=0.0),
        ],
    )
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(elevation=5.0),
        regions=[
            sb.Region("sand", sb.polygon([(0, 0), (5, 0.5), (10, 0), (10, 2), (0, 2)]), LOOSE, **porous),
            sb.Region(
                "silt",
                sb.polygon([(0, 2), (10, 2), (10, 3), (7, 3), (4, 4), (0, 4)]),
                SILT,
                porosity=0.42,
                **porous,
            ),
        ],
        sides=sb.FreeField(),
        stages=[
            sb.Gravity(),
            sb.Shaking(PULSE, base=base),
            sb.Shaking(PULSE, base=sb.CompliantBase(500.0, 2.2, Vp=900.0, vertical="roller"), duration=0.2),
        ],
        output=sb.Output(depths=[1.0], points=[(2.0, 2.0)], field_dt=0.25),
    )


def wall_and_column(folder: Path) -> sb.Scene:
    """Dry ground on an inclined base between a column and a smooth wall; the wave runs to the right."""
    return sb.Scene(
        spacing=0.5,
        regions=[
            sb.Region("soil", sb.polygon([(0, 0), (6, 0.6), (6, 4), (0, 4)]), SILT, dry_unit_weight=17.0),
        ],
        sides=sb.Sides(sb.FreeField(), sb.Roller()),
        stages=[
            sb.Gravity(),
            sb.Shaking(
                sb.MotionSpec(synthetic={"pga_g": 0.2, "duration": 1.0, "seed": 3, "pgv": 0.08}),
                base=sb.CompliantBase(apparent_velocity=300.0),
                duration=0.6,
                rayleigh=sb.Rayleigh(ratio=0.1, frequencies=(2.0, 4.0)),
            ),
        ],
        output=sb.Output(depths=[1.0]),
    )


def column_and_wall(folder: Path) -> sb.Scene:
    """Wet elastic ground between a rough wall and a column; the wave runs to the left."""
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(elevation=3.0),
        regions=[
            sb.Region(
                "rock",
                sb.box(x=(0, 5), y=(0, 1.5)),
                BEDROCK,
                hydraulic_conductivity=1e-6,
                Gs=2.6,
                porosity=0.2,
            ),
            sb.Region(
                "gravel",
                sb.box(x=(0, 5), y=(1.5, 3)),
                FILL,
                hydraulic_conductivity=1e-2,
                Gs=2.6,
                porosity=0.4,
            ),
        ],
        sides=sb.Sides(sb.Fixed(), sb.FreeField()),
        stages=[
            sb.Gravity(),
            sb.Shaking(
                sb.MotionSpec(dt=0.01, velocity=[0.3 * value for value in _wave()]),
                base=sb.CompliantBase(apparent_velocity=-400.0, vertical="absorbing"),
                duration=0.4,
            ),
        ],
        output=sb.Output(depths=[1.0]),
        numerics=sb.Numerics(local_damping=0.02),
    )


def steady_seepage(folder: Path) -> sb.Scene:
    """Every condition of water on its way to a steady state, and an earthquake in that water."""
    region: dict[str, Any] = {"retention": RETENTION, "Gs": 2.65, "porosity": 0.4}
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(points=[(0, 3.5), (8, 2.0)], above="retention"),
        regions=[
            sb.Region("low", sb.box(x=(0, 8), y=(0, 2)), SILT, hydraulic_conductivity=1e-4, **region),
            sb.Region(
                "dam",
                sb.polygon([(0, 2), (8, 2), (8, 2.5), (5, 4), (0, 4)]),
                SILT,
                hydraulic_conductivity=sb.Conductivity(1e-4, 3e-5, angle_deg=10.0),
                **region,
            ),
        ],
        sides=sb.Roller(),
        stages=[
            sb.Seepage(
                [
                    sb.Reservoir("left", level=3.5),
                    sb.Pressure([(8, 0), (8, 0.6)], pressure=16.0),
                    sb.SeepageFace([(8, 2.5), (5, 4)]),
                    sb.Rain("surface", rate=2.0e-6, x=(0, 5)),
                    sb.Flux("base", inflow=1.0e-6, x=(2, 4)),
                    sb.Head("base", head=2.5, x=(6, 7)),
                    sb.Drain([(4.2, 1.2), (5.6, 1.4)]),
                ]
            ),
            sb.Gravity(),
            sb.Shaking(WEAK_PULSE, duration=0.4),
            sb.Shaking(
                duration=0.2,
                conditions=[
                    sb.Reservoir("left", level=[(0.0, 3.5), (0.2, 3.0)]),
                    sb.Rain("surface", rate=[(0.0, 0.0), (0.1, 1.0e-5)], x=(0, 5)),
                    sb.SeepageFace("right"),
                ],
            ),
        ],
        output=sb.Output(depths=[1.0]),
    )


def seepage_in_time(folder: Path) -> sb.Scene:
    """A reservoir that falls, rain, and a sudden inflow, then shaking with all edges sealed."""
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(elevation=3.0),
        regions=[
            sb.Region(
                "sand",
                sb.box(x=(0, 4), y=(0, 4)),
                LOOSE,
                hydraulic_conductivity=1e-4,
                retention=sb.VanGenuchten(4.0, 2.5, residual_saturation=0.1),
                Gs=2.65,
            )
        ],
        sides=sb.Sides(sb.Roller(), sb.Fixed()),
        stages=[
            sb.Seepage(
                [
                    sb.Reservoir("right", level=[(0.0, 3.0), (1800.0, 2.0)]),
                    sb.Rain("surface", rate=[(0.0, 0.0), (600.0, 5.0e-6)]),
                    sb.Flux("left", inflow=[(0.0, 0.0), (6000.0, 0.0), (6001.0, 2.0e-4)]),
                ],
                duration=7200.0,
            ),
            sb.Gravity(),
            sb.Shaking(PULSE, duration=0.3, conditions=[]),
        ],
        output=sb.Output(depths=[2.0]),
        numerics=sb.Numerics(diffusion="implicit"),
    )


def water_alone(folder: Path) -> sb.Scene:
    """Seepage through full soil, and no other stage."""
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0.0),
        regions=_column(3.0, [(SILT, 0, 4, {"hydraulic_conductivity": 1e-5, "Gs": 2.65, "porosity": 0.4})]),
        sides=sb.Roller(),
        stages=[
            sb.Seepage(
                [sb.Head("left", head=4.5), sb.Head("right", head=4.0)], duration=600.0, tolerance=0.001
            )
        ],
        output=sb.Output(field_dt=200.0),
    )


def dry_above_water(folder: Path) -> sb.Scene:
    """Soil that is dry above the water table and undrained, on a base that is smooth at rest."""
    return sb.Scene(
        spacing=0.25,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=1.0, above="dry"),
        regions=_column(0.5, [(LOOSE, 0, 3, {"Gs": 2.65})]),
        stages=[sb.Gravity(base="free-slip"), sb.Shaking(PULSE, duration=0.5)],
        output=sb.Output(depths=[1.0, 2.0]),
    )


def slope_run_out(folder: Path) -> sb.Scene:
    """A slope half under water and half held by suction, shaken between columns until it flows."""
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(elevation=2.5, above="retention"),
        regions=[
            sb.Region(
                "slope",
                sb.polygon([(0, 0), (10, 0), (10, 2), (7, 2), (4, 4), (0, 4)]),
                WEAK_SILT,
                hydraulic_conductivity=1e-4,
                retention=sb.VanGenuchten(alpha=2.0, n=2.0),
                Gs=2.65,
                porosity=0.4,
            )
        ],
        sides=sb.FreeField(),
        stages=[sb.Gravity(), sb.Shaking(PULSE, duration=0.4), sb.RunOut(0.4)],
        output=sb.Output(field_dt=0.2),
    )


def dry_heap(folder: Path) -> sb.Scene:
    """A dry heap that falls to both sides."""
    return sb.Scene(
        spacing=0.02,
        regions=[sb.Region("heap", sb.box(x=(0.0, 0.2), y=(0.0, 0.1)), GRAINS, porosity=0.4, Gs=2.65)],
        sides=sb.Roller(),
        stages=[sb.Gravity(), sb.RunOut(0.25, open_sides=["left", "right"], viscosity=0.2)],
        output=sb.Output(field_dt=0.1, history_dt=0.01),
    )


def wet_heap(folder: Path) -> sb.Scene:
    """A heap of sand that flows into water whose surface is inclined."""
    return sb.Scene(
        spacing=0.1,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0.0),
        regions=[
            sb.Region("heap", sb.box(x=(0.0, 0.6), y=(0.0, 0.6)), LOOSE, Gs=2.65, hydraulic_conductivity=1e-2)
        ],
        sides=sb.Sides(sb.Fixed(), sb.Roller()),
        stages=[
            sb.Gravity(),
            sb.RunOut(0.06, open_sides=["right"], still_water=[(0.0, 0.5), (1.5, 0.3)]),
        ],
        output=sb.Output(field_dt=0.1),
        numerics=sb.Numerics(gap_memory=True, geometry_strain_limit=0.02),
    )


def flowing_clay(folder: Path) -> sb.Scene:
    """Run-out of a block of clay to the left in air; nothing is repeated."""
    return sb.Scene(
        spacing=0.25,
        regions=[
            sb.Region("clay", sb.box(x=(0, 2), y=(0, 1.5)), SOFT_CLAY, dry_unit_weight=18.0),
        ],
        sides=sb.Roller(),
        stages=[sb.Gravity(), sb.Shaking(WEAK_PULSE, duration=0.2), sb.RunOut(0.2, open_sides=["left"])],
        output=sb.Output(field_dt=0.1),
        numerics=sb.Numerics(integrator="rk4", local_damping=0.05),
    )


def falling_sand(folder: Path) -> sb.Scene:
    """Loose sand that holds its water and falls apart in air."""
    return sb.Scene(
        spacing=0.1,
        water=sb.Water(bulk_modulus=2.0e4),
        water_table=sb.WaterTable(depth=0.0),
        regions=[sb.Region("sand", sb.box(x=(0.0, 0.5), y=(0.0, 0.5)), LOOSE, Gs=2.65)],
        sides=sb.Roller(),
        stages=[sb.Gravity(), sb.RunOut(0.08, open_sides=["right"], still_water=[])],
        output=sb.Output(field_dt=0.1),
    )


def edges_of_water(folder: Path) -> sb.Scene:
    """Conditions on every edge, in time and then while the ground moves."""
    soil: dict[str, Any] = {
        "hydraulic_conductivity": 1e-4,
        "retention": RETENTION,
        "Gs": 2.65,
        "porosity": 0.4,
    }
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0.0),
        regions=_column(8.0, [(SILT, 0, 3, soil)]),
        sides=sb.Roller(),
        stages=[
            sb.Seepage(
                [
                    sb.Head("surface", head=3.2, x=(0, 2)),
                    sb.Pressure("surface", pressure=1.0, x=(2, 4)),
                    sb.Reservoir("surface", level=3.5, x=(4, 6)),
                    sb.SeepageFace("surface", x=(6, 8)),
                    sb.Pressure("base", pressure=32.0, x=(0, 2)),
                    sb.Reservoir("base", level=3.0, x=(3, 5)),
                    sb.SeepageFace("left"),
                    sb.Pressure("right", pressure=[(0.0, 20.0), (300.0, 25.0)]),
                ],
                duration=600.0,
            ),
            sb.Gravity(),
            sb.Shaking(
                WEAK_PULSE,
                duration=0.3,
                conditions=[
                    sb.Flux("surface", inflow=1.0e-6),
                    sb.Flux("right", inflow=-1.0e-6),
                    sb.SeepageFace("base"),
                    sb.Pressure("left", pressure=20.0),
                ],
            ),
        ],
    )


def moving_water(folder: Path) -> sb.Scene:
    """A slope held by suction, shaken in rain beside a rising reservoir; implicit and partly full."""
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(elevation=1.5, above="retention"),
        regions=[
            sb.Region(
                "slope",
                sb.polygon([(0, 0), (8, 0), (8, 1.5), (6, 1.5), (3, 3.5), (0, 3.5)]),
                LOOSE,
                hydraulic_conductivity=1e-2,
                retention=RETENTION,
                Gs=2.65,
            )
        ],
        sides=sb.Roller(),
        stages=[
            sb.Gravity(),
            sb.Shaking(
                WEAK_PULSE,
                duration=0.4,
                rayleigh=sb.Rayleigh(ratio=0.01, frequencies=(2.0, 10.0)),
                conditions=[
                    sb.Reservoir([(8, 1.5), (6, 1.5), (3, 3.5)], level=[(0.0, 1.5), (0.2, 2.5)]),
                    sb.Rain([(3, 3.5), (0, 3.5)], rate=1.0e-3),
                ],
            ),
        ],
        output=sb.Output(depths=[1.0]),
        numerics=sb.Numerics(local_damping=0.05),
    )


def printed_slope(folder: Path) -> sb.Scene:
    """The printed operators in a dry slope on an uneven base between columns."""
    return sb.Scene(
        spacing=0.5,
        regions=[
            sb.Region(
                "slope",
                sb.polygon([(0, 0), (5, 0.5), (10, 0), (10, 2), (7, 2), (4, 4), (0, 4)]),
                FILL,
                dry_unit_weight=17.0,
            ),
        ],
        sides=sb.FreeField(),
        stages=[sb.Gravity(), sb.Shaking(PULSE, duration=0.5)],
        output=sb.Output(depths=[1.0]),
        numerics=sb.Numerics(operators="printed", local_damping=0.05),
    )


def corrected_slope(folder: Path) -> sb.Scene:
    """Corrected inertia in a wet slope of two soils on an inclined base, with Rayleigh damping."""
    porous: dict[str, Any] = {"hydraulic_conductivity": 1e-2, "Gs": 2.65, "porosity": 0.4}
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(elevation=4.5),
        regions=[
            sb.Region("low", sb.polygon([(0, 0), (8, 0.6), (8, 2), (0, 2)]), ROCK, **porous),
            sb.Region(
                "high", sb.polygon([(0, 2), (8, 2), (8, 2.5), (5, 2.5), (3, 4), (0, 4)]), SILT, **porous
            ),
        ],
        sides=sb.Roller(),
        stages=[
            sb.Gravity(),
            sb.Shaking(WEAK_PULSE, duration=0.4, rayleigh=sb.Rayleigh(ratio=0.01, frequencies=(2.0, 10.0))),
        ],
        output=sb.Output(depths=[1.0]),
        numerics=sb.Numerics(dispersion_correction=True, diffusion="implicit"),
    )


def inclined_run_out(folder: Path) -> sb.Scene:
    """Wet sand on an inclined base that absorbs, shaken in both directions, then a run-out at its foot."""
    return sb.Scene(
        spacing=0.25,
        water=sb.Water(),
        water_table=sb.WaterTable(points=[(0, 1.4), (3, 0.9)], above="dry"),
        regions=[
            sb.Region(
                "sand",
                sb.polygon([(0, 0.4), (3, 0), (3, 1), (0, 2)]),
                WEAK_SILT,
                hydraulic_conductivity=1e-3,
                Gs=2.65,
                porosity=0.4,
            )
        ],
        sides=sb.Sides(sb.Fixed(), sb.Roller()),
        stages=[
            sb.Gravity(),
            sb.Shaking(
                WEAK_PULSE,
                vertical=WEAK_PULSE,
                duration=0.3,
                rayleigh=sb.Rayleigh(ratio=0.02, frequencies=(2.0, 20.0)),
            ),
            sb.RunOut(0.3, open_sides=["right"]),
        ],
        output=sb.Output(depths=[0.5], field_dt=0.1),
        numerics=sb.Numerics(velocity_filter=0.1, time_step_factor=0.6),
    )


def repeated_run_out(folder: Path) -> sb.Scene:
    """Run-out of a berm between periodic sides, without still water."""
    return sb.Scene(
        spacing=0.25,
        water=sb.Water(),
        water_table=sb.WaterTable(elevation=1.0, above="retention"),
        regions=[
            sb.Region(
                "clay",
                sb.polygon([(0, 0), (4, 0), (4, 1), (3, 1), (2.5, 2), (1.5, 2), (1, 1), (0, 1)]),
                sb.TotalStress(Su=3.0, Sr=1.0, softening_strain=0.1, G=1.5e3, K=4.0e3),
                hydraulic_conductivity=1e-5,
                retention=RETENTION,
                Gs=2.7,
                porosity=0.5,
            )
        ],
        stages=[sb.Gravity(), sb.RunOut(0.4, still_water=[])],
        output=sb.Output(field_dt=0.2),
    )


def dual_sand(folder: Path) -> sb.Scene:
    """Two sands over rock on the dual lattice, drained implicitly, under a pulse with Rayleigh damping."""
    porous: dict[str, Any] = {"hydraulic_conductivity": 1e-3, "Gs": 2.67}
    soils = [(ROCK, 0, 1, porous | {"porosity": 0.4}), (MEDIUM, 1, 2, porous), (LOOSE, 2, 3, porous)]
    return sb.Scene(
        spacing=0.25,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0.5, above="dry"),
        regions=_column(0.5, soils),
        stages=[
            sb.Gravity(),
            sb.Shaking(PULSE, duration=0.4, rayleigh=sb.Rayleigh(ratio=0.02, frequencies=(1.0, 10.0))),
        ],
        output=sb.Output(depths=[1.0], stress_paths=True),
        numerics=sb.Numerics(operators="dual", diffusion="implicit"),
    )


def dual_heap(folder: Path) -> sb.Scene:
    """A slope of clay on the dual lattice that flows into still water, after a shake without drainage."""
    return sb.Scene(
        spacing=0.1,
        water=sb.Water(bulk_modulus=2.0e4),
        water_table=sb.WaterTable(elevation=1.0),
        regions=[
            sb.Region(
                "clay",
                sb.polygon([(0, 0), (1.0, 0), (1.0, 0.4), (0.6, 0.8), (0, 0.8)]),
                sb.TotalStress(Su=0.4, Sr=0.2, softening_strain=0.2, G=400.0, K=900.0),
                porosity=0.5,
                Gs=2.7,
            )
        ],
        sides=sb.Sides(sb.Fixed(), sb.Roller()),
        stages=[
            sb.Gravity(),
            sb.Shaking(WEAK_PULSE, duration=0.1),
            sb.RunOut(0.6, open_sides=["right"]),
        ],
        output=sb.Output(field_dt=0.2),
        numerics=sb.Numerics(operators="dual"),
    )


ALL: dict[str, Callable[[Path], sb.Scene]] = {
    build.__name__.replace("_", " "): build
    for build in (
        level_ground,
        explicit_flow,
        implicit_flow,
        undrained_pond,
        printed_dry,
        printed_wet,
        corrected,
        free_field,
        wall_and_column,
        column_and_wall,
        steady_seepage,
        seepage_in_time,
        water_alone,
        dry_above_water,
        slope_run_out,
        dry_heap,
        wet_heap,
        flowing_clay,
        falling_sand,
        edges_of_water,
        moving_water,
        printed_slope,
        corrected_slope,
        inclined_run_out,
        repeated_run_out,
        dual_sand,
        dual_heap,
    )
}
