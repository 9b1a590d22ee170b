"""The water of a scene: what is refused of it, and which of its conditions hold while the ground moves."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from ..._errors import InvalidInput
from ..edges import COORDINATE_TOLERANCE
from ..water import (
    REFERENCES,
    AnyCondition,
    Drain,
    Pressure,
    Seepage,
    SeepageFace,
    described,
    frozen,
    heads_of,
    prescribed,
    series_of,
    value_at,
)

if TYPE_CHECKING:
    from ..scene import Region, Scene, Shaking

_WATER = "water = Water()"
_PERMEABLE = "hydraulic_conductivity = 1e-5 (m/s) is a fine sand"
_RETENTION = "VanGenuchten(alpha=7.5, n=1.89) is a sandy loam"


def check(scene: Scene) -> None:
    """Refuse the first thing wrong with the water of a scene whose section is right."""
    _check_table(scene)
    for i, stage in enumerate(scene.stages):
        if stage.kind == "seepage":
            _check_seepage(scene, stage, i)
    for i, stage in enumerate(scene.stages):
        if stage.kind == "shaking" and stage.conditions:
            _check_moving_water(scene, stage.conditions, f"scene.stages[{i}].conditions")


def regions_above_water(scene: Scene) -> list[tuple[int, Region]]:
    """Regions of which a part lies above the water table, with their places."""
    found = []
    for i, region in enumerate(scene.regions):
        corners = shapely.get_coordinates(region.geometry)
        # Between its corners the water table may bend too.
        xs = [x for x, _ in (scene.water_table.points or ())] if scene.water_table else []
        x0, y0, x1, y1 = region.geometry.bounds
        for x in xs:
            if x0 < x < x1:
                line = region.geometry.intersection(shapely.LineString([(x, y0), (x, y1)]))
                if not line.is_empty:
                    corners = np.vstack([corners, [(x, line.bounds[3])]])
        if (corners[:, 1] > scene.water_level_at(corners[:, 0]) + COORDINATE_TOLERANCE).any():
            found.append((i, region))
    return found


def moving_conditions(scene: Scene, stage: Shaking) -> list[tuple[AnyCondition, float | None]]:
    """Conditions in a shaking stage, and what each prescribed at rest: :meth:`Scene.moving_conditions`."""
    at_rest = _AtRest.of(scene)
    current = [
        (condition, at_rest.value(condition, line))
        for condition, line in _placed(scene, scene.seepage.conditions if scene.seepage else ())
        if "free-field" not in _sides_along(scene, line)
    ]
    end = scene.seepage.duration if scene.seepage else None
    for before in scene.stages:
        if before.kind != "shaking":
            continue
        if before.conditions is None:
            current = [(frozen(condition, end or 0.0), rest) for condition, rest in current]
        else:
            placed = _placed(scene, before.conditions)
            current = [(condition, at_rest.value(condition, line)) for condition, line in placed]
        if before is stage:
            break
        end = scene.duration(before)
    return current


# A condition and the line on which it holds, found once: lines may have thousands of points.
_Placed = tuple[AnyCondition, BaseGeometry]


def _placed(scene: Scene, conditions: Sequence[AnyCondition]) -> list[_Placed]:
    return [(condition, scene.condition_line(condition)) for condition in conditions]


@dataclass(frozen=True)
class _AtRest:
    """The conditions at the end of a scene's seepage stage, `time` in s; none without one."""

    conditions: Sequence[AnyCondition]
    lines: NDArray[np.object_]
    time: float

    @classmethod
    def of(cls, scene: Scene) -> _AtRest:
        conditions = scene.seepage.conditions if scene.seepage else ()
        end = scene.seepage.duration if scene.seepage else None
        return cls(conditions, np.array([line for _, line in _placed(scene, conditions)]), end or 0.0)

    def value(self, condition: AnyCondition, line: BaseGeometry) -> float | None:
        """What a condition prescribed (0 for nothing); None if it did not hold."""
        # The same points are told at once; the same line by others takes seconds where it has thousands.
        same = shapely.equals_exact(self.lines, line)
        if not same.any():
            same = shapely.equals(self.lines, line)
        for before in itertools.compress(self.conditions, same):
            if before.kind == condition.kind:
                return value_at(before, self.time)
        return None


def _sides_along(scene: Scene, line: BaseGeometry) -> set[str]:
    """Kinds of the sides of the section along which a line runs; none for most lines."""
    x = line.bounds[0::2]
    return {
        kind
        for kind, end in zip(scene.side_kinds, scene.bounds[0::2], strict=True)
        if np.allclose(x, end, atol=COORDINATE_TOLERANCE, rtol=0.0)
    }


def _is_permeable(scene: Scene) -> bool:
    return any(region.conductivity[0] for region in scene.regions)


def _check_table(scene: Scene) -> None:
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


def _check_seepage(scene: Scene, stage: Seepage, place: int) -> None:
    path = f"scene.stages[{place}]"
    kinds = [condition.kind for condition in stage.conditions]
    if place > 0:
        raise InvalidInput(
            f"{path}.kind",
            stage.kind,
            "must be the first stage: the ground is at rest",
            "water that flows while the ground moves is computed by the other stages themselves",
        )
    if scene.water is None:
        raise InvalidInput("scene.water", None, "is required by a seepage stage", _WATER)
    if not _is_permeable(scene):
        raise InvalidInput(
            "scene.regions",
            [region.name for region in scene.regions],
            "must hold one that water flows through",
            _PERMEABLE,
        )
    is_steady = stage.duration is None
    if is_steady and not any(kind in REFERENCES for kind in kinds):
        raise InvalidInput(
            f"{path}.conditions",
            kinds,
            "must tell the pressure somewhere: with fluxes alone no state is steady, or any level is",
            "a Head, a Reservoir, a SeepageFace, or a duration",
        )
    placed = _placed(scene, stage.conditions)
    for k, (condition, line) in enumerate(placed):
        own = f"{path}.conditions[{k}]"
        _check_condition(scene, condition, line, own)
        if is_steady and len(series_of(condition)) > 1:
            raise InvalidInput(
                f"{own}.{prescribed(condition)}",
                series_of(condition),
                "must not change with time on the way to a steady state",
                "give the stage a duration, in s",
            )
    _check_shared_edges(placed, f"{path}.conditions")
    _check_desaturation(scene, placed)


def _check_moving_water(scene: Scene, conditions: Sequence[AnyCondition], path: str) -> None:
    """Conditions of a stage in which the ground moves."""
    kinds = [condition.kind for condition in conditions]
    if scene.water is None:
        raise InvalidInput(path, kinds, "go with water, of which the scene has none", _WATER)
    if not _is_permeable(scene):
        raise InvalidInput(path, kinds, "need soil that water flows through", _PERMEABLE)
    at_rest, placed = _AtRest.of(scene), _placed(scene, conditions)
    for k, (condition, line) in enumerate(placed):
        own = f"{path}[{k}]"
        _check_condition(scene, condition, line, own)
        _check_beside_columns(scene, condition, line, at_rest, own)
        _check_flooded(scene, condition, line, own)
    _check_shared_edges(placed, path)


def _check_condition(scene: Scene, condition: AnyCondition, line: BaseGeometry, path: str) -> None:
    """A condition holds on a line of the section, and its heads lie in it or above."""
    if isinstance(condition, Drain):
        if not shapely.buffer(scene.section, COORDINATE_TOLERANCE).covers(line):
            raise InvalidInput(
                f"{path}.points",
                condition.points,
                "must lie in the section",
                "water at its edges is told by the other conditions",
            )
    elif line.is_empty or line.length <= COORDINATE_TOLERANCE:
        raise InvalidInput(
            f"{path}.{'x' if condition.x else 'on'}",
            condition.x or condition.on,
            "must cover a stretch of the section's edge",
            f"the section reaches from x = {scene.bounds[0]:g} to {scene.bounds[2]:g} m",
        )
    else:
        if not isinstance(condition.on, str):
            _check_points(scene, condition.on, line, f"{path}.on")
        if "periodic" in _sides_along(scene, line):
            raise InvalidInput(
                f"{path}.on",
                condition.on,
                "does not go with periodic sides, which are no edges",
                "sides = Roller() or FreeField()",
            )
    lowest = scene.outline.base[:, 1].min()
    if (told := heads_of(condition)) is not None:
        name, values = told
        for j, (_, value) in enumerate(values):
            if value < lowest - COORDINATE_TOLERANCE:
                place = f"[{j}]" if len(values) > 1 else ""
                raise InvalidInput(
                    f"{path}.{name}{place}",
                    value,
                    f"must not lie below the base, elevation {lowest:g} m",
                    "heads are elevations in the section's own coordinates",
                )


@functools.lru_cache(maxsize=8)
def _band(edge: BaseGeometry, width: float) -> BaseGeometry:
    """What lies within a distance (m) of an edge, less a sliver where the edge turns; quick to ask."""
    band = shapely.buffer(edge, width)
    shapely.prepare(band)
    return band


def _check_points(scene: Scene, points: Sequence[tuple[float, float]], line: BaseGeometry, path: str) -> None:
    """The points of a line, and what lies between them, must be on the edge."""
    edge = scene.section.exterior
    if _band(edge, scene.spacing).covers(line):
        return
    away = shapely.distance(shapely.points(np.array(points)), edge)
    farthest = int(np.argmax(away))
    hint = "for a line inside the section: Drain"
    if away[farthest] > scene.spacing:
        raise InvalidInput(
            f"{path}[{farthest}]",
            points[farthest],
            f"must lie on the edge of the section, it is {away[farthest]:.3g} m away",
            hint,
        )
    between = shapely.segmentize(line, scene.spacing)
    away = shapely.distance(shapely.points(shapely.get_coordinates(between)), edge)
    if away.max() > scene.spacing:
        raise InvalidInput(
            path,
            points,
            f"must follow the edge of the section, it leaves it by {away.max():.3g} m",
            hint,
        )


def _check_shared_edges(placed: Sequence[_Placed], path: str) -> None:
    """No stretch of edge may obey two conditions."""
    edges = [
        (k, condition.on, line)
        for k, (condition, line) in enumerate(placed)
        if not isinstance(condition, Drain)
    ]
    if len(edges) < 2:
        return
    lines = [line for _, _, line in edges]
    pairs = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=COORDINATE_TOLERANCE).T
    for i, j in sorted((int(i), int(j)) for i, j in pairs if i < j):
        (k, _, one), (m, on, line) = edges[i], edges[j]
        # All of the one that the other reaches: a line may be long, and meet its neighbour at its end alone.
        x0, y0, x1, y1 = line.bounds
        margin = 2.0 * COORDINATE_TOLERANCE
        near = shapely.clip_by_rect(one, x0 - margin, y0 - margin, x1 + margin, y1 + margin)
        common = line.intersection(shapely.buffer(near, COORDINATE_TOLERANCE))
        # Lines that meet share the reach of their ends.
        if common.length > 4.0 * COORDINATE_TOLERANCE:
            x0, y0, x1, y1 = common.bounds
            raise InvalidInput(
                f"{path}[{m}].on",
                on,
                f"must leave out the edge of conditions[{k}], but they share x {x0:g} to {x1:g}, "
                f"y {y0:g} to {y1:g}",
                "cut it by x = (left, right) or by points",
            )


def _check_beside_columns(
    scene: Scene, condition: AnyCondition, line: BaseGeometry, at_rest: _AtRest, path: str
) -> None:
    """Free-field columns know no conditions of their own."""
    if "free-field" not in scene.side_kinds or isinstance(condition, Drain):
        return
    if "free-field" in _sides_along(scene, line):
        raise InvalidInput(
            f"{path}.on",
            condition.on,
            "must not be a free-field side, whose column tells the water there",
            "leave the condition out",
        )
    on_surface = line.distance(scene.outline.edges["surface"]) <= COORDINATE_TOLERANCE
    if on_surface and (len(series_of(condition)) > 1 or at_rest.value(condition, line) is None):
        name = prescribed(condition) or "on"
        raise InvalidInput(
            f"{path}.{name}",
            getattr(condition, name),
            "must stay on the surface what it was in the seepage stage, beside free-field sides: their "
            "columns keep the water they have",
            "sides = Roller(), far away",
        )


def _check_flooded(scene: Scene, condition: AnyCondition, line: BaseGeometry, path: str) -> None:
    """Soil that is dry at rest takes no water: it has no retention curve to tell how."""
    if not scene.is_partly_saturated or scene.holds_suction or isinstance(condition, Drain | SeepageFace):
        return
    x, y = shapely.get_coordinates(shapely.segmentize(line, scene.spacing)).T
    dry = y > scene.water_level_at(x) + COORDINATE_TOLERANCE
    told = heads_of(condition)
    comes = np.inf if told is None else max(value for _, value in told[1])
    if (dry & (y < comes)).any():
        raise InvalidInput(
            path,
            described(condition, 0.0),
            "must not bring water to soil that is dry above the water table",
            "WaterTable(..., above='retention') and a retention curve for the soil",
        )


def _check_desaturation(scene: Scene, placed: Sequence[_Placed]) -> None:
    """Soil that heads leave above them must say what it holds."""
    drained = any(isinstance(condition, Drain) for condition, _ in placed)
    drowned = drained and _is_drowned(scene, placed)
    levels = [
        _lowest_head(scene, condition, line)
        for condition, line in placed
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


def _lowest_head(scene: Scene, condition: AnyCondition, line: BaseGeometry) -> float:
    """The lowest head that a condition may draw the water down to, m; infinite if it tells none."""
    if (told := heads_of(condition)) is not None:
        return min(value for _, value in told[1])
    bottom = float(line.bounds[1])
    if isinstance(condition, Pressure) and scene.water is not None:
        return bottom + min(value for _, value in condition.pressure) / scene.water.unit_weight
    return bottom if isinstance(condition, SeepageFace | Drain) else float("inf")


def _is_drowned(scene: Scene, placed: Sequence[_Placed]) -> bool:
    """Whether open water stands on all of the ground: a drain then draws through what stays full."""
    dry = scene.outline.edges["surface"]
    for condition, line in placed:
        told = heads_of(condition)
        if told and min(value for _, value in told[1]) >= line.bounds[3] - COORDINATE_TOLERANCE:
            dry = dry.difference(shapely.buffer(line, COORDINATE_TOLERANCE))
    return bool(dry.length <= COORDINATE_TOLERANCE)
