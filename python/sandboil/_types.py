"""Numbers, points and sequences as the models take them, and how large a scene may be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Field

# Coordinates closer than this are the same point, m: far below any spacing, far above the round-off of a
# section that is a kilometre wide.
COORDINATE_TOLERANCE = 1.0e-6

# Most regions, stages, conditions and the like of a scene, and most points of a line: far beyond any section
# that is drawn by hand, and few enough to compare each with each in seconds.
MAX_PARTS = 200
MAX_POINTS = 5000

_NO_NUMBER = "must be a number; write it without quotes, for example 0.5"

Floats = NDArray[np.float64]

_Item = TypeVar("_Item")


def as_float(value: object) -> float:
    """Any real number (numpy's too) as a float; text and truth values are refused, since they are slips."""
    if isinstance(value, (bool, str, bytes)) or not hasattr(value, "__float__"):
        raise ValueError(_NO_NUMBER)
    try:
        return float(value)
    except (TypeError, OverflowError):
        # An array of several numbers, or an integer beyond all floats.
        raise ValueError(_NO_NUMBER) from None


def _as_list(value: object) -> object:
    """Numpy arrays as lists; other values unchanged."""
    return value.tolist() if hasattr(value, "tolist") else value


Number = Annotated[float, BeforeValidator(as_float)]
Positive = Annotated[Number, Field(gt=0.0)]
NonNegative = Annotated[Number, Field(ge=0.0)]
Count = Annotated[int, Field(strict=True, ge=1)]
Point = tuple[Number, Number]
Many = Annotated[Sequence[_Item], BeforeValidator(_as_list), AfterValidator(tuple)]
"""Any sequence on entry, stored as a tuple: equal scenes compare equal and cannot be changed."""
