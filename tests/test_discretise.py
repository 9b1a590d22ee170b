"""Particles fill the section, know their soil, and start from the exact geostatic stress."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sandboil import Box, Elastic, Gravity, PM4Sand, Polygon, Region, Scene, Water, WaterTable, box, polygon
from sandboil._errors import InvalidInput
from sandboil.ground.discretise import discretise

GRAVITY = 9.81
WATER = Water(unit_weight=10.0)
ROCK = Elastic(G=1.0e4, K=2.0e4)


def level_ground(spacing: float = 0.2, pond: float = 0.0) -> Scene:
    """The paper's section 6.2: 8, 6 and 6 m of PM4Sand from the top."""
    layers = [("layer 1", (12, 20), 0.35), ("layer 2", (6, 12), 0.55), ("layer 3", (0, 6), 0.75)]
    return Scene(
        spacing=spacing,
        water=WATER,
        water_table=WaterTable(elevation=20.0 + pond),
        regions=[
            Region(name, box(x=(0, 1), y=y), PM4Sand(Dr, 600.0, 0.5), Gs=2.67, hydraulic_conductivity=1e-3)
            for name, y, Dr in layers
        ],
        stages=[Gravity()],
    )


def dry(spacing: float, *shapes: Box | Polygon, unit_weight: float = 18.0) -> Scene:
    return Scene(
        spacing=spacing,
        regions=[
            Region(f"part {i}", shape, ROCK, dry_unit_weight=unit_weight + i)
            for i, shape in enumerate(shapes)
        ],
        stages=[Gravity()],
    )


def buoyant_unit_weight(Dr: float) -> float:
    """(Gs - 1)/(1 + e) gamma_w for Gs 2.67 and e = 0.8 - 0.3 Dr."""
    return (2.67 - 1.0) / (1.8 - 0.3 * Dr) * 10.0


def test_level_ground_is_filled_row_by_row() -> None:
    particles = discretise(level_ground())
    assert particles.position.shape == (500, 2)
    assert particles.spacing == pytest.approx((0.2, 0.2))
    assert particles.bounds == (0.0, 1.0, 0.0, 20.0)
    np.testing.assert_allclose(particles.position[:6, 0], [0.1, 0.3, 0.5, 0.7, 0.9, 0.1])
    np.testing.assert_allclose(particles.position[:6, 1], [0.1, 0.1, 0.1, 0.1, 0.1, 0.3])
    np.testing.assert_array_equal(np.bincount(particles.region), [200, 150, 150])
    np.testing.assert_allclose(particles.volume, 0.04)
    np.testing.assert_allclose(particles.surface_elevation, 20.0)


def test_level_ground_carries_the_exact_overburden() -> None:
    scene = level_ground()
    particles = discretise(scene)
    depth = 20.0 - particles.position[:, 1]
    upper, middle, lower = (buoyant_unit_weight(Dr) for Dr in (0.35, 0.55, 0.75))
    expected = (
        upper * np.minimum(depth, 8.0)
        + middle * np.clip(depth - 8.0, 0.0, 6.0)
        + lower * np.clip(depth - 14.0, 0.0, None)
    )
    np.testing.assert_allclose(particles.sigma_v_eff0, expected, rtol=1e-12)
    np.testing.assert_allclose(particles.pore_pressure0, 10.0 * depth, rtol=1e-12)
    # Between the particles too; the OpenSees reference of this site starts from 4.926254 kPa at 0.5 m.
    effective, pressure = particles.stress_at(np.array([[0.37, 19.5], [0.0, 0.0], [1.0, 20.0]]))
    np.testing.assert_allclose(
        effective, [4.926254, 8 * upper + 6 * middle + 6 * lower, 0.0], rtol=1e-6, atol=1e-12
    )
    np.testing.assert_allclose(pressure, [5.0, 200.0, 0.0], atol=1e-12)


def test_particles_know_their_soil() -> None:
    particles = discretise(level_ground())
    e = 0.8 - 0.3 * np.array([0.35, 0.55, 0.75])[particles.region]
    rho_w = 10.0 / GRAVITY
    np.testing.assert_allclose(particles.porosity0, e / (1.0 + e))
    np.testing.assert_allclose(particles.solid_density, 2.67 * rho_w)
    np.testing.assert_allclose(particles.dry_density, 2.67 * rho_w / (1.0 + e))


def test_pond_raises_pressure_and_leaves_effective_stress() -> None:
    ground, flooded = discretise(level_ground()), discretise(level_ground(pond=3.0))
    np.testing.assert_allclose(flooded.sigma_v_eff0, ground.sigma_v_eff0, rtol=1e-10)
    np.testing.assert_allclose(flooded.pore_pressure0, ground.pore_pressure0 + 30.0)
    effective, pressure = flooded.stress_at(np.array([[0.5, 22.0]]))
    assert effective == pytest.approx(0.0, abs=1e-12)
    assert pressure == pytest.approx(10.0)


def test_dry_ground_has_no_pore_pressure() -> None:
    particles = discretise(dry(0.5, box(x=(0, 1), y=(2, 4)), box(x=(0, 1), y=(0, 2))))
    np.testing.assert_array_equal(particles.pore_pressure0, 0.0)
    effective, pressure = particles.stress_at(np.array([[0.5, 3.0], [0.5, 1.0]]))
    np.testing.assert_allclose(effective, [18.0, 36.0 + 19.0])
    np.testing.assert_array_equal(pressure, 0.0)


def test_spacing_that_does_not_divide_is_fitted() -> None:
    particles = discretise(dry(0.3, box(x=(0, 1), y=(0, 2))))
    assert particles.spacing == pytest.approx((1.0 / 3.0, 2.0 / 7.0))
    assert len(particles.position) == 21
    assert particles.volume.sum() == pytest.approx(2.0)


def test_one_particle_wide_column() -> None:
    particles = discretise(dry(0.2, box(x=(0, 0.2), y=(0, 4))))
    assert particles.position.shape == (20, 2)
    np.testing.assert_allclose(particles.position[:, 0], 0.1)


def test_centre_on_a_boundary_goes_to_the_region_listed_first() -> None:
    # The boundary runs through the centres of the second row; round-off in y must not scatter the row.
    low, high = box(x=(0, 3), y=(0, 0.45)), box(x=(0, 3), y=(0.45, 3))
    for first, second in ((low, high), (high, low)):
        particles = discretise(dry(0.3, first, second))
        row = np.isclose(particles.position[:, 1], 0.45)
        assert row.sum() == 10
        np.testing.assert_array_equal(particles.region[row], 0)


def test_region_between_the_columns_is_refused() -> None:
    # Two columns of 1 m, centres at 0.5 and 1.5 m: the mound stands between them.
    ground, mound = box(x=(0, 2), y=(0, 1)), polygon([(0.55, 1), (1.46, 1), (1, 1.9)])
    with pytest.raises(InvalidInput, match="leaves region 'part 1' without a particle") as refused:
        discretise(dry(0.9, ground, mound))
    assert refused.value.path == "scene.spacing"


def embankment() -> Scene:
    """A mound with 1:1 slopes on a base, repeated to both sides."""
    return dry(
        0.1,
        box(x=(0, 6), y=(0, 1)),
        polygon([(1, 1), (5, 1), (4, 2), (2, 2)]),
    )


def test_polygon_leaves_the_air_empty_and_follows_its_surface() -> None:
    particles = discretise(embankment())
    x, y = particles.position.T
    assert particles.volume.sum() == pytest.approx(6.0 + 3.0, rel=0.02)
    surface = np.clip(np.minimum(x, 6.0 - x), 1.0, 2.0)
    np.testing.assert_allclose(particles.surface_elevation, surface, atol=1e-5)
    assert (y <= surface + 1e-5).all()
    base = np.clip(surface - np.maximum(y, 1.0), 0.0, None) * 19.0 + np.maximum(1.0 - y, 0.0) * 18.0
    np.testing.assert_allclose(particles.sigma_v_eff0, base, rtol=1e-4, atol=1e-4)


def test_region_crossed_twice_by_a_vertical_is_counted_part_by_part() -> None:
    base = box(x=(0, 4), y=(0, 1))
    around = polygon([(0, 1), (1, 1), (1, 3), (3, 3), (3, 2), (2, 2), (2, 1), (4, 1), (4, 4), (0, 4)])
    shelf = polygon([(1, 1), (2, 1), (2, 2), (3, 2), (3, 3), (1, 3)])
    particles = discretise(dry(0.5, base, around, shelf))
    foot = np.array([[2.5, 0.0], [1.5, 0.0], [0.5, 0.0], [2.5, 1.5], [2.5, 2.5]])
    effective, _ = particles.stress_at(foot)
    np.testing.assert_allclose(
        effective,
        [18.0 + 2 * 19.0 + 20.0, 18.0 + 19.0 + 2 * 20.0, 18.0 + 3 * 19.0, 19.0 + 20.0 + 9.5, 19.0 + 10.0],
    )


def test_vertical_along_an_upright_edge_counts_one_soil() -> None:
    def column(name: str, x: tuple[float, float], unit_weight: float) -> Region:
        return Region(name, box(x=x, y=(0, 2)), ROCK, dry_unit_weight=unit_weight)

    regions = [column("left", (0, 1), 18.0), column("middle", (1, 2), 20.0), column("right", (2, 3), 18.0)]
    particles = discretise(Scene(spacing=0.5, regions=regions, stages=[Gravity()]))
    feet = np.array([[0.0, 0.0], [1.0, 0.0], [1.5, 0.0], [2.0, 0.0], [3.0, 0.0]])
    effective, _ = particles.stress_at(feet)
    np.testing.assert_allclose(effective, [36.0, 40.0, 40.0, 36.0, 36.0])


def test_points_beyond_a_periodic_side_repeat_the_section() -> None:
    particles = discretise(embankment())
    y = np.array([0.3, 0.3, 0.3])
    inside, _ = particles.stress_at(np.column_stack([np.array([5.7, 0.2, 1.5]), y]))
    outside, _ = particles.stress_at(np.column_stack([np.array([-0.3, 6.2, 7.5]), y]))
    np.testing.assert_allclose(outside, inside, rtol=1e-9)


@given(
    width=st.floats(0.5, 5.0),
    thicknesses=st.lists(st.floats(0.5, 5.0), min_size=1, max_size=4),
    ratio=st.floats(0.1, 0.66),
)
def test_layers_are_filled_whole_and_stress_grows_with_depth(
    width: float, thicknesses: list[float], ratio: float
) -> None:
    levels = np.concatenate([[0.0], np.cumsum(thicknesses)])
    spans = [(float(low), float(high)) for low, high in itertools.pairwise(levels)]
    layers = [box(x=(0.0, width), y=span) for span in spans]
    # Rows are at most 3/2 of the spacing high, so that this spacing leaves no layer without one.
    spacing = ratio * min(width, *thicknesses)
    particles = discretise(dry(spacing, *layers))
    assert particles.volume.sum() == pytest.approx(width * levels[-1])
    assert abs(particles.spacing[1] / spacing - 1.0) <= 0.5
    for index, (low, high) in enumerate(spans):
        y = particles.position[particles.region == index, 1]
        assert y.min() >= low - 1e-5
        assert y.max() <= high + 1e-5
    column = particles.position[:, 0] == particles.position[0, 0]
    assert (np.diff(particles.sigma_v_eff0[column]) < 0.0).all()
    # Midpoint rule of the weight of the rows, exact but for the rows that straddle layers.
    top_down = particles.dry_density[column][::-1] * GRAVITY * particles.spacing[1]
    summed = (np.cumsum(top_down) - top_down / 2)[::-1]
    straddle = len(thicknesses) * len(thicknesses) * particles.spacing[1]
    np.testing.assert_allclose(particles.sigma_v_eff0[column], summed, atol=straddle)
