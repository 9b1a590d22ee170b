"""The command line as a user meets it: a process, its two streams, its exit code."""

from __future__ import annotations

import contextlib
import io
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import scenes
from sandboil import Gravity, Motion, PM4Sand, Run, Shaking, lab, load
from sandboil.cli import main

DONE, INVALID, STOPPED, INTERRUPTED = 0, 2, 3, 130


def command(*arguments: object) -> list[str]:
    """The installed command, or its module where the scripts' folder is elsewhere."""
    script = shutil.which("sandboil", path=str(Path(sys.executable).parent))
    start = [script] if script else [sys.executable, "-c", "from sandboil.cli import main; main()"]
    return [*start, *map(str, arguments)]


def sandboil(*arguments: object) -> subprocess.CompletedProcess[str]:
    """The command in a separate process, as a user starts it."""
    return subprocess.run(command(*arguments), capture_output=True, text=True, timeout=120, check=False)


def called(*arguments: object) -> subprocess.CompletedProcess[str]:
    """The same in this process, which saves the second that a new one takes to load."""
    out, err = io.StringIO(), io.StringIO()
    words = ["sandboil", *map(str, arguments)]
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        patch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as exited:
            main()
    code = exited.value.code
    assert isinstance(code, int)
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


def refused(*arguments: object) -> str:
    """The message on stderr of a command that refuses its input: one line, and nothing on stdout."""
    done = called(*arguments)
    assert (done.returncode, done.stdout) == (INVALID, "")
    assert done.stderr.startswith("sandboil: ")
    assert done.stderr.count("\n") == 1, done.stderr
    assert "Traceback" not in done.stderr
    return done.stderr


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    scenes.column().to_toml(path)
    return path


@pytest.fixture
def record(tmp_path: Path) -> Path:
    path = tmp_path / "record.csv"
    scenes.PULSE.scaled(pga_g=0.1).write_csv(path)
    return path


# From scene to pictures


def test_plan_run_and_plot(scene_file: Path, tmp_path: Path) -> None:
    planned = called("plan", scene_file)
    assert (planned.returncode, planned.stderr) == (DONE, "")
    assert "steps of" in planned.stdout
    out = tmp_path / "out"
    done = sandboil("run", scene_file, "--out", out, "--threads", 1, "--accuracy", "draft")
    # No bar where nobody watches.
    assert (done.returncode, done.stderr) == (DONE, "")
    results = load(out)
    assert done.stdout == f"{results.summary()}\n"
    assert (results.status, results.accuracy) == ("complete", "draft")
    drawn = called("plot", out)
    assert (drawn.returncode, drawn.stderr) == (DONE, "")
    assert all(Path(line).is_file() for line in drawn.stdout.splitlines())
    assert len(drawn.stdout.splitlines()) == 5


def test_another_motion_shakes_the_scene(scene_file: Path, record: Path, tmp_path: Path) -> None:
    chosen = ("--motion", record, "--column", "acceleration_g")
    assert called("run", scene_file, "--out", tmp_path / "out", *chosen).returncode == DONE
    motion = load(tmp_path / "out").motion()
    assert motion is not None
    assert motion.pga_g == pytest.approx(0.1)


def test_only_commands_that_work_are_offered() -> None:
    page = called("--help").stdout
    assert all(name in page for name in ("plan", "run", "plot", "motion", "lab"))
    assert not any(name in page for name in ("report", "trade", "study"))
    assert "--resume" in called("run", "--help").stdout


# Refused: exit code 2


def test_a_misspelt_key_is_refused_with_the_right_one(scene_file: Path, tmp_path: Path) -> None:
    scene_file.write_text(
        scene_file.read_text().replace("hydraulic_conductivity", "hydraulic_conductivty", 1)
    )
    for message in (refused("plan", scene_file), refused("run", scene_file, "--out", tmp_path / "out")):
        assert "scene.regions[0].hydraulic_conductivty" in message
        assert "did you mean 'hydraulic_conductivity'" in message
    assert not (tmp_path / "out").exists()


def test_a_scene_that_is_not_there_is_refused(tmp_path: Path) -> None:
    assert "must be a readable TOML file" in refused("plan", tmp_path / "none.toml")


def test_a_folder_that_holds_a_run_is_refused(scene_file: Path, finished: Run) -> None:
    assert "must not hold a run" in refused("run", scene_file, "--out", finished.path.parent)


def test_an_unwritable_folder_is_refused(scene_file: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert "is a file" in refused("run", scene_file, "--out", tmp_path / "file" / "out")


def test_a_motion_that_cannot_be_read_is_refused(scene_file: Path, tmp_path: Path) -> None:
    none = tmp_path / "none.AT2"
    assert "must be a readable record" in refused(
        "run", scene_file, "--out", tmp_path / "out", "--motion", none
    )
    assert "belongs to a --motion" in refused("plan", scene_file, "--unit", "g")
    assert not (tmp_path / "out").exists()


def test_a_folder_without_results_is_refused(tmp_path: Path) -> None:
    assert "must contain a results.h5" in refused("plot", tmp_path)


@pytest.mark.parametrize(
    "arguments",
    [
        ("run",),
        ("run", "scene.toml", "--out", "out", "--accuracy", "perfect"),
        ("run", "scene.toml", "--out", "out", "--threads", "many"),
        ("fly",),
    ],
)
def test_misuse_of_the_command_is_refused(arguments: tuple[str, ...]) -> None:
    done = called(*arguments)
    assert (done.returncode, done.stdout) == (INVALID, "")
    assert "Traceback" not in done.stderr


# Stopped: exit codes 3 and 130


def test_divergence_exits_with_3_and_keeps_results(tmp_path: Path) -> None:
    scenes.diverging_column().to_toml(tmp_path / "scene.toml")
    done = sandboil("run", tmp_path / "scene.toml", "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (STOPPED, "")
    message = done.stderr.replace("\n", " ")
    for part in ("diverged", "node", "time", "step", str(tmp_path / "out" / "results.h5")):
        assert part in message
    assert "Traceback" not in message
    results = load(tmp_path / "out")
    assert results.status == "stopped"
    assert results.message in message
    assert "stopped" in str(results.summary())


def test_a_run_that_cannot_write_exits_with_3_and_resumes(tmp_path: Path, finished: Run) -> None:
    scenes.column().to_toml(tmp_path / "scene.toml")
    out = tmp_path / "out"
    # A disk that is full behaves so: files cannot grow.
    limited = subprocess.run(
        command("run", tmp_path / "scene.toml", "--out", out, "--checkpoint-time", 0.1),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (180_000, 180_000)),
    )
    assert (limited.returncode, limited.stdout) == (STOPPED, "")
    message = limited.stderr.replace("\n", " ")
    for part in (
        "could not be written",
        "File too large",
        "is kept: remove the cause and resume",
        "results.h5",
    ):
        assert part in message
    assert "Traceback" not in message
    assert load(out).status == "running"
    # The newest checkpoint is damaged too, which is reported before the run continues.
    newest = sorted((out / "checkpoints").glob("0*"))[-1]
    newest.write_bytes(newest.read_bytes()[:-1])
    done = called("run", tmp_path / "scene.toml", "--out", out, "--resume")
    assert done.returncode == DONE
    assert (
        done.stderr
        == f"warning: {newest} is damaged: its checksum is not that of its bytes; it is left out\n"
    )
    assert done.stdout.split()[:2] == ["status", "complete"]
    np.testing.assert_array_equal(load(out).field("displacement"), finished.field("displacement"))


def test_a_folder_without_a_run_is_not_resumed(tmp_path: Path, scene_file: Path) -> None:
    message = refused("run", scene_file, "--out", tmp_path / "none", "--resume")
    assert "must hold a run to resume, but has no results.h5" in message


def test_interrupting_exits_with_130_and_leaves_a_readable_file(tmp_path: Path) -> None:
    endless = scenes.column(stages=[Gravity(), Shaking(scenes.PULSE, duration=1000.0)])
    endless.to_toml(tmp_path / "scene.toml")
    out = tmp_path / "out"
    process = subprocess.Popen(
        command("run", tmp_path / "scene.toml", "--out", out),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60.0
    while not ((out / "results.h5").exists() and (out / "results.h5").stat().st_size > 100_000):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, message = process.communicate(timeout=60)
    assert process.returncode == INTERRUPTED
    assert "interrupted in shaking" in message
    assert "Traceback" not in message
    results = load(out)
    assert results.status == "interrupted"
    assert np.isfinite(results.field_series("velocity")).all()
    assert called("plot", out).returncode == DONE


# The laboratory

SAND = ("--Dr", 0.55, "--G0", 677, "--hpo", 0.4)


def test_cyclic_shear_counts_cycles(tmp_path: Path) -> None:
    out, picture = tmp_path / "test.csv", tmp_path / "test.png"
    result = called("lab", "dss", *SAND, "--csr", 0.147, "--out", out, "--plot", picture)
    assert (result.returncode, result.stderr) == (DONE, "")
    expected = lab.cyclic_dss(PM4Sand(Dr=0.55, G0=677, hpo=0.4), csr=0.147)
    assert f"{'single amplitude 3 %':<28}{expected.cycles_to(gamma_sa=0.03):>8.2f}\n" in result.stdout
    assert f"{'double amplitude 5 %':<28}{expected.cycles_to(gamma_da=0.05):>8.2f}\n" in result.stdout
    assert result.stdout.splitlines()[-1].endswith(expected.ended)
    header, *rows = out.read_text().splitlines()
    assert header.split(",") == list(expected.columns())
    assert len(rows) == len(expected.gamma)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_criterion_that_is_never_reached_says_so() -> None:
    result = called("lab", "dss", *SAND, "--csr", 0.05, "--max-cycles", 2)
    assert result.returncode == DONE
    assert f"{'r_u 0.95':<28}{'never':>8}\n" in result.stdout


def test_monotonic_shear_of_a_soil_in_a_file(tmp_path: Path) -> None:
    soil = tmp_path / "soil.toml"
    soil.write_text('kind = "elastic"\nG = 3.0e4\nK = 9.0e4\n')
    result = called("lab", "dss", "--soil", soil, "--monotonic", "--drained", "--gamma-max", 0.01)
    assert result.returncode == DONE
    assert [line.split()[:2] for line in result.stdout.splitlines()[1:4]] == [
        ["0.1", "30.00"],
        ["0.5", "150.00"],
        ["1", "300.00"],
    ]


def test_a_strain_path_gives_stresses_as_csv(tmp_path: Path) -> None:
    path, out = tmp_path / "path.csv", tmp_path / "stress.csv"
    path.write_text("gamma_xy,eps_xx,eps_yy\n0,0,0\n0.001,0,-0.0001\n")
    arguments = ("lab", "strain-path", path, "--stress0", -50, -100, 0, *SAND)
    result = called(*arguments)
    assert result.returncode == DONE
    header, first, last = result.stdout.splitlines()
    assert header == "eps_xx,eps_yy,gamma_xy,sig_xx,sig_yy,tau_xy,sig_zz,void_ratio"
    assert first == "0,0,0,-50,-100,0,-50,0.635"
    assert [float(value) for value in last.split(",")][:3] == [0.0, -1e-4, 1e-3]
    assert called(*arguments, "--out", out).stdout == ""
    assert out.read_text() == result.stdout


def test_the_shear_cell_is_told_as_a_test_at_one_point(tmp_path: Path) -> None:
    out = tmp_path / "cell.csv"
    result = called("lab", "cell", *SAND, "--csr", 0.3, "--spacing", 0.02, "--max-cycles", 1, "--out", out)
    assert "largest spread" in result.stdout
    assert "max_cycles = 1 was reached" in result.stdout
    assert out.read_text(encoding="utf-8").startswith("gamma,tau,sigma_v_eff")
    assert "lab.shear_cell.size" in refused("lab", "cell", *SAND, "--csr", 0.3, "--spacing", 0.025)


def test_calibration_prints_a_material_that_the_laboratory_and_a_scene_take(tmp_path: Path) -> None:
    out, picture = tmp_path / "sand.toml", tmp_path / "curve.png"
    result = called("lab", "calibrate", "--spt", 6, "--G0", 470, "--out", out, "--plot", picture)
    assert (result.returncode, result.stderr) == (DONE, "")
    assert result.stdout.startswith("# CRR 0.09")
    assert result.stdout.endswith(out.read_text())
    assert picture.stat().st_size > 0
    assert "G0 = 470.0" in out.read_text()
    curve = called("lab", "crr", "--soil", out, "--csr", 0.092, "--csr", 0.03, "--max-cycles", 30)
    assert curve.returncode == DONE
    _, reached, missed = curve.stdout.splitlines()
    assert float(reached.split()[1]) == pytest.approx(15.0, abs=0.51)
    assert missed.split() == ["0.0300", "never", "never", "never"]


def test_a_resistance_that_cannot_be_calibrated_is_warned_of() -> None:
    result = called("lab", "calibrate", "--Dr", 0.35, "--G0", 476, "--crr", 1.2)
    assert result.returncode == DONE
    assert "warning: crr = 1.2 in 15 cycles cannot be met" in result.stderr
    assert "--G0" in refused("lab", "calibrate", "--Dr", 0.5, "--crr", 0.1)


def test_slips_in_the_laboratory_are_refused(tmp_path: Path) -> None:
    soil, path = tmp_path / "soil.toml", tmp_path / "path.csv"
    assert "material.hpo = None: is required" in refused("lab", "dss", "--Dr", 0.5, "--G0", 600, "--csr", 0.1)
    assert "lab.cyclic_dss.K0" in refused("lab", "dss", *SAND, "--csr", 0.1, "--K0", 0.01)
    assert "must be given for a cyclic test" in refused("lab", "dss", *SAND)
    assert "and not with --monotonic" in refused("lab", "dss", *SAND, "--csr", 0.1, "--monotonic")
    assert "must be a readable TOML file" in refused("lab", "dss", "--soil", soil, "--csr", 0.1)
    soil.write_text("kind = 'pm4sand'\nDr = 0.5\nG0 = 600\nhp = 0.4\n")
    assert "soil.material.hp = 0.4: unknown key" in refused("lab", "dss", "--soil", soil, "--csr", 0.1)
    assert "excludes --Dr, --G0, --hpo" in refused("lab", "dss", "--soil", soil, *SAND, "--csr", 0.1)
    out = tmp_path / "none" / "out.csv"
    done = called("lab", "dss", *SAND, "--csr", 0.3, "--out", out)
    assert (done.returncode, "must be writable" in done.stderr) == (INVALID, True)
    stress0 = ("--stress0", -50, -100, 0)
    assert "must be a readable CSV" in refused("lab", "strain-path", path, *stress0, *SAND)
    path.write_text("eps_xx,eps_yy\n0,0\n")
    assert "must have a column gamma_xy" in refused("lab", "strain-path", path, *stress0, *SAND)


# Motions


def test_motion_info_measures(record: Path) -> None:
    result = called("motion", "info", record, "--column", "acceleration_g")
    assert result.returncode == DONE
    lines = dict(line.rsplit("  ", 1) for line in result.stdout.splitlines() if "  " in line)
    found = {name.strip(): value.strip() for name, value in lines.items()}
    assert found["peak acceleration"] == "0.1 g"
    assert found["points"] == str(len(scenes.PULSE.time))


def test_motion_spectrum_is_csv(record: Path) -> None:
    result = called("motion", "spectrum", record, "--damping", "0.1")
    assert result.returncode == DONE
    header, *rows = result.stdout.splitlines()
    assert header == "period_s,psa_g"
    table = np.array([row.split(",") for row in rows], dtype=float)
    expected = Motion.from_csv(record).response_spectrum(0.1)
    np.testing.assert_allclose(table, np.column_stack([expected.periods, expected.psa_g]), rtol=1e-5)


def test_motion_convert_scales_filters_and_changes_the_form(record: Path, tmp_path: Path) -> None:
    out = tmp_path / "converted.AT2"
    assert called("motion", "convert", record, "--out", out, "--pga", 0.2, "--high", 20).returncode == DONE
    expected = Motion.from_csv(record).filtered(high=20.0).scaled(pga_g=0.2)
    np.testing.assert_allclose(Motion.from_at2(out).acceleration_g, expected.acceleration_g, atol=1e-7)
    assert "must end in .at2, .csv" in refused("motion", "convert", record, "--out", tmp_path / "x.txt")
    assert "must be given" in refused("motion", "info", unitless(tmp_path))


def test_motion_deconvolve_writes_the_base_s_motion_and_tells_strains(
    scene_file: Path, record: Path, tmp_path: Path
) -> None:
    out = tmp_path / "base.AT2"
    result = called("motion", "deconvolve", record, "--scene", scene_file, "--out", out, "--linear")
    assert (result.returncode, result.stderr) == (DONE, "")
    wanted = Motion.from_file(record).deconvolved(scenes.column().profile(), linear=True)
    np.testing.assert_allclose(Motion.from_at2(out).acceleration_g, wanted.acceleration_g, atol=1e-8)
    assert "1 iterations, converged" in result.stdout
    assert len(result.stdout.splitlines()) == 3 + len(scenes.column().profile().layers)
    options = ("--scene", scene_file, "--out", out, "--max-frequency", 1e3)
    assert "Nyquist" in refused("motion", "deconvolve", record, *options)


def unitless(folder: Path) -> Path:
    path = folder / "unitless.csv"
    path.write_text("time,acceleration\n0.0,0.1\n0.01,0.2\n")
    return path
