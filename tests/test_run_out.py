"""Run-out, from Python."""

from pathlib import Path

import numpy as np
import pytest
import sandboil as sb
from sandboil import InvalidInput
from sandboil.results import plots

GRAINS = sb.DruckerPrager(E=840.0, nu=0.3, phi=19.8, c=0.0)
SPACING = 0.01


def heap(*, wet: bool = False, stages: list[object] | None = None, **changes: object) -> sb.Scene:
    """A heap of 0.2 x 0.1 m between walls, dry or full of water; the right wall is removed."""
    water = {"water": sb.Water(), "water_table": sb.WaterTable(depth=0.0)} if wet else {}
    given = {
        "regions": [
            sb.Region(
                "heap",
                sb.Box(x=(0.0, 0.2), y=(0.0, 0.1)),
                GRAINS,
                porosity=0.4,
                Gs=2.65,
                hydraulic_conductivity=1e-2 if wet else 0.0,
            )
        ],
        "spacing": SPACING,
        "sides": sb.Roller(),
        "stages": stages or [sb.Gravity(), sb.RunOut(0.6, open_sides=["right"])],
        "output": sb.Output(field_dt=0.1),
        **water,
        **changes,
    }
    return sb.Scene(**given)  # type: ignore[arg-type]


def slope(*stages: object, **changes: object) -> sb.Scene:
    """A slope of 1:2.5 in water up to 3 m, its soil above held by suction."""
    soil = sb.MohrCoulomb(c=5.0, phi=35.0, E=2.0e4, nu=0.3)
    ground = sb.Region(
        "slope",
        sb.polygon([(0, 0), (16, 0), (16, 2), (12, 2), (7, 4), (0, 4)]),
        soil,
        hydraulic_conductivity=1e-4,
        retention=sb.VanGenuchten(alpha=2.0, n=2.0),
        Gs=2.65,
        porosity=0.4,
    )
    given = {
        "spacing": 0.5,
        "water": sb.Water(),
        "water_table": sb.WaterTable(elevation=3.0, above="retention"),
        "regions": [ground],
        "sides": sb.FreeField(),
        "stages": list(stages),
        **changes,
    }
    return sb.Scene(**given)  # type: ignore[arg-type]


def test_a_heap_flows_and_comes_to_rest(tmp_path: Path) -> None:
    until_rest = [sb.Gravity(), sb.RunOut(1.2, open_sides=["right"])]
    run = sb.run(heap(stages=until_rest), tmp_path / "out")
    moved = run.field("displacement")
    assert 0.1 < moved[:, 0].max() < 0.3
    # A corner of the heap stays where it was.
    assert np.hypot(*moved[np.argmin(run.position.sum(axis=1))]) < 1e-3
    energy = run.energy()
    assert energy["kinetic"][-1] < 1e-5 * energy["kinetic"].max()
    assert np.all(np.diff(energy["damping"]) >= 0.0)
    paths = plots.plot(run)
    assert [path.name for path in paths] == ["run_out.png", "energy.png"]
    assert all(path.stat().st_size > 10_000 for path in paths)


def test_water_goes_with_a_heap_and_leaves_it(tmp_path: Path) -> None:
    """The final pressure is zero in air, and hydrostatic at each particle under water."""
    for still, level in (([], 0.0), ([(0.0, 0.5)], 0.5)):
        stage = sb.RunOut(1.0, open_sides=["right"], still_water=still)
        run = sb.run(heap(wet=True, stages=[sb.Gravity(), stage]), tmp_path / str(level))
        places = run.position + run.field("displacement")
        expected = 10.0 * np.maximum(level - places[:, 1], 0.0)
        assert np.abs(run.field("pore_pressure") - expected).max() < 0.05
        assert (run.position[:, 0].max() + 0.05) < places[:, 0].max()


def test_sides_that_are_not_open_hold_the_ground(tmp_path: Path) -> None:
    run = sb.run(heap(stages=[sb.Gravity(), sb.RunOut(0.2)]), tmp_path / "out")
    assert np.abs(run.field("displacement", stage="run-out")).max() < 1e-4


def test_a_stable_slope_stays_stable(tmp_path: Path) -> None:
    """Beside free-field columns, half under water, half held by suction: shaken a little, then a run-out."""
    shaking = sb.Shaking(sb.Motion.ricker(2.0, 0.05), duration=1.5)
    run = sb.run(slope(sb.Gravity(), shaking, sb.RunOut(1.0)), tmp_path / "out")
    apart = run.field("displacement") - run.field("displacement", stage="shaking")
    assert np.abs(apart).max() < 2e-3
    suction = run.field("pore_pressure") < 0.0
    assert suction.any()
    assert run.field("pore_pressure")[suction] == pytest.approx(
        run.field("pore_pressure", stage="shaking")[suction], abs=0.05
    )


def test_only_a_run_out_has_its_cost() -> None:
    simulation = sb.Simulation(heap(stages=[sb.Gravity(), sb.Shaking(duration=0.1)]))
    simulation.begin_next_stage()
    assert "run_out" not in simulation.arrays()
    flowing = sb.Simulation(heap())
    flowing.begin_next_stage()
    assert "run_out" in flowing.arrays()
    assert {"run-out": True, "base dashpots": False}.items() <= {
        name: on for name, on, _ in flowing.scene.active_physics()
    }.items()


@pytest.mark.parametrize(
    ("stages", "expected"),
    [
        ([sb.Gravity(), sb.RunOut(1.0)], (True, "slope")),
        ([sb.Gravity(), sb.Shaking(duration=1.0), sb.RunOut(1.0)], (True, "slope")),
        ([sb.Gravity()], (True, "slope")),
    ],
)
def test_soil_above_the_water_is_partly_saturated(stages: list[object], expected: tuple[bool, str]) -> None:
    """Suction acts on the skeleton in every stage, also where water does not flow."""
    (fact,) = [fact for fact in slope(*stages).active_physics() if fact.name == "partial saturation"]
    assert (fact.on, fact.why) == expected


def test_a_scene_that_flows_is_written_and_read() -> None:
    scene = heap(wet=True, stages=[sb.Gravity(), sb.RunOut(1.0, still_water=[(0.0, 0.3), (1.0, 0.2)])])
    assert sb.Scene.from_toml(scene.to_toml()) == scene


def test_ground_cannot_be_shaken_after_a_run_out() -> None:
    with pytest.raises(InvalidInput, match=r"stages\[1\]\.kind = 'run-out': must be the last stage"):
        heap(stages=[sb.Gravity(), sb.RunOut(1.0), sb.Shaking(duration=1.0)])
