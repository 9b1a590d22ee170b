"""Geometry of the section that the regions fill together."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from .._types import COORDINATE_TOLERANCE
from ..ground.outline import Outline
from .shapes import Box, Polygon

if TYPE_CHECKING:
    from .region import Region
    from .scene import Scene

# Digits of the levels of soils in m: one digit coarser than COORDINATE_TOLERANCE.
_LEVEL_DIGITS = 5


# Called many times for a scene; scenes made from one another mostly have the same shapes.
@functools.lru_cache(maxsize=8)
def joined(shapes: tuple[Box | Polygon, ...]) -> BaseGeometry:
    """Shapes joined into one."""
    return shapely.union_all([shape.geometry for shape in shapes], grid_size=COORDINATE_TOLERANCE)


@functools.lru_cache(maxsize=8)
def outlined(shapes: tuple[Box | Polygon, ...]) -> Outline:
    """Outline of the section that consists of the shapes."""
    return Outline.of(joined(shapes))


def bounds_of(regions: Sequence[Region]) -> tuple[float, float, float, float]:
    """(x0, y0, x1, y1) of regions, m."""
    boxes = shapely.bounds([region.geometry for region in regions])
    (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


def side_profile(scene: Scene, x: float) -> list[tuple[str, float, float]]:
    """Soils of a side of the section as (name, bottom, top), lowest first; empty if it is not straight.

    Regions that differ only in name and place are the same soil, which has the name of the first of them.
    """
    _, y0, _, y1 = scene.bounds
    line = shapely.LineString([(x, y0), (x, y1)])
    touching = [(soil, region.geometry.intersection(line)) for soil, region in _soils(scene.regions)]
    pieces = sorted(
        (round(part.bounds[1], _LEVEL_DIGITS), round(part.bounds[3], _LEVEL_DIGITS), name)
        for name, common in touching
        for part in shapely.get_parts(common)
        if part.length > COORDINATE_TOLERANCE
    )
    levels = [(bottom, top) for bottom, top, _ in pieces]
    whole = bool(levels) and levels[0][0] == round(y0, _LEVEL_DIGITS)
    whole = whole and all(below[1] == above[0] for below, above in itertools.pairwise(levels))
    return [(name, bottom, top) for bottom, top, name in pieces] if whole else []


def _soils(regions: Sequence[Region]) -> list[tuple[str, Region]]:
    """Every region with the name of its soil."""
    soils = [region.model_dump(exclude={"name", "shape"}) for region in regions]
    return [(regions[soils.index(soil)].name, region) for soil, region in zip(soils, regions, strict=True)]


def sides_along(scene: Scene, line: BaseGeometry) -> set[str]:
    """Kinds of the sides of the section along which a line runs; none for most lines."""
    x = line.bounds[0::2]
    return {
        kind
        for kind, end in zip(scene.side_kinds, scene.bounds[0::2], strict=True)
        if np.allclose(x, end, atol=COORDINATE_TOLERANCE, rtol=0.0)
    }


def regions_above_water(scene: Scene) -> list[tuple[int, Region]]:
    """Regions of which a part lies above the water table, with their places in the scene."""
    bends = [x for x, _ in (scene.water_table.points or ())] if scene.water_table else []
    found = []
    for i, region in enumerate(scene.regions):
        corners = _corners(region, bends)
        if (corners[:, 1] > scene.water_level_at(corners[:, 0]) + COORDINATE_TOLERANCE).any():
            found.append((i, region))
    return found


def _corners(region: Region, bends: Sequence[float]) -> NDArray[np.float64]:
    """Corners of a region, and the highest points of it where the water table bends between them."""
    corners: NDArray[np.float64] = shapely.get_coordinates(region.geometry)
    x0, y0, x1, y1 = region.geometry.bounds
    for x in bends:
        if x0 < x < x1:
            line = region.geometry.intersection(shapely.LineString([(x, y0), (x, y1)]))
            if not line.is_empty:
                corners = np.vstack([corners, [(x, line.bounds[3])]])
    return corners
