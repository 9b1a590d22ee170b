"""Pore water at the edges of a section and in its soils. Units kN, m, s, Mg; x horizontal, y up.

Edges without a condition let nothing through. Values that change with time are given as pairs (time in s,
value): straight between them, constant before the first and after the last.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import cos, dist, radians, sin
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
import shapely
from pydantic import BeforeValidator, Field, PlainSerializer, model_validator
from pydantic.config import JsonDict
from shapely.geometry.base import BaseGeometry

from .._errors import InvalidInput
from .._model import MAX_PARTS, MAX_POINTS, Many, Model, Number, as_float
from ..ground.outline import Outline
from .edges import COORDINATE_TOLERANCE, Point
from .soils import NonNegative, Positive

_LAYERS: JsonDict = {"remedy": "layered soils have several times less across their layers, but not none"}
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
    """A constant as the number that it was given by."""
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


class Conductivity(Model):
    """Hydraulic conductivity that differs with direction, m/s.

    `horizontal` acts along a line that rises by `angle_deg` degrees towards positive x, `vertical` at right
    angles to it: the lie of inclined layers.
    """

    _label: ClassVar[str] = "hydraulic_conductivity"
    _positional: ClassVar[tuple[str, ...]] = ("horizontal", "vertical")

    horizontal: Positive = Field(description="along the layers, m/s", json_schema_extra=_LAYERS)
    vertical: Positive = Field(description="across them, m/s", json_schema_extra=_LAYERS)
    angle_deg: Number = Field(
        default=0.0,
        ge=-90.0,
        le=90.0,
        description="inclination of the layers, degrees",
        json_schema_extra={"remedy": "positive where they rise to the right"},
    )

    if TYPE_CHECKING:

        def __init__(self, horizontal: float, vertical: float, *, angle_deg: float = 0.0) -> None: ...

    @property
    def core(self) -> tuple[float, float, tuple[float, float]]:
        """Largest and smallest value, m/s, and the direction of the largest."""
        along = (cos(radians(self.angle_deg)), sin(radians(self.angle_deg)))
        if self.horizontal >= self.vertical:
            return self.horizontal, self.vertical, along
        return self.vertical, self.horizontal, (-along[1], along[0])

    @property
    def largest(self) -> float:
        """The larger of both, m/s."""
        return max(self.horizontal, self.vertical)

    def __str__(self) -> str:
        inclined = f", layers at {self.angle_deg:g} degrees" if self.angle_deg else ""
        return f"{self.horizontal:g} and {self.vertical:g} m/s{inclined}"


class VanGenuchten(Model):
    """Water retention of van Genuchten (1980) and relative conductivity of Mualem (1976).

    `S_e = (1 + (alpha y)^n)^(1/n - 1)` at the suction head y in m. Typical (alpha, n): sand 14.5, 2.68; sandy
    loam 7.5, 1.89; loam 3.6, 1.56; clay 0.8, 1.09 (Carsel and Parrish 1988).
    """

    _label: ClassVar[str] = "retention"
    _positional: ClassVar[tuple[str, ...]] = ("alpha", "n")

    kind: Literal["van-genuchten"] = "van-genuchten"
    alpha: Number = Field(
        gt=0.0,
        le=1000.0,
        description="1/m, about the inverse of the capillary rise",
        json_schema_extra={"remedy": "tables in 1/cm: times 100; in 1/kPa: times the unit weight of water"},
    )
    n: Number = Field(
        gt=1.0,
        le=20.0,
        description="steepness",
        json_schema_extra={"remedy": "2.7 for sand, 1.9 for sandy loam, 1.1 for clay"},
    )
    residual_saturation: Number = Field(
        default=0.0,
        ge=0.0,
        lt=1.0,
        description="at great suction",
        json_schema_extra={"remedy": "a share of the pores: 0.05 to 0.1 for sand"},
    )
    full_saturation: Number = Field(
        default=1.0,
        gt=0.0,
        le=1.0,
        description="without suction",
        json_schema_extra={"remedy": "a share of the pores: 1, less with trapped air"},
    )

    if TYPE_CHECKING:

        def __init__(
            self, alpha: float, n: float, *, residual_saturation: float = 0.0, full_saturation: float = 1.0
        ) -> None: ...

    @model_validator(mode="after")
    def _rises(self) -> VanGenuchten:
        if self.residual_saturation >= self.full_saturation:
            raise InvalidInput(
                "retention.residual_saturation",
                self.residual_saturation,
                f"must be below full_saturation, {self.full_saturation:g}",
                "0.05 to 0.1 for sand",
            )
        return self

    @property
    def core(self) -> tuple[float, float, float, float]:
        """The parameters as the numerical core takes them."""
        return self.alpha, self.n, self.residual_saturation, self.full_saturation


class _Condition(Model):
    _label: ClassVar[str] = "condition"
    _positional: ClassVar[tuple[str, ...]] = ("on",)

    on: Line = Field(description="an edge by name, or points (x, y) along one", json_schema_extra=_LINE)
    x: Point | None = Field(default=None, description="the part of it between two x, m")

    @model_validator(mode="after")
    def _part_of_an_edge(self) -> _Condition:
        if self.x is None:
            return self
        if self.on not in ("surface", "base"):
            raise InvalidInput(
                "condition.x", self.x, "cuts the 'surface' or the 'base'", "other lines are given by points"
            )
        if not self.x[0] < self.x[1]:
            raise InvalidInput("condition.x", self.x, "must rise", "order: left end, right end")
        return self


class Head(_Condition):
    """Total head h_p + y on a stretch of edge, m."""

    kind: Literal["head"] = "head"
    head: Series = Field(description="m", json_schema_extra=_SERIES)

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, head: Any, x: tuple[float, float] | None = None) -> None: ...


class Pressure(_Condition):
    """Pore pressure on a stretch of edge, kPa, compression positive."""

    kind: Literal["pressure"] = "pressure"
    pressure: Series = Field(description="kPa", json_schema_extra=_SERIES)

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, pressure: Any, x: tuple[float, float] | None = None) -> None: ...


class Flux(_Condition):
    """Inflow through a stretch of edge, m/s; negative draws water out, whatever the soil holds."""

    kind: Literal["flux"] = "flux"
    inflow: Series = Field(description="m/s, inwards", json_schema_extra=_SERIES)

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, inflow: Any, x: tuple[float, float] | None = None) -> None: ...


class Rain(_Condition):
    """Rain on a stretch of surface, m/s per horizontal area. What the soil does not take runs off."""

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


class Reservoir(_Condition):
    """Open water before a stretch of edge: its head below the `level` (m), a seepage face above it."""

    kind: Literal["reservoir"] = "reservoir"
    level: Series = Field(description="elevation of the water, m", json_schema_extra=_SERIES)

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, level: Any, x: tuple[float, float] | None = None) -> None: ...


class SeepageFace(_Condition):
    """A stretch of edge open to the air: water leaves it at zero pressure, none comes in."""

    kind: Literal["seepage-face"] = "seepage-face"

    if TYPE_CHECKING:

        def __init__(self, on: Any, *, x: tuple[float, float] | None = None) -> None: ...


class Drain(Model):
    """A line inside the section at which water leaves at zero pressure."""

    _label: ClassVar[str] = "condition"
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


AnyCondition = Head | Pressure | Flux | Rain | Reservoir | SeepageFace | Drain
Condition = Annotated[AnyCondition, Field(discriminator="kind")]


def _through(points: Sequence[tuple[float, float]]) -> BaseGeometry:
    """A line through points; as flat numbers, ten times as fast as from pairs."""
    return shapely.LineString(np.fromiter(itertools.chain.from_iterable(points), np.float64).reshape(-1, 2))


def line_of(condition: AnyCondition, outline: Outline) -> BaseGeometry:
    """The line on which a condition holds at the edges of a section; empty where its part lies beyond."""
    if isinstance(condition, Drain):
        return _through(condition.points)
    if not isinstance(condition.on, str):
        return _through(condition.on)
    line = outline.edges[condition.on]
    if condition.x is None:
        return line
    y0, y1 = line.bounds[1] - 1.0, line.bounds[3] + 1.0
    part = shapely.intersection(line, shapely.box(condition.x[0], y0, condition.x[1], y1))
    return shapely.line_merge(part) if part.geom_type == "MultiLineString" else part


# Conditions that tell the level of the pressure; a flux alone leaves it open.
REFERENCES = ("head", "pressure", "rain", "reservoir", "seepage-face", "drain")


def heads_of(condition: Model) -> tuple[str, Series] | None:
    """Name and values of what a condition says of heads, m; None if it says nothing."""
    if isinstance(condition, Head):
        return "head", condition.head
    if isinstance(condition, Reservoir):
        return "level", condition.level
    return None


# What conditions prescribe, and its unit.
_PRESCRIBED = {"head": "m", "pressure": "kPa", "inflow": "m/s", "rate": "m/s", "level": "m"}


def prescribed(condition: Model) -> str | None:
    """Name of what a condition prescribes; None if it has no value."""
    return next((name for name in _PRESCRIBED if name in type(condition).model_fields), None)


def series_of(condition: Model) -> Series:
    """Values of a condition over time; empty if it has none."""
    name = prescribed(condition)
    values: Series = () if name is None else getattr(condition, name)
    return values


def value_at(condition: Any, time: float) -> float:
    """What a condition prescribes at a time (s); 0 if it has no value."""
    series = series_of(condition)
    if not series:
        return 0.0
    moments, values = zip(*series, strict=True)
    return float(np.interp(time, moments, values))


def frozen(condition: Any, time: float) -> Any:
    """The condition as it is at a time (s), from then on."""
    name = prescribed(condition)
    return (
        condition
        if name is None
        else condition.model_copy(update={name: ((0.0, value_at(condition, time)),)})
    )


def described(condition: Any, time: float) -> str:
    """Kind of a condition and what it prescribes at a time (s), for people."""
    name = prescribed(condition)
    if name is None:
        return str(condition.kind)
    told = condition.kind if name == condition.kind else f"{condition.kind}, {name}"
    return f"{told} {value_at(condition, time):.4g} {_PRESCRIBED[name]}"


class Seepage(Model):
    """Water that flows through the ground at rest, before anything moves.

    Without a `duration` (s) the state that does not change any more, found without time. It starts from the
    scene's water table, at rest, and what it ends with is the pore water of the stages that follow.
    """

    _label: ClassVar[str] = "stage"
    _positional: ClassVar[tuple[str, ...]] = ("conditions",)

    kind: Literal["seepage"] = "seepage"
    conditions: Many[Condition] = Field(
        min_length=1,
        max_length=MAX_PARTS,
        json_schema_extra={"remedy": "for example Head('left', head=4.0) and SeepageFace('right')"},
    )
    duration: Positive | None = Field(
        default=None,
        description="s; none: to the steady state",
        json_schema_extra={"remedy": "86400 is a day; leave it out for the steady state"},
    )

    if TYPE_CHECKING:

        def __init__(
            self,
            conditions: Sequence[AnyCondition],
            *,
            duration: float | None = None,
        ) -> None: ...


def _tensor(value: object) -> object:
    """A table as the conductivity that it tells, which refuses its own values."""
    return Conductivity(**value) if isinstance(value, dict) else value


AnyConductivity = Annotated[NonNegative | Conductivity, BeforeValidator(_tensor)]
