"""Shapes of regions. Coordinates in m, x horizontal, y up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal

import shapely
from pydantic import Field, model_validator
from shapely.geometry.base import BaseGeometry

from .._errors import InvalidInput
from .._model import Model
from .._types import COORDINATE_TOLERANCE, MAX_POINTS, Many, Point


class Box(Model):
    """Rectangle x[0]..x[1] by y[0]..y[1], m."""

    _label: ClassVar[str] = "shape"

    kind: Literal["box"] = "box"
    x: Point = Field(description="left and right, m")
    y: Point = Field(description="bottom and top, m")

    @model_validator(mode="after")
    def _not_empty(self) -> Box:
        for name, (low, high) in (("x", self.x), ("y", self.y)):
            if high - low <= COORDINATE_TOLERANCE:
                raise InvalidInput(
                    f"shape.{name}",
                    (low, high),
                    "must rise, else the region is empty",
                    "order: low end, high end",
                )
        return self

    @property
    def geometry(self) -> BaseGeometry:
        """The shape as a shapely polygon."""
        return shapely.box(self.x[0], self.y[0], self.x[1], self.y[1])


class Polygon(Model):
    """Simple polygon by its corners in order, m; it closes itself."""

    _label: ClassVar[str] = "shape"

    kind: Literal["polygon"] = "polygon"
    points: Many[Point] = Field(min_length=3, max_length=MAX_POINTS, description="corners (x, y) in order, m")

    @model_validator(mode="after")
    def _simple(self) -> Polygon:
        geometry = self.geometry
        if not geometry.is_valid:
            raise InvalidInput(
                "shape.points",
                self.points,
                f"must form a simple polygon: {shapely.is_valid_reason(geometry)}",
                "give the corners in order around the region",
            )
        if geometry.area <= COORDINATE_TOLERANCE * geometry.length:
            raise InvalidInput(
                "shape.points",
                self.points,
                "must enclose an area, the region is empty",
                "give the corners in order around the region",
            )
        return self

    @property
    def geometry(self) -> BaseGeometry:
        """The shape as a shapely polygon."""
        return shapely.Polygon(self.points)


Shape = Annotated[Box | Polygon, Field(discriminator="kind")]


def box(x: tuple[float, float], y: tuple[float, float]) -> Box:
    """Rectangle x[0]..x[1] by y[0]..y[1], m."""
    return Box(x=x, y=y)


def polygon(points: Sequence[tuple[float, float]]) -> Polygon:
    """Simple polygon by its corners in order, m."""
    return Polygon(points=points)
