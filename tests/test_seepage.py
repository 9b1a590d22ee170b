"""Seepage through ground at rest: scenes, results and refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sandboil as sb
from sandboil import InvalidInput

SAND = sb.Elastic(E=2.0e4, nu=0.3)
RETENTION = sb.VanGenuchten(8.0, 3.0, residual_saturation=0.05)
PERMEABILITY = 1.0e-4
# Steady flow between two faces: k (h1^2 - h2^2)/(2 L), for any phreatic surface (Charny).
DISCHARGE = PERMEABILITY * (8.0**2 - 2.0**2) / (2.0 * 10.0)


def block(**changes: Any) -> sb.Region:
    """10 m by 10 m of sand."""
    settings: dict[str, Any] = {
        "hydraulic_conductivity": PERMEABILITY,
        "retention": RETENTION,
        "Gs": 2.65,
        "porosity": 0.4,
    }
    return sb.Region("block", sb.box(x=(0, 10), y=(0, 10)), SAND, **(settings | changes))


def dam(conditions: list[Any] | None = None, duration: float | None = None, **changes: Any) -> sb.Scene:
    """The block between 8 m of water on its left and 2 m on its right."""
    if conditions is None:
        conditions = [sb.Reservoir("left", level=8.0), sb.Reservoir("right", level=2.0)]
    settings: dict[str, Any] = {
        "spacing": 0.5,
        "water": sb.Water(),
        "water_table": sb.WaterTable(elevation=8.0),
        "regions": [block()],
        "sides": sb.Roller(),
        "stages": [sb.Seepage(conditions, duration=duration)],
    }
    return sb.Scene(**(settings | changes))


def test_steady_flow_through_a_dam(tmp_path: Path) -> None:
    run = sb.run(dam(), tmp_path / "out")
    assert run.field_names == ["pore_pressure", "head", "saturation"]
    flow = dict(run.discharge)
    assert [kind for kind, _ in run.discharge] == ["reservoir", "reservoir"]
    (_, into), (_, out) = run.discharge
    assert into == pytest.approx(DISCHARGE, rel=0.02)
    assert into + out == pytest.approx(0.0, abs=1e-6 * into)
    assert flow == {"reservoir": out}
    assert run.water_balance is None
    head, saturation = run.field("head"), run.field("saturation")
    assert head.max() < 8.0 + 1e-6
    assert head.min() > 2.0 - 1e-6
    assert saturation.min() < 0.5
    np.testing.assert_allclose(run.field("pore_pressure"), 10.0 * (head - run.position[:, 1]), atol=1e-9)


def test_a_falling_reservoir_keeps_the_water(tmp_path: Path) -> None:
    falling = [sb.Reservoir("left", level=[(0.0, 8.0), (3600.0, 3.0)]), sb.Reservoir("right", level=2.0)]
    run = sb.run(dam(falling, duration=7200.0), tmp_path / "out")
    assert run.water_balance is not None
    inflow, stored = run.water_balance
    assert stored < 0.0
    assert stored == pytest.approx(sum(inflow), abs=1e-6 * max(abs(flow) for flow in inflow))


def test_driven_in_steps_or_at_once_is_the_same() -> None:
    at_once, in_steps = (sb.Simulation(dam(duration=3600.0)) for _ in range(2))
    at_once.run_stage()
    while not in_steps.is_complete:
        assert in_steps.step(3) > 0
    assert in_steps.time == at_once.time == 3600.0
    np.testing.assert_array_equal(in_steps.field("head"), at_once.field("head"))
    assert at_once.outlets(1)[:, 2].sum() == pytest.approx(at_once.discharge[1][1])


@pytest.mark.parametrize(
    "condition",
    [
        sb.Head("base", head=[(0.0, 8.0), (10.0, 9.0)]),
        sb.Pressure([(0.0, 0.0), (0.0, 5.0)], pressure=30.0),
        sb.Flux("surface", inflow=-1e-8, x=(2.0, 4.0)),
        sb.Rain("surface", rate=[(0.0, 0.0), (3600.0, 1e-6)]),
        sb.Reservoir("left", level=8.0),
        sb.SeepageFace("surface"),
        sb.Drain([(4.0, 1.0), (6.0, 1.0)]),
    ],
)
def test_conditions_survive_a_file(condition: Any) -> None:
    scene = dam([condition, sb.Head("right", head=2.0)], duration=3600.0)
    assert sb.Scene.from_toml(scene.to_toml()) == scene


def test_soils_and_tables_survive_a_file() -> None:
    layered = block(hydraulic_conductivity=sb.Conductivity(1e-4, 1e-5, angle_deg=20.0))
    scene = dam(regions=[layered], water_table=sb.WaterTable(points=[(0, 8), (10, 2)], above="retention"))
    assert sb.Scene.from_toml(scene.to_toml()) == scene
    conductivity = layered.conductivity
    assert (conductivity.major, conductivity.minor) == (1e-4, 1e-5)
    assert conductivity.direction == pytest.approx((np.cos(np.radians(20.0)), np.sin(np.radians(20.0))))
    upright = sb.Conductivity(1e-6, 1e-5).core
    assert (upright.major, upright.minor) == (1e-5, 1e-6)
    assert upright.direction == pytest.approx((0.0, 1.0))


def ground(**changes: Any) -> sb.Scene:
    """4 m of level ground with water 2 m below it, at rest and then left alone for a while."""
    region = sb.Region("sand", sb.box(x=(0, 1), y=(0, 4)), SAND, Gs=2.65, porosity=0.4, retention=RETENTION)
    settings: dict[str, Any] = {
        "spacing": 0.25,
        "water": sb.Water(),
        "water_table": sb.WaterTable(depth=2.0),
        "regions": [region],
        "stages": [sb.Gravity(tolerance=1e-6), sb.Shaking(duration=0.2)],
    }
    return sb.Scene(**(settings | changes))


@pytest.mark.parametrize("above", ["dry", "retention"])
def test_ground_above_the_water_table(above: str, tmp_path: Path) -> None:
    run = sb.run(ground(water_table=sb.WaterTable(depth=2.0, above=above)), tmp_path / "out")
    y = run.position[:, 1]
    suction = np.minimum(10.0 * (2.0 - y), 0.0)
    saturation = run.field("saturation")
    if above == "dry":
        expected, pressure = np.where(y > 2.0, 0.0, 1.0), 10.0 * np.maximum(2.0 - y, 0.0)
    else:
        x = (8.0 * -suction / 10.0) ** 3.0
        expected, pressure = 0.05 + 0.95 * (1.0 + x) ** (1.0 / 3.0 - 1.0), 10.0 * (2.0 - y)
    np.testing.assert_allclose(saturation, expected, atol=1e-12)
    np.testing.assert_allclose(run.field("pore_pressure"), pressure, atol=1e-6)
    # Total stress by the soil's own weight; what pushes the grains apart is S_r p.
    solid, unit = (1.0 - 0.4) * 2.65 * 10.0, 10.0 * 0.4
    column = run.column()
    order = column[np.argsort(-y[column])]
    weight = 0.25 * (solid + unit * expected[order])
    total = np.cumsum(weight) - 0.5 * weight
    effective = total - (expected * pressure)[order]
    found = run.field("sigma_v_eff", 0.0, stage="shaking")[order]
    # The end rows alternate by a few per cent of a row's weight times the depth of the column.
    np.testing.assert_allclose(found[2:-2], effective[2:-2], rtol=0.02, atol=0.3)
    # Nothing moves when the stage begins, and there is no excess pressure above the water.
    assert np.abs(run.field("displacement")).max() < 1e-4
    assert np.abs(run.field("excess_pore_pressure")).max() < 1e-6


def test_the_water_of_seepage_continues_in_the_next_stages(tmp_path: Path) -> None:
    stages = [*dam().stages, sb.Gravity(), sb.Shaking(duration=0.05)]
    regions = [block(K0=0.5)]
    run = sb.run(dam(stages=stages, regions=regions), tmp_path / "out")
    alone = sb.Simulation(dam())
    alone.run_stage()
    np.testing.assert_allclose(run.field("pore_pressure"), alone.field("pore_pressure"), atol=1e-6)
    np.testing.assert_array_equal(run.field("saturation"), alone.field("saturation"))
    assert run.discharge == alone.discharge
    assert np.abs(run.field("excess_pore_pressure")).max() < 1e-6


def test_rain_falls_on_the_horizontal() -> None:
    """What a slope takes of rain is that of its width in the map, not of its length."""
    slope = sb.Region(
        "slope",
        sb.polygon([(0, 0), (20, 0), (20, 4), (12, 4), (4, 8), (0, 8)]),
        SAND,
        hydraulic_conductivity=PERMEABILITY,
        retention=RETENTION,
        Gs=2.65,
        porosity=0.4,
    )
    rain = [sb.Rain("surface", rate=1e-7), sb.Head("base", head=1.0)]
    simulation = sb.Simulation(dam(rain, regions=[slope], water_table=sb.WaterTable(elevation=1.0)))
    simulation.run_stage()
    assert simulation.discharge[0][1] == pytest.approx(20.0 * 1e-7, rel=1e-3)
    assert simulation.discharge[1][1] == pytest.approx(-20.0 * 1e-7, rel=1e-3)


def test_coarse_sand_finds_its_steady_state() -> None:
    """Its capillary rise, 0.07 m, is far below a spacing: conductivities swing unless followed with care."""
    embankment = sb.Scene.from_toml(Path(__file__).parents[1] / "examples" / "embankment" / "scene.toml")
    sand = sb.VanGenuchten(14.5, 2.68, residual_saturation=0.05)
    regions = [region.changed(retention=sand) for region in embankment.regions]
    scene = embankment.changed(regions=regions, stages=embankment.stages[:1])
    simulation = sb.Simulation(scene)
    simulation.run_stage()
    assert simulation.steps < 400
    flows = [flow for _, flow in simulation.discharge]
    assert abs(sum(flows)) < 1e-6 * max(flows)


def test_saturated_ground_has_no_cost_of_partial_saturation() -> None:
    scene = ground(water_table=sb.WaterTable(depth=0.0))
    simulation = sb.Simulation(scene)
    simulation.run_stage()
    assert simulation.particles.saturation0 is None
    assert not any(name.startswith("seepage") for name in simulation.counters())
    assert "saturation" not in simulation.field_names
    off = {name for name, on, _ in scene.active_physics() if not on}
    assert {"seepage", "partial saturation"} <= off


def without(name: str) -> dict[str, Any]:
    return {"regions": [block(**{name: None})]}


REFUSED: dict[str, tuple[Callable[[], object], str, str]] = {
    "head below the base": (
        lambda: dam([sb.Head("left", head=-1.0)]),
        "scene.stages[0].conditions[0].head",
        "must not lie below the base, elevation 0 m",
    ),
    "level below the base at a time": (
        lambda: dam([sb.Reservoir("left", level=[(0, 1), (9, -2)])], duration=9.0),
        "scene.stages[0].conditions[0].level[1]",
        "must not lie below the base",
    ),
    "reservoir beyond the section": (
        lambda: dam([sb.Reservoir("surface", level=8.0, x=(20.0, 30.0))]),
        "scene.stages[0].conditions[0].x",
        "must cover a stretch of the section's edge",
    ),
    "points off the edge": (
        lambda: dam([sb.Head([(0.0, 0.0), (5.0, 5.0)], head=8.0)]),
        "scene.stages[0].conditions[0].on[1]",
        "must lie on the edge of the section, it is 5 m away",
    ),
    "drain outside": (
        lambda: dam([sb.Drain([(1.0, 1.0), (12.0, 1.0)])]),
        "scene.stages[0].conditions[0].points",
        "must lie in the section",
    ),
    "soil that would dry without a curve": (
        lambda: dam(**without("retention")),
        "scene.regions[0].retention",
        "is required",
    ),
    "table in the ground without a curve": (
        lambda: ground(regions=[sb.Region("sand", sb.box(x=(0, 1), y=(0, 4)), SAND, Gs=2.65, porosity=0.4)]),
        "scene.regions[0].retention",
        "is required of soil above the water table",
    ),
    "no soil that lets water through": (
        lambda: dam(**without("hydraulic_conductivity")),
        "scene.regions",
        "must contain a permeable region",
    ),
    "fluxes alone on the way to a steady state": (
        lambda: dam([sb.Flux("left", inflow=1e-6), sb.Flux("right", inflow=-1e-6)]),
        "scene.stages[0].conditions",
        "must fix the pressure somewhere",
    ),
    "change on the way to a steady state": (
        lambda: dam([sb.Reservoir("left", level=[(0, 8), (9, 2)])]),
        "scene.stages[0].conditions[0].level",
        "must not change with time",
    ),
    "seepage without water": (
        lambda: dam(water=None, water_table=None),
        "scene.water",
        "is required by a seepage stage",
    ),
    "seepage after gravity": (
        lambda: dam(stages=[sb.Gravity(), *dam().stages]),
        "scene.stages[1].kind",
        "must be the first stage",
    ),
    "condition on a periodic side": (
        lambda: dam(sides=sb.Periodic()),
        "scene.stages[0].conditions[0].on",
        "must not be a periodic side",
    ),
    "alpha of zero": (lambda: sb.VanGenuchten(0.0, 2.0), "retention.alpha", "must lie in (0, 1000]"),
    "n of one": (lambda: sb.VanGenuchten(1.0, 1.0), "retention.n", "must lie in (1, 20]"),
    "residual above full": (
        lambda: sb.VanGenuchten(1.0, 2.0, residual_saturation=0.5, full_saturation=0.4),
        "retention.residual_saturation",
        "must be below full_saturation",
    ),
    "no conductivity across layers": (
        lambda: sb.Conductivity(1e-5, 0.0),
        "hydraulic_conductivity.vertical",
        "must be greater than 0",
    ),
    "negative rain": (lambda: sb.Rain("surface", rate=-1e-6), "condition.rate[0]", "must not be negative"),
    "times that fall": (
        lambda: sb.Reservoir("left", level=[(9, 1), (0, 2)]),
        "condition.level",
        "must have rising times",
    ),
    "no samples": (lambda: sb.Reservoir("left", level=[]), "condition.level", "must hold at least one pair"),
    "words for a level": (lambda: sb.Reservoir("left", level="high"), "condition.level", "must be a number"),
    "not a number": (lambda: sb.Head("left", head=float("nan")), "condition.head[0][1]", "finite"),
    "edge of no name": (lambda: sb.Head("top", head=1.0), "condition.on", "must be one of 'surface'"),
    "one point": (lambda: sb.Head([(0, 0)], head=1.0), "condition.on", "at least two points"),
    "part of a side": (lambda: sb.Head("left", head=1.0, x=(0, 1)), "condition.x", "cuts the 'surface'"),
    "table twice": (
        lambda: sb.WaterTable(elevation=1.0, points=[(0, 1), (1, 1)]),
        "water_table",
        "exactly one of elevation, depth and points",
    ),
    "table that turns back": (
        lambda: sb.WaterTable(points=[(0, 1), (0, 2)]),
        "water_table.points[1]",
        "must lie to the right",
    ),
}


@pytest.mark.parametrize("slip", REFUSED)
def test_slip_is_refused(slip: str) -> None:
    make, path, allowed = REFUSED[slip]
    with pytest.raises(InvalidInput) as refused:
        make()
    assert refused.value.path == path
    assert allowed in refused.value.allowed


def test_columns_are_refused_with_seepage() -> None:
    stages = [*dam().stages, sb.Gravity(), sb.Shaking(duration=0.1)]
    with pytest.raises(InvalidInput, match="seepage"):
        sb.Simulation(dam(stages=stages, sides=sb.FreeField()), keep_columns=True)
