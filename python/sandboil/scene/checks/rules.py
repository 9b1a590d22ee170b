"""Choices of a scene that exclude each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ... import _core
from ..rules import MESSAGES, STAGE
from ..stages import AnyStage, RunOut, Shaking

if TYPE_CHECKING:
    from ..scene import Scene


def check_choices(scene: Scene) -> None:
    """No stage breaks a rule of the core. The first in its table of those that are broken is refused."""
    broken = [
        (_core.RULES.index(name), i)
        for i, stage in enumerate(scene.stages)
        for name in _core.broken_rules(choices(scene, stage))
    ]
    if not broken:
        return
    rule, i = min(broken)
    message = MESSAGES[_core.RULES[rule]]
    if message.part == STAGE:
        raise message.refusal(f"scene.stages[{i}]", scene.stages[i])
    raise message.refusal("scene.numerics", scene.numerics)


def choices(scene: Scene, stage: AnyStage) -> _core.Choices:
    """What the core's rules look at in a stage of a scene. In a run-out free-field sides are held."""
    is_run_out = isinstance(stage, RunOut)
    return _core.Choices(
        printed_operators=scene.numerics.operators == "printed",
        dispersion_correction=scene.numerics.dispersion_correction,
        water=scene.water is not None,
        periodic_sides=scene.is_periodic,
        free_field="free-field" in scene.side_kinds and not is_run_out,
        open_sides=isinstance(stage, RunOut) and bool(stage.open_sides),
        rayleigh_damping=isinstance(stage, Shaking) and stage.rayleigh is not None,
        large_displacements=is_run_out,
        hydraulic_conditions=isinstance(stage, Shaking) and bool(stage.conditions),
        still_water=isinstance(stage, RunOut) and bool(stage.still_water),
    )
