"""The order of stages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._errors import InvalidInput
from ..stages import Gravity, RunOut

if TYPE_CHECKING:
    from ..scene import Scene


def check_order(scene: Scene) -> None:
    """Seepage if there is any, then gravity, then the rest."""
    first = 0 if scene.seepage is None else 1
    if len(scene.stages) > first and not isinstance(scene.stages[first], Gravity):
        raise InvalidInput(
            f"scene.stages[{first}].kind",
            scene.stages[first].kind,
            "must be 'gravity': shaking needs the stresses at rest",
            "put Gravity() before it",
        )
    for i, stage in enumerate(scene.stages[first + 1 :], start=first + 1):
        if isinstance(stage, Gravity):
            raise InvalidInput(
                f"scene.stages[{i}].kind",
                "gravity",
                "must come before all shaking, and only once",
                "leave it out",
            )


def check_run_out(scene: Scene) -> None:
    """A run-out is the last stage, since the ground has another shape after it."""
    for i, stage in enumerate(scene.stages[:-1]):
        if isinstance(stage, RunOut):
            raise InvalidInput(
                f"scene.stages[{i}].kind", stage.kind, "must be the last stage", "put it at the end"
            )
