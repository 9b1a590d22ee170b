"""The water of a scene: its table, its seepage stage, and its conditions while the ground moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from ..._errors import InvalidInput
from ..._types import COORDINATE_TOLERANCE
from ..conditions import AnyCondition, Drain
from ..moving_water import AtRest, Placed, placed
from ..section import regions_above_water
from ..stages import Seepage
from ..water import Water
from .conditions import refuse_beside_columns, refuse_flooded, refuse_misplaced, refuse_shared_edges

if TYPE_CHECKING:
    from ..scene import Scene

_WATER = "water = Water()"
_PERMEABLE = "hydraulic_conductivity = 1e-5 (m/s) is a fine sand"
_RETENTION = "VanGenuchten(alpha=7.5, n=1.89) is a sandy loam"


def check_water_table(scene: Scene) -> None:
    """Water and its table are given together, and soil above the table has a retention curve."""
    if scene.water is None and scene.water_table is not None:
        raise InvalidInput("scene.water", None, "is required when there is a water table", _WATER)
    if scene.water is not None and scene.water_table is None:
        raise InvalidInput(
            "scene.water_table",
            None,
            "is required when there is water",
            "WaterTable(depth=0) is at the surface",
        )
    if scene.water_table is not None and scene.water_table.above != "dry":
        for i, region in regions_above_water(scene):
            if region.retention is None and scene.seepage is None:
                raise InvalidInput(
                    f"scene.regions[{i}].retention",
                    None,
                    f"is required of soil above the water table (region {region.name!r})",
                    f"{_RETENTION}; or WaterTable(..., above='dry')",
                )


def check_seepage(scene: Scene) -> None:
    """Seepage is the first stage, has water and soil to flow through, and conditions that lead somewhere."""
    for i, stage in enumerate(scene.stages):
        if isinstance(stage, Seepage):
            _refuse_seepage(scene, stage, i)


def check_moving_water(scene: Scene) -> None:
    """Conditions of the water in stages in which the ground moves."""
    for i, stage in scene.shakings:
        if stage.conditions:
            _refuse_moving(scene, stage.conditions, f"scene.stages[{i}].conditions")


def _is_permeable(scene: Scene) -> bool:
    return any(region.conductivity.major for region in scene.regions)


def _refuse_seepage(scene: Scene, stage: Seepage, place: int) -> None:
    path = f"scene.stages[{place}]"
    kinds = [condition.kind for condition in stage.conditions]
    if place > 0:
        raise InvalidInput(
            f"{path}.kind",
            stage.kind,
            "must be the first stage: the ground is at rest in it",
            "the other stages compute the flow of water in moving ground",
        )
    if scene.water is None:
        raise InvalidInput("scene.water", None, "is required by a seepage stage", _WATER)
    if not _is_permeable(scene):
        raise InvalidInput(
            "scene.regions",
            [region.name for region in scene.regions],
            "must contain a permeable region",
            _PERMEABLE,
        )
    is_steady = stage.duration is None
    if is_steady and not any(condition.fixes_pressure for condition in stage.conditions):
        raise InvalidInput(
            f"{path}.conditions",
            kinds,
            "must fix the pressure somewhere: with fluxes alone no steady state exists, or many do",
            "a Head, a Reservoir, a SeepageFace, or a duration",
        )
    places = placed(scene, stage.conditions)
    for k, (condition, line) in enumerate(places):
        own = f"{path}.conditions[{k}]"
        refuse_misplaced(scene, condition, line, own)
        if is_steady and len(condition.series) > 1:
            raise InvalidInput(
                f"{own}.{condition.value_name}",
                condition.series,
                "must not change with time on the way to a steady state",
                "give the stage a duration, in s",
            )
    refuse_shared_edges(places, f"{path}.conditions")
    _refuse_desaturation(scene, scene.water, places)


def _refuse_moving(scene: Scene, conditions: Sequence[AnyCondition], path: str) -> None:
    """Conditions of a stage in which the ground moves."""
    kinds = [condition.kind for condition in conditions]
    if scene.water is None:
        raise InvalidInput(path, kinds, "need water; this scene has none", _WATER)
    if not _is_permeable(scene):
        raise InvalidInput(path, kinds, "need a permeable region", _PERMEABLE)
    at_rest, places = AtRest.of(scene), placed(scene, conditions)
    for k, (condition, line) in enumerate(places):
        own = f"{path}[{k}]"
        refuse_misplaced(scene, condition, line, own)
        refuse_beside_columns(scene, condition, line, at_rest, own)
        refuse_flooded(scene, condition, line, own)
    refuse_shared_edges(places, path)


def _refuse_desaturation(scene: Scene, water: Water, places: Sequence[Placed]) -> None:
    """Soil above the lowest head needs a retention curve."""
    drained = any(isinstance(condition, Drain) for condition, _ in places)
    drowned = drained and _is_drowned(scene, places)
    levels = [
        condition.lowest_head(float(line.bounds[1]), water.unit_weight)
        for condition, line in places
        if not (drowned and isinstance(condition, Drain))
    ]
    level = min([*levels, float(scene.water_level_at(np.array(scene.bounds[0::2])).min())])
    for i, region in enumerate(scene.regions):
        if region.retention is None and region.geometry.bounds[3] > level + scene.spacing:
            raise InvalidInput(
                f"scene.regions[{i}].retention",
                None,
                f"is required: region {region.name!r} reaches {region.geometry.bounds[3]:g} m, above the "
                f"head of {level:g} m",
                _RETENTION,
            )


def _is_drowned(scene: Scene, places: Sequence[Placed]) -> bool:
    """Whether open water covers all of the ground: soil above a drain then stays full."""
    dry = scene.outline.edges["surface"]
    for condition, line in places:
        level = min((value for _, value in condition.heads), default=-np.inf)
        if level >= line.bounds[3] - COORDINATE_TOLERANCE:
            dry = dry.difference(shapely.buffer(line, COORDINATE_TOLERANCE))
    return bool(dry.length <= COORDINATE_TOLERANCE)
