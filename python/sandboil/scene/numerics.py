"""Parameters of the numerical method."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, StrictBool, model_validator
from pydantic.config import JsonDict

from .. import _core
from .._errors import InvalidInput
from .._model import Model
from .._types import Number, Positive
from .rules import MESSAGES

# Smoothing length over spacing.
DEFAULT_SMOOTHING_RATIO = 1.4

# The same on the dual lattice.
DUAL_SMOOTHING_RATIO = 1.2

# Strength of the velocity filter on the dual lattice: its short waves are stiffer, and sand that liquefies
# excites them more. A wave of 20 particles loses 0.05 % to it.
DUAL_VELOCITY_FILTER = 0.5

# Strength of the velocity filter: enough that liquefied sand keeps no grid-scale noise that would change an
# answer, while a wave of 20 particles loses only 0.04 % to it (validation/README.md).
DEFAULT_VELOCITY_FILTER = 0.2

_LEAVE: JsonDict = {"remedy": "leave it out for the default, which suits most scenes"}


def _smoothing_ratio(given: dict[str, Any]) -> float:
    """The default beside the fields that are given before it."""
    return DUAL_SMOOTHING_RATIO if given.get("operators") == "dual" else DEFAULT_SMOOTHING_RATIO


class Numerics(Model):
    """Numbers of the method. The defaults are for engineering; other values are for studies of the method.

    `operators` are "conservative", the paper's "printed" ones, or "dual": one stress point a node at the
    corners of cells, which does not lock in nearly incompressible ground. `smoothing_ratio` is
    h/spacing (default 1.4, and 1.2 on the dual lattice); `velocity_filter` (default 0.2, and 0.5 on the dual
    lattice) and `local_damping` are fractions; `time_step_factor` is
    relative to the measured stability limit; beyond `geometry_strain_limit` the particle lists are
    renewed (default 0.2, and 0.02 for the printed operators, which do not follow the deformation).
    `dispersion_correction` corrects the speed of short waves while shaking, and the positions of contacts of
    soils and of the surface for them, at shorter and costlier steps.
    """

    _label: ClassVar[str] = "numerics"

    operators: Literal["conservative", "dual", "printed"] = "conservative"
    smoothing_ratio: Number = Field(
        default_factory=_smoothing_ratio, ge=1.0, le=3.0, description="h/spacing", json_schema_extra=_LEAVE
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
        if self.velocity_filter is not None:
            return self.velocity_filter
        return DUAL_VELOCITY_FILTER if self.operators == "dual" else DEFAULT_VELOCITY_FILTER

    @model_validator(mode="after")
    def _no_idle_choice(self) -> Numerics:
        """Refuse a choice without effect beside the others."""
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
                "is not computed by implicit diffusion",
                "diffusion = 'explicit' computes it",
            ),
            (
                "velocity_filter",
                self.operators == "printed" and bool(self.velocity_filter),
                "has no effect on the printed operators, which have no filter",
                "leave it out, or take operators = 'conservative'",
            ),
        ]
        for name, is_idle, allowed, remedy in idle:
            if is_idle:
                raise InvalidInput(f"numerics.{name}", getattr(self, name), allowed, remedy)
        return self

    @model_validator(mode="after")
    def _no_broken_rule(self) -> Numerics:
        """Refuse choices that exclude each other in any scene."""
        choices = _core.Choices(
            printed_operators=self.operators == "printed",
            dispersion_correction=self.dispersion_correction,
        )
        for name in _core.broken_rules(choices):
            raise MESSAGES[name].refusal(self._label, self)
        return self
