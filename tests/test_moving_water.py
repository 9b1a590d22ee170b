"""Water under conditions while the ground moves, from Python."""

from pathlib import Path

import numpy as np
import pytest
import sandboil as sb
from sandboil import InvalidInput

SAND = sb.Elastic(E=2.0e4, nu=0.3)


def slope(stages: list[object], **changes: object) -> sb.Scene:
    """A 1:2.5 slope under 3 m of water."""
    ground = sb.Region(
        "slope",
        sb.polygon([(0, 0), (16, 0), (16, 2), (12, 2), (7, 4), (0, 4)]),
        SAND,
        hydraulic_conductivity=1e-2,
        Gs=2.65,
        porosity=0.4,
    )
    given = {
        "spacing": 0.5,
        "water": sb.Water(),
        "water_table": sb.WaterTable(elevation=7.0),
        "regions": [ground],
        "sides": sb.Roller(),
        "stages": stages,
        "numerics": sb.Numerics(local_damping=0.3),
        **changes,
    }
    return sb.Scene(**given)  # type: ignore[arg-type]


def test_a_falling_reservoir_moves_no_submerged_slope(tmp_path: Path) -> None:
    """Water above the ground acts through the water pressure at the surface only."""
    falling = sb.Reservoir("surface", level=[(0.0, 7.0), (1.0, 4.5)])
    stages = [sb.Gravity(), sb.Shaking(duration=4.0, conditions=[falling])]
    run = sb.run(slope(stages), tmp_path / "out")
    change = -2.5 * 10.0
    assert run.field("excess_pore_pressure") == pytest.approx(change, rel=2e-3)
    # As a load on the skeleton it would sink the crest by q H / M'.
    modulus = 2.0e4 * 0.7 / (1.3 * 0.4)
    assert np.abs(run.field("displacement")).max() < 5e-3 * -change * 4.0 / modulus


def test_conditions_continue_unless_the_stage_has_its_own() -> None:
    steady = sb.Seepage([sb.Reservoir("surface", level=7.0), sb.Head("left", head=8.0)])
    first, second, third = (
        sb.Shaking(duration=1.0),
        sb.Shaking(duration=2.0, conditions=[sb.Reservoir("surface", level=[(0.0, 7.0), (4.0, 5.0)])]),
        sb.Shaking(duration=1.0),
    )
    scene = slope([steady, sb.Gravity(), first, second, third])
    conditions = [
        [(c.kind, c.value_at(0.5), rest) for c, rest in scene.moving_conditions(stage)]
        for stage in (first, second, third)
    ]
    assert conditions[0] == [("reservoir", 7.0, 7.0), ("head", 8.0, 8.0)]
    assert conditions[1] == [("reservoir", 6.75, 7.0)]
    # The level at the end of the stage before.
    assert conditions[2] == [("reservoir", 6.0, 7.0)]
    ended = sb.Shaking(duration=1.0, conditions=[])
    assert slope([steady, sb.Gravity(), ended]).moving_conditions(ended) == []


def test_continued_conditions_move_nothing(tmp_path: Path) -> None:
    steady = sb.Seepage([sb.Reservoir("surface", level=7.0), sb.Head("left", head=8.0)])
    run = sb.run(slope([steady, sb.Gravity(), sb.Shaking(duration=0.5)]), tmp_path / "out")
    assert np.abs(run.field("excess_pore_pressure")).max() < 1e-9
    assert np.abs(run.field("displacement")).max() < 1e-9


def test_conditions_of_a_shaking_stage_come_from_toml(tmp_path: Path) -> None:
    scene = slope([sb.Gravity(), sb.Shaking(duration=1.0, conditions=[sb.Head("base", head=9.0)])])
    text = scene.to_toml()
    again = sb.Scene.from_toml(text)
    assert again == scene


def test_a_drain_lowers_what_shaking_raises() -> None:
    """Excess pressure beside a drain is lower than without the drain."""
    motion = sb.Motion.ricker(frequency=2.0, pga_g=0.1)

    def largest(conditions: list[object]) -> float:
        ground = sb.Region(
            "sand",
            sb.box(x=(0, 2), y=(0, 4)),
            sb.PM4Sand(Dr=0.35, G0=476.0, hpo=0.53),
            hydraulic_conductivity=1e-2,
            Gs=2.65,
        )
        shaken = sb.Shaking(motion, conditions=conditions)
        stages = [sb.Gravity(), shaken]
        scene = slope(stages, regions=[ground], sides=sb.Periodic(), water_table=sb.WaterTable(depth=0.0))
        simulation = sb.Simulation(scene)
        while not simulation.is_complete:
            simulation.step(1000)
        return float(simulation.field("excess_pore_pressure").max())

    free = largest([])
    drained = largest([sb.Drain([(0, 1), (2, 1)]), sb.Drain([(0, 2.5), (2, 2.5)])])
    assert drained < 0.5 * free


@pytest.mark.parametrize(
    ("changes", "conditions", "path", "allowed"),
    [
        (
            {"water": None, "water_table": None},
            [sb.Head("base", head=8.0)],
            "stages[1].conditions",
            "need water",
        ),
        ({}, [sb.Head("base", head=-1.0)], "conditions[0].head", "below the base"),
        ({}, [sb.Drain([(0, 9), (4, 9)])], "conditions[0].points", "in the section"),
        (
            {},
            [sb.Head("base", head=8.0), sb.SeepageFace("base", x=(2, 4))],
            "conditions[1].on",
            "must not overlap conditions[0]",
        ),
        (
            {"water_table": sb.WaterTable(elevation=3.0, above="dry")},
            [sb.Reservoir("surface", level=[(0.0, 3.0), (1.0, 5.0)])],
            "conditions[0]",
            "dry above the water table",
        ),
        ({"sides": sb.FreeField()}, [sb.Head("left", head=8.0)], "conditions[0].on", "free-field side"),
        (
            {"sides": sb.FreeField()},
            [sb.Reservoir("surface", level=[(0.0, 7.0), (1.0, 6.0)])],
            "conditions[0].level",
            "beside free-field sides",
        ),
    ],
)
def test_conditions_that_mean_nothing_are_refused(
    changes: dict[str, object], conditions: list[object], path: str, allowed: str
) -> None:
    with pytest.raises(InvalidInput) as refused:
        slope([sb.Gravity(), sb.Shaking(duration=1.0, conditions=conditions)], **changes)
    assert path in str(refused.value)
    assert allowed in str(refused.value)


@pytest.mark.parametrize("conductivity", [1e-12, 1e-5, 1.0])
@pytest.mark.parametrize(
    ("retention", "condition"),
    [
        (None, sb.Reservoir("surface", level=[(0.0, 7.0), (1e-3, 1.0)])),
        (sb.VanGenuchten(0.8, 1.09), sb.Rain("surface", rate=1e-3)),
        (
            sb.VanGenuchten(14.5, 2.68, residual_saturation=0.1),
            sb.Reservoir("surface", level=[(0.0, 1.0), (1e-3, 6.0)]),
        ),
        (sb.VanGenuchten(2.0, 2.0, residual_saturation=0.1), sb.Head("base", head=[(0.0, 1.0), (1e-3, 0.0)])),
    ],
)
def test_sudden_changes_end_in_numbers(conductivity: float, retention: object, condition: object) -> None:
    """A drawdown, a storm on dry clay, a flood over dry sand and a base that drains, all at once."""
    dry = retention is not None
    scene = slope([sb.Gravity(), sb.Shaking(duration=0.2, conditions=[condition])])
    changes: dict[str, object] = {
        "regions[0].hydraulic_conductivity": conductivity,
        "regions[0].retention": retention,
    }
    if dry:
        changes["water_table"] = sb.WaterTable(elevation=1.0, above="retention")
    simulation = sb.Simulation(scene.changed(**changes), threads=1)
    simulation.run_stage()
    simulation.run_stage()
    pressure, moved = simulation.field("pore_pressure"), simulation.field("displacement")
    # No more than the water brings, or a suction of as much, and no movement beyond that of its weight.
    assert np.abs(pressure - simulation.particles.pore_pressure0).max() < 2.0 * 10.0 * 6.0
    assert np.abs(moved).max() < 0.02
    if dry:
        assert 0.0 < simulation.field("saturation").min() <= simulation.field("saturation").max() <= 1.0
