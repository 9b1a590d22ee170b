"""Results that a run keeps."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, StrictBool

from .._model import Model
from .._types import MAX_PARTS, Many, Number, Point


class Output(Model):
    """Results that a run keeps. They never change the time step.

    Histories are recorded at the surface, the base, the `depths` (m below ground, in the mid column) and the
    `points` (x, y) every `history_dt` s; all fields every `field_dt` s; envelopes include every step.
    """

    _label: ClassVar[str] = "output"

    depths: Many[Number] = Field(default=(), max_length=MAX_PARTS, description="m below the ground surface")
    points: Many[Point] = Field(default=(), max_length=MAX_PARTS, description="(x, y), m")
    history_dt: Number = Field(
        default=0.005,
        gt=0.0,
        description="s",
        json_schema_extra={"remedy": "0.005 resolves frequencies below 100 Hz"},
    )
    field_dt: Number = Field(
        default=0.25,
        gt=0.0,
        description="s",
        json_schema_extra={"remedy": "0.25 gives four frames a second"},
    )
    envelopes: Many[Literal["r_u", "gamma_max"]] = ("r_u", "gamma_max")
    stress_paths: StrictBool = Field(
        default=True, description="shear stress, vertical stress and strain at the depths"
    )
