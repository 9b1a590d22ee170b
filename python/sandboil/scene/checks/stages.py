"""Stages: their order, and what a run-out needs."""

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
    """A run-out is the last stage, since the ground has another shape after it, and its strains are large."""
    for i, stage in enumerate(scene.stages):
        if isinstance(stage, RunOut):
            _refuse_run_out(scene, stage, i)


def _refuse_run_out(scene: Scene, stage: RunOut, i: int) -> None:
    path = f"scene.stages[{i}]"
    if i < len(scene.stages) - 1:
        raise InvalidInput(f"{path}.kind", stage.kind, "must be the last stage", "put it at the end")
    if scene.numerics.operators == "printed":
        raise InvalidInput(
            "scene.numerics.operators",
            "printed",
            "must be 'conservative' in a run-out: the printed ones are for small strains",
            "leave it out",
        )
    if scene.numerics.dispersion_correction:
        raise InvalidInput(
            "scene.numerics.dispersion_correction",
            True,
            "must be left out in a run-out: the contacts of soils move",
            "leave it out",
        )
    if stage.open_sides and scene.is_periodic:
        raise InvalidInput(
            f"{path}.open_sides",
            stage.open_sides,
            "cannot open periodic sides",
            "sides = Roller()",
        )
    if stage.still_water and scene.water is None:
        raise InvalidInput(
            f"{path}.still_water",
            stage.still_water,
            "needs water; this scene has none",
            "water = Water()",
        )
