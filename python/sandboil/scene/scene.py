"""The scene: a section of ground and the stages that it goes through. Units kN, m, s, Mg; x horizontal, y up.

Everything is checked when the scene is made, so that a scene that exists can be computed.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from pydantic.config import JsonDict
from shapely.geometry.base import BaseGeometry

from .. import _core
from .._checked import checked
from .._errors import InvalidInput
from .._model import Model
from .._types import MAX_PARTS, Many, Number, Positive
from ..ground.outline import Outline
from ..motion import Motion
from ..run.plan import Plan, plan
from ..site._profile import DEFAULT_LAYER, CurveChoice, SiteProfile, profile
from . import moving_water, scene_file, section
from .checks import CHECKS
from .conditions import AnyCondition
from .edges import AnySides, Arrival, Periodic, Sides
from .motion_spec import MotionSpec
from .numerics import Numerics
from .output import Output
from .physics import Physics, active_physics
from .region import Region
from .stages import AnyStage, Gravity, RunOut, Seepage, Shaking, Stage
from .water import Water, WaterTable

_REGIONS: JsonDict = {"remedy": "join regions of the same soil in one polygon"}
_STAGES: JsonDict = {"remedy": "for example Gravity() and Shaking(motion)"}


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

    @model_validator(mode="after")
    def _computable(self) -> Self:
        for check in CHECKS:
            check(self)
        return self

    # Geometry

    @property
    def section(self) -> BaseGeometry:
        """All regions joined, as shapely geometry."""
        return section.joined(tuple(region.shape for region in self.regions))

    @property
    def outline(self) -> Outline:
        """Base, sides and ground surface of the section."""
        return section.outlined(tuple(region.shape for region in self.regions))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(x0, y0, x1, y1) of the section, m."""
        return section.bounds_of(self.regions)

    @property
    def side_kinds(self) -> tuple[str, str]:
        """Kind of the left and of the right side."""
        sides = self.sides
        return (sides.left.kind, sides.right.kind) if isinstance(sides, Sides) else (sides.kind, sides.kind)

    @property
    def is_periodic(self) -> bool:
        """Whether the section repeats beyond its sides."""
        return self.sides.kind == "periodic"

    # Stages

    @property
    def stage_names(self) -> list[str]:
        """One name per stage: its kind, with a number from the second of a kind: shaking, shaking_2."""
        kinds = [stage.kind for stage in self.stages]
        counts = [kinds[: i + 1].count(kind) for i, kind in enumerate(kinds)]
        return [kind if count == 1 else f"{kind}_{count}" for kind, count in zip(kinds, counts, strict=True)]

    @property
    def seepage(self) -> Seepage | None:
        """The seepage stage, if there is one."""
        first = self.stages[0]
        return first if isinstance(first, Seepage) else None

    @property
    def statics(self) -> Gravity:
        """The gravity stage; the default one in a scene without it."""
        return next((stage for stage in self.stages if isinstance(stage, Gravity)), Gravity())

    @property
    def shakings(self) -> list[tuple[int, Shaking]]:
        """The shaking stages, each with its index among all stages."""
        return [(i, stage) for i, stage in enumerate(self.stages) if isinstance(stage, Shaking)]

    @property
    def run_out(self) -> RunOut | None:
        """The run-out, if there is one."""
        last = self.stages[-1]
        return last if isinstance(last, RunOut) else None

    @property
    def is_at_rest(self) -> bool:
        """Whether water is all that moves: the scene has no stage with grains."""
        return len(self.stages) == 1 and self.seepage is not None

    def arrivals(self, stage: Shaking) -> list[Arrival]:
        """The stretches of the base and the waves that arrive there in a stage, from left to right."""
        x0, _, x1, _ = self.bounds
        return stage.base.arrivals(x0, x1)

    def duration(self, stage: AnyStage) -> float | None:
        """Duration of a stage in s: as given, or else until the last motion has passed, which is read.

        None for gravity, which ends at rest, and for seepage to its steady state.
        """
        x0, _, x1, _ = self.bounds
        return stage.whole_duration((x0, x1))

    def with_motion(self, motion: Motion | MotionSpec) -> Scene:
        """The same scene with another motion in every stage that has one."""
        spec = motion if isinstance(motion, MotionSpec) else MotionSpec.of(motion)
        shaken = [(i, stage) for i, stage in self.shakings if stage.motion is not None]
        if not shaken:
            raise InvalidInput(
                "scene.stages",
                self.stage_names,
                "must hold a shaking stage with a motion, which the given motion replaces",
                "give the stage a motion in the scene",
            )
        for i, stage in shaken:
            if stage.vertical is not None:
                raise InvalidInput(
                    f"scene.stages[{i}].vertical",
                    stage.vertical,
                    "is a component of the motion that another would replace",
                    "make the scene with Shaking(motion, vertical=...)",
                )
        return self.changed(**{f"stages[{i}].motion": spec for i, _ in shaken})

    # Water

    def water_level_at(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Elevation of the water table above each x, m; below everything in a dry scene."""
        if self.water_table is None:
            return np.full(np.shape(x), -np.inf)
        return self.water_table.level_at(x, highest_ground=self.bounds[3])

    def condition_line(self, condition: AnyCondition) -> BaseGeometry:
        """The line on which a hydraulic condition holds."""
        return condition.line(self.outline)

    def moving_conditions(self, stage: Shaking) -> list[tuple[AnyCondition, float | None]]:
        """Conditions of the water in a shaking stage, and the value of each at rest if it held there.

        Where the stage names none, those before stay as they last were, but for those on free-field sides.
        """
        return moving_water.moving_conditions(self, stage)

    @property
    def holds_suction(self) -> bool:
        """Whether soil above the water table holds water by its retention curve; else it is dry."""
        return self.seepage is not None or (self.water_table is not None and self.water_table.above != "dry")

    @property
    def is_partly_saturated(self) -> bool:
        """Whether some pores hold air at the start, or may later."""
        if self.water is None:
            return False
        return bool(section.regions_above_water(self)) or (
            self.seepage is not None and any(region.retention for region in self.regions)
        )

    @property
    def uses_acceleration_term(self) -> bool:
        """Whether the pore water's acceleration enters the flow (numerics.acceleration_term resolved)."""
        largest = max(region.conductivity.major for region in self.regions)
        choice = self.numerics.acceleration_term
        if self.water is None or largest == 0.0 or choice == "off":
            return False
        return choice == "on" or largest <= _core.ACCELERATION_TERM_CONDUCTIVITY

    # Before a run

    def active_physics(self) -> list[Physics]:
        """All physics that a scene can leave out: (name, on, why) for each."""
        return active_physics(self)

    def plan(self) -> Plan:
        """What would be computed and what it would cost."""
        return plan(self)

    @checked("scene")
    def profile(
        self,
        x: Number | None = None,
        *,
        curves: CurveChoice = "darendeli",
        thickness: Positive = DEFAULT_LAYER,
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
        return profile(self, x, curves=curves, thickness=thickness)

    # Files

    def to_toml(self, path: str | Path | None = None, *, resolved: bool = False) -> str:
        """The scene as TOML text, also written to `path` if given.

        It holds what was given; `resolved=True` adds every default, so that the text keeps its meaning when
        defaults change. Either way :meth:`from_toml` gives an equal scene.
        """
        text = scene_file.text_of(self, resolved=resolved)
        if path is not None:
            scene_file.write(text, path)
        return text

    @classmethod
    def from_toml(cls, path_or_text: str | Path) -> Scene:
        """Scene from a TOML file, or from TOML text (recognised by its line breaks).

        Motion files named in it are taken relative to the scene's file. Raises :class:`InvalidInput`.
        """
        return cls(**scene_file.table_of(path_or_text))
