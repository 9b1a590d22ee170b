"""Choices that exclude each other: the core has the rules, here are the messages for users."""

from __future__ import annotations

from typing import NamedTuple

from .._errors import InvalidInput
from .._model import Model


class Message(NamedTuple):
    """The message for a rule that is broken.

    Attributes
    ----------
    part : of the scene that holds the choice to leave out: its numerics, or the stage
    field : of the part
    allowed : what the field must be
    hint : what to do instead
    """

    part: str
    field: str
    allowed: str
    hint: str

    def refusal(self, path: str, part: Model) -> InvalidInput:
        """The refusal of the field of a part, whose place is `path`."""
        return InvalidInput(f"{path}.{self.field}", getattr(part, self.field), self.allowed, self.hint)


NUMERICS, STAGE = "numerics", "stage"

# By the names of the rules in the core.
MESSAGES: dict[str, Message] = {
    "dispersion correction with printed operators": Message(
        NUMERICS,
        "dispersion_correction",
        "cannot be used with the printed operators, whose force is not the transpose of their strain",
        "leave it out, or take operators = 'conservative'",
    ),
    "large displacements with printed operators": Message(
        NUMERICS,
        "operators",
        "must be 'conservative' in a run-out: the printed ones are for small strains",
        "leave it out",
    ),
    "large displacements with dispersion correction": Message(
        NUMERICS,
        "dispersion_correction",
        "must be left out in a run-out: the contacts of soils move",
        "leave it out",
    ),
    "large displacements with free field": Message(
        STAGE,
        "kind",
        "must not be beside free-field sides: the ground would leave the nodes that are coupled to columns",
        "sides = Roller()",
    ),
    "large displacements with hydraulic conditions": Message(
        STAGE,
        "kind",
        "must have no hydraulic conditions: the edges on which these act would move",
        "still_water is the water around a run-out",
    ),
    "open sides with periodic sides": Message(
        STAGE, "open_sides", "cannot open periodic sides", "sides = Roller()"
    ),
    "still water without water": Message(
        STAGE, "still_water", "needs water; this scene has none", "water = Water()"
    ),
    "Rayleigh damping with printed operators": Message(
        STAGE,
        "rayleigh",
        "must be left out with the printed operators: their force is not the transpose of their "
        "strain, so a viscous stress may amplify waves instead of damping them",
        "numerics.local_damping works with both, or take operators = 'conservative'",
    ),
    "dispersion correction with free field": Message(
        NUMERICS,
        "dispersion_correction",
        "must be left out beside free-field sides, whose columns have the plain inertia",
        "level ground on Periodic sides may have it; elsewhere take a smaller spacing",
    ),
    "printed operators with water and free field": Message(
        NUMERICS,
        "operators",
        "must be 'conservative' in saturated ground beside free-field sides: Eq. 9 adds energy to waves "
        "where no surface fixes the pressure",
        "dry ground or Periodic sides may have the printed operators",
    ),
}
