"""The scene: what is there, and what is done to it. Units kN, m, s, Mg; x horizontal, y up.

Everything is checked when the scene is made, so that a scene that exists can be computed. What can be said
in Python can be said in TOML with the same names, where `kind` takes the place of the class.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, StrictBool, model_validator
from pydantic.config import JsonDict
from shapely.geometry.base import BaseGeometry

from .. import _core
from .._errors import InvalidInput
from .._model import MAX_PARTS, MAX_POINTS, Many, Model, Number, field_remedy
from ..files import toml as _toml
from ..ground.outline import Outline
from .checks import water as _scene_water
from .edges import (
    COORDINATE_TOLERANCE,
    AnySides,
    Arrival,
    CompliantBase,
    Periodic,
    Point,
    Sides,
)
from .motion_spec import GivenMotion, MotionSpec
from .soils import Elastic, Material, PM4Sand, Positive
from .water import (
    AnyCondition,
    AnyConductivity,
    Condition,
    Conductivity,
    Seepage,
    VanGenuchten,
    line_of,
)

if TYPE_CHECKING:
    from ..motion import Motion
    from ..run.plan import Plan
    from ..site._profile import CurveChoice, SiteProfile

# Density of water where a scene without water gives Gs, Mg/m3: the scenes' usual 10 kN/m3 at 9.81 m/s2.
REFERENCE_WATER_DENSITY = 10.0 / 9.81

# Strength of the velocity filter: enough that liquefied sand keeps no grid-scale noise that would move an
# answer, while a wave of 20 particles loses only 0.04 % to it (docs/validation.md).
DEFAULT_VELOCITY_FILTER = 0.2

# Most cells of the lattice over a section: their weights alone would fill 40 GB.
MAX_CELLS = 10_000_000

# Most frames of a run: a frame holds every field of every node.
MAX_FRAMES = 100_000

# Least height of a side that is a wall or a free field, in spacings: a single row would have no depth in it.
LEAST_SIDE_ROWS = 2

# Thickness of the layers that a profile is divided into, m: a fifth of the wavelength at 20 Hz in soil of
# 100 m/s.
DEFAULT_LAYER = 1.0

# Relative mismatch up to which densities given twice are the same: they come with three to four digits.
DENSITY_TOLERANCE = 1.0e-3

_POROSITY: JsonDict = {"remedy": "sand has a porosity of 0.35 to 0.5, a void ratio of 0.5 to 1"}
_UNIT_WEIGHT: JsonDict = {"remedy": "soil weighs 14 to 22 kN/m3; 1800 kg/m3 are 17.7"}
_REGIONS: JsonDict = {"remedy": "regions of one soil can be one polygon"}
_STAGES: JsonDict = {"remedy": "for example Gravity() and Shaking(motion)"}
_LEAVE: JsonDict = {"remedy": "leave it out for the default, which suits most scenes"}

Count = Annotated[int, Field(strict=True, ge=1)]
Poisson = Annotated[Number, Field(ge=0.0, lt=0.5)]
# Hz, far beyond earthquakes and sites on both sides; outside, damping would make time steps of nothing.
Frequency = Annotated[Number, Field(ge=0.01, le=1000.0)]


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


@dataclass(frozen=True)
class SoilPhases:
    """How much solid and water a soil holds. Densities in Mg/m3, per volume of soil save the solid's."""

    porosity: float
    void_ratio: float
    Gs: float
    solid_density: float
    dry_density: float
    saturated_density: float


class Region(Model):
    """A part of the section made of one soil.

    Densities: any sufficient set of `Gs`, `porosity` or `void_ratio`, and unit weights in kN/m3. PM4Sand's
    void ratio comes from its relative density. `bulk_unit_weight` is that of the soil as it stands: saturated
    in a scene with water, dry in one without. Without `hydraulic_conductivity` (m/s, or a
    :class:`Conductivity` that differs with direction) the region is undrained. `retention` tells what it
    holds above the water table. `K0` is the ratio of horizontal to vertical effective stress that the gravity
    stage aims at.
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
        default=None, description="what it holds above the water table; none: all pores stay full"
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
    def conductivity(self) -> tuple[float, float, tuple[float, float]]:
        """Largest and smallest hydraulic conductivity, m/s, and the direction of the largest."""
        given = self.hydraulic_conductivity or 0.0
        return given.core if isinstance(given, Conductivity) else (given, given, (1.0, 0.0))

    @property
    def initial_poisson_ratio(self) -> float:
        """nu = K0/(1 + K0), with which an elastic level ground comes to rest at K0."""
        return self.K0 / (1.0 + self.K0)

    def resolved(self, scene: Scene) -> SoilPhases:
        """Porosity and densities as given; :class:`InvalidInput` if not enough or contradictory."""
        return self._phases(scene.gravity, scene.water)

    def _phases(self, gravity: float, water: Water | None) -> SoilPhases:
        rho_w = REFERENCE_WATER_DENSITY if water is None else water.unit_weight / gravity
        dry = None if self.dry_unit_weight is None else self.dry_unit_weight / gravity
        saturated = None if self.saturated_unit_weight is None else self.saturated_unit_weight / gravity
        if self.bulk_unit_weight is not None:
            bulk = self.bulk_unit_weight / gravity
            if water is None:
                dry = self._agreed("bulk_unit_weight", bulk, dry, gravity)
            else:
                saturated = self._agreed("bulk_unit_weight", bulk, saturated, gravity)
        n = self._given_porosity()
        Gs = self.Gs
        if n is None:
            if Gs is not None and dry is not None:
                n = 1.0 - dry / (Gs * rho_w)
            elif Gs is not None and saturated is not None:
                n = (Gs - saturated / rho_w) / (Gs - 1.0)
            elif dry is not None and saturated is not None:
                n = (saturated - dry) / rho_w
            elif dry is not None and water is None:
                # Nothing flows through a dry soil, so how its volume divides into grains and pores is left
                # out: all of it counts as solid.
                return SoilPhases(0.0, 0.0, dry / rho_w, dry, dry, dry)
            else:
                raise self._insufficient(water)
            if not 0.0 < n < 1.0:
                raise InvalidInput(
                    "region",
                    self._given_densities(),
                    f"these densities give a porosity of {n:.4g}, which must lie in (0, 1)",
                    f"the density of water is {rho_w:.4g} Mg/m3",
                )
        if Gs is None:
            if dry is not None:
                Gs = dry / ((1.0 - n) * rho_w)
            elif saturated is not None:
                Gs = (saturated / rho_w - n) / (1.0 - n)
            else:
                raise self._insufficient(water)
        phases = SoilPhases(
            porosity=n,
            void_ratio=n / (1.0 - n),
            Gs=Gs,
            solid_density=Gs * rho_w,
            dry_density=(1.0 - n) * Gs * rho_w,
            saturated_density=((1.0 - n) * Gs + n) * rho_w,
        )
        self._agreed("dry_unit_weight", dry, phases.dry_density, gravity)
        self._agreed("saturated_unit_weight", saturated, phases.saturated_density, gravity)
        return phases

    def _given_porosity(self) -> float | None:
        """Porosity said directly, by the void ratio or by PM4Sand's relative density; they must agree."""
        said: list[tuple[str, float, float]] = []
        if isinstance(self.material, PM4Sand):
            e = self.material.initial_void_ratio
            said.append((f"material.Dr = {self.material.Dr:g}", e, e / (1.0 + e)))
        if self.void_ratio is not None:
            said.append(("void_ratio", self.void_ratio, self.void_ratio / (1.0 + self.void_ratio)))
        if self.porosity is not None:
            said.append(("porosity", self.porosity, self.porosity))
        for name, value, n in said[1:]:
            first, _, expected = said[0]
            if abs(n - expected) > DENSITY_TOLERANCE * expected:
                right = expected if name == "porosity" else expected / (1.0 - expected)
                raise InvalidInput(
                    f"region.{name}",
                    value,
                    f"contradicts {first}, which gives {name} = {right:.5g}",
                    "give only one",
                )
        return said[0][2] if said else None

    def _agreed(self, name: str, density: float | None, other: float | None, gravity: float) -> float | None:
        if density is not None and other is not None and abs(density - other) > DENSITY_TOLERANCE * other:
            raise InvalidInput(
                f"region.{name}",
                density * gravity,
                f"contradicts the other densities given, which make it {other * gravity:.5g} kN/m3",
                "give only a sufficient set",
            )
        return other if density is None else density

    def _given_densities(self) -> dict[str, float]:
        names = (
            "Gs",
            "porosity",
            "void_ratio",
            "dry_unit_weight",
            "bulk_unit_weight",
            "saturated_unit_weight",
        )
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}

    def _insufficient(self, water: Water | None) -> InvalidInput:
        return InvalidInput(
            "region",
            self._given_densities(),
            "needs enough densities: two of Gs, porosity (or void_ratio; known for PM4Sand), "
            "dry_unit_weight, saturated_unit_weight"
            + (", or a dry_unit_weight alone" if water is None else ""),
            "for example Gs = 2.65 with porosity = 0.4",
        )


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
        said = {"elevation": self.elevation, "depth": self.depth, "points": self.points}
        if sum(value is not None for value in said.values()) != 1:
            raise InvalidInput(
                "water_table",
                said,
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


class Gravity(Model):
    """Static stage: self-weight with elastic soils, to rest, on a base that is rough or smooth.

    It ends when the largest acceleration falls below `tolerance` (of gravity). Poisson's ratio is K0/(1 + K0)
    of each region unless `initial_poisson_ratio` is given for all.
    """

    _label: ClassVar[str] = "stage"

    kind: Literal["gravity"] = "gravity"
    tolerance: Number = Field(
        default=1.0e-4,
        gt=0.0,
        lt=1.0,
        description="largest acceleration over gravity",
        json_schema_extra={"remedy": "leave it out for 1e-4"},
    )
    max_steps: Count = Field(
        default=200_000,
        description="after which it gives up",
        json_schema_extra={"remedy": "leave it out for 200000"},
    )
    initial_poisson_ratio: Poisson | None = Field(
        default=None,
        description="nu of the ground at rest",
        json_schema_extra={"remedy": "leave it out for K0/(1 + K0) of each region"},
    )
    base: Literal["no-slip", "free-slip"] = "no-slip"


class Rayleigh(Model):
    """Viscous damping of a `ratio` of critical at two `frequencies`, less between them and more outside.

    A drag in proportion to mass, on the absolute velocity, and a viscous stress in proportion to the soil's
    present elastic stiffness: xi(w) = a/(2 w) + b w/2. The second fades as sand softens, and shortens the
    time step, since the shortest waves on the grid are damped most. Usual ratios are 0.005 to 0.03.
    """

    _label: ClassVar[str] = "rayleigh"

    ratio: Number = Field(
        gt=0.0,
        le=0.3,
        description="damping ratio, 1",
        json_schema_extra={"remedy": "a fraction: 0.005 is half a per cent"},
    )
    frequencies: tuple[Frequency, Frequency] = Field(
        description="low and high, Hz",
        json_schema_extra={"remedy": "the site's own frequency, and about five times that"},
    )

    @model_validator(mode="after")
    def _ascending(self) -> Rayleigh:
        low, high = self.frequencies
        if not low < high:
            raise InvalidInput(
                "rayleigh.frequencies",
                self.frequencies,
                "must ascend (low and high, Hz)",
                "the site's own frequency, and about five times that"
                if low == high
                else f"frequencies = [{high:g}, {low:g}]",
            )
        return self

    def __str__(self) -> str:
        low, high = self.frequencies
        return f"{100.0 * self.ratio:g} % at {low:g} and {high:g} Hz"


class Shaking(Model):
    """Dynamic stage on a compliant base: PM4Sand at work, water flowing.

    Without a motion the ground stands on its dashpots for `duration` seconds. With one, `duration` is that of
    the motion and of its way along the base unless given; a longer one adds quiet time. `vertical` is the
    vertical component of the same record (same kind and spacing), positive upwards; the base then absorbs
    vertically too. `rayleigh` damps beside the soil's own hysteresis.

    `conditions` are those of the water while the ground moves, with time counted from the stage's beginning.
    Left out, those that held before go on as they last were; an empty list ends them all. Edges without one
    are impermeable, save the ground surface, which keeps its pressure. Lines go with the ground.
    """

    _label: ClassVar[str] = "stage"
    _positional: ClassVar[tuple[str, ...]] = ("motion",)

    kind: Literal["shaking"] = "shaking"
    motion: GivenMotion = None
    vertical: GivenMotion = None
    base: CompliantBase = CompliantBase()
    duration: Positive | None = Field(
        default=None, description="s", json_schema_extra={"remedy": "leave it out for that of the motion"}
    )
    rayleigh: Rayleigh | None = None
    conditions: Annotated[Many[Condition], Field(max_length=MAX_PARTS)] | None = Field(
        default=None, description="left out: as before"
    )

    if TYPE_CHECKING:

        def __init__(
            self,
            motion: Motion | MotionSpec | None = None,
            *,
            vertical: Motion | MotionSpec | None = None,
            base: CompliantBase = ...,
            duration: float | None = None,
            rayleigh: Rayleigh | None = None,
            conditions: Sequence[AnyCondition] | None = None,
        ) -> None: ...

    @model_validator(mode="after")
    def _some_duration(self) -> Shaking:
        if self.duration is None and not any(motion for _, motion in self.motions):
            raise InvalidInput("stage.duration", None, "is required when there is no motion", "in seconds")
        return self

    @model_validator(mode="after")
    def _vertical_motion_fits(self) -> Shaking:
        if self.vertical is not None:
            if self.base.vertical == "roller":
                raise InvalidInput(
                    "stage.base.vertical",
                    self.base.vertical,
                    "must be 'absorbing' under a vertical motion: a roller does not move",
                    "leave it out",
                )
            if self.motion is not None and self.motion.kind != self.vertical.kind:
                raise InvalidInput(
                    "stage.vertical.kind",
                    self.vertical.kind,
                    f"must be that of the horizontal motion, {self.motion.kind!r}",
                    "take both components of the same record",
                )
            own = [i for i, segment in enumerate(self.base.segments) if segment.motion is not None]
            if own:
                raise InvalidInput(
                    f"stage.base.segments[{own[0]}].motion",
                    self.base.segments[own[0]].motion,
                    "must be left out beside a vertical motion, which is a component of the stage's motion",
                    "give the segments delays alone",
                )
        if self.base_vertical == "absorbing" and self.base.Vs is not None and self.base.Vp is None:
            raise InvalidInput(
                "stage.base.Vp",
                None,
                "is required beside Vs on a base that absorbs vertically",
                "Vp = Vs sqrt((2 - 2 nu)/(1 - 2 nu)); or leave Vs and density out too",
            )
        return self

    @property
    def base_vertical(self) -> Literal["roller", "absorbing"]:
        """What the base is vertically: as given, or else what the vertical motion needs."""
        return self.base.vertical or ("roller" if self.vertical is None else "absorbing")

    @property
    def motions(self) -> list[tuple[str, MotionSpec | None]]:
        """Every motion of the stage with its place in it."""
        segments = [
            (f"base.segments[{i}].motion", segment.motion) for i, segment in enumerate(self.base.segments)
        ]
        return [("motion", self.motion), ("vertical", self.vertical), *segments]

    def with_motions(self, change: Callable[[MotionSpec], MotionSpec]) -> Shaking:
        """The same stage with every motion changed."""
        update: dict[str, Any] = {}
        if self.motion is not None:
            update["motion"] = change(self.motion)
        if self.vertical is not None:
            update["vertical"] = change(self.vertical)
        if any(segment.motion for segment in self.base.segments):
            segments = tuple(
                segment
                if segment.motion is None
                else segment.model_copy(update={"motion": change(segment.motion)})
                for segment in self.base.segments
            )
            update["base"] = self.base.model_copy(update={"segments": segments})
        return self.model_copy(update=update)


class RunOut(Model):
    """Ground that flows, to where it comes to rest: large displacements under its own weight.

    The base and the sides are held where they stand, as in statics, and the ground flows over them from the
    state and the motion that the stage before has left. It is the last stage.

    `open_sides` are taken away, as a gate is, and the base goes on beyond them. `viscosity` is Monaghan's
    coefficient of the forces that brake particles which approach each other. `still_water` is the surface of
    the water around the ground, (x, y) from left to right, level beyond its ends; left out, that of the state
    at rest, ponds and water table; empty, there is none. Pore pressure beyond its hydrostatic pressure drains
    through the free surface, wherever that comes to be. Soil above the water keeps the suction and the water
    it has.
    """

    _label: ClassVar[str] = "stage"
    _positional: ClassVar[tuple[str, ...]] = ("duration",)

    kind: Literal["run-out"] = "run-out"
    duration: Positive = Field(
        description="s",
        json_schema_extra={"remedy": "a heap falls for sqrt(2 height/gravity) s, and flows twice as long"},
    )
    open_sides: Annotated[Many[Literal["left", "right"]], Field(max_length=2)] = ()
    viscosity: Number = Field(
        default=0.1,
        ge=0.0,
        le=10.0,
        description="1",
        json_schema_extra={"remedy": "leave it out for 0.1"},
    )
    still_water: Annotated[Many[Point], Field(max_length=MAX_PARTS)] | None = Field(
        default=None, description="(x, y), m; left out: as at rest"
    )

    if TYPE_CHECKING:

        def __init__(
            self,
            duration: float,
            *,
            open_sides: Sequence[Literal["left", "right"]] = (),
            viscosity: float = 0.1,
            still_water: Sequence[tuple[float, float]] | None = None,
        ) -> None: ...

    @model_validator(mode="after")
    def _line_runs_to_the_right(self) -> RunOut:
        line = self.still_water or ()
        for i, ((before, _), (x, _)) in enumerate(itertools.pairwise(line), start=1):
            if not x > before:
                raise InvalidInput(
                    f"stage.still_water[{i}]",
                    line[i],
                    f"must lie to the right of the point before it, x > {before:g} m",
                    "points run from left to right",
                )
        return self


AnyStage = Gravity | Shaking | RunOut | Seepage
# Stages in which the ground moves.
Moving = Shaking | RunOut
Stage = Annotated[AnyStage, Field(discriminator="kind")]


class Output(Model):
    """What is kept of a run. It never changes the time step.

    Histories are taken at the surface, the base, the `depths` (m below ground, in the mid column) and the
    `points` (x, y) every `history_dt` s; all fields every `field_dt` s; envelopes see every step.
    """

    _label: ClassVar[str] = "output"

    depths: Many[Number] = Field(default=(), max_length=MAX_PARTS, description="m below the ground surface")
    points: Many[Point] = Field(default=(), max_length=MAX_PARTS, description="(x, y), m")
    history_dt: Number = Field(
        default=0.005,
        gt=0.0,
        description="s",
        json_schema_extra={"remedy": "0.005 shows all below 100 Hz"},
    )
    field_dt: Number = Field(
        default=0.25,
        gt=0.0,
        description="s",
        json_schema_extra={"remedy": "0.25 makes four pictures a second"},
    )
    envelopes: Many[Literal["r_u", "gamma_max"]] = ("r_u", "gamma_max")
    stress_paths: StrictBool = Field(
        default=True, description="shear stress, vertical stress and strain at the depths"
    )


class Numerics(Model):
    """How it is computed. The defaults are for engineering; the rest is for studies of the method itself.

    `smoothing_ratio` is h/spacing; `velocity_filter` (default 0.2) and `local_damping` are
    fractions; `time_step_factor` is
    relative to the measured stability limit; beyond `geometry_strain_limit` the particle lists follow the
    motion (default 0.2, and 0.02 for the printed operators, which do not carry the deformation).
    `dispersion_correction` keeps short waves from being slow while shaking, and contacts of soils and
    the surface from being out of place for them, at shorter and dearer steps.
    """

    _label: ClassVar[str] = "numerics"

    operators: Literal["conservative", "printed"] = "conservative"
    smoothing_ratio: Number = Field(
        default=1.4, ge=1.0, le=3.0, description="h/spacing", json_schema_extra=_LEAVE
    )
    velocity_filter: Annotated[Number, Field(ge=0.0, le=1.0)] | None = Field(
        default=None, description="fraction per step", json_schema_extra=_LEAVE
    )
    local_damping: Number = Field(
        default=0.0, ge=0.0, lt=1.0, description="fraction of the force", json_schema_extra=_LEAVE
    )
    time_step_factor: Annotated[Number, Field(gt=0.0, le=2.0)] | None = Field(
        default=None, description="of the stability limit", json_schema_extra=_LEAVE
    )
    integrator: Literal["default", "rk4", "reference"] = "default"
    integrator_tolerance: Annotated[Number, Field(gt=0.0, le=1.0e-4)] | None = Field(
        default=None, description="relative error of a sub-step", json_schema_extra=_LEAVE
    )
    diffusion: Literal["auto", "implicit", "explicit"] = "auto"
    acceleration_term: Literal["auto", "on", "off"] = "auto"
    dispersion_correction: StrictBool = False
    geometry_strain_limit: Positive | None = Field(
        default=None, description="strain", json_schema_extra=_LEAVE
    )
    gap_memory: StrictBool = False

    @property
    def filter_strength(self) -> float:
        """Strength of the velocity filter as it is run."""
        if self.operators == "printed":
            return 0.0
        return DEFAULT_VELOCITY_FILTER if self.velocity_filter is None else self.velocity_filter

    @model_validator(mode="after")
    def _no_idle_choice(self) -> Numerics:
        """Refuse what would be said in vain: a choice that the others leave nothing to act on."""
        idle = [
            (
                "integrator_tolerance",
                self.integrator_tolerance is not None and self.integrator != "default",
                f"has no effect on the {self.integrator!r} integrator, which has its own sub-step rule",
                "integrator = 'default' is controlled by its error",
            ),
            (
                "acceleration_term",
                self.acceleration_term == "on" and self.diffusion == "implicit",
                "is left out by implicit diffusion",
                "diffusion = 'explicit' carries it",
            ),
            (
                "velocity_filter",
                self.operators == "printed" and bool(self.velocity_filter),
                "has no effect on the printed operators, which have no filter",
                "leave it out, or take operators = 'conservative'",
            ),
            (
                "dispersion_correction",
                self.operators == "printed" and self.dispersion_correction,
                "is not for the printed operators, whose force is not the transpose of their strain",
                "leave it out, or take operators = 'conservative'",
            ),
        ]
        for name, is_idle, told, remedy in idle:
            if is_idle:
                raise InvalidInput(f"numerics.{name}", getattr(self, name), told, remedy)
        return self


class Scene(Model):
    """A vertical section of ground, its water, and the stages it goes through. Immutable and checked."""

    _label: ClassVar[str] = "scene"

    spacing: Number = Field(
        gt=0.0,
        description="particle spacing, m",
        json_schema_extra={"remedy": "a fifth of the thinnest layer: 0.2 to 1 m in most sections"},
    )
    gravity: Number = Field(
        default=9.81,
        gt=0.0,
        description="m/s2",
        json_schema_extra={"remedy": "9.81: downwards without a sign"},
    )
    water: Water | None = None
    water_table: WaterTable | None = None
    regions: Many[Region] = Field(min_length=1, max_length=MAX_PARTS, json_schema_extra=_REGIONS)
    sides: AnySides = Periodic()
    stages: Many[Stage] = Field(min_length=1, max_length=MAX_PARTS, json_schema_extra=_STAGES)
    output: Output = Output()
    numerics: Numerics = Numerics()

    # Checks: each refuses the first thing wrong, in the order in which a user would mend them.

    @model_validator(mode="after")
    def _computable(self) -> Scene:
        self._check_names()
        self._check_size()
        self._check_overlaps()
        self._check_section()
        self._check_spacing()
        _scene_water.check(self)
        self._check_densities()
        self._check_materials()
        self._check_stages()
        self._check_bases()
        self._check_damping()
        self._check_inertia()
        self._check_printed_water()
        self._check_output()
        return self

    def _check_names(self) -> None:
        names = [region.name for region in self.regions]
        for i, name in enumerate(names):
            if name in names[:i]:
                raise InvalidInput(
                    f"scene.regions[{i}].name",
                    name,
                    f"is already the name of regions[{names.index(name)}]",
                    "give each its own",
                )

    def _check_overlaps(self) -> None:
        shapes = [region.geometry for region in self.regions]
        for i, shape in enumerate(shapes):
            for j in range(i):
                common = shape.intersection(shapes[j])
                if common.area > COORDINATE_TOLERANCE * shape.length:
                    x0, y0, x1, y1 = common.bounds
                    raise InvalidInput(
                        f"scene.regions[{i}].shape",
                        self.regions[i].shape,
                        f"must not overlap region {self.regions[j].name!r}",
                        f"they share {common.area:.4g} m2 in x {x0:g} to {x1:g}, y {y0:g} to {y1:g}",
                    )

    def _check_section(self) -> None:
        section = self.section
        pieces = list(section.geoms) if section.geom_type != "Polygon" else [section]
        if len(pieces) > 1:
            spans = (
                f"x {x0:g} to {x1:g}, y {y0:g} to {y1:g}" for x0, y0, x1, y1 in (p.bounds for p in pieces)
            )
            raise InvalidInput(
                "scene.regions",
                [region.name for region in self.regions],
                "must join into one section without gaps",
                f"separate pieces: {'; '.join(spans)}",
            )
        if holes := list(section.interiors):
            x0, y0, x1, y1 = holes[0].bounds
            raise InvalidInput(
                "scene.regions",
                [region.name for region in self.regions],
                "must fill the section without gaps",
                f"a hole lies in x {x0:g} to {x1:g}, y {y0:g} to {y1:g}",
            )
        outline = self.outline
        if isinstance(self.sides, Periodic):
            self._check_periodic(outline)
        else:
            self._check_sides(outline)

    def _check_periodic(self, outline: Outline) -> None:
        x0, _, x1, _ = self.bounds
        if not outline.base_is_level:
            y = outline.base[:, 1]
            raise InvalidInput(
                "scene.regions",
                [region.name for region in self.regions],
                "must stand on a level base between periodic sides, but it lies between "
                f"y = {y.min():g} and {y.max():g} m",
                "sides = FreeField() takes any base",
            )
        left, right = (self._side_profile(x) for x in (x0, x1))
        if not left or left != right:
            raise InvalidInput(
                "scene.sides",
                self.sides.kind,
                "needs straight vertical sides, the same soils at the same levels on both",
                f"left: {left or 'no vertical side'}; right: {right or 'no vertical side'}",
            )

    def _check_sides(self, outline: Outline) -> None:
        least = LEAST_SIDE_ROWS * self.spacing
        x0, _, x1, _ = self.bounds
        edges = (("left", x0, outline.left), ("right", x1, outline.right))
        for (hand, x, (bottom, top)), kind in zip(edges, self.side_kinds, strict=True):
            if top - bottom < least - COORDINATE_TOLERANCE:
                raise InvalidInput(
                    "scene.sides",
                    kind,
                    f"needs a straight vertical edge of at least {LEAST_SIDE_ROWS} spacings, {least:g} m, on "
                    f"the {hand}, which has {top - bottom:g} m",
                    "where a slope reaches the side, extend the section by level ground that ends upright",
                )
            if (np.abs(outline.surface[1:-1, 0] - x) <= COORDINATE_TOLERANCE).any():
                raise InvalidInput(
                    "scene.sides",
                    kind,
                    f"needs one straight vertical edge on the {hand}, but the section reaches x = {x:g} m "
                    f"again above {top:g} m",
                    "fill the section up to the side, or let only its lowest part reach it",
                )

    def _side_profile(self, x: float) -> list[tuple[str, float, float]]:
        """Soils of a side of the section as (name, bottom, top), lowest first; empty if not straight."""
        _, y0, _, y1 = self.bounds
        line = shapely.LineString([(x, y0), (x, y1)])
        digits = 5  # of the levels in m: one digit coarser than COORDINATE_TOLERANCE
        touching = [(self._soil_name(region), region.geometry.intersection(line)) for region in self.regions]
        pieces = sorted(
            (round(part.bounds[1], digits), round(part.bounds[3], digits), name)
            for name, common in touching
            for part in shapely.get_parts(common)
            if part.length > COORDINATE_TOLERANCE
        )
        levels = [(bottom, top) for bottom, top, _ in pieces]
        whole = bool(levels) and levels[0][0] == round(y0, digits)
        whole = whole and all(below[1] == above[0] for below, above in itertools.pairwise(levels))
        return [(name, bottom, top) for bottom, top, name in pieces] if whole else []

    def _soil_name(self, region: Region) -> str:
        """Name of the first region of the same soil: regions that differ only in name and place are alike."""
        soils = [other.model_dump(exclude={"name", "shape"}) for other in self.regions]
        return self.regions[soils.index(region.model_dump(exclude={"name", "shape"}))].name

    def _check_size(self) -> None:
        x0, y0, x1, y1 = self.bounds
        cells = (x1 - x0) / self.spacing * ((y1 - y0) / self.spacing)
        if cells > MAX_CELLS:
            raise InvalidInput(
                "scene.spacing",
                self.spacing,
                f"must make at most {MAX_CELLS:g} cells, not {cells:.3g} of {x1 - x0:g} by {y1 - y0:g} m",
                "increase it, or check the unit of the coordinates",
            )

    def _check_spacing(self) -> None:
        for region in self.regions:
            x0, y0, x1, y1 = region.geometry.bounds
            thickness = min(x1 - x0, y1 - y0)
            if self.spacing > thickness + COORDINATE_TOLERANCE:
                raise InvalidInput(
                    "scene.spacing",
                    self.spacing,
                    f"must not exceed the least extent of any region, {thickness:g} m ({region.name})",
                    "a fifth of the thinnest layer, or join layers that are thinner",
                )

    def _check_materials(self) -> None:
        """Let the soil models refuse what only they know, each at a stress that any soil bears."""
        for i, region in enumerate(self.regions):
            try:
                _core.small_strain_moduli(region.material.core(), (-100.0, -100.0, 0.0, -100.0))
            except InvalidInput as error:
                path = f"scene.regions[{i}].material.{error.path}"
                remedy = field_remedy(type(region.material).model_fields[error.path])
                raise InvalidInput(path, error.value, error.allowed, remedy) from None

    def _check_densities(self) -> None:
        for i, region in enumerate(self.regions):
            try:
                region.resolved(self)
            except InvalidInput as error:
                path = error.path.replace("region", f"scene.regions[{i}]", 1)
                raise InvalidInput(path, error.value, error.allowed, error.hint) from None

    def _check_stages(self) -> None:
        first = 1 if isinstance(self.stages[0], Seepage) else 0
        if len(self.stages) > first and not isinstance(self.stages[first], Gravity):
            raise InvalidInput(
                f"scene.stages[{first}].kind",
                self.stages[first].kind,
                "must be 'gravity': shaking needs the stresses at rest",
                "put Gravity() before it",
            )
        for i, stage in enumerate(self.stages[first + 1 :], start=first + 1):
            if isinstance(stage, Gravity):
                raise InvalidInput(
                    f"scene.stages[{i}].kind",
                    "gravity",
                    "must come before all shaking, and only once",
                    "leave it out",
                )
        for i, stage in enumerate(self.stages):
            if isinstance(stage, RunOut):
                self._check_run_out(stage, i)

    def _check_run_out(self, stage: RunOut, i: int) -> None:
        """Ground that has flowed is none to begin anew with, and its strains are not small."""
        path = f"scene.stages[{i}]"
        if i < len(self.stages) - 1:
            raise InvalidInput(f"{path}.kind", stage.kind, "must be the last stage", "put it at the end")
        if self.numerics.operators == "printed":
            raise InvalidInput(
                "scene.numerics.operators",
                "printed",
                "must be 'conservative' where the ground flows: the printed ones bear small strains alone",
                "leave it out",
            )
        if self.numerics.dispersion_correction:
            raise InvalidInput(
                "scene.numerics.dispersion_correction",
                True,
                "must be left out where the ground flows: its contacts do not stay where they are",
                "leave it out",
            )
        if stage.open_sides and isinstance(self.sides, Periodic):
            raise InvalidInput(
                f"{path}.open_sides",
                stage.open_sides,
                "does not go with periodic sides, which are none",
                "sides = Roller()",
            )
        if stage.still_water and self.water is None:
            raise InvalidInput(
                f"{path}.still_water",
                stage.still_water,
                "goes with water, of which the scene has none",
                "water = Water()",
            )

    def _check_bases(self) -> None:
        shaken = [(i, stage) for i, stage in enumerate(self.stages) if isinstance(stage, Shaking)]
        for i, stage in shaken:
            path = f"scene.stages[{i}].base"
            first = shaken[0][1].base_vertical
            if stage.base_vertical != first:
                # The force that holds the weight is that of the moment when the first shaking began.
                raise InvalidInput(
                    f"{path}.vertical",
                    stage.base_vertical,
                    f"must be as in the first shaking stage, {first!r}",
                    "say base = CompliantBase(vertical='absorbing') in every one of them",
                )
            if stage.base.Vs is not None and stage.base.Vp is None and not self.outline.base_is_level:
                raise InvalidInput(
                    f"{path}.Vp",
                    None,
                    "is required beside Vs under a base that is not level: there it resists both waves",
                    "Vp = Vs sqrt((2 - 2 nu)/(1 - 2 nu)); or leave Vs and density out too",
                )
            self._check_arrivals(stage, path)

    def _check_arrivals(self, stage: Shaking, path: str) -> None:
        base = stage.base
        x0, _, x1, _ = self.bounds
        name = "segments" if base.segments else "apparent_velocity"
        said = getattr(base, name)
        if not said:
            return
        if isinstance(self.sides, Periodic):
            raise InvalidInput(
                f"{path}.{name}",
                said,
                "must be left out between periodic sides: what differs along the base is not periodic",
                "sides = FreeField()",
            )
        arrivals = base.arrivals(x0, x1)
        if base.segments:
            ends = [x0, *(end for arrival in arrivals for end in arrival.x), x1]
            for before, after in zip(ends[::2], ends[1::2], strict=True):
                if abs(after - before) > COORDINATE_TOLERANCE:
                    told = "overlap" if after < before else "leave a gap"
                    low, high = sorted((before, after))
                    raise InvalidInput(
                        f"{path}.segments",
                        [arrival.x for arrival in arrivals],
                        f"must cover the base, x {x0:g} to {x1:g} m, side by side, but they {told} from "
                        f"{low:g} to {high:g}",
                        "let each begin where the one before ends",
                    )
        duration = stage.duration
        for arrival in arrivals:
            if duration is not None and arrival.latest >= duration:
                # The place that the user gave a segment, not the one from left to right.
                given = [segment.x for segment in base.segments]
                raise InvalidInput(
                    f"{path}.segments[{given.index(arrival.x)}].delay" if given else f"{path}.{name}",
                    arrival.delay if given else said,
                    f"must let the wave arrive before the stage ends: it takes {arrival.latest:g} of "
                    f"{duration:g} s",
                    "a longer duration",
                )

    def _check_damping(self) -> None:
        for i, stage in enumerate(self.stages):
            if isinstance(stage, Shaking) and stage.rayleigh and self.numerics.operators == "printed":
                raise InvalidInput(
                    f"scene.stages[{i}].rayleigh",
                    stage.rayleigh,
                    "must be left out with the printed operators: their force is not the transpose of their "
                    "strain, so a viscous stress may feed waves instead of damping them",
                    "numerics.local_damping works with both, or take operators = 'conservative'",
                )

    def _check_inertia(self) -> None:
        if self.numerics.dispersion_correction and "free-field" in self.side_kinds:
            raise InvalidInput(
                "scene.numerics.dispersion_correction",
                True,
                "must be left out beside free-field sides, whose push is reckoned with the plain inertia",
                "level ground on Periodic sides may have it; elsewhere take a smaller spacing",
            )

    def _check_printed_water(self) -> None:
        if (
            self.numerics.operators == "printed"
            and self.water is not None
            and "free-field" in self.side_kinds
        ):
            raise InvalidInput(
                "scene.numerics.operators",
                "printed",
                "must be 'conservative' in saturated ground beside free-field sides: Eq. 9 feeds waves where "
                "pressure is held at no surface",
                "dry ground or Periodic sides may have the printed operators",
            )

    def _check_output(self) -> None:
        left, bottom, right, top = self.bounds
        for stage in self.stages:
            duration = stage.duration if isinstance(stage, Moving) else None
            if duration is not None and duration / self.output.field_dt > MAX_FRAMES:
                raise InvalidInput(
                    "scene.output.field_dt",
                    self.output.field_dt,
                    f"must give at most {MAX_FRAMES:g} frames in {duration:g} s",
                    f"at least {duration / MAX_FRAMES:.3g} s",
                )
        for i, depth in enumerate(self.output.depths):
            if depth in self.output.depths[:i]:
                raise InvalidInput(f"scene.output.depths[{i}]", depth, "is named twice", "leave it out")
        x = 0.5 * (left + right)
        ends = shapely.LineString([(x, bottom), (x, top)]).intersection(self.section).bounds
        thickness = ends[3] - self.outline.base_elevation(x)
        for i, depth in enumerate(self.output.depths):
            if not 0.0 <= depth <= thickness + COORDINATE_TOLERANCE:
                raise InvalidInput(
                    f"scene.output.depths[{i}]",
                    depth,
                    f"must lie in the mid column, [0, {thickness:g}] m",
                    "depths are positive downwards from the surface",
                )
        section = shapely.buffer(self.section, COORDINATE_TOLERANCE)
        for i, point in enumerate(self.output.points):
            if not section.covers(shapely.Point(point)):
                raise InvalidInput(
                    f"scene.output.points[{i}]",
                    point,
                    f"must lie in the section, x {left:g} to {right:g}, y {bottom:g} to {top:g} m",
                    "points are (x, y) in the section's own coordinates",
                )

    # What follows from the scene.

    @property
    def section(self) -> BaseGeometry:
        """All regions joined, as shapely geometry."""
        return _joined(tuple(region.shape for region in self.regions))

    @property
    def outline(self) -> Outline:
        """Base, sides and ground surface of the section."""
        return _outlined(tuple(region.shape for region in self.regions))

    @property
    def side_kinds(self) -> tuple[str, str]:
        """Kind of the left and of the right side."""
        sides = self.sides
        return (sides.left.kind, sides.right.kind) if isinstance(sides, Sides) else (sides.kind, sides.kind)

    def arrivals(self, stage: Shaking) -> list[Arrival]:
        """The stretches of the base and the waves that come to them in a stage, from left to right."""
        x0, _, x1, _ = self.bounds
        return stage.base.arrivals(x0, x1)

    def duration(self, stage: AnyStage) -> float | None:
        """Duration of a stage in s: as given, or else until the last motion has passed, which is read.

        None for gravity, which ends at rest, and for seepage to its steady state.
        """
        if isinstance(stage, Gravity):
            return None
        if not isinstance(stage, Shaking) or stage.duration is not None:
            return stage.duration
        own = max(motion.load().duration if motion else 0.0 for motion in (stage.motion, stage.vertical))
        return max(
            arrival.latest + (arrival.motion.load().duration if arrival.motion else own)
            for arrival in self.arrivals(stage)
        )

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(x0, y0, x1, y1) of the section, m."""
        boxes = shapely.bounds([region.geometry for region in self.regions])
        (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
        return float(x0), float(y0), float(x1), float(y1)

    def condition_line(self, condition: AnyCondition) -> BaseGeometry:
        """The line on which a hydraulic condition holds."""
        return line_of(condition, self.outline)

    def moving_conditions(self, stage: Shaking) -> list[tuple[AnyCondition, float | None]]:
        """Conditions of the water in a shaking stage, and what each prescribed at rest if it held there.

        Where the stage leaves them to those before, these stay as they last were, save on free-field sides.
        """
        return _scene_water.moving_conditions(self, stage)

    def water_level_at(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Elevation of the water table above each x, m; below everything in a dry scene."""
        table = self.water_table
        if table is None:
            return np.full(np.shape(x), -np.inf)
        if table.points is not None:
            levels: NDArray[np.float64] = np.interp(x, *np.transpose(table.points))
            return levels
        level = self.bounds[3] - table.depth if table.depth is not None else table.elevation
        return np.full(np.shape(x), level)

    @property
    def seepage(self) -> Seepage | None:
        """The seepage stage, if there is one."""
        first = self.stages[0]
        return first if isinstance(first, Seepage) else None

    @property
    def is_at_rest(self) -> bool:
        """Whether water is all that moves: no stage looks at the grains."""
        return len(self.stages) == 1 and self.seepage is not None

    @property
    def holds_suction(self) -> bool:
        """Whether soil above the water table holds water by its retention curve, or is dry."""
        return self.seepage is not None or (self.water_table is not None and self.water_table.above != "dry")

    @property
    def is_partly_saturated(self) -> bool:
        """Whether some pores hold air at the start, or may come to."""
        if self.water is None:
            return False
        return bool(_scene_water.regions_above_water(self)) or (
            self.seepage is not None and any(region.retention for region in self.regions)
        )

    @property
    def stage_names(self) -> list[str]:
        """One name per stage: its kind, and from the second of a kind on its number: shaking, shaking_2."""
        kinds = [stage.kind for stage in self.stages]
        counts = [kinds[: i + 1].count(kind) for i, kind in enumerate(kinds)]
        return [kind if count == 1 else f"{kind}_{count}" for kind, count in zip(kinds, counts, strict=True)]

    @property
    def uses_acceleration_term(self) -> bool:
        """Whether the pore water's acceleration enters the flow (numerics.acceleration_term resolved)."""
        conductivities = [region.conductivity[0] for region in self.regions]
        if self.water is None or max(conductivities) == 0.0 or self.numerics.acceleration_term == "off":
            return False
        return (
            self.numerics.acceleration_term == "on"
            or max(conductivities) <= _core.ACCELERATION_TERM_CONDUCTIVITY
        )

    def active_physics(self) -> list[tuple[str, bool, str]]:
        """What this scene computes and what it is spared: (name, active, reason)."""
        wet = self.water is not None
        permeable = [region.name for region in self.regions if region.hydraulic_conductivity]
        # Linear elasticity remembers nothing but the stress.
        stateful = [region.name for region in self.regions if not isinstance(region.material, Elastic)]
        shakings = [stage for stage in self.stages if isinstance(stage, Shaking)]
        shaken = bool(shakings)
        flowing = [stage for stage in self.stages if isinstance(stage, RunOut)]
        moves = shaken or bool(flowing)
        damping = self.numerics.local_damping
        damped = [stage.rayleigh for stage in shakings if stage.rayleigh]
        dry, still = "the scene has no water", "no shaking stage"
        absorbing = [stage for stage in shakings if stage.base_vertical == "absorbing"]
        passing = [told for stage in shakings if (told := _passage(stage.base))]

        def active(name: str, reason: str, *missing: tuple[bool, str]) -> tuple[str, bool, str]:
            """`name` is active for its reason, unless something is missing: then the first such reason."""
            lacking = [why for is_missing, why in missing if is_missing]
            return (name, not lacking, lacking[0] if lacking else reason)

        no_flow = ((not wet, dry), (not moves, still), (not permeable, "no region is permeable"))
        term = self.numerics.acceleration_term
        compared = "no region exceeds" if self.uses_acceleration_term else "a region exceeds"
        chosen = f"{compared} {_core.ACCELERATION_TERM_CONDUCTIVITY:g} m/s"
        if term != "auto":
            chosen = f"numerics.acceleration_term is {term!r}"
        return [
            active("pore water", self._water_told(), (not wet, dry)),
            active(
                "seepage",
                "to its steady state"
                if self.seepage and self.seepage.duration is None
                else "for its duration",
                (not wet, dry),
                (self.seepage is None, "no seepage stage"),
            ),
            active("water diffusion", f"conductivity in {', '.join(permeable)}", *no_flow),
            active("water acceleration", chosen, *no_flow, (not self.uses_acceleration_term, chosen)),
            active(
                "partial saturation",
                ", ".join(region.name for region in self.regions if region.retention)
                or "dry above the water",
                (not wet, dry),
                (not self.is_partly_saturated, "the water table is nowhere below the ground"),
            ),
            active(
                "soil state",
                f"in {', '.join(stateful)}",
                (not stateful, "every region is linearly elastic"),
                (not moves, still),
            ),
            active("base dashpots", "compliant base while shaking", (not shaken, still)),
            active(
                "vertical waves",
                "under a vertical motion" if any(s.vertical for s in absorbing) else "the base absorbs them",
                (not shaken, still),
                (not absorbing, "the base is a roller vertically"),
            ),
            active(
                "wave passage",
                "; ".join(passing),
                (not shaken, still),
                (not passing, "the wave reaches all of the base at once"),
            ),
            active(
                "free-field columns",
                self._columns_told(),
                (isinstance(self.sides, Periodic), "the sides are periodic"),
                ("free-field" not in self.side_kinds, f"the sides are {' and '.join(self.side_kinds)}"),
                (not shaken, still),
            ),
            active(
                "local damping",
                f"numerics.local_damping is {damping:g}",
                (not moves, still),
                (damping == 0.0, "numerics.local_damping is 0"),
            ),
            active(
                "Rayleigh damping",
                "; ".join(str(rayleigh) for rayleigh in damped),
                (not shaken, still),
                (not damped, "no shaking stage asks for it"),
            ),
            active(
                "dispersion correction",
                "numerics.dispersion_correction is true",
                (not shaken, still),
                (not self.numerics.dispersion_correction, "numerics.dispersion_correction is false"),
            ),
            active(
                "run-out",
                f"large displacements, viscosity {flowing[0].viscosity:g}" if flowing else "",
                (not flowing, "no run-out stage"),
            ),
            (
                "velocity filter",
                self.numerics.filter_strength > 0.0,
                "the printed operators have none"
                if self.numerics.operators == "printed"
                else f"numerics.velocity_filter is {self.numerics.filter_strength:g}",
            ),
        ]

    def _water_told(self) -> str:
        x0, _, x1, _ = self.bounds
        low, high = sorted(self.water_level_at(np.array([x0, x1])))
        told = f"{low:g} m" if low == high else f"{low:g} to {high:g} m"
        return f"water table at elevation {told}"

    def _columns_told(self) -> str:
        """Which sides have a column, and how many particles all columns together."""
        x0, _, x1, _ = self.bounds
        edges = ((x0, "left", self.outline.left), (x1, "right", self.outline.right))
        free = [
            (self._side_profile(x), round((top - bottom) / self.spacing), hand)
            for (x, hand, (bottom, top)), kind in zip(edges, self.side_kinds, strict=True)
            if kind == "free-field"
        ]
        hands = " and ".join(hand for _, _, hand in free)
        passing = any(isinstance(stage, Shaking) and _passage(stage.base) for stage in self.stages)
        alike = len(free) == 2 and free[0][0] == free[1][0] and not passing
        distinct = free[:1] if alike else free
        particles = sum(rows for _, rows, _ in distinct)
        number = f"{len(distinct)} column{'s' if len(distinct) > 1 else ''}"
        return f"on the {hands}: {number} of {particles} particles{' in all' if len(distinct) > 1 else ''}"

    def with_motion(self, motion: Motion | MotionSpec) -> Scene:
        """The same scene shaken by another motion, in every stage that has one."""
        spec = motion if isinstance(motion, MotionSpec) else MotionSpec.of(motion)
        shaken = [isinstance(stage, Shaking) and stage.motion is not None for stage in self.stages]
        if not any(shaken):
            raise InvalidInput(
                "scene.stages",
                self.stage_names,
                "must hold a shaking stage with a motion for another to replace it",
                "give the stage a motion in the scene",
            )
        for i, stage in enumerate(self.stages):
            if isinstance(stage, Shaking) and stage.motion is not None and stage.vertical is not None:
                raise InvalidInput(
                    f"scene.stages[{i}].vertical",
                    stage.vertical,
                    "is a component of the motion that another would replace",
                    "make the scene with Shaking(motion, vertical=...)",
                )
        stages = tuple(
            stage.model_copy(update={"motion": spec}) if has_motion else stage
            for stage, has_motion in zip(self.stages, shaken, strict=True)
        )
        return self.model_copy(update={"stages": stages})

    def plan(self) -> Plan:
        """What would be computed and what it would cost."""
        from ..run.plan import plan

        return plan(self)

    def profile(
        self,
        x: float | None = None,
        *,
        curves: CurveChoice = "darendeli",
        thickness: float = DEFAULT_LAYER,
    ) -> SiteProfile:
        """The ground at `x` as level layers on a half-space, for equivalent-linear analysis.

        Each layer has the unit weight and the small-strain stiffness that its soil has at rest, at the
        geostatic stress in its middle. The half-space is the base of the first shaking stage. Linearly
        elastic soils stay linear and undamped.

        Parameters
        ----------
        x : m; default the middle of the section
        curves : stiffness and damping over strain: "darendeli", the published mean for sand (2001), or
            "material", those of the soil model itself, which takes seconds per layer
        thickness : of a layer at most, m, but not less than a particle's spacing
        """
        from ..site._profile import profile

        return profile(self, x, curves=curves, thickness=thickness)

    # Files.

    def to_toml(self, path: str | Path | None = None, *, resolved: bool = False) -> str:
        """The scene as TOML text, also written to `path` if given.

        It holds what was said; `resolved=True` adds every default, so that the text keeps its meaning when
        defaults change. Either way :meth:`from_toml` gives an equal scene.
        """
        said: dict[str, Any] = self.model_dump(exclude_none=True, exclude_unset=not resolved)
        text = _toml.text(said)
        if path is not None:
            try:
                Path(path).write_text(text, encoding="utf-8")
            except OSError as error:
                raise InvalidInput(
                    "path", str(path), f"must be writable: {error.strerror}", "check folder and rights"
                ) from error
        return text

    @classmethod
    def from_toml(cls, path_or_text: str | Path) -> Scene:
        """Scene from a TOML file, or from TOML text (recognised by its line breaks).

        Motion files named in it are taken relative to the scene's file. Raises :class:`InvalidInput`.
        """
        if isinstance(path_or_text, str) and "\n" in path_or_text:
            return cls._from_text(path_or_text, "text", Path())
        path = Path(path_or_text)
        return cls._from_text(_toml.read(path, "scene"), str(path), path.parent)

    @classmethod
    def _from_text(cls, text: str, origin: str, folder: Path) -> Scene:
        scene = cls(**_toml.parse(text, "scene", origin))
        stages = tuple(_anchored(stage, folder) for stage in scene.stages)
        return scene.model_copy(update={"stages": stages})


# A scene asks for these again and again; scenes made of one another mostly share them.
@functools.lru_cache(maxsize=8)
def _joined(shapes: tuple[Box | Polygon, ...]) -> BaseGeometry:
    """Shapes joined into one."""
    return shapely.union_all([shape.geometry for shape in shapes], grid_size=COORDINATE_TOLERANCE)


@functools.lru_cache(maxsize=8)
def _outlined(shapes: tuple[Box | Polygon, ...]) -> Outline:
    """Edges of the section that shapes make together."""
    return Outline.of(_joined(shapes))


def _passage(base: CompliantBase) -> str:
    """How a wave comes to different places of a base at different times; empty where it does not."""
    if base.apparent_velocity is not None:
        return f"at an apparent {base.apparent_velocity:g} m/s"
    return f"{len(base.segments)} segments" if len(base.segments) > 1 else ""


def _anchored(stage: AnyStage, folder: Path) -> AnyStage:
    """The stage with its motions' files found from `folder`."""
    return stage.with_motions(lambda spec: spec.anchored(folder)) if isinstance(stage, Shaking) else stage
