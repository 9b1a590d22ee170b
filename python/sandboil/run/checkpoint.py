"""States of a run kept beside its results, from which it can continue.

The folder `checkpoints` holds the last two states of an unfinished run, `000012.state`, and that at the end
of every stage, `gravity.state`, from which other runs can start. Each is written whole under another name,
flushed to the disk and renamed, and has a note that identifies it.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import time
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from .. import _core
from .._errors import DamagedState, InvalidInput, ResumeWarning
from ..core.simulation import OUTPUT, STAGE_PREFIX, Simulation
from ..files.committed_file import sync_folder

FOLDER_NAME = "checkpoints"
_SUFFIX = ".state"
_UNFINISHED = ".part"

# How many states of an unfinished run are kept: the one before replaces a newest one that is damaged.
_KEPT = 2

# Wall time between checkpoints, s: five minutes of work are lost at most, for some tenths of a second each.
SECONDS = 300.0


@dataclass(frozen=True)
class Note:
    """Identity of a stored state, and what a run needs besides it to continue.

    Attributes
    ----------
    number : of the state in its run; later ones are higher
    stage, time, step : of the run at that moment, s
    is_end : whether the stage was at its end
    target : time of the next frame, s; infinite if there is none before the end
    wall_time : spent on the stage, s
    fingerprints : of the scene, as :attr:`Simulation.fingerprints`
    results : extent of the results file, as :meth:`Writer.mark`
    """

    number: int
    stage: str
    time: float
    step: int
    is_end: bool
    target: float
    wall_time: float
    fingerprints: dict[str, str]
    results: dict[str, Any]

    def __str__(self) -> str:
        return f"the end of {self.stage}" if self.is_end else f"{self.stage} at {self.time:.6g} s"


@dataclass(frozen=True)
class Stored:
    """A sound state in a file."""

    path: Path
    note: Note


def refuse_intervals(seconds: float | None, interval: float | None) -> None:
    """Refuse checkpoint intervals, as of :class:`Keeper`, that are not positive."""
    for name, value in (("checkpoint_seconds", seconds), ("checkpoint_time", interval)):
        if value is not None and not 0.0 < value < math.inf:
            raise InvalidInput(
                name, value, "must be a positive time in s, or None", "300 loses five minutes at most"
            )


class Keeper:
    """Stores the states of a run.

    Parameters
    ----------
    folder : of the run
    simulation : whose states are kept
    seconds : wall time between states, s; None: none but at the end of stages and on an interruption
    interval : simulated time between states, s; None: without one

    Attributes
    ----------
    last : note of the last state stored, or of the one that the run is resumed from
    """

    def __init__(
        self,
        folder: Path,
        simulation: Simulation,
        seconds: float | None,
        interval: float | None,
    ) -> None:
        self._folder = folder / FOLDER_NAME
        self._simulation = simulation
        self._seconds = math.inf if seconds is None else seconds
        self._interval = math.inf if interval is None else interval
        self.last: Note | None = None
        self._clock = time.monotonic()
        self._passed = 0

    @property
    def is_due(self) -> bool:
        """Whether the next checkpoint is due."""
        return time.monotonic() - self._clock >= self._seconds or self._intervals > self._passed

    @property
    def _intervals(self) -> int:
        """Intervals of simulated time that have passed in the stage."""
        simulation = self._simulation
        return 0 if simulation.duration is None else int(simulation.time / self._interval)

    def store(
        self, results: dict[str, Any], target: float, wall_time: float, *, is_end: bool = False
    ) -> None:
        """Store the present state, if it has one; see :class:`Note`. Raises :class:`OSError`."""
        simulation = self._simulation
        if not simulation.can_be_stored:
            return
        note = Note(
            number=1 if self.last is None else self.last.number + 1,
            stage=simulation.stage,
            time=simulation.time,
            step=simulation.steps,
            is_end=is_end,
            target=target,
            wall_time=wall_time,
            fingerprints=simulation.fingerprints,
            results=results,
        )
        self._folder.mkdir(exist_ok=True)
        path = self._folder / f"{simulation.stage if is_end else format(note.number, '06')}{_SUFFIX}"
        part = path.with_suffix(_UNFINISHED)
        try:
            simulation.store(part, json.dumps(asdict(note)).encode())
            part.replace(path)
        except OSError:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
            raise
        sync_folder(self._folder)
        self.forget(_KEPT)
        self.last = note
        self._clock, self._passed = time.monotonic(), 0 if is_end else self._intervals

    def forget(self, kept: int = 0) -> None:
        """Remove all numbered states but the last `kept`, and unfinished files of a killed run."""
        for path in self._folder.glob(f"*{_UNFINISHED}"):
            path.unlink()
        numbered = sorted(self._folder.glob(f"[0-9]*{_SUFFIX}"))
        for path in numbered[: len(numbered) - kept]:
            path.unlink()


def exist(folder: Path) -> bool:
    """Whether the folder of a run holds states, sound or not."""
    return any((folder / FOLDER_NAME).glob(f"*{_SUFFIX}"))


def stored(folder: Path) -> list[Stored]:
    """The states in the folder of a run, latest first. Damaged ones are left out with a warning."""
    found = []
    for path in (folder / FOLDER_NAME).glob(f"*{_SUFFIX}"):
        try:
            found.append(Stored(path, _note(path)))
        except DamagedState as error:
            warnings.warn(f"{error}; it is left out", ResumeWarning, stacklevel=3)
    return sorted(found, key=lambda state: state.note.number, reverse=True)


def at_end_of(folder: Path, stage: str) -> Stored:
    """The state at the end of a stage of the run in `folder`; :class:`InvalidInput` if there is none."""
    states = (folder / FOLDER_NAME).glob(f"*{_SUFFIX}")
    ends = {path.stem: path for path in sorted(states) if not path.stem.isdecimal()}
    if stage not in ends:
        raise InvalidInput(
            "start",
            (os.fspath(folder), stage),
            f"must be a run and a stage that it has completed: {', '.join(ends) or 'there is none'}",
            "let that run complete the stage first",
        )
    return Stored(ends[stage], _note(ends[stage]))


_NOTES = TypeAdapter(Note)


def _note(path: Path) -> Note:
    """The note of a stored state; :class:`DamagedState` if it is not as we write it."""
    try:
        return _NOTES.validate_json(_core.stored_note(path), strict=True)
    except ValidationError as error:
        detail = error.errors()[0]
        place = ".".join(map(str, detail["loc"])) or "its note"
        raise DamagedState(f"{path} is damaged: {place}: {detail['msg']}") from error


def refuse_other_run(folder: Path, own: dict[str, str], theirs: dict[str, str]) -> None:
    """Refuse to resume a run of another scene: fingerprints as :attr:`Simulation.fingerprints`."""
    differing = [name for name in {**own, **theirs} if own.get(name) != theirs.get(name)]
    _refuse("out", folder, differing, "run the scene from its beginning, into another folder")


def refuse_other_start(state: Stored, own: dict[str, str]) -> None:
    """Refuse to start from a state that the scene with the fingerprints `own` would not reach itself."""
    stages = [name for name in own if name.startswith(STAGE_PREFIX)]
    last = STAGE_PREFIX + state.note.stage
    if last not in own:
        known = ", ".join(name.removeprefix(STAGE_PREFIX) for name in stages)
        raise InvalidInput("start", state.note.stage, f"must be a stage of the scene: {known}")
    reached = stages[: stages.index(last) + 1]
    counted = [name for name in own if name not in (OUTPUT, *stages)] + reached
    theirs = state.note.fingerprints
    differing = [name for name in counted if own[name] != theirs.get(name)]
    _refuse("start", state.path, differing, "leave start out: the stage is then computed")


def _refuse(path: str, value: Path, differing: list[str], hint: str) -> None:
    if differing:
        known = f"must be of the same scene, but had another {', '.join(differing)}"
        raise InvalidInput(path, os.fspath(value), known, hint)
