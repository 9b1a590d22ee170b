"""Soils: densities that are enough and agree, and parameters that the soil models take."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ... import _core
from ..._errors import InvalidInput
from ..._refusals import field_remedy, relocated

if TYPE_CHECKING:
    from ..scene import Scene


def check_densities(scene: Scene) -> None:
    """Every region has enough densities, and they agree."""
    for i, region in enumerate(scene.regions):
        try:
            region.resolved(scene)
        except InvalidInput as error:
            path = relocated(error.path, f"scene.regions[{i}]")
            raise InvalidInput(path, error.value, error.allowed, error.hint) from None


def check_materials(scene: Scene) -> None:
    """The core accepts the parameters of every soil, at a stress that any soil can carry."""
    for i, region in enumerate(scene.regions):
        try:
            _core.small_strain_moduli(region.material.core(), (-100.0, -100.0, 0.0, -100.0))
        except InvalidInput as error:
            path = f"scene.regions[{i}].material.{error.path}"
            remedy = field_remedy(type(region.material).model_fields[error.path])
            raise InvalidInput(path, error.value, error.allowed, remedy) from None
