"""Runs that are stopped in every possible way and continued: the same bits, and every loss is reported."""

from __future__ import annotations

import contextlib
import errno
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import sandboil as sb
import scenes
from sandboil import (
    InvalidInput,
    ResumeWarning,
    Run,
    RunInterrupted,
    SandboilError,
    Scene,
    load,
    run,
)
from sandboil.files.committed_file import CommittedFile, twin_of
from sandboil.results import writer
from sandboil.results.layout import FILE_NAME
from sandboil.run import checkpoint as checkpoints
from sandboil.run.columns import FILE_NAME as COLUMNS

COMMIT_INTERVAL = writer._COMMIT_INTERVAL
HERE = Path(__file__).parent

# A run in a separate process that commits every frame and stores its state as often as possible.
RUNNING = """
import sys, warnings
import scenes
from sandboil import run
from sandboil.results import writer
writer._COMMIT_INTERVAL = 0.0
folder, threads, resume = sys.argv[1:]
warnings.simplefilter("ignore")
run(scenes.column(), folder, threads=int(threads), resume=resume == "resume", checkpoint_seconds=0.02)
"""


class Killed(BaseException):
    """Stands for the end of a process."""


def contents(folder: Path) -> dict[str, Any]:
    """The content of a results file, without wall times, the machine, and the number of resumptions."""
    found: dict[str, Any] = {}

    def look(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset) and name != "frames/wall_time":
            found[name] = item[()].tobytes() if item.dtype.kind != "O" else list(item.asstr()[()])
        for key, value in item.attrs.items():
            if key != "wall_time_s" and name != "machine":
                found[f"{name}@{key}"] = np.asarray(value).tobytes()

    with h5py.File(folder / FILE_NAME, "r") as file:
        file.visititems(look)
        found |= {key: str(value) for key, value in file.attrs.items() if key != "resumed"}
    return found


def assert_same(folder: Path, other: Path) -> None:
    found, expected = contents(folder), contents(other)
    assert found.keys() == expected.keys()
    assert [name for name in expected if found[name] != expected[name]] == []


def states(folder: Path) -> list[Path]:
    """The checkpoints of an incomplete run, oldest first."""
    return sorted((folder / checkpoints.FOLDER_NAME).glob("[0-9]*"))


@pytest.fixture(scope="module")
def whole(finished: Run) -> Path:
    return finished.path.parent


def killed_run(
    folder: Path, when: int, monkeypatch: pytest.MonkeyPatch, scene: Scene | None = None, **options: Any
) -> None:
    """A run that ends, as if killed, at its `when`-th reading of the clock; checkpoints every 0.1 s."""
    looks = 0
    advance = sb.Simulation.advance

    def advancing(simulation: sb.Simulation, until: float, seconds: float) -> bool:
        nonlocal looks
        looks += 1
        if looks == when:
            raise Killed
        return advance(simulation, until, 0.0)

    given: dict[str, Any] = {"threads": 1, "checkpoint_time": 0.1} | options
    with monkeypatch.context() as patch:
        patch.setattr(sb.Simulation, "advance", advancing)
        with pytest.raises(Killed):
            run(scenes.column() if scene is None else scene, folder, **given)


# Killed


def kill(folder: Path, after: float, threads: int, resume: bool) -> bool:
    """Kill a run so many seconds after it has results; returns whether it was still running."""
    arguments = [str(folder), str(threads), "resume" if resume else "new"]
    process = subprocess.Popen([sys.executable, "-c", RUNNING, *arguments], cwd=HERE, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60.0
    while not (folder / FILE_NAME).exists():
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.001)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(after)
    process.kill()
    process.communicate()
    return process.returncode == -signal.SIGKILL


def assert_readable(folder: Path) -> None:
    """h5py and the reader open the results, and their content is valid."""
    with h5py.File(folder / FILE_NAME, "r") as file:
        steps = file["VTKHDF/Steps"]
        assert steps.attrs["NSteps"] == len(steps["Values"]) == len(file["frames/time"])
        nodes = int(file["VTKHDF/NumberOfPoints"][0])
        assert len(file["VTKHDF/Points"]) == nodes * steps.attrs["NSteps"]
    found = load(folder)
    assert found.status in ("running", "complete")
    if "shaking" in found.stages and len(found._frame_time):
        assert np.isfinite(found.field_series("velocity")).all()


def resumed(folder: Path, threads: int) -> Run:
    with warnings.catch_warnings():
        # It may have been killed before its first checkpoint.
        warnings.simplefilter("ignore", ResumeWarning)
        return run(scenes.column(), folder, threads=threads, resume=True)


def test_kills_of_a_run_and_of_those_that_resume_it_change_no_bit(tmp_path: Path, whole: Path) -> None:
    moments = random.Random(5)
    folder = tmp_path / "out"
    for number in range(4):
        kill(folder, moments.uniform(0.0, 0.6), threads=1 + number % 2, resume=number > 0)
        assert_readable(folder)
    assert resumed(folder, threads=2).status == "complete"
    assert_same(folder, whole)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_fifty_kills_at_random_moments(tmp_path: Path, whole: Path) -> None:
    moments = random.Random(50)
    still_running = 0
    for number in range(50):
        folder = tmp_path / str(number)
        still_running += kill(folder, moments.uniform(0.0, 1.2), threads=1 + number % 3, resume=False)
        assert_readable(folder)
        assert resumed(folder, threads=1 + (number + 1) % 3).status == "complete"
        assert_same(folder, whole)
    print(f"{still_running} of 50 were running when they were killed")
    assert still_running >= 30


@pytest.mark.parametrize("when", [3, 8, 15, 30, 45])
def test_a_run_resumes_from_every_part_of_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path, when: int
) -> None:
    killed_run(tmp_path, when, monkeypatch, checkpoint_seconds=1e-9)
    assert load(tmp_path).status == "running"
    done = run(scenes.column(), tmp_path, threads=3, resume=True)
    assert (done.status, done.resumed) == ("complete", 1)
    assert done.summary()["resumed, times"] == 1
    assert_same(tmp_path, whole)
    assert states(tmp_path) == []
    assert not twin_of(tmp_path / FILE_NAME).exists()


def test_a_run_killed_between_two_stages_begins_the_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shaking = sb.Shaking(scenes.PULSE, duration=0.3)
    scene = scenes.column(stages=[sb.Gravity(), shaking, shaking])
    run(scene, tmp_path / "whole", threads=1)
    begin = sb.Simulation.begin_next_stage

    def beginning(simulation: sb.Simulation) -> None:
        if simulation.stage == "shaking":
            raise Killed
        begin(simulation)

    with monkeypatch.context() as patch:
        patch.setattr(sb.Simulation, "begin_next_stage", beginning)
        with pytest.raises(Killed):
            run(scene, tmp_path / "out", threads=1)
    run(scene, tmp_path / "out", threads=1, resume=True)
    assert_same(tmp_path / "out", tmp_path / "whole")


def test_a_run_killed_after_its_last_step_is_completed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path
) -> None:
    def closing(*_: Any) -> None:
        raise Killed

    with monkeypatch.context() as patch:
        patch.setattr(writer.Writer, "close", closing)
        with pytest.raises(Killed):
            run(scenes.column(), tmp_path, threads=1)
    assert load(tmp_path).status == "running"
    run(scenes.column(), tmp_path, threads=1, resume=True)
    assert_same(tmp_path, whole)


def test_a_killed_file_opens_in_vtk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
    killed_run(tmp_path, 40, monkeypatch)
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(tmp_path / FILE_NAME))
    reader.Update()
    assert reader.GetNumberOfSteps() == len(load(tmp_path).frame_times()) >= 2
    assert reader.GetOutputDataObject(0).GetNumberOfPoints() == 32


@pytest.mark.parametrize("threads", [1, 2, 8])
def test_keeping_states_changes_no_bit(tmp_path: Path, whole: Path, threads: int) -> None:
    run(scenes.column(), tmp_path, threads=threads, checkpoint_seconds=1e-3, checkpoint_time=0.01)
    assert_same(tmp_path, whole)


def test_a_run_killed_before_its_first_checkpoint_starts_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path
) -> None:
    killed_run(tmp_path, 1, monkeypatch)
    with pytest.warns(ResumeWarning, match="begins again"):
        run(scenes.column(), tmp_path, threads=1, resume=True)
    assert_same(tmp_path, whole)


def test_two_shaking_stages_between_columns_resume_with_what_they_keep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = scenes.column(
        sides=sb.FreeField(),
        stages=[sb.Gravity(), *(sb.Shaking(scenes.PULSE, duration=0.5) for _ in range(2))],
        output=sb.Output(depths=[1.0], field_dt=0.1, stress_paths=True),
    )
    run(scene, tmp_path / "whole", threads=1, keep_columns=True)
    killed_in = set()
    for when in (20, 70, 120):
        folder = tmp_path / str(when)
        killed_run(folder, when, monkeypatch, scene, keep_columns=True, checkpoint_seconds=1e-3)
        killed_in.add(load(folder).stages[-1])
        run(scene, folder, threads=2, keep_columns=True, resume=True)
        assert_same(folder, tmp_path / "whole")
        with h5py.File(folder / COLUMNS) as found, h5py.File(tmp_path / "whole" / COLUMNS) as expected:
            for name in ("shaking/left/values", "shaking_2/right/values"):
                np.testing.assert_array_equal(
                    found[name], expected[name], err_msg=f"{name}, killed at {when}"
                )


# Damaged


def damage(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def test_a_damaged_checkpoint_is_reported_and_the_one_before_is_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path
) -> None:
    killed_run(tmp_path, 45, monkeypatch)
    _, newest = states(tmp_path)
    damage(newest)
    with pytest.warns(ResumeWarning, match=rf"{newest.name} is damaged: its checksum .* left out") as caught:
        run(scenes.column(), tmp_path, threads=1, resume=True)
    assert len(caught) == 1
    assert_same(tmp_path, whole)


def test_without_a_sound_checkpoint_nothing_is_touched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed_run(tmp_path, 45, monkeypatch)
    for path in (tmp_path / checkpoints.FOLDER_NAME).iterdir():
        path.write_bytes(path.read_bytes()[:1000])
    before = (tmp_path / FILE_NAME).read_bytes()
    with (
        pytest.warns(ResumeWarning),
        pytest.raises(InvalidInput, match="must have a checkpoint that is sound"),
    ):
        run(scenes.column(), tmp_path, threads=1, resume=True)
    assert (tmp_path / FILE_NAME).read_bytes() == before


@pytest.mark.parametrize("length", [0, 50_000])
def test_results_that_cannot_be_read_are_replaced_by_the_second_copy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path, length: int
) -> None:
    twin = twin_of(tmp_path / FILE_NAME)
    monkeypatch.setattr("sandboil.files.committed_file.CommittedFile.close", lambda _: None)
    killed_run(tmp_path, 45, monkeypatch)
    monkeypatch.undo()
    assert twin.exists()
    os.truncate(tmp_path / FILE_NAME, length)
    with pytest.raises(InvalidInput, match="must be a sound file"):
        load(tmp_path)
    # The second copy is one commit behind, so the newest checkpoint may be later than its last frame.
    with (
        pytest.warns(ResumeWarning, match="its second copy is used"),
        pytest.warns(ResumeWarning, match="left out: .* ends before it"),
    ):
        run(scenes.column(), tmp_path, threads=1, resume=True)
    assert_same(tmp_path, whole)


# Refused


def test_only_the_same_scene_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    killed_run(tmp_path, 45, monkeypatch)
    before = (tmp_path / FILE_NAME).read_bytes()
    stages = [sb.Gravity(), sb.Shaking(scenes.PULSE.scaled(factor=1.01), duration=0.8)]
    for changed, allowed in (
        (scenes.column(spacing=0.5), "spacing, position"),
        (scenes.column(stages=stages), "another stages.shaking;"),
        (scenes.column(output=sb.Output(depths=[1.0, 3.0], points=[(0.25, 0.6)], field_dt=0.2)), "output"),
    ):
        with pytest.raises(InvalidInput, match=allowed):
            run(changed, tmp_path, resume=True)
    assert (tmp_path / FILE_NAME).read_bytes() == before


def test_a_run_that_cannot_be_resumed_is_refused(tmp_path: Path, whole: Path) -> None:
    with pytest.raises(InvalidInput, match=f"must hold a run to resume, but has no {FILE_NAME}"):
        run(scenes.column(), tmp_path / "none", resume=True)
    assert not (tmp_path / "none").exists()
    with pytest.raises(InvalidInput, match="leave out one of start and resume"):
        run(scenes.column(), tmp_path / "none", resume=True, start=(whole, "gravity"))
    for name in ("checkpoint_seconds", "checkpoint_time"):
        for value in (0.0, -1.0, float("nan")):
            with pytest.raises(InvalidInput, match=f"{name} = .*must be a positive time"):
                run(scenes.column(), tmp_path / "none", **{name: value})
    (tmp_path / "left" / checkpoints.FOLDER_NAME).mkdir(parents=True)
    with pytest.raises(InvalidInput, match=f"must not hold a run, but has {checkpoints.FOLDER_NAME}"):
        run(scenes.column(), tmp_path / "left")


def test_a_complete_run_is_left_as_it_is(whole: Path) -> None:
    before = (whole / FILE_NAME).read_bytes()
    assert run(scenes.column(), whole, resume=True).status == "complete"
    assert (whole / FILE_NAME).read_bytes() == before


def test_a_folder_in_use_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    advance = sb.Simulation.advance

    def meanwhile(simulation: sb.Simulation, until: float, seconds: float) -> bool:
        monkeypatch.setattr(sb.Simulation, "advance", advance)
        with pytest.raises(InvalidInput, match="must be free for this run alone"):
            run(scenes.column(), tmp_path, threads=1, resume=True)
        return advance(simulation, until, seconds)

    monkeypatch.setattr(sb.Simulation, "advance", meanwhile)
    assert run(scenes.column(), tmp_path, threads=1).status == "complete"


# Another motion on the same ground


def test_the_ground_at_rest_is_taken_from_another_run(tmp_path: Path, whole: Path) -> None:
    other = scenes.column(stages=[sb.Gravity(), sb.Shaking(scenes.PULSE.scaled(factor=0.7), duration=0.4)])
    run(other, tmp_path / "whole", threads=1)
    for start in (load(whole), whole, str(whole)):
        folder = tmp_path / type(start).__name__
        shutil.rmtree(folder, ignore_errors=True)
        run(other, folder, threads=2, start=(start, "gravity"))
        assert_same(folder, tmp_path / "whole")


def test_a_further_stage_follows_the_last_of_another_run(tmp_path: Path, whole: Path) -> None:
    gravity, shaking = scenes.column().stages
    twice = scenes.column(stages=[gravity, shaking, sb.Shaking(scenes.PULSE, duration=0.2)])
    expected = run(twice, tmp_path / "whole", threads=1)
    found = run(twice, tmp_path / "out", threads=1, start=(whole, "shaking"))
    np.testing.assert_array_equal(found.field("displacement"), expected.field("displacement"))
    np.testing.assert_array_equal(
        found.history("r_u", depth=1.0).values, expected.history("r_u", depth=1.0).values
    )


def test_other_ground_does_not_start_there(tmp_path: Path, whole: Path) -> None:
    for changed, allowed in (
        ({"water": sb.Water(bulk_modulus=2.0e6)}, "another water;"),
        ({"numerics": sb.Numerics(smoothing_ratio=1.3)}, "another numerics;"),
        ({"stages": [sb.Gravity(tolerance=1e-3), sb.Shaking(scenes.PULSE, duration=0.4)]}, "stages.gravity"),
    ):
        with pytest.raises(InvalidInput, match=allowed) as caught:
            run(scenes.column(**changed), tmp_path / "out", start=(whole, "gravity"))
        assert caught.value.path == "start"
    with pytest.raises(InvalidInput, match="a stage that it has completed: gravity, shaking"):
        run(scenes.column(), tmp_path / "out", start=(whole, "grvity"))
    with pytest.raises(InvalidInput, match="must be a stage of the scene: gravity"):
        run(scenes.column(stages=[sb.Gravity()]), tmp_path / "out", start=(whole, "shaking"))
    assert not (tmp_path / "out").exists()


# Asked to stop


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_asked_to_stop_resumes_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path, number: signal.Signals
) -> None:
    looks = 0
    advance = sb.Simulation.advance

    def advancing(simulation: sb.Simulation, until: float, seconds: float) -> bool:
        nonlocal looks
        looks += 1
        if looks == 25:
            os.kill(os.getpid(), number)
        return advance(simulation, until, 0.0)

    with monkeypatch.context() as patch:
        patch.setattr(sb.Simulation, "advance", advancing)
        with pytest.raises(RunInterrupted, match="can be resumed") as caught:
            run(scenes.column(), tmp_path, threads=1)
    assert load(tmp_path).status == "interrupted"
    at = load(tmp_path).times[-1]
    assert f"{at:.6g} s" in str(caught.value)
    begun: list[float] = []

    def beginning(simulation: sb.Simulation, until: float, seconds: float) -> bool:
        begun.append(simulation.time)
        return advance(simulation, until, seconds)

    monkeypatch.setattr(sb.Simulation, "advance", beginning)
    run(scenes.column(), tmp_path, threads=2, resume=True)
    assert begun[0] == at
    assert_same(tmp_path, whole)


# A run that never checks whether it was asked to stop.
HELD = """
import sys, time
import sandboil as sb, scenes
def held(*_):
    print("here", file=sys.stderr, flush=True)
    time.sleep(60.0)
sb.Simulation.advance = held
sb.run(scenes.column(), sys.argv[1])
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_second_signal_ends_a_run_at_once(tmp_path: Path, number: signal.Signals) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", HELD, str(tmp_path)], cwd=HERE, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    assert process.stderr.readline() == "here\n"
    process.send_signal(number)
    time.sleep(0.3)
    assert process.poll() is None
    process.send_signal(number)
    process.communicate(timeout=10)
    assert process.returncode == -number
    assert load(tmp_path).status == "running"


# No space, no folder, no permission


@contextlib.contextmanager
def small_disk(folder: Path, size: int) -> Iterator[Path]:
    """A disk of so many bytes."""
    folder.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if made.returncode != 0:
        pytest.skip(f"a small disk cannot be mounted here: {made.stderr.decode().strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def fill(disk: Path, left: int) -> Path:
    """Leave so many bytes on a disk."""
    ballast = disk / "ballast"
    free = shutil.disk_usage(disk).free
    with ballast.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, max(1, free - left))
    return ballast


def stopped_on_full_disk(disk: Path, left: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run on a disk with so much free space; the files on it can be read afterwards."""
    ballast = fill(disk, left)
    with monkeypatch.context() as patch:
        patch.setattr(writer, "_COMMIT_INTERVAL", 0.0)
        with pytest.raises(SandboilError, match="No space left on device") as caught:
            run(scenes.column(), disk / "out", threads=1, checkpoint_time=0.05)
    ballast.unlink()
    if isinstance(caught.value, InvalidInput):
        # There was no space even for the head of the results: refused before any work.
        assert not (disk / "out" / FILE_NAME).exists()
        return
    assert "results last written are whole" in str(caught.value)
    assert_readable(disk / "out")


@pytest.mark.parametrize("left", [300_000, 450_000, 600_000])
def test_a_full_disk_ends_the_run_which_continues_when_there_is_space(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path, left: int
) -> None:
    with small_disk(tmp_path / "disk", 20_000_000) as disk:
        stopped_on_full_disk(disk, left, monkeypatch)
        resumed(disk / "out", threads=1)
        assert_same(disk / "out", whole)


@pytest.mark.slow
def test_twenty_full_disks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path) -> None:
    room = random.Random(20)
    with small_disk(tmp_path / "disk", 20_000_000) as disk:
        for _ in range(20):
            stopped_on_full_disk(disk, room.randrange(150_000, 600_000), monkeypatch)
            if (disk / "out" / FILE_NAME).exists():
                resumed(disk / "out", threads=1)
                assert_same(disk / "out", whole)
            shutil.rmtree(disk / "out")


@pytest.mark.parametrize("what", ["removed", "read-only", "limited"])
def test_a_folder_that_can_no_longer_be_written_ends_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path, what: str
) -> None:
    looks, advance = 0, sb.Simulation.advance
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)

    def read_only(*_: Any) -> int:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    def advancing(simulation: sb.Simulation, until: float, seconds: float) -> bool:
        nonlocal looks
        looks += 1
        if looks == 30 and what == "removed":
            shutil.rmtree(tmp_path / "out")
        elif looks == 30 and what == "read-only":
            # The answer of a kernel after an error of the disk.
            patch.setattr(os, "pwrite", read_only)
        elif looks == 30:
            resource.setrlimit(resource.RLIMIT_FSIZE, (150_000, limits[1]))
        return advance(simulation, until, 0.0)

    with monkeypatch.context() as patch:
        patch.setattr(sb.Simulation, "advance", advancing)
        try:
            with pytest.raises(
                SandboilError, match=r"could not be written to .*: remove the cause and resume"
            ) as caught:
                run(scenes.column(), tmp_path / "out", threads=1, checkpoint_time=0.05)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not isinstance(caught.value, InvalidInput), "the command exits with 3"
    if what != "removed":
        assert_readable(tmp_path / "out")
        resumed(tmp_path / "out", threads=1)
        assert_same(tmp_path / "out", whole)


# What it costs


@pytest.mark.slow
def test_states_and_commits_of_a_large_section_take_below_two_per_cent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = sb.Region(
        "sand", sb.box(x=(0, 100), y=(0, 50)), scenes.LOOSE, hydraulic_conductivity=1e-4, Gs=2.67
    )
    scene = scenes.column(
        spacing=0.5,
        regions=[ground],
        stages=[sb.Gravity(tolerance=1e-2), sb.Shaking(scenes.PULSE, duration=0.05)],
        output=sb.Output(depths=[5.0], field_dt=0.005),
    )
    spent: dict[str, list[float]] = {"store": [], "commit": []}

    def timed(owner: type, name: str) -> None:
        call = getattr(owner, name)

        def timing(*args: Any) -> Any:
            start = time.perf_counter()
            answer = call(*args)
            spent[name].append(time.perf_counter() - start)
            return answer

        monkeypatch.setattr(owner, name, timing)

    timed(sb.Simulation, "store")
    timed(CommittedFile, "commit")
    monkeypatch.setattr(writer, "_COMMIT_INTERVAL", 0.0)
    run(scene, tmp_path, threads=2, checkpoint_time=0.02)
    (size,) = {path.stat().st_size for path in (tmp_path / checkpoints.FOLDER_NAME).glob("shaking*")}
    store, commit = (float(np.median(spent[name])) for name in ("store", "commit"))
    share = store / checkpoints.SECONDS + commit / COMMIT_INTERVAL
    print(f"20000 nodes: a state {size / 1e6:.0f} MB, {store:.2f} s; a commit {commit:.3f} s: {share:.2%}")
    assert share < 0.02
