"""The errors a user of sandboil can meet, and the search for the name that was probably meant."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable

# Similarity below which a suggestion would puzzle more than help (difflib ratio, 0 to 1).
_NEAREST_CUTOFF = 0.5
# Longest name that is compared, characters: no known name is longer, and the cost is the product of lengths.
_LONGEST_NAME = 100

# How much of a refused value a message shows: a few lines, however large the value is.
_SHOWN = reprlib.Repr()
_SHOWN.maxlist = _SHOWN.maxtuple = _SHOWN.maxdict = 12
_SHOWN.maxstring = _SHOWN.maxlong = 120
# Longest part of a message, characters: it may contain text of a user's file.
_SHOWN.maxother = _LONGEST_PART = 600


def _cut(text: str) -> str:
    """A text without its middle if it is very long."""
    half = _LONGEST_PART // 2
    return text if len(text) <= _LONGEST_PART else f"{text[:half]} ... {text[-half:]}"


class SandboilError(Exception):
    """Root of every error that sandboil raises on purpose."""


class InvalidInput(SandboilError, ValueError):
    """Input refused before any work was done.

    Attributes
    ----------
    path : the place of the value, for example ``scene.regions[0].porosity``
    value : that was given there
    allowed : what would be accepted, for example ``must lie in (0, 1)``
    hint : the nearest right name or the remedy, or None
    """

    def __init__(self, path: str, value: object, allowed: str, hint: str | None = None) -> None:
        super().__init__(path, value, allowed, hint)
        self.path = path
        self.value = value
        self.allowed = allowed
        self.hint = hint

    def __str__(self) -> str:
        message = f"{_cut(self.path)} = {_cut(_SHOWN.repr(self.value))}: {_cut(self.allowed)}"
        return f"{message}; {_cut(self.hint)}" if self.hint else message


class SimulationDiverged(SandboilError):
    """A field is no longer finite or bounded; what was computed before is kept.

    Attributes
    ----------
    quantity : name of the field that is no longer finite or bounded
    value : what it was
    node : index of the first offending node
    position : its (x, y) in m
    time : time in the stage, s
    step : step number in the stage
    """

    def __init__(
        self,
        quantity: str,
        node: int,
        position: tuple[float, float],
        value: float,
        time: float,
        step: int,
    ) -> None:
        super().__init__(quantity, node, position, value, time, step)
        self.quantity = quantity
        self.value = value
        self.node = node
        self.position = position
        self.time = time
        self.step = step

    def __str__(self) -> str:
        x, y = self.position
        return (
            f"the run diverged: {self.quantity} of node {self.node} at ({x:.6g}, {y:.6g}) m is "
            f"{self.value:.3g}, time {self.time:.6g} s, step {self.step}"
        )


class DamagedState(SandboilError):
    """A stored state whose bytes have changed since they were written."""


class SandboilWarning(UserWarning):
    """An answer that may not be what was meant. The text gives the reason and the remedy."""


class SuctionWarning(SandboilWarning):
    """Seepage left a suction in soil without a retention curve. The text gives the place."""


class ResumeWarning(UserWarning):
    """A resumed run found something damaged or missing. The text names it, and what was used instead."""


class RunInterrupted(SandboilError):
    """The user stopped the run; the result file is complete up to the last frame."""


def nearest_name(name: str, candidates: Iterable[str]) -> str | None:
    """The candidate most similar to `name` regardless of case, or None if nothing comes near."""
    by_lower = {candidate.lower(): candidate for candidate in candidates}
    found = difflib.get_close_matches(name[:_LONGEST_NAME].lower(), by_lower, n=1, cutoff=_NEAREST_CUTOFF)
    return by_lower[found[0]] if found else None


def unknown_name(path: str, name: str, known: list[str]) -> InvalidInput:
    """The refusal of a name that is none of `known`, with the nearest right one."""
    meant = nearest_name(name, known)
    return InvalidInput(
        path,
        name,
        f"must be one of {', '.join(known)}",
        f"did you mean {meant!r}?" if meant else "take one of these",
    )
