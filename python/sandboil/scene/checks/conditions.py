"""Conditions of the water: where they may hold, and what they may prescribe there."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ..._errors import InvalidInput
from ..._types import COORDINATE_TOLERANCE
from ..conditions import AnyCondition, Drain
from ..moving_water import AtRest, Placed
from ..section import sides_along

if TYPE_CHECKING:
    from ..scene import Scene

# Conditions that bring no water into the ground.
_PASSIVE = ("drain", "seepage-face")


def refuse_misplaced(scene: Scene, condition: AnyCondition, line: BaseGeometry, path: str) -> None:
    """A condition holds on a line of the section, and its heads do not lie below the base."""
    if isinstance(condition, Drain):
        if not shapely.buffer(scene.section, COORDINATE_TOLERANCE).covers(line):
            raise InvalidInput(
                f"{path}.points",
                condition.points,
                "must lie in the section",
                "the other conditions are for the edges",
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
        if "periodic" in sides_along(scene, line):
            raise InvalidInput(
                f"{path}.on",
                condition.on,
                "must not be a periodic side, which is no edge",
                "sides = Roller() or FreeField()",
            )
    lowest = scene.outline.base[:, 1].min()
    heads = condition.heads
    for j, (_, value) in enumerate(heads):
        if value < lowest - COORDINATE_TOLERANCE:
            place = f"[{j}]" if len(heads) > 1 else ""
            raise InvalidInput(
                f"{path}.{condition.value_name}{place}",
                value,
                f"must not lie below the base, elevation {lowest:g} m",
                "heads are elevations in the section's own coordinates",
            )


@functools.lru_cache(maxsize=8)
def _band(edge: BaseGeometry, width: float) -> BaseGeometry:
    """The area within a distance (m) of an edge, prepared for fast queries."""
    band = shapely.buffer(edge, width)
    shapely.prepare(band)
    return band


def _check_points(scene: Scene, points: Sequence[tuple[float, float]], line: BaseGeometry, path: str) -> None:
    """The points of a line and the stretches between them must lie on the edge."""
    edge = scene.section.exterior
    if _band(edge, scene.spacing).covers(line):
        return
    away = shapely.distance(shapely.points(np.array(points)), edge)
    farthest = int(np.argmax(away))
    hint = "use Drain for a line inside the section"
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
            f"must follow the edge of the section; it is up to {away.max():.3g} m away from it",
            hint,
        )


def refuse_shared_edges(placed: Sequence[Placed], path: str) -> None:
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
        # Only the part of the first near the second: a long line may meet its neighbour at one end alone.
        x0, y0, x1, y1 = line.bounds
        margin = 2.0 * COORDINATE_TOLERANCE
        near = shapely.clip_by_rect(one, x0 - margin, y0 - margin, x1 + margin, y1 + margin)
        common = line.intersection(shapely.buffer(near, COORDINATE_TOLERANCE))
        # Lines that meet share the tolerance around their ends.
        if common.length > 4.0 * COORDINATE_TOLERANCE:
            x0, y0, x1, y1 = common.bounds
            raise InvalidInput(
                f"{path}[{m}].on",
                on,
                f"must not overlap conditions[{k}]; they share x {x0:g} to {x1:g}, y {y0:g} to {y1:g}",
                "cut it by x = (left, right) or by points",
            )


def refuse_beside_columns(
    scene: Scene, condition: AnyCondition, line: BaseGeometry, at_rest: AtRest, path: str
) -> None:
    """Free-field columns have no conditions."""
    if "free-field" not in scene.side_kinds or isinstance(condition, Drain):
        return
    if "free-field" in sides_along(scene, line):
        raise InvalidInput(
            f"{path}.on",
            condition.on,
            "must not be a free-field side, where the column gives the water",
            "leave the condition out",
        )
    on_surface = line.distance(scene.outline.edges["surface"]) <= COORDINATE_TOLERANCE
    if on_surface and (len(condition.series) > 1 or at_rest.value(condition, line) is None):
        name = condition.value_name or "on"
        raise InvalidInput(
            f"{path}.{name}",
            getattr(condition, name),
            "must be on the surface as in the seepage stage beside free-field sides: their columns keep "
            "their water",
            "sides = Roller(), far away",
        )


def refuse_flooded(scene: Scene, condition: AnyCondition, line: BaseGeometry, path: str) -> None:
    """Soil that is dry at rest takes no water: it has no retention curve."""
    if not scene.is_partly_saturated or scene.holds_suction or condition.kind in _PASSIVE:
        return
    x, y = shapely.get_coordinates(shapely.segmentize(line, scene.spacing)).T
    dry = y > scene.water_level_at(x) + COORDINATE_TOLERANCE
    level = max((value for _, value in condition.heads), default=np.inf)
    if (dry & (y < level)).any():
        raise InvalidInput(
            path,
            condition.described(0.0),
            "must not bring water to soil that is dry above the water table",
            "WaterTable(..., above='retention') and a retention curve for the soil",
        )
