"""The motions of shaking stages as upgoing waves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._errors import InvalidInput
from ..motion import Motion
from ..scene.stages import Shaking

if TYPE_CHECKING:
    from ..scene.scene import Scene


@dataclass(frozen=True)
class StageMotions:
    """The motions of a shaking stage, read.

    Attributes
    ----------
    places : (place in the stage, motion) of each
    main : the stage's own; None if it has none
    vertical : its vertical component, if any
    segments : one for each stretch of the base from left to right; None: that of the stage
    """

    places: list[tuple[str, Motion]]
    main: Motion | None
    vertical: Motion | None
    segments: list[Motion | None]

    def waves(self) -> tuple[list[_core.Wave], list[int | None]]:
        """The upgoing waves, and for each stretch the index of its wave; None where no wave arrives."""
        waves: list[_core.Wave] = []
        upgoing = [
            None if motion is None else motion.upgoing_velocity() for motion in (self.main, self.vertical)
        ]
        horizontal, vertical = (None if wave is None else np.ascontiguousarray(wave[1]) for wave in upgoing)
        dt = next((wave[0] for wave in upgoing if wave is not None), None)
        if dt is not None:
            still = np.zeros(1)
            waves.append(
                _core.Wave(
                    interval=dt, horizontal=still if horizontal is None else horizontal, vertical=vertical
                )
            )
        of_stage = len(waves) - 1 if waves else None
        indices: list[int | None] = []
        for motion in self.segments:
            if motion is None:
                indices.append(of_stage)
            else:
                own, velocity = motion.upgoing_velocity()
                indices.append(len(waves))
                waves.append(
                    _core.Wave(interval=own, horizontal=np.ascontiguousarray(velocity), vertical=None)
                )
        return waves, indices


def loaded_motions(scene: Scene) -> list[StageMotions | None]:
    """The motions of every stage, None where it is no shaking stage.

    Raises :class:`InvalidInput` with the stage for a motion that cannot be read or used.
    """
    loaded = {i: _stage_motions(scene, stage, f"scene.stages[{i}].") for i, stage in scene.shakings}
    return [loaded.get(i) for i in range(len(scene.stages))]


def _stage_motions(scene: Scene, stage: Shaking, path: str) -> StageMotions:
    loaded: dict[str, Motion] = {}
    for place, spec in stage.motions:
        if spec is None:
            continue
        try:
            loaded[place] = spec.load()
            loaded[place].upgoing_velocity()
        except InvalidInput as error:
            # The place in a file follows the place in the stage.
            rest = error.path.removeprefix("motion")
            inner = rest if rest != error.path else f", {error.path}"
            raise InvalidInput(f"{path}{place}{inner}", error.value, error.allowed, error.hint) from None
    main, vertical = loaded.get("motion"), loaded.get("vertical")
    if main is not None and vertical is not None and not math.isclose(main.dt, vertical.dt):
        raise InvalidInput(
            f"{path}vertical.dt",
            vertical.dt,
            f"must be that of the horizontal motion, {main.dt:g} s",
            "take both components of the same record",
        )
    of_spec = {id(spec): loaded[place] for place, spec in stage.motions if spec is not None}
    segments = [
        None if arrival.motion is None else of_spec[id(arrival.motion)] for arrival in scene.arrivals(stage)
    ]
    return StageMotions(list(loaded.items()), main, vertical, segments)
