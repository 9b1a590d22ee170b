"""Running a scene into a folder: stages, output as it goes, progress, and an end with a readable file."""

from __future__ import annotations

import math
import os
import shutil
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, Literal, get_args

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from ._errors import InvalidInput, RunInterrupted, SandboilError
from .columns import save as save_column
from .results import FILE_NAME, Run, Writer
from .scene import Gravity, Scene
from .simulation import LOOK_INTERVAL, Simulation, unknown_name

Accuracy = Literal["draft", "standard", "reference"]

# What each preset gives to numerics that the scene leaves open. Measured on the level ground
# (docs/validation.md, rows "draft" and "explicit"): the draft makes fewer steps with a coarser soil update;
# the reference solves the pore water explicitly, with its acceleration where it can, in more of them.
ACCURACY: dict[str, dict[str, Any]] = {
    "draft": {"integrator_tolerance": 1.0e-4, "time_step_factor": 0.9},
    "standard": {},
    "reference": {"integrator_tolerance": 1.0e-6, "diffusion": "explicit"},
}

# Free space with which a run still ends in order, bytes: the last frame of 100 000 nodes takes 15 MB.
DISK_RESERVE = 64_000_000

# The time left is told from the speed of the last so many seconds: the soil's cost changes as it liquefies.
_SPEED_WINDOW = 30.0


def with_accuracy(scene: Scene, accuracy: str) -> Scene:
    """The scene with a preset's numerics wherever it says nothing itself.

    Raises :class:`InvalidInput` for an unknown preset.
    """
    if accuracy not in ACCURACY:
        raise unknown_name("accuracy", accuracy, list(get_args(Accuracy)))
    said = scene.numerics.model_fields_set
    filled = {name: value for name, value in ACCURACY[accuracy].items() if name not in said}
    if scene.numerics.integrator != "default":
        filled.pop("integrator_tolerance", None)
    return (
        scene.model_copy(update={"numerics": scene.numerics.model_copy(update=filled)}) if filled else scene
    )


def run(
    scene: Scene,
    out: str | os.PathLike[str],
    threads: int = 2,
    accuracy: Accuracy = "standard",
    progress: bool | None = None,
    *,
    columns: str | os.PathLike[str] | None = None,
    keep_columns: bool = False,
) -> Run:
    """Compute a scene into a folder and return its results.

    Parameters
    ----------
    scene : what is computed
    out : folder for `results.h5`, made if need be; it must not hold a run
    threads : that share the work; results are the same bits for any number
    accuracy : fills only those numerics that the scene leaves open
    progress : whether to show a bar on stderr; default only on a terminal
    columns : folder of a run that kept its free-field columns: they are read instead of solved again
    keep_columns : whether to keep the columns, in `free_field.h5`

    Raises
    ------
    InvalidInput : before any work: a folder that cannot be written or holds a run, a motion that cannot be
        read or used, an unknown accuracy
    RunInterrupted : Ctrl-C or a request to terminate; the file is complete up to that moment
    SimulationDiverged, SandboilError : the run stopped itself; the file holds all until then
    """
    scene = with_accuracy(scene, accuracy)
    folder = Path(out)
    _refuse_unusable(folder)
    simulation = Simulation(scene, threads, columns=columns, keep_columns=keep_columns)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        writer = Writer(folder / FILE_NAME, simulation, accuracy)
    except OSError as error:
        raise _unwritable(folder, error) from error
    with _interrupts() as interrupt, _progress_bar(progress) as bar:
        try:
            for index in range(len(scene.stages)):
                if index > 0:
                    simulation.begin_next_stage()
                _run_stage(simulation, writer, interrupt, bar)
                for stage, hand, fingerprint, record in simulation.take_columns():
                    save_column(folder, stage, hand, fingerprint, record)
        except RunInterrupted as error:
            writer.close("interrupted", str(error))
            raise
        except SandboilError as error:
            writer.close("stopped", str(error))
            raise
    writer.close("complete")
    return Run(folder)


def _refuse_unusable(folder: Path) -> None:
    """Refuse a folder that holds a run or cannot be written or made."""
    if (folder / FILE_NAME).exists():
        raise InvalidInput(
            "out", str(folder), f"must not hold a run, but has a {FILE_NAME}", "choose another or remove it"
        )
    existing = next(path for path in [folder, *folder.absolute().parents] if path.exists())
    if not existing.is_dir():
        raise InvalidInput(
            "out", str(folder), f"must be a folder, but {existing} is a file", "choose another"
        )
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InvalidInput(
            "out",
            str(folder),
            f"must be writable, but {existing} is not",
            "choose another or mend its rights",
        )


def _unwritable(folder: Path, error: OSError) -> InvalidInput:
    return InvalidInput("out", str(folder), f"must be writable: {error}", "choose another or mend its rights")


def _refuse_full_disk(path: Path) -> None:
    """Stop while the file can still be closed: HDF5 cut off by a full disk cannot be read any more."""
    free = shutil.disk_usage(path.parent).free
    if free < DISK_RESERVE:
        raise SandboilError(f"the disk of {path} is nearly full: {free / 1e6:.0f} MB are left")


def _run_stage(simulation: Simulation, writer: Writer, interrupt: Interrupt, bar: Bar) -> None:
    """Run the present stage to its end with a frame at its beginning, its end and every field interval.

    Gravity has one frame at most: its end, if no stage follows whose beginning would be the same.
    """
    scene = simulation.scene
    interval = scene.output.field_dt if simulation.duration is not None else math.inf
    is_last = simulation.stage == scene.stage_names[-1]
    start = time.perf_counter()

    def spent() -> float:
        return time.perf_counter() - start

    writer.begin_stage()
    bar.begin(simulation)
    if simulation.duration is not None:
        writer.write(spent())

    def next_target() -> float:
        # The next multiple that is not within the half step by which one is met.
        return interval * (math.floor((simulation.time + 0.5 * simulation.dt) / interval) + 1.0)

    target = next_target()
    try:
        while not simulation.stage_is_complete:
            reached = simulation.advance(target, LOOK_INTERVAL)
            bar.update(simulation)
            if interrupt.asked:
                raise RunInterrupted(
                    f"interrupted in {simulation.stage} at {simulation.time:.6g} s; "
                    "the results up to then are complete"
                )
            if reached and not simulation.stage_is_complete:
                _refuse_full_disk(writer.path)
                writer.write(spent())
                target = next_target()
    except SandboilError:
        simulation.finish_histories()
        writer.write(spent())
        raise
    writer.write(spent(), frame=simulation.duration is not None or is_last)
    writer.end_stage()


class Interrupt:
    """Whether the user has asked to stop."""

    asked = False


@contextmanager
def _interrupts() -> Iterator[Interrupt]:
    """Turn Ctrl-C and SIGTERM into a request that is met between steps, so that no file is left half written.

    A second Ctrl-C stops at once. Only the main thread may take signals; others run on unheeding.
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
        self._row = self.progress.add_task(simulation.stage, total=duration, told="")

    def update(self, simulation: Simulation) -> None:
        """Show how far the stage has come."""
        if simulation.duration is None:
            stage = simulation.present_stage
            told = (
                f"unbalanced {simulation.residual:.1e} of gravity, {stage.tolerance:.0e} wanted"
                if isinstance(stage, Gravity)
                else f"iteration {simulation.steps}"
            )
            # Nobody knows how far rest or the steady state is: the row fills when it is reached.
            total = 1.0 if simulation.stage_is_complete else None
            self.progress.update(self._row, told=told, total=total, completed=1.0 if total else 0.0)
        else:
            told = f"{simulation.time:.2f} of {simulation.duration:g} s"
            self.progress.update(self._row, completed=min(simulation.time, simulation.duration), told=told)


@contextmanager
def _progress_bar(wanted: bool | None) -> Iterator[Bar]:
    console = Console(stderr=True)
    shown = console.is_terminal if wanted is None else wanted
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[told]}"),
    )
    with Progress(
        *columns, console=console, disable=not shown, speed_estimate_period=_SPEED_WINDOW
    ) as progress:
        yield Bar(progress)
