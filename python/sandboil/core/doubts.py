"""Warnings about inputs that are allowed but may not be intended."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..scene.stages import Shaking
from .motions import StageMotions
from .units import improbable

if TYPE_CHECKING:
    from ..scene.scene import Scene

# Velocity at the end of a motion over its peak beyond which a run warns. The ground is then stopped within a
# sample, by a wave of stress rho Vs v: up to this share it is small against the waves of the shaking itself.
# Records that were baseline corrected end far below.
RESIDUAL_VELOCITY = 0.02


def doubts(scene: Scene, loaded: list[StageMotions | None]) -> list[str]:
    """Why the answer may not be what was meant; empty if there is no reason known."""
    found = improbable(scene) + _of_statics(scene)
    for (i, stage), motions in zip(scene.shakings, filter(None, loaded), strict=True):
        path = f"scene.stages[{i}]"
        found += _of_residual_velocities(motions, path)
        found += _of_duration(scene, stage, motions, path)
    return found


def _of_statics(scene: Scene) -> list[str]:
    base = scene.statics.base
    if base != "free-slip" or scene.outline.base_is_level:
        return []
    return [
        f"scene.stages[{scene.stages.index(scene.statics)}].base = {base!r} above a base that is not level: "
        "stresses at rest in rows above it alternate by up to 70 %; 'no-slip' leaves 4 %"
    ]


def _of_residual_velocities(motions: StageMotions, path: str) -> list[str]:
    found = []
    for place, motion in motions.places:
        left = float(motion.velocity[-1])
        if abs(left) > RESIDUAL_VELOCITY * motion.pgv:
            found.append(
                f"{path}.{place} ends with a velocity of {left:.3g} m/s, {abs(left) / motion.pgv:.0%} of "
                f"its peak, and a drift of {motion.displacement[-1]:.3g} m: the ground is stopped by a "
                "shock and stays displaced; motion.baseline_corrected() removes both"
            )
    return found


def _of_duration(scene: Scene, stage: Shaking, motions: StageMotions, path: str) -> list[str]:
    """Stages that end before a wave has passed."""
    found = []
    for arrival, own in zip(scene.arrivals(stage), motions.segments, strict=True):
        passing = own or motions.main or motions.vertical
        if stage.duration is None or passing is None or arrival.latest == 0.0:
            continue
        end = arrival.latest + passing.duration
        if end > stage.duration + passing.dt:
            found.append(
                f"{path}.duration = {stage.duration:g} s ends before the motion has passed the base from "
                f"x = {arrival.x[0]:g} to {arrival.x[1]:g} m, which takes {end:.4g} s"
            )
    return found
