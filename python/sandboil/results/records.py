"""What a reader returns: a history, a profile, a surface."""

from __future__ import annotations

from dataclasses import dataclass

from .._errors import InvalidInput
from .._types import Floats


@dataclass(frozen=True)
class History:
    """A quantity over time.

    Attributes
    ----------
    name, unit, label : the quantity, its unit, and the point
    time : (m,) s, 0 at the beginning of the stage
    values : (m,)
    """

    name: str
    unit: str
    label: str
    time: Floats
    values: Floats


@dataclass(frozen=True)
class Profile:
    """A field along the column of nodes nearest to x, from the surface down.

    Attributes
    ----------
    name, unit : what it is
    time : of the frame, s
    x : initial place of the column, m
    depth : (m,) initial depth below the surface, m
    values : (m,), or (m, 2) for vectors
    """

    name: str
    unit: str
    time: float
    x: float
    depth: Floats
    values: Floats


@dataclass(frozen=True)
class Surface:
    """The ground surface at one time, from the uppermost node of every column.

    Attributes
    ----------
    time : of the frame, s
    x, y : (m,) present place of the surface, m
    displacement : (m, 2) since the scene was made, m
    """

    time: float
    x: Floats
    y: Floats
    displacement: Floats


def interval_of(history: History) -> float:
    """Spacing of a history, s."""
    if len(history.time) < 2:
        raise InvalidInput("history", history.name, "must hold at least two samples: the run ended too early")
    return float(history.time[-1] - history.time[0]) / (len(history.time) - 1)
