"""The section: regions with names, without overlaps and gaps, with a base and sides that can be computed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._errors import InvalidInput
from ..._types import COORDINATE_TOLERANCE
from ..section import side_profile

if TYPE_CHECKING:
    from ..scene import Scene

# Most cells of the lattice over a section: their weights alone would fill 40 GB.
MAX_CELLS = 10_000_000

# Least height of a side that is a wall or a free field, in spacings: a single row would have no depth in it.
LEAST_SIDE_ROWS = 2


def check_names(scene: Scene) -> None:
    """No two regions have the same name."""
    names = [region.name for region in scene.regions]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InvalidInput(
                f"scene.regions[{i}].name",
                name,
                f"is already the name of regions[{names.index(name)}]",
                "give each its own",
            )


def check_size(scene: Scene) -> None:
    """The lattice fits into memory."""
    x0, y0, x1, y1 = scene.bounds
    cells = (x1 - x0) / scene.spacing * ((y1 - y0) / scene.spacing)
    if cells > MAX_CELLS:
        raise InvalidInput(
            "scene.spacing",
            scene.spacing,
            f"must make at most {MAX_CELLS:g} cells, not {cells:.3g} of {x1 - x0:g} by {y1 - y0:g} m",
            "increase it, or check the unit of the coordinates",
        )


def check_overlaps(scene: Scene) -> None:
    """No two regions share an area."""
    shapes = [region.geometry for region in scene.regions]
    for i, shape in enumerate(shapes):
        for j in range(i):
            common = shape.intersection(shapes[j])
            if common.area > COORDINATE_TOLERANCE * shape.length:
                x0, y0, x1, y1 = common.bounds
                raise InvalidInput(
                    f"scene.regions[{i}].shape",
                    scene.regions[i].shape,
                    f"must not overlap region {scene.regions[j].name!r}",
                    f"they share {common.area:.4g} m2 in x {x0:g} to {x1:g}, y {y0:g} to {y1:g}",
                )


def check_section(scene: Scene) -> None:
    """The regions join into one section without gaps."""
    section = scene.section
    pieces = list(section.geoms) if section.geom_type != "Polygon" else [section]
    if len(pieces) > 1:
        spans = (f"x {x0:g} to {x1:g}, y {y0:g} to {y1:g}" for x0, y0, x1, y1 in (p.bounds for p in pieces))
        raise InvalidInput(
            "scene.regions",
            [region.name for region in scene.regions],
            "must join into one section without gaps",
            f"separate pieces: {'; '.join(spans)}",
        )
    if holes := list(section.interiors):
        x0, y0, x1, y1 = holes[0].bounds
        raise InvalidInput(
            "scene.regions",
            [region.name for region in scene.regions],
            "must fill the section without gaps",
            f"a hole lies in x {x0:g} to {x1:g}, y {y0:g} to {y1:g}",
        )


def check_sides(scene: Scene) -> None:
    """Base and sides have a shape that the kinds of the sides allow."""
    if scene.is_periodic:
        _refuse_unlike_sides(scene)
    else:
        _refuse_low_sides(scene)


def _refuse_unlike_sides(scene: Scene) -> None:
    """Periodic sides have a level base between them and the same soils on both."""
    outline, (x0, _, x1, _) = scene.outline, scene.bounds
    if not outline.base_is_level:
        y = outline.base[:, 1]
        raise InvalidInput(
            "scene.regions",
            [region.name for region in scene.regions],
            "must stand on a level base between periodic sides, but it lies between "
            f"y = {y.min():g} and {y.max():g} m",
            "sides = FreeField() takes any base",
        )
    left, right = (side_profile(scene, x) for x in (x0, x1))
    if not left or left != right:
        raise InvalidInput(
            "scene.sides",
            scene.sides.kind,
            "needs straight vertical sides, the same soils at the same levels on both",
            f"left: {left or 'no vertical side'}; right: {right or 'no vertical side'}",
        )


def _refuse_low_sides(scene: Scene) -> None:
    """Walls and free fields have one upright edge of some height."""
    least = LEAST_SIDE_ROWS * scene.spacing
    outline, (x0, _, x1, _) = scene.outline, scene.bounds
    edges = (("left", x0, outline.left), ("right", x1, outline.right))
    for (hand, x, (bottom, top)), kind in zip(edges, scene.side_kinds, strict=True):
        if top - bottom < least - COORDINATE_TOLERANCE:
            raise InvalidInput(
                "scene.sides",
                kind,
                f"needs a straight vertical edge of at least {LEAST_SIDE_ROWS} spacings, {least:g} m, on "
                f"the {hand}, which has {top - bottom:g} m",
                "where a slope reaches the side, extend the section by level ground that ends upright",
            )
        if (np.abs(outline.surface[1:-1, 0] - x) <= COORDINATE_TOLERANCE).any():
            raise InvalidInput(
                "scene.sides",
                kind,
                f"needs one straight vertical edge on the {hand}, but the section reaches x = {x:g} m "
                f"again above {top:g} m",
                "fill the section up to the side, or let only its lowest part reach it",
            )


def check_spacing(scene: Scene) -> None:
    """Every region has room for a particle."""
    for region in scene.regions:
        x0, y0, x1, y1 = region.geometry.bounds
        thickness = min(x1 - x0, y1 - y0)
        if scene.spacing > thickness + COORDINATE_TOLERANCE:
            raise InvalidInput(
                "scene.spacing",
                scene.spacing,
                f"must not exceed the least extent of any region, {thickness:g} m ({region.name})",
                "a fifth of the thinnest layer, or join layers that are thinner",
            )
