"""Sources of ground motions, as a scene stores them."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from .._errors import InvalidInput, nearest_name
from .._model import Model
from .._types import Many, Number, Positive
from ..motion import Motion


class MotionSpec(Model):
    """Source of a ground motion, so that a scene can be written to a file.

    Exactly one source: `file` (PEER .AT2, or a CSV with its `unit` and `column` unless its header has them),
    `synthetic` or `ricker` (arguments of the :class:`Motion` constructors of those names), or `dt` with
    `acceleration_g` or `velocity` (m/s). `scale` multiplies the motion.
    """

    _label: ClassVar[str] = "motion"

    file: str | None = Field(default=None, description="path, relative to the scene's file")
    unit: str | None = Field(default=None, description="unit of a CSV's values")
    column: Annotated[int, Field(strict=True, ge=0)] | str | None = None
    synthetic: dict[str, int | Number] | None = None
    ricker: dict[str, int | Number] | None = None
    dt: Positive | None = Field(
        default=None,
        description="time between samples, s",
        json_schema_extra={"remedy": "in seconds, for example 0.005"},
    )
    acceleration_g: Many[Number] | None = None
    velocity: Many[Number] | None = Field(default=None, description="m/s")
    kind: Literal["outcrop", "within", "upgoing"] = "outcrop"
    scale: Number | None = None

    @field_validator("synthetic", "ricker")
    @classmethod
    def _complete(cls, given: dict[str, float] | None, field: ValidationInfo) -> dict[str, float] | None:
        """Check the generator's arguments and add its defaults, so that the scene keeps its meaning."""
        if given is None:
            return None
        generator = str(field.field_name)
        known = dict(inspect.signature(getattr(Motion, generator)).parameters)
        known.pop("kind", None)
        for name, value in given.items():
            if name not in known:
                meant = nearest_name(name, known)
                raise InvalidInput(
                    f"{generator}.{name}",
                    value,
                    f"unknown key, known are {', '.join(known)}",
                    f"did you mean {meant!r}?" if meant else "leave it out, or take one of these",
                )
        for name, parameter in known.items():
            if parameter.default is inspect.Parameter.empty and name not in given:
                raise InvalidInput(
                    f"{generator}.{name}", None, "is required", f"see Motion.{generator} for what it takes"
                )
        defaults = {name: parameter.default for name, parameter in known.items()}
        complete = defaults | given
        return {name: complete[name] for name in known if complete[name] is not None}

    @model_validator(mode="after")
    def _one_source(self) -> MotionSpec:
        sources = ("file", "synthetic", "ricker", "acceleration_g", "velocity")
        given = [name for name in sources if getattr(self, name) is not None]
        if len(given) != 1:
            raise InvalidInput(
                "motion",
                given,
                f"must have exactly one source of {', '.join(sources)}",
                "for example file = 'record.AT2'",
            )
        source = given[0]
        if (self.dt is not None) != (source in ("acceleration_g", "velocity")):
            raise InvalidInput(
                "motion.dt",
                self.dt,
                "is given with acceleration_g or velocity, and only with them",
                "files and generators have a time step; that of samples is in s, for example 0.005",
            )
        return self

    @classmethod
    def of(cls, motion: Motion) -> MotionSpec:
        """The source of a motion that is unchanged since, else its samples."""
        if motion.source is None:
            samples: dict[str, Any] = {motion.quantity: getattr(motion, motion.quantity)}
            return cls(dt=motion.dt, kind=motion.kind, **samples)
        source = dict(motion.source)
        if "file" in source:
            # The name is relative to the working folder; a scene's file may be written to another one.
            source["file"] = str(Path(source["file"]).absolute())
        return cls(**source)

    def load(self) -> Motion:
        """The motion; :class:`InvalidInput` if its file or its numbers are no motion."""
        if self.file is not None:
            motion = Motion.from_file(self.file, unit=self.unit, column=self.column, kind=self.kind)
        elif self.synthetic is not None:
            motion = Motion.synthetic(**dict[str, Any](self.synthetic), kind=self.kind)
        elif self.ricker is not None:
            motion = Motion.ricker(**dict[str, Any](self.ricker), kind=self.kind)
        else:
            samples: dict[str, Any] = self.model_dump(include={"dt", "acceleration_g", "velocity", "kind"})
            motion = Motion(**samples)
        return motion if self.scale is None else motion.scaled(factor=self.scale)


def _source(value: object) -> object:
    if value is None or isinstance(value, (dict, MotionSpec)):
        return value
    return MotionSpec.of(value) if isinstance(value, Motion) else value


GivenMotion = Annotated[MotionSpec | None, BeforeValidator(_source)]
"""A motion, or its source, or none."""
