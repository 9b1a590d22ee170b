"""The dual lattice: a mirrored section is the mirror image, and nearly incompressible ground flows."""

from __future__ import annotations

import numpy as np
import pytest
import sandboil as sb
from numpy.typing import NDArray

from validation.run_out.__main__ import heap, result

Floats = NDArray[np.float64]

WIDTH = 20.0
DUAL = sb.Numerics(operators="dual")


def mirrored(places: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(WIDTH - x, y) for x, y in reversed(places)]


def embankment(*, is_mirrored: bool) -> sb.Scene:
    """A dam of unequal slopes on sand, half under water, at rest."""
    outline = [(4.0, 2.0), (16.0, 2.0), (11.0, 5.0), (10.0, 5.0)]
    porous = {"Gs": 2.67, "hydraulic_conductivity": 1e-4}
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(elevation=2.0, above="dry"),
        regions=[
            sb.Region("sand", sb.box(x=(0, WIDTH), y=(0, 2)), sb.PM4Sand(Dr=0.45, G0=550, hpo=0.5), **porous),
            sb.Region(
                "dam",
                sb.polygon(mirrored(outline) if is_mirrored else outline),
                sb.MohrCoulomb(c=5.0, phi=32.0, E=5e4, nu=0.3),
                porosity=0.4,
                **porous,
            ),
        ],
        sides=sb.Roller(),
        stages=[sb.Gravity()],
        numerics=DUAL,
    )


def sorted_rows(x: Floats, *fields: Floats) -> tuple[Floats, ...]:
    """Places and fields of the nodes, row by row from the left."""
    order = np.lexsort((x[:, 0].round(6), x[:, 1].round(6)))
    return tuple(field[order] for field in (x, *fields))


def test_a_mirrored_section_at_rest_is_the_mirror_image() -> None:
    found = []
    for is_mirrored in (False, True):
        simulation = sb.Simulation(embankment(is_mirrored=is_mirrored), threads=1)
        simulation.run_stage()
        x, sign = simulation.particles.position.copy(), 1.0
        if is_mirrored:
            x[:, 0], sign = WIDTH - x[:, 0], -1.0
        fields = (simulation.field("sigma_v_eff"), sign * simulation.field("tau_xy"))
        found.append(sorted_rows(x, *fields))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-11 * np.abs(one).max())


def test_a_column_that_falls_to_the_left_is_the_mirror_image() -> None:
    """Rounding differs between the two, and sand that yields makes the difference grow."""
    soil = sb.DruckerPrager(E=840.0, nu=0.3, phi=30.0, c=0.0)
    column = sb.Region("column", sb.box(x=(0, 0.1), y=(0, 0.1)), soil, porosity=0.4, Gs=2.65)
    found = []
    for side in ("right", "left"):
        scene = sb.Scene(
            spacing=0.01,
            regions=[column],
            sides=sb.Roller(),
            stages=[sb.Gravity(), sb.RunOut(0.1, open_sides=[side])],
            numerics=DUAL,
        )
        simulation = sb.Simulation(scene, threads=1)
        while not simulation.is_complete:
            simulation.run_stage()
        x, moved = simulation.particles.position.copy(), simulation.field("displacement")
        if side == "left":
            x[:, 0], moved = 0.1 - x[:, 0], moved * (-1.0, 1.0)
        found.append(sorted_rows(x, moved)[1])
    largest = np.abs(found[0]).max()
    print(f"largest displacement {largest:.3f} m, difference {np.abs(found[0] - found[1]).max():.1e} m")
    np.testing.assert_allclose(*found, atol=1e-9 * largest)


@pytest.mark.slow
def test_an_undrained_heap_flows() -> None:
    """The conservative operators lock: their heap of ten rows stops at 0.22 m, from 0.2 m."""
    _, shown = result(heap(spacing=0.01, k=0.0, duration=2.0, operators="dual"), 2)
    assert shown["front, m"] == pytest.approx(0.37, abs=0.02)


PULSE = sb.Motion.ricker(frequency=4.0, pga_g=0.2)
SAND = sb.PM4Sand(Dr=0.4, G0=500.0, hpo=0.5)
CLAY = sb.MohrCoulomb(c=20.0, phi=30.0, E=5e4, nu=0.3)
SLOPE_45 = [(0.0, 0.0), (10.0, 0.0), (10.0, 2.0), (6.0, 2.0), (2.0, 6.0), (0.0, 6.0)]
SLOPE_89 = [(0.0, 0.0), (10.0, 0.0), (10.0, 2.0), (4.07, 2.0), (4.0, 6.0), (0.0, 6.0)]
NOTCH = [(0.0, 0.0), (10.0, 0.0), (10.0, 4.0), (6.0, 4.0), (6.0, 2.0), (5.0, 2.0), (5.0, 4.0), (0.0, 4.0)]


def sand(width: float = 2.0, height: float = 4.0, k: float = 1e-4) -> sb.Region:
    return sb.Region("sand", sb.box(x=(0, width), y=(0, height)), SAND, Gs=2.67, hydraulic_conductivity=k)


def layers(moduli: tuple[float, float], conductivities: tuple[float, float]) -> list[sb.Region]:
    """Two elastic layers of 2 m, from below."""
    return [
        sb.Region(
            f"layer {i}",
            sb.box(x=(0, 2), y=(2 * i, 2 * i + 2)),
            sb.Elastic(E=modulus, nu=0.3),
            porosity=0.4,
            Gs=2.67,
            hydraulic_conductivity=k,
        )
        for i, (modulus, k) in enumerate(zip(moduli, conductivities, strict=True))
    ]


def section(outline: list[tuple[float, float]]) -> list[sb.Region]:
    return [sb.Region("clay", sb.polygon(outline), CLAY, porosity=0.4, Gs=2.67, hydraulic_conductivity=1e-6)]


# Regions, and what else differs from a section 2 m wide between rollers under a water table at its surface.
EXTREMES: dict[str, tuple[list[sb.Region], dict[str, object]]] = {
    "one column": ([sand(width=0.5)], {"sides": sb.Periodic()}),
    "two by two": ([sand(width=1.0, height=1.0)], {}),
    "nearly undrained": ([sand(k=1e-12)], {}),
    "drained at once": ([sand(k=1.0)], {}),
    "soft water": ([sand()], {"water": sb.Water(bulk_modulus=2.2e4)}),
    "stiff water": ([sand()], {"water": sb.Water(bulk_modulus=2.2e8)}),
    "contrast of stiffness 1e4": (layers((2e7, 2e3), (1e-4, 1e-4)), {}),
    "contrast of conductivity 1e8": (layers((2e5, 2e5), (1e-2, 1e-10)), {}),
    "slope of 45 degrees in a pond": (section(SLOPE_45), {"water_table": sb.WaterTable(elevation=8.0)}),
    "slope of 89 degrees in a pond": (section(SLOPE_89), {"water_table": sb.WaterTable(elevation=8.0)}),
    "notch in a pond": (section(NOTCH), {"water_table": sb.WaterTable(elevation=8.0)}),
}


@pytest.mark.filterwarnings("ignore::sandboil.SandboilWarning")
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes_are_stable(name: str) -> None:
    """Half a second of shaking; the ground moves by millimetres."""
    regions, changes = EXTREMES[name]
    settings: dict[str, object] = {
        "spacing": 0.5,
        "water": sb.Water(),
        "water_table": sb.WaterTable(depth=0.0),
        "sides": sb.Roller(),
        "stages": [sb.Gravity(), sb.Shaking(PULSE, duration=0.5)],
    }
    simulation = sb.Simulation(sb.Scene(regions=regions, numerics=DUAL, **(settings | changes)), threads=1)
    while not simulation.is_complete:
        simulation.run_stage()
    moved = np.abs(simulation.field("displacement")).max()
    print(f"{name}: {1e3 * moved:.2f} mm in {simulation.steps} steps, {simulation.flow_scheme}")
    assert moved < 0.02
    assert np.isfinite(simulation.field("excess_pore_pressure")).all()


@pytest.mark.parametrize("k", [None, 1e-4])
def test_undamped_ground_loses_no_energy(k: float | None) -> None:
    """What corners and their groups store is what the waves bring in, without drainage and with it."""
    ground = sb.Region(
        "ground",
        sb.box(x=(0, 1), y=(0, 4)),
        sb.Elastic(E=5e4, nu=0.3),
        porosity=0.4,
        Gs=2.67,
        hydraulic_conductivity=k,
    )
    scene = sb.Scene(
        spacing=0.25,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0.0),
        regions=[ground],
        sides=sb.Roller(),
        stages=[sb.Gravity(), sb.Shaking(PULSE, vertical=PULSE.scaled(factor=0.5), duration=1.0)],
        numerics=sb.Numerics(operators="dual", velocity_filter=0.0),
    )
    simulation = sb.Simulation(scene, threads=1)
    simulation.run_stage()
    simulation.run_stage()
    _, energy = simulation.take_energy()
    lost, stored = (np.abs(energy[name]).max() for name in ("damping", "stress"))
    print(f"k {k}: {lost / stored:.1e} of the energy lost")
    assert np.abs(energy["water"]).max() > 1e-3 * stored
    assert lost < 1e-6 * stored


def test_seepage_in_time_precedes_the_dual_lattice() -> None:
    """The storage of the skeleton is read at the corners of each cell."""
    scene = sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0.0),
        regions=[sand(width=2.0, height=2.0, k=1e-6)],
        sides=sb.Roller(),
        stages=[sb.Seepage([sb.Head("base", head=3.0)], duration=100.0), sb.Gravity()],
        numerics=DUAL,
    )
    # Seepage flows between nodes in both, with weights of the same smoothing length.
    beside = {"numerics.operators": "conservative", "numerics.smoothing_ratio": 1.4}
    heads = []
    for case in (scene, scene.changed(**beside)):
        simulation = sb.Simulation(case, threads=1)
        simulation.run_stage()
        heads.append(simulation.field("head"))
        simulation.run_stage()
        assert simulation.is_complete
    # The stress at rest is linear: its mean over a cell is the same on both layouts.
    np.testing.assert_allclose(*heads, rtol=2e-5)
