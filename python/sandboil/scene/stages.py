"""The stages that a scene goes through."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from .._errors import InvalidInput
from .._model import Model
from .._types import MAX_PARTS, Count, Many, Number, Point, Positive
from .conditions import AnyCondition, Condition
from .edges import CompliantBase
from .motion_spec import GivenMotion, MotionSpec

if TYPE_CHECKING:
    from ..motion import Motion

Poisson = Annotated[Number, Field(ge=0.0, lt=0.5)]
# Hz, far beyond earthquakes and sites on both sides; outside, damping would make time steps far too short.
Frequency = Annotated[Number, Field(ge=0.01, le=1000.0)]


class _Stage(Model):
    """What all stages have in common."""

    _label: ClassVar[str] = "stage"

    # Whether the ground moves: only such a stage has histories and energies.
    moves: ClassVar[bool] = False

    if TYPE_CHECKING:
        kind: str

        @property
        def duration(self) -> float | None: ...

    @property
    def motions(self) -> list[tuple[str, MotionSpec | None]]:
        """Every motion of the stage with its place in it."""
        return []

    def with_motions(self, change: Callable[[MotionSpec], MotionSpec]) -> Self:
        """The same stage with every motion changed."""
        return self

    def whole_duration(self, ends: tuple[float, float]) -> float | None:
        """Duration in s as given, or else until the last motion has passed, which is read.

        `ends` are those of the base, m. None for a stage that ends at rest or at a steady state.
        """
        return self.duration


# Error of a step of seepage in time.
DEFAULT_TOLERANCE = 0.002


class Seepage(_Stage):
    """Water that flows through the ground at rest, before the other stages.

    Without a `duration` (s) the steady state, found without time. It starts from the scene's water table at
    rest, and its final pore water is that of the stages that follow.

    In time, the ground stores water also by expansion of its skeleton under constant total vertical
    stress, with the small-strain moduli of its soils under the effective stress at rest. `tolerance` is
    the error of a time step, of degrees of saturation and of heads over their range; the error of the
    result falls as its square root. A steady state has none.
    """

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
    tolerance: Number = Field(
        default=DEFAULT_TOLERANCE,
        ge=1.0e-5,
        le=0.05,
        description="error of a time step, of saturation and of heads over their range",
        json_schema_extra={"remedy": "leave it out for 0.002"},
    )

    @model_validator(mode="after")
    def _no_idle_tolerance(self) -> Seepage:
        """Refuse an error in time of a steady state."""
        if self.duration is None and self.tolerance != DEFAULT_TOLERANCE:
            raise InvalidInput(
                f"{self._label}.tolerance",
                self.tolerance,
                "has no effect on a steady state, which has no steps in time",
                "give a duration, or leave it out",
            )
        return self

    if TYPE_CHECKING:

        def __init__(
            self,
            conditions: Sequence[AnyCondition],
            *,
            duration: float | None = None,
            tolerance: float = DEFAULT_TOLERANCE,
        ) -> None: ...


class Gravity(_Stage):
    """Static stage: self-weight with elastic soils, to rest, on a base that is rough or smooth.

    It ends when the largest acceleration falls below `tolerance` (of gravity). Poisson's ratio is K0/(1 + K0)
    of each region unless `initial_poisson_ratio` is given for all.
    """

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
        description="largest number of steps",
        json_schema_extra={"remedy": "leave it out for 200000"},
    )
    initial_poisson_ratio: Poisson | None = Field(
        default=None,
        description="nu of the ground at rest",
        json_schema_extra={"remedy": "leave it out for K0/(1 + K0) of each region"},
    )
    base: Literal["no-slip", "free-slip"] = "no-slip"

    @property
    def duration(self) -> None:
        """None: the stage ends when the ground is at rest."""
        return None


class Rayleigh(Model):
    """Viscous damping of a `ratio` of critical at two `frequencies`, less between them and more outside.

    A drag in proportion to mass, on the absolute velocity, and a viscous stress in proportion to the soil's
    present elastic stiffness: xi(w) = a/(2 w) + b w/2. The second decreases as sand softens, and shortens the
    time step, since it damps the shortest waves on the grid most. Usual ratios are 0.005 to 0.03.
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


class Shaking(_Stage):
    """Dynamic stage on a compliant base, with the soils' own models and the flow of water.

    Without a motion the ground rests on its dashpots for `duration` seconds. With one, `duration` is that of
    the motion and of its way along the base unless given; a longer one adds quiet time. `vertical` is the
    vertical component of the same record (same kind and spacing), positive upwards; the base then absorbs
    vertically too. `rayleigh` damps beside the soil's own hysteresis.

    `conditions` are those of the water while the ground moves, with time counted from the stage's beginning.
    Left out, those before hold with their last values; an empty list ends them all. Edges without one are
    impermeable, but for the ground surface, which keeps its pressure. Lines move with the ground.
    """

    _positional: ClassVar[tuple[str, ...]] = ("motion",)

    moves: ClassVar[bool] = True

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

    def with_motions(self, change: Callable[[MotionSpec], MotionSpec]) -> Self:
        """The same stage with every motion changed."""
        return self.changed(**{place: change(motion) for place, motion in self.motions if motion is not None})

    def whole_duration(self, ends: tuple[float, float]) -> float | None:
        """Duration in s as given, or else until the last motion has passed all of the base, which is read."""
        if self.duration is not None:
            return self.duration
        own = max(motion.load().duration if motion else 0.0 for motion in (self.motion, self.vertical))
        return max(
            arrival.latest + (arrival.motion.load().duration if arrival.motion else own)
            for arrival in self.base.arrivals(*ends)
        )


class RunOut(_Stage):
    """Run-out: large displacements under the weight of the ground, until it comes to rest.

    Base and sides are fixed as in statics, and the ground moves on them from the state and the motion at the
    end of the stage before. It is the last stage.

    `open_sides` are removed, as a gate is, and the base continues beyond them. `viscosity` is Monaghan's
    coefficient of the forces between particles that approach each other. `still_water` is the surface of
    the water around the ground, (x, y) from left to right, level beyond its ends; the default is the water
    surface at rest, with ponds; with no points there is no water. Pore pressure above the hydrostatic
    pressure of this water drains through the free surface, which moves with the ground. Soil above the
    water keeps its suction and its water content.
    """

    _positional: ClassVar[tuple[str, ...]] = ("duration",)

    moves: ClassVar[bool] = True

    kind: Literal["run-out"] = "run-out"
    duration: Positive = Field(
        description="s",
        json_schema_extra={"remedy": "a heap falls for sqrt(2 height/gravity) s, and moves twice as long"},
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
Stage = Annotated[AnyStage, Field(discriminator="kind")]
