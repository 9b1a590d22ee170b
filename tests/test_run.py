"""A scene driven by hand and run into a folder: the stages, what is refused, and how a run may end."""

from __future__ import annotations

import csv
import os
import runpy
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import scenes
from sandboil import (
    Gravity,
    InvalidInput,
    Motion,
    Numerics,
    Region,
    Run,
    RunInterrupted,
    SandboilError,
    SandboilWarning,
    Scene,
    Shaking,
    Simulation,
    SimulationDiverged,
    box,
    discretise,
    load,
    run,
)
from sandboil.run import neighbourhood
from sandboil.run.accuracy import with_accuracy
from sandboil.run.run import warn_of_forced_sub_steps

LEVEL_GROUND = Path(__file__).parents[1] / "examples" / "level_ground"


# Driving by hand


def test_stepping_goes_through_the_stages() -> None:
    simulation = Simulation(scenes.column(), threads=1)
    assert (simulation.stage, simulation.time, simulation.steps) == ("gravity", 0.0, 0)
    simulation.run_stage()
    assert simulation.stage == "gravity"
    assert simulation.stage_is_complete
    assert not simulation.is_complete
    assert simulation.residual <= 1.0e-4
    assert simulation.step(3) == 3
    assert (simulation.stage, simulation.steps) == ("shaking", 3)
    assert simulation.time == pytest.approx(3 * simulation.dt)
    simulation.run_stage()
    assert simulation.is_complete
    assert simulation.time == pytest.approx(0.8, abs=simulation.dt)
    assert simulation.step(5) == 0


def test_one_call_steps_across_the_end_of_a_stage() -> None:
    by_hand = Simulation(scenes.column(), threads=1)
    by_hand.run_stage()
    in_gravity = by_hand.steps
    by_hand.step(10)
    at_once = Simulation(scenes.column(), threads=1)
    assert at_once.step(in_gravity + 10) == in_gravity + 10
    assert (at_once.stage, at_once.steps) == ("shaking", 10)
    np.testing.assert_array_equal(at_once.field("velocity"), by_hand.field("velocity"))


def test_the_ground_at_rest_has_its_geostatic_state() -> None:
    scene = scenes.column()
    simulation = Simulation(scene, threads=1)
    simulation.run_stage()
    particles = discretise(scene)
    # Two rows at either end carry the boundaries' own error.
    inner = slice(4, -4)
    vertical = particles.sigma_v_eff0[inner]
    for name, share in (("sigma_v_eff", 1.0), ("sigma_h_eff", 0.5), ("p_eff", 0.75)):
        np.testing.assert_allclose(simulation.field(name)[inner], share * vertical, rtol=0.04)
    np.testing.assert_allclose(simulation.field("r_u_stress")[inner], 0.0, atol=0.04)
    np.testing.assert_array_equal(simulation.field("pore_pressure"), particles.pore_pressure0)
    np.testing.assert_array_equal(simulation.field("r_u"), 0.0)


def test_fields_have_a_row_per_node_and_agree_with_each_other() -> None:
    simulation = Simulation(scenes.column(), threads=1)
    simulation.run_stage()
    simulation.run_stage()
    fields = simulation.fields(simulation.field_names)
    assert fields["velocity"].shape == fields["displacement"].shape == fields["acceleration"].shape == (32, 2)
    assert all(values.shape == (32,) for name, values in fields.items() if values.ndim == 1)
    particles = simulation.particles
    excess = fields["excess_pore_pressure"]
    assert excess.max() > 0.5
    np.testing.assert_allclose(fields["r_u"] * particles.sigma_v_eff0, excess)
    np.testing.assert_allclose(fields["pore_pressure"] - particles.pore_pressure0, excess, atol=1e-12)
    np.testing.assert_allclose((1.0 - fields["r_u_stress"]) * particles.sigma_v_eff0, fields["sigma_v_eff"])
    assert (fields["gamma_max"] >= np.abs(fields["gamma_xy"]) - 1e-15).all()
    envelope = simulation.envelope("r_u")
    assert envelope is not None
    assert (envelope >= fields["r_u"]).all()


def test_shear_strain_and_stress_of_an_upgoing_wave_have_the_textbook_signs() -> None:
    """A wave going up with u = f(t - y/c) strains the soil by -v/c and stresses it by -rho c v."""
    motion = Motion.ricker(frequency=4.0, pga_g=0.1)
    tall = scenes.dry_column(
        regions=[Region("rock", box(x=(0, 0.5), y=(0, 40)), scenes.ROCK, dry_unit_weight=20.0)],
        spacing=0.5,
        stages=[Gravity(), Shaking(motion, duration=2.0)],
    )
    simulation = Simulation(tall, threads=1)
    simulation.run_stage()
    simulation.begin_next_stage()
    speed = np.sqrt(scenes.ROCK.shear_modulus / (20.0 / 9.81))
    # The peak of the wave is at 10 m and its front has not reached the surface.
    while not simulation.advance(1.5 / 4.0 + 10.0 / speed, 10.0):
        pass
    passing = slice(10, 30)
    velocity = simulation.field("velocity")[passing, 0]
    assert np.abs(velocity).max() > 0.005
    expected = -velocity / speed
    np.testing.assert_allclose(
        simulation.field("gamma_xy")[passing], expected, atol=0.05 * np.abs(expected).max()
    )
    stress = scenes.ROCK.shear_modulus * expected
    np.testing.assert_allclose(simulation.field("tau_xy")[passing], stress, atol=0.05 * np.abs(stress).max())


def test_an_unknown_field_is_refused_with_the_nearest_name() -> None:
    simulation = Simulation(scenes.column(), threads=1)
    with pytest.raises(InvalidInput, match="did you mean 'velocity'"):
        simulation.field("velocty")
    with pytest.raises(InvalidInput, match="must be one of r_u, gamma_max"):
        simulation.envelope("velocity")


@pytest.mark.parametrize("threads", [0, -1, 1.5, True])
def test_an_invalid_number_of_threads_is_refused(threads: int) -> None:
    with pytest.raises(InvalidInput, match="threads"):
        Simulation(scenes.column(), threads=threads)


# Running into a folder


def test_a_run_holds_every_stage_to_its_end(finished: Run) -> None:
    assert finished.status == "complete"
    assert finished.stages == ["gravity", "shaking"]
    times = finished.times
    dt = finished.time_steps()[0]
    np.testing.assert_allclose(times, np.arange(0.0, 0.85, 0.1), atol=dt.max())
    assert times[0] == 0.0
    history = finished.history("velocity_x")
    np.testing.assert_allclose(history.time, 0.005 * np.arange(len(history.time)), atol=1e-12)
    assert history.time[-1] == pytest.approx(0.8, abs=0.006)


def test_output_does_not_change_the_steps(tmp_path: Path, finished: Run) -> None:
    sparse = scenes.column(output={"field_dt": 10.0, "history_dt": 0.02, "envelopes": []})
    other = run(sparse, tmp_path, threads=1)
    assert other.accounts()["steps"] == finished.accounts()["steps"]
    np.testing.assert_array_equal(other.field("displacement"), finished.field("displacement"))
    assert len(other.times) == 2


def test_gravity_alone_leaves_one_frame(tmp_path: Path) -> None:
    results = run(scenes.column(stages=[Gravity()]), tmp_path)
    assert len(results.times) == 1
    assert results.field("sigma_v_eff").min() > 0.0
    with pytest.raises(InvalidInput, match="only they have histories"):
        results.history("velocity_x")


def test_gravity_followed_by_shaking_is_read_at_its_start(finished: Run) -> None:
    with pytest.raises(InvalidInput, match="beginning of the next stage"):
        finished.field("sigma_v_eff", stage="gravity")
    np.testing.assert_array_equal(finished.field("r_u", 0.0), 0.0)


def test_ground_that_does_not_come_to_rest_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(SandboilError, match="not at rest after 5 steps"):
        run(scenes.column(stages=[Gravity(tolerance=1e-12, max_steps=5)]), tmp_path)
    assert load(tmp_path).status == "stopped"


def test_a_dry_column_of_unknown_porosity_runs(tmp_path: Path) -> None:
    results = run(scenes.dry_column(), tmp_path)
    assert "excess_pore_pressure" not in results.field_names
    assert "r_u" not in results.history_names
    np.testing.assert_allclose(results.field("sigma_v_eff", 0.0).max(), 20.0 * 3.875, rtol=0.05)


# Accuracy fills what is left open


def test_accuracy_fills_only_what_the_scene_leaves_open(tmp_path: Path) -> None:
    open_scene = scenes.column()
    assert with_accuracy(open_scene, "standard") == open_scene
    assert with_accuracy(open_scene, "draft").numerics.integrator_tolerance == 1.0e-4
    assert with_accuracy(open_scene, "draft").numerics.time_step_factor == 0.9
    assert with_accuracy(open_scene, "reference").numerics.diffusion == "explicit"
    scene = scenes.column(
        numerics=Numerics(integrator_tolerance=3.0e-5, time_step_factor=0.5, diffusion="implicit")
    )
    for accuracy in ("draft", "standard", "reference"):
        assert with_accuracy(scene, accuracy) == scene
    with pytest.raises(InvalidInput, match="did you mean 'draft'"):
        with_accuracy(open_scene, "drafty")
    results = run(scenes.column(stages=[Gravity()]), tmp_path, accuracy="draft")
    assert results.accuracy == "draft"
    assert results.scene.numerics.integrator_tolerance == 1.0e-4


# Refused before any work


def test_a_folder_that_holds_a_run_is_refused(finished: Run) -> None:
    before = finished.path.read_bytes()
    with pytest.raises(InvalidInput, match="must not hold a run") as caught:
        run(scenes.column(), finished.path.parent)
    assert caught.value.path == "out"
    assert finished.path.read_bytes() == before


def test_a_folder_below_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(InvalidInput, match="is a file"):
        run(scenes.column(), tmp_path / "file" / "out")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="rights do not bind the super-user")
def test_a_folder_without_rights_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(InvalidInput, match="must be writable"):
        run(scenes.column(), tmp_path / "out")


def test_a_motion_that_cannot_be_read_is_refused_and_leaves_no_folder(tmp_path: Path) -> None:
    scene = scenes.column(stages=[Gravity(), Shaking({"file": str(tmp_path / "none.AT2")})])
    with pytest.raises(InvalidInput, match="must be a readable"):
        run(scene, tmp_path / "out")
    assert not (tmp_path / "out").exists()


# How a run may end


def test_divergence_keeps_what_was_computed(tmp_path: Path) -> None:
    with pytest.raises(SimulationDiverged) as caught:
        run(scenes.diverging_column(), tmp_path)
    error = caught.value
    results = load(tmp_path)
    assert results.status == "stopped"
    assert results.message == str(error)
    assert error.quantity in results.message
    assert 0 <= error.node < len(results.position)
    x, y = error.position
    assert f"node {error.node} at" in results.message
    assert np.isfinite([x, y]).all()
    # The last frame is the state in which it stopped.
    assert results.times[-1] == error.time
    assert len(results.history("velocity_x").time) > 0 or error.time < 0.05


def test_divergence_leaves_its_neighbourhood(tmp_path: Path) -> None:
    with pytest.raises(SimulationDiverged) as caught:
        run(scenes.diverging_column(), tmp_path)
    error, results = caught.value, load(tmp_path)
    with (tmp_path / "neighbourhood.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    # The diverged node and all others within six spacings at rest.
    assert int(rows[0]["node"]) == error.node
    away = np.linalg.norm(results.position - results.position[error.node], axis=1)
    assert {int(row["node"]) for row in rows} == set(np.flatnonzero(away <= 6.0 * 0.25).tolist())
    for row in rows:
        node = int(row["node"])
        assert (float(row["x (m)"]), float(row["y (m)"])) == tuple(results.position[node])
        assert row["region"] == "rock"
        assert float(row["velocity_x (m/s)"]) == results.field("velocity")[node, 0]
        assert float(row["sigma_v_eff (kPa)"]) == results.field("sigma_v_eff")[node]
    assert (tmp_path / "neighbourhood.png").read_bytes().startswith(b"\x89PNG")
    assert str(tmp_path / "neighbourhood.csv") in error.__notes__[-1]


def test_a_neighbourhood_that_cannot_be_written_hides_no_divergence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError("No space left on device")

    monkeypatch.setattr(neighbourhood, "write", full)
    with pytest.raises(SimulationDiverged) as caught:
        run(scenes.diverging_column(), tmp_path)
    assert "No space left" in caught.value.__notes__[-1]
    assert load(tmp_path).status == "stopped"


def test_a_diverged_run_continues_from_its_last_state(tmp_path: Path) -> None:
    with pytest.raises(SimulationDiverged) as first:
        run(scenes.diverging_column(), tmp_path / "out")
    # The same run diverges at the same place; a run that does not diverge can start from its ground at rest.
    with pytest.raises(SimulationDiverged) as again:
        run(scenes.diverging_column(), tmp_path / "out", resume=True)
    assert str(again.value) == str(first.value)
    mended = run(scenes.dry_column(), tmp_path / "mended", start=(tmp_path / "out", "gravity"))
    assert mended.status == "complete"
    assert not (tmp_path / "mended" / "neighbourhood.csv").exists()


def interrupt_when_shaking(folder: Path, number: signal.Signals) -> subprocess.Popen[str]:
    """A run in a separate process, sent a signal once its file contains some shaking."""
    code = (
        "import scenes, sandboil as sb\n"
        "scene = scenes.column(stages=[sb.Gravity(), sb.Shaking(scenes.PULSE, duration=1000.0)])\n"
        f"sb.run(scene, {str(folder)!r}, threads=1)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=Path(__file__).parent, stderr=subprocess.PIPE, text=True
    )
    results, deadline = folder / "results.h5", time.monotonic() + 60.0
    while not (results.exists() and results.stat().st_size > 100_000):
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(number)
    return process


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_is_readable(tmp_path: Path, number: signal.Signals) -> None:
    process = interrupt_when_shaking(tmp_path, number)
    error = process.communicate(timeout=60)[1]
    assert RunInterrupted.__name__ in error
    results = load(tmp_path)
    assert results.status == "interrupted"
    assert "interrupted in shaking" in results.message
    # The last frame is that of the moment, and the histories reach it to within their filter.
    assert results.history("velocity_x").time[-1] == pytest.approx(results.times[-1], abs=0.05)
    assert np.isfinite(results.field("velocity")).all()


def test_handlers_of_signals_are_put_back(tmp_path: Path) -> None:
    before = signal.getsignal(signal.SIGINT)
    run(scenes.column(stages=[Gravity()]), tmp_path)
    assert signal.getsignal(signal.SIGINT) is before


# The example


def shortened(scene: Scene) -> Scene:
    return scene.changed(**{"stages[1].duration": 0.3})


@pytest.mark.parametrize("language", ["toml", "py"])
def test_the_example_runs(tmp_path: Path, language: str) -> None:
    path = LEVEL_GROUND / f"scene.{language}"
    scene = Scene.from_toml(path) if language == "toml" else runpy.run_path(str(path))["scene"]
    results = run(shortened(scene), tmp_path)
    assert results.status == "complete"
    assert results.times[-1] == pytest.approx(0.3, abs=1e-3)
    assert len(results.position) == 500


def test_many_forced_sub_steps_are_told() -> None:
    with pytest.warns(SandboilWarning, match="shaking: 2.0% of the sub-steps"):
        warn_of_forced_sub_steps("shaking", {"forced_acceptances": 20, "substeps": 1000})


@pytest.mark.parametrize(
    "counters", [{"forced_acceptances": 10, "substeps": 1000}, {"forced_acceptances": 0, "substeps": 0}, {}]
)
def test_few_forced_sub_steps_are_not_told(counters: dict[str, int]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_forced_sub_steps("shaking", counters)
