"""A plan agrees with the run, and writes nothing."""

from __future__ import annotations

import warnings
from pathlib import Path

import h5py
import pytest
import scenes
from frozen import scenes as frozen_scenes
from sandboil import (
    Gravity,
    InvalidInput,
    Plan,
    Run,
    SandboilWarning,
    Shaking,
    Simulation,
    Water,
)
from sandboil.run import plan as plan_module
from sandboil.run.plan import pore_pressure_coefficients
from sandboil.scene.physics import reasons


def grown_bytes(run: Run) -> int:
    """Bytes of fields and histories in a results file, uncompressed."""
    with h5py.File(run.path) as file:
        grown = [
            file["VTKHDF/Points"],
            *file["VTKHDF/PointData"].values(),
            *file["histories/shaking"].values(),
        ]
        return sum(dataset.nbytes for dataset in grown)


@pytest.fixture(autouse=True)
def short_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan_module, "TRIAL_SECONDS", 0.2)


def test_the_plan_agrees_with_the_run(finished: Run) -> None:
    plan = scenes.column().plan()
    assert isinstance(plan, Plan)
    gravity, shaking = plan.stages
    assert gravity.steps == finished.accounts("gravity")["steps"]
    assert shaking.dt == pytest.approx(finished.time_steps()[0][0], rel=1e-6)
    assert shaking.dt_limit == finished.time_steps()[1][0]
    assert shaking.steps == pytest.approx(finished.accounts()["steps"], rel=0.05)
    assert (plan.nodes, plan.stress_nodes, shaking.duration) == (32, 64, 0.8)
    accounts = finished.accounts()
    assert plan.arrays["soil_state"] == accounts["bytes_soil_state"]
    # Timed on a machine that others use too: the order of magnitude.
    assert plan.wall_time is not None
    measured = finished.accounts("gravity")["wall_time_s"] + accounts["wall_time_s"]
    assert 0.1 * measured < plan.wall_time < 10.0 * measured
    assert plan.file_size == pytest.approx(grown_bytes(finished), rel=0.05)


def test_the_page_lists_what_is_on_and_why() -> None:
    text = str(scenes.column().plan())
    for line in (
        "nodes         32",
        "on   pore water             water table at elevation 4 m",
        "off  free-field columns     the sides are periodic",
        "limited by the",
        "ms a step in a trial of",
        "memory",
        "pore pressure coefficient B",
        "standard; what presets save and cost is measured on the level ground",
    ):
        assert line in text


def test_the_plan_reports_the_acceleration_term_that_the_solver_chose() -> None:
    def acceleration(diffusion: str) -> tuple[bool, str]:
        plan = scenes.column(numerics={"diffusion": diffusion}).plan()
        ((on, reason),) = [(on, reason) for name, on, reason in plan.physics if name == "water acceleration"]
        return on, reason

    assert acceleration("explicit")[0]
    assert acceleration("implicit") == (False, "pore pressure diffusion is implicit")


@pytest.mark.parametrize("name", frozen_scenes.ALL)
def test_the_scene_and_the_core_agree_on_what_is_computed(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plan_module, "TRIAL_SECONDS", 0.0)
    scene = frozen_scenes.ALL[name](tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SandboilWarning)
        planned = scene.plan().physics
    foreseen = scene.active_physics()
    # The core may still choose not to compute what is left to it.
    left = {each.name for each in reasons(scene) if each.not_chosen}
    assert left <= {"water acceleration"}
    differing = [
        (then, now)
        for then, now in zip(foreseen, planned, strict=True)
        if then.name not in left and then != now
    ]
    assert differing == []
    assert all(then.on or not now.on for then, now in zip(foreseen, planned, strict=True))
    assert all(fact.why for fact in planned)


@pytest.mark.parametrize("name", ["level ground", "steady seepage"])
def test_every_physics_of_the_core_has_its_reasons(name: str, tmp_path: Path) -> None:
    scene = frozen_scenes.ALL[name](tmp_path)
    simulation = Simulation(scene, threads=1)
    names = set(simulation.physics)
    simulation.begin_next_stage()
    names |= set(simulation.physics)
    told = {each.name for each in reasons(scene)}
    assert names <= told
    # Only a stage of seepage has that physics.
    assert told - names == (set() if scene.seepage else {"seepage"})


def test_a_dry_scene_without_shaking_plans_neither() -> None:
    plan = scenes.dry_column(stages=[Gravity()]).plan()
    assert plan.pore_pressure_coefficients == {}
    assert "coefficient B" not in str(plan)
    assert {name for name, on, _ in plan.physics if on} == {"velocity filter"}
    assert set(plan.arrays) == {"motion", "constant_forces", "stress", "geometry", "phases"}


def test_the_steps_of_a_long_static_stage_are_not_estimated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan_module, "TRIAL_SECONDS", 0.0)
    plan = scenes.column(stages=[Gravity(tolerance=1e-12)]).plan()
    assert plan.stages[0].steps is None
    assert plan.wall_time is None
    assert "not known in advance" in str(plan)


def test_a_shaking_without_a_motion_is_planned() -> None:
    plan = scenes.column(stages=[Gravity(), Shaking(duration=3.0)]).plan()
    assert plan.stages[1].duration == 3.0


def test_compressible_water_is_warned_of() -> None:
    natural = pore_pressure_coefficients(scenes.column())
    soft = pore_pressure_coefficients(scenes.column(water=Water(bulk_modulus=5.0e4)))
    # PM4Sand at sigma_v' = 39.6 kPa, K0 = 0.5: p = 29.7 kPa, K = G (2/3) 1.3/0.4, G = G0 p_atm sqrt(p/p_atm)
    # less what the stress ratio takes, and n = 0.575/1.575.
    stiffness = 890.0 * 101.3 * (29.7 / 101.3) ** 0.5 * 2.0 / 3.0 * 1.3 / 0.4
    n = 0.575 / 1.575
    for modulus, coefficients in ((1.0e6, natural), (5.0e4, soft)):
        assert coefficients["dense"] == pytest.approx(modulus / n / (modulus / n + stiffness), rel=0.03)
    assert min(natural.values()) > plan_module.LEAST_COEFFICIENT > soft["dense"]
    text = str(scenes.column(water=Water(bulk_modulus=5.0e4)).plan())
    assert "below 0.9: the water's bulk modulus is low" in text
    assert "below 0.9" not in str(scenes.column().plan())


def test_a_plan_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scenes.column().plan()
    assert not list(tmp_path.iterdir())


def test_what_a_run_refuses_a_plan_refuses(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="must be a readable"):
        scenes.column(stages=[Gravity(), Shaking({"file": str(tmp_path / "none.AT2")})]).plan()
    with pytest.raises(InvalidInput, match="threads"):
        plan_module.plan(scenes.column(), threads=0)
    with pytest.raises(InvalidInput, match="did you mean 'reference'"):
        plan_module.plan(scenes.column(), accuracy="referense")
