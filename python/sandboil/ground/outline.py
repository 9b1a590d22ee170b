"""The edges of a section: its base, its two sides, and the ground surface between the sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from .._errors import InvalidInput
from .._types import COORDINATE_TOLERANCE, Floats


@dataclass(frozen=True)
class Outline:
    """Edges of a section.

    Attributes
    ----------
    base : (m, 2) corners of the lower boundary from left to right, m; x rises from each to the next
    left, right : (bottom, top) of the vertical edge at the left and right end of the section, m; equal where
        there is none, as at a toe
    surface : (k, 2) corners of the ground surface from left to right, m
    """

    base: Floats
    left: tuple[float, float]
    right: tuple[float, float]
    surface: Floats

    @classmethod
    def of(cls, section: BaseGeometry) -> Outline:
        """Edges of a polygon without holes; :class:`InvalidInput` if its base is no single line below it."""
        ring = shapely.get_coordinates(shapely.geometry.polygon.orient(section).exterior)[:-1]
        x, y = ring.T
        # Counter-clockwise: from the lower left corner the base, the right side, the surface, the left side.
        at_left, at_right = x <= x.min() + COORDINATE_TOLERANCE, x >= x.max() - COORDINATE_TOLERANCE
        start = np.flatnonzero(at_left)[np.argmin(y[at_left])]
        ring, at_left, at_right = (np.roll(part, -start, axis=0) for part in (ring, at_left, at_right))
        x, y = ring.T
        end = int(np.flatnonzero(at_right)[np.argmin(y[at_right])])
        base = ring[: end + 1]
        _refuse_overhang(base)
        # The right side goes up from `end`, the left one down to the start.
        top_right = end + _run(at_right[end:]) - 1
        top_left = len(ring) - _run(at_left[:0:-1])
        surface = np.vstack([ring, ring[:1]])[top_right : top_left + 1][::-1]
        return cls(
            base=_without_idle_corners(base),
            left=(float(y[0]), float(surface[0, 1])),
            right=(float(y[end]), float(surface[-1, 1])),
            surface=_without_idle_corners(surface),
        )

    @property
    def ends(self) -> tuple[float, float]:
        """Left and right end of the section, m."""
        return float(self.base[0, 0]), float(self.base[-1, 0])

    @property
    def edges(self) -> dict[str, BaseGeometry]:
        """Every edge by its name: a line, which has no length where there is none."""
        x0, x1 = self.ends
        lines: dict[str, Any] = {
            "surface": self.surface,
            "base": self.base,
            "left": [(x0, level) for level in self.left],
            "right": [(x1, level) for level in self.right],
        }
        return {name: shapely.LineString(line) for name, line in lines.items()}

    @property
    def base_is_level(self) -> bool:
        """Whether the base is one horizontal line."""
        return bool(np.ptp(self.base[:, 1]) <= COORDINATE_TOLERANCE)

    @property
    def is_level(self) -> bool:
        """Whether base and ground surface are level: the section is a box."""
        return self.base_is_level and bool(np.ptp(self.surface[:, 1]) <= COORDINATE_TOLERANCE)

    def base_elevation(self, x: float) -> float:
        """Elevation of the base at `x`, m."""
        return float(np.interp(x, *self.base.T))


def _run(is_on: NDArray[np.bool_]) -> int:
    """Number of true values before the first false one."""
    return len(is_on) if is_on.all() else int(np.argmin(is_on))


def _without_idle_corners(line: Floats) -> Floats:
    """The same line without corners at which it does not turn, as where two regions meet."""
    corners: Floats = shapely.get_coordinates(
        shapely.simplify(shapely.LineString(line), COORDINATE_TOLERANCE)
    )
    return corners


def _refuse_overhang(base: Floats) -> None:
    back = np.flatnonzero(np.diff(base[:, 0]) <= COORDINATE_TOLERANCE)
    if len(back):
        (xa, ya), (xb, yb) = base[back[0]], base[back[0] + 1]
        fault = "is upright" if abs(xb - xa) <= COORDINATE_TOLERANCE else "turns back"
        raise InvalidInput(
            "scene.regions",
            [(float(xa), float(ya)), (float(xb), float(yb))],
            "must stand on a base that runs from the left end of the section to the right one, but it "
            f"{fault} from ({xa:g}, {ya:g}) to ({xb:g}, {yb:g})",
            "give a step of the base a slope, and fill overhangs and gaps below the base",
        )
