"""Presets of accuracy: numerics for what a scene leaves open."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, get_args

from .._errors import unknown_name

if TYPE_CHECKING:
    from ..scene.scene import Scene

Accuracy = Literal["draft", "standard", "reference"]

# Measured on the level ground (rows "draft" and "explicit" of validation/level_ground/README.md): the draft
# makes fewer steps with a coarser soil update; the reference solves the pore water explicitly, with its
# acceleration where it can, in more of them.
ACCURACY: dict[str, dict[str, Any]] = {
    "draft": {"integrator_tolerance": 1.0e-4, "time_step_factor": 0.9},
    "standard": {},
    "reference": {"integrator_tolerance": 1.0e-6, "diffusion": "explicit"},
}


def with_accuracy(scene: Scene, accuracy: str) -> Scene:
    """The scene with the numerics of a preset wherever it gives none itself.

    Raises :class:`InvalidInput` for an unknown preset.
    """
    if accuracy not in ACCURACY:
        raise unknown_name("accuracy", accuracy, list(get_args(Accuracy)))
    given = scene.numerics.model_fields_set
    filled = {name: value for name, value in ACCURACY[accuracy].items() if name not in given}
    if scene.numerics.integrator != "default":
        filled.pop("integrator_tolerance", None)
    return scene.changed(**{f"numerics.{name}": value for name, value in filled.items()}) if filled else scene
