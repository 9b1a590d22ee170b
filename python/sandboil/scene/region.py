"""Regions of one soil."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field
from pydantic.config import JsonDict
from shapely.geometry.base import BaseGeometry

from .. import _core
from .._model import Model
from .._types import Number, Positive
from .phases import SoilPhases, phases_of
from .shapes import Box, Polygon, Shape
from .soils import Material
from .water import AnyConductivity, Conductivity, VanGenuchten

if TYPE_CHECKING:
    from .scene import Scene

_POROSITY: JsonDict = {"remedy": "sand has a porosity of 0.35 to 0.5, a void ratio of 0.5 to 1"}
_UNIT_WEIGHT: JsonDict = {"remedy": "soil weighs 14 to 22 kN/m3; 1800 kg/m3 are 17.7"}


class Region(Model):
    """A part of the section made of one soil.

    Densities: any sufficient set of `Gs`, `porosity` or `void_ratio`, and unit weights in kN/m3. PM4Sand's
    void ratio follows from its relative density. `bulk_unit_weight` is that of saturated soil in a scene with
    water, of dry soil in one without. Without `hydraulic_conductivity` (m/s, or a :class:`Conductivity` that
    differs with direction) the region is undrained. `retention` gives its saturation above the water table.
    `K0` is the ratio of horizontal to vertical effective stress in level ground after the gravity stage.
    """

    _label: ClassVar[str] = "region"
    _positional: ClassVar[tuple[str, ...]] = ("name", "shape", "material")

    name: str = Field(min_length=1, json_schema_extra={"remedy": "name what it is: 'loose sand'"})
    shape: Shape
    material: Material
    hydraulic_conductivity: AnyConductivity | None = Field(
        default=None,
        description="m/s, the same in all directions or a Conductivity; none: undrained",
        json_schema_extra={"remedy": "1e-3 is a coarse sand, 1e-5 a fine one, 1e-8 a silty clay"},
    )
    retention: VanGenuchten | None = Field(
        default=None, description="saturation above the water table; none: all pores stay full"
    )
    Gs: Annotated[Number, Field(gt=1.0)] | None = Field(
        default=None,
        description="specific gravity of the solids",
        json_schema_extra={"remedy": "2.65 for quartz, 2.7 for most soils"},
    )
    porosity: Annotated[Number, Field(gt=0.0, lt=1.0)] | None = Field(
        default=None, description="pores per volume of soil", json_schema_extra=_POROSITY
    )
    void_ratio: Positive | None = Field(
        default=None, description="pores per volume of solids", json_schema_extra=_POROSITY
    )
    dry_unit_weight: Positive | None = Field(
        default=None, description="kN/m3", json_schema_extra=_UNIT_WEIGHT
    )
    bulk_unit_weight: Positive | None = Field(
        default=None, description="kN/m3", json_schema_extra=_UNIT_WEIGHT
    )
    saturated_unit_weight: Positive | None = Field(
        default=None, description="kN/m3", json_schema_extra=_UNIT_WEIGHT
    )
    K0: Number = Field(
        default=0.5,
        gt=0.0,
        lt=1.0,
        description="horizontal over vertical effective stress",
        json_schema_extra={
            "remedy": "gravity acts on an elastic soil with nu = K0/(1 + K0), which must be below 0.5"
        },
    )

    if TYPE_CHECKING:

        def __init__(
            self,
            name: str,
            shape: Box | Polygon,
            material: Material,
            *,
            hydraulic_conductivity: float | Conductivity | None = None,
            retention: VanGenuchten | None = None,
            Gs: float | None = None,
            porosity: float | None = None,
            void_ratio: float | None = None,
            dry_unit_weight: float | None = None,
            bulk_unit_weight: float | None = None,
            saturated_unit_weight: float | None = None,
            K0: float = 0.5,
        ) -> None: ...

    @property
    def geometry(self) -> BaseGeometry:
        """The region as a shapely polygon."""
        return self.shape.geometry

    @property
    def conductivity(self) -> _core.Conductivity:
        """Hydraulic conductivity by its principal values, m/s; zero in undrained soil."""
        given = self.hydraulic_conductivity or 0.0
        if isinstance(given, Conductivity):
            return given.core
        return _core.Conductivity(major=given, minor=given, direction=(1.0, 0.0))

    @property
    def initial_poisson_ratio(self) -> float:
        """nu = K0/(1 + K0), with which an elastic level ground comes to rest at K0."""
        return self.K0 / (1.0 + self.K0)

    def resolved(self, scene: Scene) -> SoilPhases:
        """Porosity and densities; :class:`InvalidInput` if those given are too few or contradict."""
        return phases_of(self, scene.gravity, scene.water)
