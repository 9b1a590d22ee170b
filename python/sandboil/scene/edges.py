"""The ground beyond the base and the sides of a section. Units kN, m, s, Mg; x horizontal, y up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from .._errors import InvalidInput
from .._model import Model
from .._types import COORDINATE_TOLERANCE, MAX_PARTS, Many, NonNegative, Number, Point, Positive
from .motion_spec import GivenMotion, MotionSpec

if TYPE_CHECKING:
    from ..motion import Motion

# Vp/Vs of an elastic solid of Poisson's ratio zero, the least that soil and rock have.
LEAST_SPEED_RATIO = sqrt(2.0)


class Periodic(Model):
    """A section that repeats without end: what leaves on one side enters on the other."""

    _label: ClassVar[str] = "sides"

    kind: Literal["periodic"] = "periodic"


class FreeField(Model):
    """Level ground that continues beyond the side.

    In the gravity stage a roller. In shaking a column of the soil at that side, solved on its own, pushes the
    section as the ground beyond would, and dashpots absorb the waves that leave the section.
    """

    _label: ClassVar[str] = "side"

    kind: Literal["free-field"] = "free-field"


class Roller(Model):
    """A smooth rigid wall in every stage: nothing crosses it, and it takes no shear."""

    _label: ClassVar[str] = "side"

    kind: Literal["roller"] = "roller"


class Fixed(Model):
    """A rough rigid wall in every stage: nothing moves on it."""

    _label: ClassVar[str] = "side"

    kind: Literal["fixed"] = "fixed"


Side = Annotated[FreeField | Roller | Fixed, Field(discriminator="kind")]


class Sides(Model):
    """A left and a right side that differ: each a :class:`FreeField`, :class:`Roller` or :class:`Fixed`."""

    _label: ClassVar[str] = "sides"
    _positional: ClassVar[tuple[str, ...]] = ("left", "right")

    kind: Literal["sides"] = "sides"
    left: Side
    right: Side

    if TYPE_CHECKING:

        def __init__(self, left: FreeField | Roller | Fixed, right: FreeField | Roller | Fixed) -> None: ...


AnySides = Annotated[Periodic | FreeField | Roller | Fixed | Sides, Field(discriminator="kind")]


class BaseSegment(Model):
    """A stretch of the base, from `x[0]` to `x[1]` m, that the wave reaches `delay` s after the stage begins.

    The wave is that of the stage's motion unless the segment has another `motion`.
    """

    _label: ClassVar[str] = "segment"
    _positional: ClassVar[tuple[str, ...]] = ("x",)

    x: Point = Field(description="left and right, m")
    delay: NonNegative = Field(
        default=0.0, description="s", json_schema_extra={"remedy": "count from the stage's beginning"}
    )
    motion: GivenMotion = None

    if TYPE_CHECKING:

        def __init__(
            self,
            x: tuple[float, float],
            *,
            delay: float = 0.0,
            motion: Motion | MotionSpec | None = None,
        ) -> None: ...

    @model_validator(mode="after")
    def _not_empty(self) -> BaseSegment:
        if self.x[1] - self.x[0] <= COORDINATE_TOLERANCE:
            raise InvalidInput(
                "segment.x",
                self.x,
                "must be (left, right) with left < right, else the segment is empty",
                "the left end comes first",
            )
        return self


@dataclass(frozen=True)
class Arrival:
    """A stretch of the base and the wave that reaches it.

    Attributes
    ----------
    x : left and right end, m
    motion : of the stretch itself; None: that of the stage
    delay : until the wave is at the left end, s
    slowness : by how much later it is at 1 m to the right, s/m
    """

    x: tuple[float, float]
    motion: MotionSpec | None = None
    delay: float = 0.0
    slowness: float = 0.0

    @property
    def latest(self) -> float:
        """Time at which the wave has reached all of the stretch, s."""
        return self.delay + max(self.slowness * (self.x[1] - self.x[0]), 0.0)


class CompliantBase(Model):
    """Half-space below the section that sends the motion up and lets downgoing waves leave.

    Its impedance is that of the soil at the base when the stage begins, unless `Vs` and `density` are given.
    Vertically it is a roller, which holds the weight and reflects compression waves, or absorbs them, as it
    does by default under a vertical motion. `Vp` is needed beside `Vs` where compression waves matter: on a
    base that absorbs them or is not level. An absorbing base holds the weight by the force at the
    beginning of shaking, so that it sinks under a load added later: keep such stages short.

    With an `apparent_velocity` the wave runs along the base, to the right if positive and to the left if
    negative, from the end of the base that it meets first. With `segments`, which must cover the base, each
    stretch has a delay and may have another motion.
    """

    _label: ClassVar[str] = "base"
    _positional: ClassVar[tuple[str, ...]] = ("Vs", "density")

    kind: Literal["compliant"] = "compliant"
    Vs: Positive | None = Field(
        default=None,
        description="shear wave velocity, m/s",
        json_schema_extra={"remedy": "rock has 300 to 3000"},
    )
    density: Positive | None = Field(
        default=None, description="Mg/m3", json_schema_extra={"remedy": "2100 kg/m3 is written 2.1"}
    )
    Vp: Positive | None = Field(
        default=None,
        description="compression wave velocity, m/s",
        json_schema_extra={"remedy": "Vp = Vs sqrt((2 - 2 nu)/(1 - 2 nu))"},
    )
    vertical: Literal["roller", "absorbing"] | None = None
    apparent_velocity: Number | None = Field(default=None, description="along the base, m/s")
    segments: Annotated[Many[BaseSegment], Field(max_length=MAX_PARTS)] = ()

    if TYPE_CHECKING:

        def __init__(
            self,
            Vs: float | None = None,
            density: float | None = None,
            *,
            Vp: float | None = None,
            vertical: Literal["roller", "absorbing"] | None = None,
            apparent_velocity: float | None = None,
            segments: Sequence[BaseSegment] = (),
        ) -> None: ...

    @model_validator(mode="after")
    def _whole_half_space(self) -> CompliantBase:
        if (self.Vs is None) != (self.density is None):
            raise InvalidInput(
                "base",
                {"Vs": self.Vs, "density": self.density},
                "must have both Vs and density, or neither: then the soil at the base gives them",
                "rock of 400 m/s has about 2.1 Mg/m3",
            )
        if self.Vp is None:
            return self
        if self.Vs is None:
            raise InvalidInput(
                "base.Vp",
                self.Vp,
                "needs Vs and density: without them the soil at the base gives all three",
                "give them too, or leave Vp out",
            )
        if self.Vp < LEAST_SPEED_RATIO * self.Vs:
            raise InvalidInput(
                "base.Vp",
                self.Vp,
                f"must be at least {LEAST_SPEED_RATIO * self.Vs:.4g} m/s for Vs = {self.Vs:g} m/s",
                "sqrt(2) Vs is that of a Poisson's ratio of zero; Vp = Vs sqrt((2 - 2 nu)/(1 - 2 nu))",
            )
        return self

    @model_validator(mode="after")
    def _one_way_of_arrival(self) -> CompliantBase:
        if self.apparent_velocity is None:
            return self
        if self.apparent_velocity == 0.0:
            raise InvalidInput(
                "base.apparent_velocity",
                self.apparent_velocity,
                "must not be zero: positive runs to the right, negative to the left",
                "leave it out for a wave that reaches the whole base at once",
            )
        if self.segments:
            raise InvalidInput(
                "base.apparent_velocity",
                self.apparent_velocity,
                "must be left out beside segments, which have their own delays",
                "delay = distance/apparent velocity in every segment",
            )
        return self

    def arrivals(self, x0: float, x1: float) -> list[Arrival]:
        """The stretches of a base from `x0` to `x1` (m), from left to right."""
        if self.segments:
            ordered = sorted(self.segments, key=lambda segment: segment.x)
            return [Arrival(segment.x, segment.motion, segment.delay) for segment in ordered]
        if self.apparent_velocity is None:
            return [Arrival((x0, x1))]
        slowness = 1.0 / self.apparent_velocity
        return [Arrival((x0, x1), delay=max(-slowness * (x1 - x0), 0.0), slowness=slowness)]
