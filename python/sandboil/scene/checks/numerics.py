"""Numbers of the method that exclude something else in the scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._errors import InvalidInput

if TYPE_CHECKING:
    from ..scene import Scene


def check_damping(scene: Scene) -> None:
    """Rayleigh damping needs a force that is the transpose of the strain."""
    for i, stage in scene.shakings:
        if stage.rayleigh and scene.numerics.operators == "printed":
            raise InvalidInput(
                f"scene.stages[{i}].rayleigh",
                stage.rayleigh,
                "must be left out with the printed operators: their force is not the transpose of their "
                "strain, so a viscous stress may amplify waves instead of damping them",
                "numerics.local_damping works with both, or take operators = 'conservative'",
            )


def check_inertia(scene: Scene) -> None:
    """Free-field columns have the plain inertia."""
    if scene.numerics.dispersion_correction and "free-field" in scene.side_kinds:
        raise InvalidInput(
            "scene.numerics.dispersion_correction",
            True,
            "must be left out beside free-field sides, whose columns have the plain inertia",
            "level ground on Periodic sides may have it; elsewhere take a smaller spacing",
        )


def check_printed_water(scene: Scene) -> None:
    """Printed operators in saturated ground need a surface that holds the pressure."""
    if scene.numerics.operators == "printed" and scene.water is not None and "free-field" in scene.side_kinds:
        raise InvalidInput(
            "scene.numerics.operators",
            "printed",
            "must be 'conservative' in saturated ground beside free-field sides: Eq. 9 adds energy to waves "
            "where no surface fixes the pressure",
            "dry ground or Periodic sides may have the printed operators",
        )
