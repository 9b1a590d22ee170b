"""Pore water and its level, and how soils conduct and hold it. Units kN, m, s."""

from __future__ import annotations

import itertools
from math import cos, radians, sin
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator
from pydantic.config import JsonDict

from .. import _core
from .._errors import InvalidInput
from .._model import Model
from .._types import MAX_PARTS, Floats, Many, NonNegative, Number, Point, Positive

_LAYERS: JsonDict = {
    "remedy": "layered soils are several times less permeable across their layers, but not impermeable"
}


class Water(Model):
    """Pore water. A scene without it is dry: it has no pore pressure anywhere."""

    _label: ClassVar[str] = "water"

    unit_weight: Number = Field(
        default=10.0, gt=0.0, description="kN/m3", json_schema_extra={"remedy": "9.81 to 10 for water"}
    )
    bulk_modulus: Number = Field(
        default=1.0e6,
        gt=0.0,
        description="kPa",
        json_schema_extra={"remedy": "2.2e6 for water without air, less with bubbles in it"},
    )


class WaterTable(Model):
    """Level of still water by elevation, by depth below the highest ground, or by `points` (x, y), m.

    Above the ground it is a pond. Where it lies below the ground, soil `above` it is "dry", or holds water by
    its "retention" curve under the suction of its height; left out, the latter if all soil there has a curve.
    """

    _label: ClassVar[str] = "water_table"

    elevation: Number | None = Field(default=None, description="m")
    depth: Number | None = Field(default=None, description="below the highest ground, m")
    points: Annotated[Many[Point], Field(min_length=2, max_length=MAX_PARTS)] | None = Field(
        default=None, description="(x, y) from left to right, m; level beyond its ends"
    )
    above: Literal["dry", "retention"] | None = None

    @model_validator(mode="after")
    def _one_level(self) -> WaterTable:
        given = {"elevation": self.elevation, "depth": self.depth, "points": self.points}
        if sum(value is not None for value in given.values()) != 1:
            raise InvalidInput(
                "water_table",
                given,
                "must be given by exactly one of elevation, depth and points",
                "depth = 0 is at the highest ground",
            )
        if self.points is not None:
            for i, (before, after) in enumerate(itertools.pairwise(self.points)):
                if not after[0] > before[0]:
                    raise InvalidInput(
                        f"water_table.points[{i + 1}]",
                        after,
                        "must lie to the right of the point before it",
                        "order the points from left to right",
                    )
        return self

    def level_at(self, x: Floats, *, highest_ground: float) -> Floats:
        """Elevation of the water at each x, m; `highest_ground` is that of the section, m."""
        if self.points is not None:
            levels: Floats = np.interp(x, *np.transpose(self.points))
            return levels
        level = highest_ground - self.depth if self.depth is not None else self.elevation
        return np.full(np.shape(x), level)


class Conductivity(Model):
    """Hydraulic conductivity that differs with direction, m/s.

    `horizontal` acts along a line that rises by `angle_deg` degrees towards positive x, `vertical` at right
    angles to it, as in inclined layers.
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
    def core(self) -> _core.Conductivity:
        """The largest and the smallest value and the direction of the largest, for the numerical core."""
        x, y = cos(radians(self.angle_deg)), sin(radians(self.angle_deg))
        if self.horizontal >= self.vertical:
            return _core.Conductivity(major=self.horizontal, minor=self.vertical, direction=(x, y))
        return _core.Conductivity(major=self.vertical, minor=self.horizontal, direction=(-y, x))

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
    def core(self) -> _core.Retention:
        """The curve for the numerical core."""
        return _core.Retention(
            alpha=self.alpha, n=self.n, residual=self.residual_saturation, full=self.full_saturation
        )


def _tensor(value: object) -> object:
    """A table as a conductivity, which checks its values."""
    return Conductivity(**value) if isinstance(value, dict) else value


AnyConductivity = Annotated[NonNegative | Conductivity, BeforeValidator(_tensor)]
