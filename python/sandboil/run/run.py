"""Running a scene into a folder: stages, output, progress, and readable results at every end."""

from __future__ import annotations

import fcntl
import math
import os
import signal
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from .._errors import (
    InvalidInput,
    ResumeWarning,
    RunInterrupted,
    SandboilError,
    SandboilWarning,
    SimulationDiverged,
)
from ..core.simulation import LOOK_INTERVAL, Simulation
from ..files.committed_file import twin_of
from ..results.layout import FILE_NAME
from ..results.reader import Run
from ..results.writer import Writer, holds, repair
from . import checkpoint
from . import neighbourhood as _neighbourhood
from .accuracy import Accuracy, with_accuracy
from .columns import save as save_column

if TYPE_CHECKING:
    from ..scene.scene import Scene

# Time over which the speed is measured for the time left, s: the cost of a step changes in liquefied soil.
_SPEED_WINDOW = 30.0

# Share of sub-steps with a larger error than was asked for above which a run warns.
FORCED_SHARE = 0.01


def run(
    scene: Scene,
    out: str | os.PathLike[str],
    threads: int = 2,
    accuracy: Accuracy = "standard",
    progress: bool | None = None,
    *,
    columns: str | os.PathLike[str] | None = None,
    keep_columns: bool = False,
    resume: bool = False,
    start: tuple[Run | str | os.PathLike[str], str] | None = None,
    checkpoint_seconds: float | None = checkpoint.SECONDS,
    checkpoint_time: float | None = None,
) -> Run:
    """Compute a scene into a folder and return its results.

    Parameters
    ----------
    scene : what is computed
    out : folder for `results.h5` and the checkpoints, made if need be; it must not hold a run
    threads : that share the work; results are the same bits for any number
    accuracy : fills only those numerics that the scene leaves open
    progress : whether to show a bar on stderr; default only on a terminal
    columns : folder of a run that kept its free-field columns: they are read instead of computed
    keep_columns : whether to keep the columns, in `free_field.h5`
    resume : continue the run of this scene in `out` from its last checkpoint; the results are the same bits
        as those of a run that was never stopped. A complete run is returned as it is
    start : a run, or its folder, and a stage that it has completed: this run begins there, for example at the
        state at rest of another one. Everything up to there must be the same in both scenes
    checkpoint_seconds : wall time between checkpoints, s; None: only at the end of stages, and if interrupted
    checkpoint_time : simulated time between checkpoints, s; None: without one

    Raises
    ------
    InvalidInput : before any work: a folder that cannot be written or holds a run, a motion that cannot be
        read or used, an unknown accuracy, a run to resume or start from that is not of this scene
    RunInterrupted : Ctrl-C or a request to terminate; the results are complete up to that moment, and the
        run can be resumed there
    SimulationDiverged : a field is no longer finite or bounded; results and checkpoints are kept, and
        `neighbourhood.csv` and `.png` show the nodes around the place
    SandboilError : the run stopped itself, or its folder could not be written; results until then are kept

    Warns
    -----
    ResumeWarning : something of a run that is resumed was damaged or missing
    """
    scene = with_accuracy(scene, accuracy)
    folder = Path(out)
    if resume and start is not None:
        raise InvalidInput("start", start, "belongs to a new run", "leave out one of start and resume")
    _refuse_unusable(folder, resume)
    checkpoint.refuse_intervals(checkpoint_seconds, checkpoint_time)
    begun = None if start is None else _end_of(*start)
    simulation = Simulation(scene, threads, columns=columns, keep_columns=keep_columns)
    keeper = checkpoint.Keeper(folder, simulation, checkpoint_seconds, checkpoint_time)
    if begun is not None:
        checkpoint.refuse_other_start(begun, simulation.fingerprints)
        simulation.restore(begun.path, begun.note.stage)
    with _only_user(folder):
        entry = None
        if resume:
            earlier, entry = _earlier(folder, simulation)
            if earlier.status == "complete":
                return earlier
            if entry is None:
                earlier.path.unlink()
        keeper.last = entry
        try:
            mark = None if entry is None else entry.results
            writer = Writer(folder / FILE_NAME, simulation, accuracy, mark)
        except OSError as error:
            raise _unwritable(folder, error) from error
        try:
            with _interrupts() as interrupt, _progress_bar(progress) as bar:
                _run_stages(simulation, writer, keeper, entry, interrupt, bar)
            keeper.forget()
        except OSError as error:
            kept = f"its state at {keeper.last}" if keeper.last else "no state"
            raise SandboilError(
                f"the run could not be written to {folder}: {error}; the results last written are whole and "
                f"{kept} is kept: remove the cause and resume the run"
            ) from error
        finally:
            writer.abandon()
    return Run(folder)


def _refuse_unusable(folder: Path, resume: bool) -> None:
    """Refuse a folder that cannot be written or made, that holds a run, or, to resume, that holds none."""
    path = folder / FILE_NAME
    found = [place.name for place in (path, twin_of(path), folder / checkpoint.FOLDER_NAME) if place.exists()]
    if found and not resume:
        raise InvalidInput(
            "out",
            str(folder),
            f"must not hold a run, but has {found[0]}",
            "choose another folder, remove it, or resume that run",
        )
    if resume and FILE_NAME not in found and twin_of(path).name not in found:
        raise InvalidInput(
            "out",
            str(folder),
            f"must hold a run to resume, but has no {FILE_NAME}",
            "leave resume out to begin one",
        )
    existing = next(place for place in [folder, *folder.absolute().parents] if place.exists())
    if not existing.is_dir():
        raise InvalidInput(
            "out", str(folder), f"must be a folder, but {existing} is a file", "choose another folder"
        )
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InvalidInput(
            "out",
            str(folder),
            f"must be writable, but {existing} is not",
            "choose another folder or change its permissions",
        )


def _unwritable(folder: Path, error: OSError) -> InvalidInput:
    return InvalidInput(
        "out", str(folder), f"must be writable: {error}", "choose another folder or change its permissions"
    )


@contextmanager
def _only_user(folder: Path) -> Iterator[None]:
    """Make the folder, and refuse it while another run writes into it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise _unwritable(folder, error) from error
    try:
        try:
            # The lock ends with the process.
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InvalidInput(
                "out",
                str(folder),
                f"must be free for this run alone: {error}",
                "wait for the run that uses it, or stop it",
            ) from error
        yield
    finally:
        os.close(handle)


def _earlier(folder: Path, simulation: Simulation) -> tuple[Run, checkpoint.Note | None]:
    """The run in a folder, and the note of its last sound state, which the simulation restores.

    No note of a complete run, nor of one that was stopped before its first checkpoint, which begins again.
    """
    path = folder / FILE_NAME
    repair(path)
    earlier = Run(folder)
    checkpoint.refuse_other_run(folder, simulation.fingerprints, earlier.fingerprints)
    if earlier.status == "complete":
        return earlier, None
    for state in checkpoint.stored(folder):
        if holds(path, state.note.results):
            simulation.restore(state.path, state.note.stage)
            return earlier, state.note
        message = f"{state.path} is left out: {path} ends before it"
        warnings.warn(message, ResumeWarning, stacklevel=3)
    if checkpoint.exist(folder):
        raise InvalidInput(
            "resume",
            str(folder),
            "must have a checkpoint that is sound, and its results up to there",
            "run the scene from its beginning, into another folder",
        )
    message = f"the run in {folder} was stopped before its first checkpoint: it begins again"
    warnings.warn(message, ResumeWarning, stacklevel=3)
    return earlier, None


def _end_of(run: Run | str | os.PathLike[str], stage: str) -> checkpoint.Stored:
    """The state at the end of a stage of another run."""
    return checkpoint.at_end_of(run.path.parent if isinstance(run, Run) else Path(run), stage)


def _run_stages(
    simulation: Simulation,
    writer: Writer,
    keeper: checkpoint.Keeper,
    entry: checkpoint.Note | None,
    interrupt: Interrupt,
    bar: Bar,
) -> None:
    """Run the stages from where the simulation stands, and close the results.

    `entry` is the note of the state that a run is resumed from.
    """
    names = simulation.scene.stage_names
    present = names.index(simulation.stage)
    try:
        for name in names[present + 1 :] if entry is not None and entry.is_end else names[present:]:
            if name != simulation.stage:
                simulation.begin_next_stage()
                entry = None
            _run_stage(simulation, writer, keeper, entry, interrupt, bar)
    except RunInterrupted as error:
        writer.close("interrupted", str(error))
        raise
    except SandboilError as error:
        writer.close("stopped", str(error))
        if isinstance(error, SimulationDiverged):
            _write_neighbourhood(simulation, error, writer.path.parent)
        raise
    writer.close("complete")


def _write_neighbourhood(simulation: Simulation, error: SimulationDiverged, folder: Path) -> None:
    """Write a table and a picture of the nodes around a divergence, and name the files in the error."""
    try:
        paths = _neighbourhood.write(folder, simulation, error)
    except OSError as failure:
        # The divergence must still be reported.
        error.add_note(f"its neighbourhood could not be written: {failure}")
        return
    error.add_note(f"its neighbourhood: {', '.join(str(path) for path in paths)}")


def _run_stage(
    simulation: Simulation,
    writer: Writer,
    keeper: checkpoint.Keeper,
    entry: checkpoint.Note | None,
    interrupt: Interrupt,
    bar: Bar,
) -> None:
    """Run the present stage to its end with a frame at its beginning, its end and every field interval.

    Gravity has one frame at most: its end, if no stage follows whose beginning would be the same.
    """
    scene = simulation.scene
    is_timed = simulation.duration is not None
    interval = scene.output.field_dt if is_timed else math.inf
    is_last = simulation.stage == scene.stage_names[-1]
    start = time.perf_counter() - (0.0 if entry is None else entry.wall_time)

    def spent() -> float:
        return time.perf_counter() - start

    bar.begin(simulation)

    def next_target() -> float:
        # The next multiple that is not within the half step by which one is met.
        return interval * (math.floor((simulation.time + 0.5 * simulation.dt) / interval) + 1.0)

    if entry is None:
        writer.begin_stage()
        if is_timed:
            writer.write(spent())
        target = next_target()
    else:
        target = entry.target
    try:
        while not simulation.stage_is_complete:
            reached = simulation.advance(target, LOOK_INTERVAL)
            bar.update(simulation)
            if reached and not simulation.stage_is_complete:
                writer.write(spent())
                target = next_target()
            if interrupt.asked and not simulation.stage_is_complete:
                keeper.store(writer.mark(), target, spent())
                raise RunInterrupted(
                    f"interrupted in {simulation.stage} at {simulation.time:.6g} s; "
                    "the results up to then are complete, and the run can be resumed"
                )
            if keeper.is_due and not simulation.stage_is_complete:
                keeper.store(writer.mark(), target, spent())
    except SandboilError:
        simulation.finish_histories()
        writer.write(spent())
        raise
    writer.write(spent(), frame=is_timed or is_last)
    writer.end_stage()
    warn_of_forced_sub_steps(simulation.stage, simulation.counters())
    for column, record in simulation.take_columns():
        save_column(writer.path.parent, column, record)
    keeper.store(writer.mark(), target, spent(), is_end=True)


def warn_of_forced_sub_steps(stage: str, counters: dict[str, int]) -> None:
    """Warn of a stage in which many sub-steps of the sand have a larger error than was asked for."""
    # A seepage stage has no sand.
    forced, made = counters.get("forced_acceptances", 0), counters.get("substeps", 0)
    if forced > FORCED_SHARE * made:
        warnings.warn(
            f"{stage}: {forced / made:.1%} of the sub-steps of the sand had their least size and a larger "
            "error than integrator_tolerance asks for; a run with numerics.integrator = 'reference' tells "
            "whether the answer changes",
            SandboilWarning,
            stacklevel=3,
        )


class Interrupt:
    """Whether the user has asked to stop."""

    asked = False


@contextmanager
def _interrupts() -> Iterator[Interrupt]:
    """Turn Ctrl-C and SIGTERM into a request that is met between steps, so that every file is whole.

    A second Ctrl-C stops at once. Only the main thread receives signals; runs in other threads continue.
    """
    interrupt = Interrupt()
    if threading.current_thread() is not threading.main_thread():
        yield interrupt
        return
    caught = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.getsignal(number) for number in caught}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def ask(number: int, frame: FrameType | None) -> None:
        interrupt.asked = True
        restore()

    for number in caught:
        signal.signal(number, ask)
    try:
        yield interrupt
    finally:
        restore()


@dataclass
class Bar:
    """Progress of the stages on a terminal; each one is a row with the time left at the present speed."""

    progress: Progress

    def begin(self, simulation: Simulation) -> None:
        """Open the row of the simulation's present stage."""
        duration = simulation.duration
        self._row = self.progress.add_task(simulation.stage, total=duration, state="")

    def update(self, simulation: Simulation) -> None:
        """Show how far the stage has come."""
        if simulation.duration is None:
            # The way to rest or to the steady state is not known: the row fills at its end.
            total = 1.0 if simulation.stage_is_complete else None
            completed = total or 0.0
        else:
            total = simulation.duration
            completed = min(simulation.time, total)
        self.progress.update(self._row, total=total, completed=completed, state=simulation.progress)


@contextmanager
def _progress_bar(wanted: bool | None) -> Iterator[Bar]:
    console = Console(stderr=True)
    shown = console.is_terminal if wanted is None else wanted
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[state]}"),
    )
    with Progress(
        *columns, console=console, disable=not shown, speed_estimate_period=_SPEED_WINDOW
    ) as progress:
        yield Bar(progress)
