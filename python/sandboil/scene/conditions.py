"""Conditions of the pore water at the edges of a section. Units kN, m, s; x horizontal, y up.

Edges without a condition are impermeable. Values that change with time are given as pairs (time in s, value):
linear between them, constant before the first and after the last.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import dist, inf
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
import shapely
from pydantic import BeforeValidator, Field, PlainSerializer, model_validator
from pydantic.config import JsonDict
from shapely.geometry.base import BaseGeometry

from .._errors import InvalidInput
from .._model import Model
from .._types import COORDINATE_TOLERANCE, MAX_POINTS, Many, Number, Point, as_float
from ..ground.outline import Outline

_SERIES: JsonDict = {"remedy": "a number, or pairs of time and value as [[0, 4.0], [3600, 3.0]]"}
_LINE: JsonDict = {"remedy": "'surface', or points as [[0, 0], [0, 4]]"}

Edge = Literal["surface", "base", "left", "right"]
EDGES: tuple[Edge, ...] = ("surface", "base", "left", "right")


def _series(value: object) -> tuple[tuple[float, float], ...]:
    """A value for all times, or pairs of time and value, as pairs."""
    if isinstance(value, (str, bytes)) or (not isinstance(value, Sequence) and not hasattr(value, "tolist")):
        return ((0.0, as_float(value)),)
    rows = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(rows, Sequence):
        return ((0.0, as_float(rows)),)
    pairs = []
    for row in rows:
        if not isinstance(row, Sequence) or isinstance(row, (str, bytes)) or len(row) != 2:
            raise ValueError("must be a number, or pairs of time (s) and value")
        pairs.append((as_float(row[0]), as_float(row[1])))
    if not pairs:
        raise ValueError("must hold at least one pair of time (s) and value")
    if any(after[0] <= before[0] for before, after in itertools.pairwise(pairs)):
        raise ValueError("must have rising times")
    return tuple(pairs)


def _shortest(pairs: tuple[tuple[float, float], ...]) -> object:
    """A constant as a number, other series as pairs."""
    return pairs[0][1] if len(pairs) == 1 else pairs


Series = Annotated[tuple[tuple[Number, Number], ...], BeforeValidator(_series), PlainSerializer(_shortest)]


def _line(value: object) -> object:
    """The name of an edge, or points."""
    if isinstance(value, str):
        if value not in EDGES:
            raise ValueError(f"must be one of {', '.join(map(repr, EDGES))}, or points (x, y)")
        return value
    rows: Any = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(rows, Sequence) or len(rows) < 2:
        raise ValueError(f"must be one of {', '.join(map(repr, EDGES))}, or at least two points (x, y)")
    if len(rows) > MAX_POINTS:
        raise ValueError(f"must hold at most {MAX_POINTS} points")
    points = []
    for row in rows:
        if not isinstance(row, Sequence) or isinstance(row, str) or len(row) != 2:
            raise ValueError("must hold points (x, y)")
        points.append((as_float(row[0]), as_float(row[1])))
    return tuple(points)


Line = Annotated[Edge | tuple[tuple[float, float], ...], BeforeValidator(_line)]


def _through(points: Sequence[tuple[float, float]]) -> BaseGeometry:
    """A line through points. Made from flat numbers, which is ten times as fast as from pairs."""
    return shapely.LineString(np.fromiter(itertools.chain.from_iterable(points), np.float64).reshape(-1, 2))


class _Condition(Model):
    """A condition that holds on a line, with a value over time or none."""

    _label: ClassVar[str] = "condition"
    # Field of the value, and its unit.
    _value: ClassVar[str | None] = None
    _unit: ClassVar[str] = ""

    # Whether the condition fixes the level of the pressure: a flux alone leaves it open.
    fixes_pressure: ClassVar[bool] = True

    if TYPE_CHECKING:
        kind: str

    @property
    def value_name(self) -> str | None:
        """Name of the field that holds the value; None without one."""
        return self._value

    @property
    def series(self) -> Series:
        """The value over time as (time in s, value); empty without one."""
        values: Series = () if self._value is None else getattr(self, self._value)
        return values

    @property
    def heads(self) -> Series:
        """Total heads over time, m; empty where the condition gives none."""
        return ()

    def value_at(self, time: float) -> float:
        """The value at a time (s); 0 without one."""
        if not self.series:
            return 0.0
        moments, values = zip(*self.series, strict=True)
        return float(np.interp(time, moments, values))

    def frozen(self, time: float) -> Self:
        """The condition with the value that it has at a time (s) for all times."""
        return self if self._value is None else self.changed(**{self._value: self.value_at(time)})

    def lowest_head(self, bottom: float, unit_weight: float) -> float:
        """The lowest head to which the condition may lower the water, m; infinite if it fixes none.

        `bottom` is the lowest elevation of its line, m, `unit_weight` that of water, kN/m3.
        """
        return min((value for _, value in self.heads), default=inf)

    def described(self, time: float) -> str:
        """Kind of the condition, and its value at a time (s), for people."""
        if self._value is None:
            return self.kind
        name = self.kind if self._value == self.kind else f"{self.kind}, {self._value}"
        return f"{name} {self.value_at(time):.4g} {self._unit}"

    def line(self, outline: Outline) -> BaseGeometry:
        """The line on which the condition holds in a section with these edges."""
        raise NotImplementedError


class _EdgeCondition(_Condition):
    """A condition on a stretch of the section's edge."""

    _positional: ClassVar[tuple[str, ...]] = ("on",)

    on: Line = Field(description="an edge by name, or points (x, y) along one", json_schema_extra=_LINE)
    x: Point | None = Field(default=None, description="the part of it between two x, m")

    @model_validator(mode="after")
    def _part_of_an_edge(self) -> Self:
        if self.x is None:
            return self
        if self.on not in ("surface", "base"):
            raise InvalidInput(
                "condition.x", self.x, "cuts the 'surface' or the 'base'", "other lines are given by points"
            )
        if not self.x[0] < self.x[1]:
            raise InvalidInput(
                "condition.x", self.x, "must be (left, right) with left < right", "the left end comes first"
            )
        return self

    def line(self, outline: Outline) -> BaseGeometry:
        """The stretch of edge; empty where its part lies beyond the section."""
        if not isinstance(self.on, str):
            return _through(self.on)
        line = outline.edges[self.on]
        if self.x is None:
            return line
        y0, y1 = line.bounds[1] - 1.0, line.bounds[3] + 1.0
        part = shapely.intersection(line, shapely.box(self.x[0], y0, self.x[1], y1))
        return shapely.line_merge(part) if part.geom_type == "MultiLineString" else part


class Head(_EdgeCondition):
    """Total head h_p + y on a stretch of edge, m."""

    _value: ClassVar[str | None] = "head"
    _unit: ClassVar[str] = "m"

    kind: Literal["head"] = "head"
    head: Series = Field(description="m", json_schema_extra=_SERIES)

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, head: Any, x: tuple[float, float] | None = None) -> None: ...

    @property
    def heads(self) -> Series:
        """Total heads over time, m."""
        return self.head


class Pressure(_EdgeCondition):
    """Pore pressure on a stretch of edge, kPa, compression positive."""

    _value: ClassVar[str | None] = "pressure"
    _unit: ClassVar[str] = "kPa"

    kind: Literal["pressure"] = "pressure"
    pressure: Series = Field(description="kPa", json_schema_extra=_SERIES)

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, pressure: Any, x: tuple[float, float] | None = None) -> None: ...

    def lowest_head(self, bottom: float, unit_weight: float) -> float:
        """The lowest head at the lowest point of the line, m."""
        return bottom + min(value for _, value in self.pressure) / unit_weight


class Flux(_EdgeCondition):
    """Inflow through a stretch of edge, m/s; negative draws water out, also from unsaturated soil."""

    _value: ClassVar[str | None] = "inflow"
    _unit: ClassVar[str] = "m/s"

    fixes_pressure: ClassVar[bool] = False

    kind: Literal["flux"] = "flux"
    inflow: Series = Field(description="m/s, inwards", json_schema_extra=_SERIES)

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, inflow: Any, x: tuple[float, float] | None = None) -> None: ...


class Rain(_EdgeCondition):
    """Rain on a stretch of surface, m/s per horizontal area. What the soil does not take runs off."""

    _value: ClassVar[str | None] = "rate"
    _unit: ClassVar[str] = "m/s"

    kind: Literal["rain"] = "rain"
    rate: Series = Field(description="m/s; 10 mm/h is 2.8e-6", json_schema_extra=_SERIES)

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, rate: Any, x: tuple[float, float] | None = None) -> None: ...

    @model_validator(mode="after")
    def _falls(self) -> Rain:
        if isinstance(self.on, str) and self.on != "surface":
            raise InvalidInput(
                "condition.on", self.on, "must be the 'surface' or points along it", "Flux takes any edge"
            )
        for i, (_, rate) in enumerate(self.rate):
            if rate < 0.0:
                raise InvalidInput(
                    f"condition.rate[{i}]", rate, "must not be negative", "Flux takes evaporation"
                )
        return self


class Reservoir(_EdgeCondition):
    """Open water before a stretch of edge: its head below the `level` (m), a seepage face above it."""

    _value: ClassVar[str | None] = "level"
    _unit: ClassVar[str] = "m"

    kind: Literal["reservoir"] = "reservoir"
    level: Series = Field(description="elevation of the water, m", json_schema_extra=_SERIES)

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, level: Any, x: tuple[float, float] | None = None) -> None: ...

    @property
    def heads(self) -> Series:
        """Total heads over time, m."""
        return self.level


class SeepageFace(_EdgeCondition):
    """A stretch of edge open to the air: water leaves it at zero pressure, none enters."""

    kind: Literal["seepage-face"] = "seepage-face"

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, x: tuple[float, float] | None = None) -> None: ...

    def lowest_head(self, bottom: float, unit_weight: float) -> float:
        """The head at the lowest point of the line, m."""
        return bottom


class Drain(_Condition):
    """A line inside the section at which water leaves at zero pressure."""

    _positional: ClassVar[tuple[str, ...]] = ("points",)

    kind: Literal["drain"] = "drain"
    points: Many[Point] = Field(min_length=2, max_length=MAX_POINTS, description="(x, y) along the drain, m")

    if TYPE_CHECKING:

        def __init__(self, points: Sequence[tuple[float, float]]) -> None: ...

    @model_validator(mode="after")
    def _has_length(self) -> Drain:
        for i, (before, after) in enumerate(itertools.pairwise(self.points)):
            if dist(before, after) <= COORDINATE_TOLERANCE:
                raise InvalidInput(
                    f"condition.points[{i + 1}]",
                    after,
                    "must lie apart from the point before it",
                    "leave one of the two out",
                )
        return self

    def line(self, outline: Outline) -> BaseGeometry:
        """The line of the drain."""
        return _through(self.points)

    def lowest_head(self, bottom: float, unit_weight: float) -> float:
        """The head at the lowest point of the line, m."""
        return bottom


AnyCondition = Head | Pressure | Flux | Rain | Reservoir | SeepageFace | Drain
Condition = Annotated[AnyCondition, Field(discriminator="kind")]
