"""Conditions of the water that hold while the ground moves, and their values at rest."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from .conditions import AnyCondition
from .section import sides_along

if TYPE_CHECKING:
    from .scene import Scene
    from .stages import Shaking

# A condition and the line on which it holds, found once: lines may have thousands of points.
Placed = tuple[AnyCondition, BaseGeometry]


def placed(scene: Scene, conditions: Sequence[AnyCondition]) -> list[Placed]:
    """Conditions with their lines."""
    return [(condition, scene.condition_line(condition)) for condition in conditions]


@dataclass(frozen=True)
class AtRest:
    """The conditions at the end of a scene's seepage stage, `time` in s; none without one."""

    conditions: Sequence[AnyCondition]
    lines: NDArray[np.object_]
    time: float

    @classmethod
    def of(cls, scene: Scene) -> AtRest:
        conditions = scene.seepage.conditions if scene.seepage else ()
        end = scene.seepage.duration if scene.seepage else None
        return cls(conditions, np.array([line for _, line in placed(scene, conditions)]), end or 0.0)

    def value(self, condition: AnyCondition, line: BaseGeometry) -> float | None:
        """The value of the same condition at rest (0 if it has none); None if it did not hold."""
        # The same points are compared fast; the same line by other points takes seconds where it has
        # thousands.
        same = shapely.equals_exact(self.lines, line)
        if not same.any():
            same = shapely.equals(self.lines, line)
        for before in itertools.compress(self.conditions, same):
            if before.kind == condition.kind:
                return before.value_at(self.time)
        return None


def moving_conditions(scene: Scene, stage: Shaking) -> list[tuple[AnyCondition, float | None]]:
    """Conditions in a shaking stage with their values at rest: see :meth:`Scene.moving_conditions`."""
    at_rest = AtRest.of(scene)
    current = [
        (condition, at_rest.value(condition, line))
        for condition, line in placed(scene, scene.seepage.conditions if scene.seepage else ())
        if "free-field" not in sides_along(scene, line)
    ]
    end = scene.seepage.duration if scene.seepage else None
    for _, before in scene.shakings:
        if before.conditions is None:
            current = [(condition.frozen(end or 0.0), value) for condition, value in current]
        else:
            current = [
                (condition, at_rest.value(condition, line))
                for condition, line in placed(scene, before.conditions)
            ]
        if before is stage:
            break
        end = scene.duration(before)
    return current
