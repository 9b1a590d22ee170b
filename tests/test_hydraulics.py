"""Seepage and partly saturated ground: their scenes, their states, and their results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scenes
from numpy.typing import NDArray
from sandboil import (
    Conductivity,
    Drain,
    Elastic,
    Flux,
    FreeField,
    Gravity,
    Head,
    InvalidInput,
    Output,
    Pressure,
    Rain,
    Region,
    Reservoir,
    Roller,
    Run,
    Scene,
    Seepage,
    SeepageFace,
    Shaking,
    Simulation,
    VanGenuchten,
    Water,
    WaterTable,
    box,
    load,
    run,
)
from sandboil.results.plots import plot, seepage

EMBANKMENT = Path(__file__).parents[1] / "examples" / "embankment" / "scene.toml"
SAND = VanGenuchten(alpha=8.0, n=3.0, residual_saturation=0.05)
SILT = VanGenuchten(alpha=2.0, n=2.0, residual_saturation=0.1)
SOIL = Elastic(E=2.0e4, nu=0.3)
UNIT_WEIGHT, POROSITY, GS = 10.0, 0.4, 2.65

# The dam with vertical faces: 16 m thick, between 24 and 4 m of water.
K, WIDTH, HIGH, LOW = 1.0e-4, 16.0, 24.0, 4.0
DISCHARGE = K * (HIGH**2 - LOW**2) / (2.0 * WIDTH)


def soil(x: tuple[float, float], y: tuple[float, float], **changes: Any) -> Region:
    settings = {"hydraulic_conductivity": K, "retention": SAND, "Gs": GS, "porosity": POROSITY}
    return Region("soil", box(x=x, y=y), SOIL, **(settings | changes))


def dam(**changes: Any) -> Scene:
    settings: dict[str, Any] = {
        "spacing": 1.0,
        "water": Water(),
        "water_table": WaterTable(elevation=HIGH),
        "sides": Roller(),
        "regions": [soil((0.0, WIDTH), (0.0, HIGH))],
        "stages": [Seepage([Reservoir("left", level=HIGH), Reservoir("right", level=LOW)])],
    }
    return Scene(**(settings | changes))


def drawdown() -> Scene:
    """A bank whose reservoir falls from 4 to 1 m within the first half of the time."""
    return dam(
        spacing=0.5,
        regions=[soil((0.0, 5.0), (0.0, 4.0), retention=SILT)],
        water_table=WaterTable(elevation=4.0),
        stages=[Seepage([Reservoir("right", level=[(0.0, 4.0), (2.0e4, 1.0)])], duration=4.0e4)],
    )


def bank(above: str | None, stages: list[Any], **changes: Any) -> Scene:
    """A level column, its water table in the middle of its height of 4 m."""
    return scenes.column(
        **(
            {
                "regions": [soil((0.0, 0.5), (0.0, 4.0), retention=SILT)],
                "water_table": WaterTable(elevation=2.0, above=above),
                "stages": stages,
            }
            | changes
        )
    )


def silt_saturation(suction_head: NDArray[np.float64]) -> NDArray[np.float64]:
    """Van Genuchten's curve of the silt, written out."""
    effective = (1.0 + (SILT.alpha * np.maximum(suction_head, 0.0)) ** SILT.n) ** (1.0 / SILT.n - 1.0)
    return SILT.residual_saturation + (1.0 - SILT.residual_saturation) * effective


# Scenes


def test_every_condition_survives_toml(tmp_path: Path) -> None:
    conditions = [
        Head([(0.0, 0.0), (0.0, 4.0)], head=3.0),
        Pressure("base", pressure=35.0, x=(2.0, 4.0)),
        Flux("base", inflow=-1.0e-7, x=(6.0, 8.0)),
        Rain("surface", rate=np.array([(0.0, 1.0e-6), (50.0, 0.0)]), x=(0.0, 5.0)),
        Reservoir("right", level=[(0.0, 4.0), (100.0, 3.0)]),
        SeepageFace("surface", x=(5.0, 10.0)),
        Drain([(4.0, 1.0), (5.0, 1.0), (6.0, 1.5)]),
    ]
    ground = soil(
        (0.0, 10.0),
        (0.0, 4.0),
        hydraulic_conductivity=Conductivity(1.0e-5, 1.0e-6, angle_deg=20.0),
        retention=VanGenuchten(alpha=2.0, n=1.5, residual_saturation=0.1, full_saturation=0.95),
    )
    table = WaterTable(points=np.array([(0.0, 3.0), (10.0, 4.0)]), above="retention")
    scene = dam(
        spacing=0.5,
        regions=[ground],
        water_table=table,
        stages=[Seepage(conditions, duration=100.0), Gravity()],
    )
    for resolved in (False, True):
        scene.to_toml(tmp_path / "scene.toml", resolved=resolved)
        assert Scene.from_toml(tmp_path / "scene.toml") == scene
    assert scene.seepage is not None
    assert scene.seepage.conditions[3].rate == ((0.0, 1.0e-6), (50.0, 0.0))
    assert Seepage([Head("left", head=3)]) == Seepage([Head("left", head=3.0)])


def test_the_water_table_may_slope() -> None:
    scene = dam(water_table=WaterTable(points=[(0.0, 20.0), (8.0, 16.0), (12.0, 16.0)]), stages=[Gravity()])
    np.testing.assert_allclose(
        scene.water_level_at(np.array([-5.0, 4.0, 10.0, 16.0])), [20.0, 18.0, 16.0, 16.0]
    )


def test_conductivity_tells_its_principal_axes() -> None:
    along = (np.cos(np.radians(30.0)), np.sin(np.radians(30.0)))
    inclined = Conductivity(1.0e-5, 1.0e-6, angle_deg=30.0).core
    assert (inclined.major, inclined.minor) == (1.0e-5, 1.0e-6)
    assert inclined.direction == pytest.approx(along)
    across = Conductivity(1.0e-6, 1.0e-5, angle_deg=30.0).core
    assert (across.major, across.minor) == (1.0e-5, 1.0e-6)
    assert across.direction == pytest.approx((-along[1], along[0]))


# Seepage alone


@pytest.fixture(scope="module")
def dammed(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(dam(), tmp_path_factory.mktemp("dam"), threads=1)


def test_the_dam_with_vertical_faces_lets_through_what_it_should(dammed: Run) -> None:
    (upstream, inflow), (downstream, outflow) = dammed.discharge
    assert (upstream, downstream) == ("reservoir", "reservoir")
    assert inflow == pytest.approx(DISCHARGE, rel=0.01)
    assert outflow == pytest.approx(-inflow, rel=1e-6)
    assert dammed.water_balance is None, "a steady state stores nothing"


def test_a_run_keeps_what_the_simulation_knows(dammed: Run) -> None:
    simulation = Simulation(dam(), threads=2)
    simulation.run_stage()
    assert simulation.is_complete
    assert simulation.discharge == dammed.discharge
    assert dammed.field_names == simulation.field_names == ["pore_pressure", "head", "saturation"]
    for name in dammed.field_names:
        np.testing.assert_array_equal(dammed.field(name), simulation.field(name))
        np.testing.assert_array_equal(dammed.seepage_field(name), simulation.field(name))
    head, pressure = dammed.field("head"), dammed.field("pore_pressure")
    np.testing.assert_allclose(pressure, UNIT_WEIGHT * (head - dammed.position[:, 1]), atol=1e-9)
    assert ((head > LOW - 1e-6) & (head < HIGH + 1e-6)).all()
    assert simulation.dt == 0.0, "no time passes"


def test_the_summary_tells_the_discharge(dammed: Run) -> None:
    figures = load(dammed.path.parent).summary()["seepage"]
    assert figures["inflow by condition, m3/s per m"] == {
        "0 reservoir": dammed.discharge[0][1],
        "1 reservoir": dammed.discharge[1][1],
    }
    assert "time step, s" not in figures


def test_a_field_of_seepage_that_does_not_exist_is_refused(dammed: Run, finished: Run) -> None:
    with pytest.raises(InvalidInput, match="must be one of pore_pressure, head, saturation"):
        dammed.seepage_field("sigma_v_eff")
    with pytest.raises(InvalidInput, match="a seepage stage"):
        finished.seepage_field("head")
    assert finished.discharge == []
    assert finished.water_balance is None


def test_a_drawdown_loses_no_water(tmp_path: Path) -> None:
    results = run(drawdown(), tmp_path, threads=1)
    assert results.water_balance is not None
    ((inflow,), stored) = results.water_balance
    assert stored == pytest.approx(inflow, rel=1e-6)
    # The pores above the lowered water, save what suction holds there.
    assert 0.05 * POROSITY * 15.0 < -stored < POROSITY * 15.0
    # Pores hold what was stored: the change of saturation, and a hundredth more for compressed water.
    lost = POROSITY * (1.0 - results.field("saturation")).sum() * 0.5**2
    assert lost == pytest.approx(-stored, rel=0.01)
    figures = results.summary()["seepage"]
    assert figures["gain of stored water, m3 per m"] == stored
    assert figures["time, s"] == 4.0e4
    assert "after 4e+04 s" in seepage(results).get_suptitle()


def test_levels_follow_the_given_times() -> None:
    """Ground so permeable that it follows the level at once: constant before and after the given times."""
    still = dam(
        regions=[soil((0.0, 4.0), (0.0, 4.0), hydraulic_conductivity=1.0)],
        water_table=WaterTable(elevation=6.0),
        stages=[Seepage([Head("left", head=[(10.0, 6.0), (20.0, 8.0)])], duration=30.0)],
    )
    simulation = Simulation(still, threads=1)
    for until, head in ((5.0, 6.0), (30.0, 8.0)):
        simulation.advance(until, 60.0)
        np.testing.assert_allclose(simulation.field("head"), head, atol=1e-3)


@pytest.mark.parametrize("scene", [dam(), drawdown()], ids=["steady", "transient"])
def test_stopping_and_stepping_change_nothing(scene: Scene) -> None:
    whole = Simulation(scene, threads=1)
    whole.run_stage()
    stepped = Simulation(scene, threads=1)
    while stepped.step():
        pass
    advanced = Simulation(scene, threads=1)
    assert advanced.step(3) == 3
    while not advanced.advance(np.inf, 1.0e-3):
        pass
    for other in (stepped, advanced):
        assert other.is_complete
        assert (other.steps, other.time) == (whole.steps, whole.time)
        np.testing.assert_array_equal(other.field("head"), whole.field("head"))
        assert other.discharge == whole.discharge
        assert other.water_balance == whole.water_balance


@pytest.mark.parametrize("interval", [0.25, 1.0e4])
def test_frames_are_written_on_the_way_and_change_nothing(interval: float, tmp_path: Path) -> None:
    scene = drawdown().changed(output=Output(field_dt=interval))
    results = run(scene, tmp_path, threads=1)
    assert results.times[0] == 0.0
    assert results.times[-1] == 4.0e4
    assert (np.diff(results.times) > 0.0).all()
    assert (np.diff(results.field_series("head").mean(axis=1)) < 0.0).all()
    whole = Simulation(scene, threads=1)
    whole.run_stage()
    np.testing.assert_array_equal(results.field("head"), whole.field("head"))
    assert results.accounts("seepage")["steps"] == whole.steps
    # One at the step nearest to each multiple, and one at the end; no more than steps.
    assert len(results.times) <= (6 if interval == 1.0e4 else whole.steps + 1)


def test_water_leaves_by_a_drain_and_what_rain_brings_runs_off() -> None:
    rain = 1.0e-6
    pieces = [Rain("surface", rate=rain), SeepageFace("right"), Drain([(4.0, 0.5), (6.0, 0.5)])]
    scene = dam(
        regions=[soil((0.0, 10.0), (0.0, 4.0), retention=SILT)],
        water_table=WaterTable(elevation=1.0),
        stages=[Seepage(pieces)],
    )
    simulation = Simulation(scene, threads=1)
    simulation.run_stage()
    rained, face, drained = (inflow for _, inflow in simulation.discharge)
    assert rained == pytest.approx(10.0 * rain, rel=1e-6)
    assert rained + face + drained == pytest.approx(0.0, abs=1e-3 * rained)
    assert drained < face < 0.0
    outlets = simulation.outlets(2)
    assert outlets[:, 2].sum() == pytest.approx(drained)
    assert ((outlets[:, 0] >= 3.5) & (outlets[:, 0] <= 6.5)).all()


def test_inclined_layers_lead_water_along_themselves() -> None:
    """Between two walls water flows along the channel by det k / k_yy, a fiftieth of the greater one."""
    inclined = Conductivity(1.0e-4, 1.0e-6, angle_deg=45.0)

    def discharge(conductivity: float | Conductivity) -> float:
        scene = dam(
            regions=[soil((0.0, 40.0), (0.0, 4.0), hydraulic_conductivity=conductivity, retention=None)],
            water_table=WaterTable(elevation=10.0),
            stages=[Seepage([Head("left", head=20.0), Head("right", head=10.0)])],
        )
        simulation = Simulation(scene, threads=1)
        simulation.run_stage()
        return simulation.discharge[0][1]

    assert discharge(1.0e-4) == pytest.approx(1.0e-4 * 4.0 * 10.0 / 40.0, rel=1e-6)
    # Four rows: what is missing falls with the spacing, 0.4 % at sixteen.
    assert discharge(Conductivity(1.0e-4, 1.0e-6)) == pytest.approx(1.0e-4, rel=0.02)
    assert discharge(Conductivity(1.0e-6, 1.0e-4, angle_deg=90.0)) == pytest.approx(1.0e-4, rel=0.02)
    across = 1.0e-4 * 1.0e-6 / (0.5 * (1.0e-4 + 1.0e-6))
    assert discharge(inclined) == pytest.approx(across, rel=0.1)


# Ground with air in it, at rest and shaken


@pytest.mark.parametrize("above", ["dry", "retention"])
def test_moist_ground_at_rest_bears_its_weight(above: str) -> None:
    """Total stress from the moist weight above; Bishop's effective stress less S_r p, at the surface too."""
    simulation = Simulation(bank(above, [Gravity(tolerance=1e-6)], spacing=0.125), threads=1)
    simulation.run_stage()
    y = simulation.particles.position[:, 1]
    fine = np.linspace(0.0, 4.0, 40_001)

    def saturation(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(at <= 2.0, 1.0, 0.0 if above == "dry" else silt_saturation(at - 2.0))

    pressure = UNIT_WEIGHT * (2.0 - y)
    if above == "dry":
        pressure = np.maximum(pressure, 0.0)
    weight = UNIT_WEIGHT * ((1.0 - POROSITY) * GS + POROSITY * saturation(fine))
    below = np.concatenate([[0.0], np.cumsum(0.5 * (weight[1:] + weight[:-1]) * np.diff(fine))])
    total = np.interp(y, fine, below[-1] - below)
    effective = total - saturation(y) * pressure

    np.testing.assert_allclose(simulation.field("pore_pressure"), pressure, atol=1e-9)
    np.testing.assert_allclose(simulation.field("saturation"), saturation(y), atol=1e-12)
    np.testing.assert_allclose(simulation.particles.sigma_v_eff0, effective, atol=0.02)
    at_rest = simulation.field("sigma_v_eff")
    # Rows beside the edges are means over half of their surroundings.
    np.testing.assert_allclose(at_rest, effective, atol=0.02 * effective.max())
    inner = (y > 0.5) & (y < 3.7)
    np.testing.assert_allclose(at_rest[inner], effective[inner], atol=0.25)


def test_soil_above_the_water_is_dry_or_holds_what_its_curve_says() -> None:
    left_out = Simulation(bank(None, [Gravity()]), threads=1)
    held = Simulation(bank("retention", [Gravity()]), threads=1)
    np.testing.assert_array_equal(
        left_out.particles.pore_pressure0,
        held.particles.pore_pressure0,
        err_msg="all soil there has a curve",
    )
    dry = Simulation(bank("dry", [Gravity()]), threads=1)
    assert dry.particles.pore_pressure0.min() == 0.0 > held.particles.pore_pressure0.min()


@pytest.fixture(scope="module")
def shaken(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Seepage that lowers the water of the column to 1 m, then statics and a pulse."""
    stages = [Seepage([Head("base", head=1.0)]), Gravity(), Shaking(scenes.PULSE, duration=0.4)]
    return run(bank(None, stages), tmp_path_factory.mktemp("shaken"), threads=1)


def test_the_stages_after_seepage_stand_on_its_water(shaken: Run) -> None:
    y = shaken.position[:, 1]
    np.testing.assert_allclose(shaken.seepage_field("head"), 1.0, atol=1e-6)
    with h5py.File(shaken.path) as file:
        np.testing.assert_array_equal(file["nodes/pore_pressure0"], file["seepage/pore_pressure"])
    pressure = shaken.field("pore_pressure", 0.0)
    np.testing.assert_allclose(pressure, UNIT_WEIGHT * (1.0 - y), atol=1e-5)
    np.testing.assert_allclose(shaken.field("saturation", 0.0), silt_saturation(y - 1.0), atol=1e-6)
    # A run begun with the water there has the same stresses: nothing jumps.
    still = Simulation(
        bank(None, [Gravity()], water_table=WaterTable(elevation=1.0)),
        threads=1,
    )
    still.run_stage()
    np.testing.assert_allclose(shaken.field("sigma_v_eff", 0.0), still.field("sigma_v_eff"), atol=1e-2)
    probe = shaken.history("pore_pressure", depth=3.0)
    assert probe.values[0] == pytest.approx(0.0, abs=0.1)


def test_partly_saturated_soil_gives_way_while_it_is_shaken(shaken: Run) -> None:
    y = shaken.position[:, 1]
    before, after = shaken.field("saturation", 0.0), shaken.field("saturation")
    # Water in pores that hold air moves, a little, and is hardly pressed.
    assert 0.0 < np.abs(after - before).max() < 1e-3
    excess = np.abs(shaken.field_series("excess_pore_pressure")).max(axis=0)
    assert excess[y > 1.25].max() < 0.2 * excess[y < 0.75].max()
    assert (excess[y < 0.75] > 0.0).all()


def test_a_mixed_run_has_the_pictures_of_its_water_and_of_its_shaking(shaken: Run, tmp_path: Path) -> None:
    names = [path.name for path in plot(shaken, tmp_path)]
    shaking = ["surface.png", "pore_pressure.png", "column.png", "energy.png", "stress_paths.png"]
    assert names == ["seepage.png", *shaking]


def test_a_seepage_run_has_one_picture(dammed: Run, tmp_path: Path) -> None:
    assert [path.name for path in plot(dammed, tmp_path)] == ["seepage.png"]
    with pytest.raises(InvalidInput, match="must be a shaking stage of the run: none"):
        plot(dammed, tmp_path, stage="shaking")


def test_the_picture_tells_heads_water_and_discharges(dammed: Run, finished: Run) -> None:
    figure = seepage(dammed)
    axes = figure.axes[0]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[:2] == ["total head, m", "phreatic line, p = 0"]
    assert labels[2].startswith("reservoir, level 24 m: +0.0017")
    assert labels[3].startswith("reservoir, level 4 m: -0.0017")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x, m", "y, m")
    assert "steady state" in figure.get_suptitle()
    # The phreatic line leaves the dam where it is known to: at 12.8 m (Hornung and Krueger 1985).
    phreatic = max((c for c in axes.collections if hasattr(c, "levels")), key=lambda c: c.get_linewidth()[0])
    line = np.vstack([path.vertices for path in phreatic.get_paths() if len(path.vertices)])
    assert np.interp(WIDTH, *line[np.argsort(line[:, 0])].T) == pytest.approx(12.8, abs=1.0)
    with pytest.raises(InvalidInput, match="must be a stage of the run"):
        seepage(finished)


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_do_not_change_a_bit(shaken: Run, threads: int, tmp_path: Path) -> None:
    again = run(shaken.scene, tmp_path, threads=threads)
    for name in shaken.field_names:
        np.testing.assert_array_equal(again.field(name), shaken.field(name))
    assert again.discharge == shaken.discharge


# What is computed, and what is not


def rows(scene: Scene) -> dict[str, tuple[bool, str]]:
    return {name: (active, reason) for name, active, reason in scene.active_physics()}


def test_the_physics_of_water_is_told() -> None:
    facts = rows(dam())
    assert facts["seepage"] == (True, "to its steady state")
    assert facts["partial saturation"] == (True, "soil")
    assert facts["water diffusion"] == (False, "no shaking stage")
    in_time = "for its duration; the skeleton stores water by its small-strain stiffness"
    assert rows(drawdown())["seepage"] == (True, in_time)
    assert rows(bank("dry", [Gravity()]))["partial saturation"][0]
    plain = rows(scenes.column())
    assert plain["seepage"] == (False, "no seepage stage")
    assert plain["partial saturation"] == (
        False,
        "the water table is at or above the ground surface everywhere",
    )
    assert rows(scenes.dry_column())["seepage"] == (False, "the scene has no water")
    # Full pores with a curve stay full unless a condition may draw water out of them.
    curved = scenes.column(sides=Roller()).changed(
        **{"regions[0].retention": SAND, "stages[1].conditions": [Head("base", head=2.0)]}
    )
    assert rows(curved)["partial saturation"] == (True, "loose")
    closed = curved.changed(**{"stages[1].conditions": []})
    assert rows(closed)["partial saturation"] == (
        False,
        "the water table is at or above the ground surface everywhere",
    )


def test_plan_tells_what_seepage_costs() -> None:
    planned = dam().plan()
    (stage,) = planned.stages
    assert stage.steps is not None
    assert stage.duration is None
    assert f"seepage: to its steady state, {stage.steps} steps" in str(planned)
    assert planned.file_size > 0
    changing = drawdown().plan()
    (stage,) = changing.stages
    assert (stage.duration, stage.dt_limit) == (4.0e4, "error of a step")
    assert stage.dt > 0.0
    # No more frames than steps, at any interval: 80 nodes of three fields and places.
    assert changing.file_size < 6 * 8 * 80 * (stage.duration / stage.dt + 2)


def test_columns_are_refused_with_seepage(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="cannot be used with a seepage stage"):
        Simulation(dam(sides=FreeField()), keep_columns=True)
    with pytest.raises(InvalidInput, match="cannot be used with a seepage stage"):
        run(dam(sides=FreeField()), tmp_path, columns=tmp_path)


def test_a_saturated_scene_pays_nothing_for_the_air_that_others_hold() -> None:
    full = soil((0.0, 0.5), (0.0, 4.0), retention=None)
    plain = Simulation(scenes.column(regions=[full]), threads=1)
    plain.run_stage()
    plain.step(10)
    assert plain.particles.saturation0 is None
    assert plain.particles.overburden.pore_water is None
    assert "saturation" not in plain.field_names
    assert not [name for name in plain.counters() if name.startswith("seepage")]
    assert plain.discharge == []
    # With a curve that nothing asks for the same bits come out.
    curved = Simulation(scenes.column(regions=[soil((0.0, 0.5), (0.0, 4.0))]), threads=1)
    curved.run_stage()
    curved.step(10)
    np.testing.assert_array_equal(curved.field("velocity"), plain.field("velocity"))
    assert curved.arrays() == plain.arrays()


def test_saturated_seepage_asks_no_retention_curve() -> None:
    scene = dam(
        regions=[soil((0.0, 16.0), (0.0, 4.0), retention=None)],
        water_table=WaterTable(elevation=10.0),
        stages=[Seepage([Head("left", head=20.0), Head("right", head=10.0)])],
    )
    assert not scene.is_partly_saturated
    simulation = Simulation(scene, threads=1)
    simulation.run_stage()
    assert simulation.counters()["seepage_retention_calls"] == 0
    partly = Simulation(dam(), threads=1)
    partly.run_stage()
    assert partly.counters()["seepage_retention_calls"] > 0


# The example


def test_the_embankment_stands_in_balance(tmp_path: Path) -> None:
    results = run(Scene.from_toml(EMBANKMENT), tmp_path, threads=2)
    assert results.status == "complete"
    kinds, inflows = zip(*results.discharge, strict=True)
    assert kinds == ("reservoir", "seepage-face", "drain")
    assert sum(inflows) == pytest.approx(0.0, abs=0.01 * inflows[0])
    assert inflows[2] < inflows[1] < 0.0, "the drain takes more than the face"
    x, y = results.position.T
    wet = results.field("pore_pressure") > 0.0
    upstream = (x > 20.0) & (x < 26.0) & (y > 4.0)
    np.testing.assert_array_equal(wet[upstream], y[upstream] < 10.0)
    # The core loses most of the head, and the drain keeps the downstream shell dry.
    assert not wet[(x > 34.0) & (y > 6.0)].any()
    assert [path.name for path in plot(results, tmp_path)] == ["seepage.png"]
