"""Output: not too many frames, and points inside the section."""

from __future__ import annotations

from typing import TYPE_CHECKING

import shapely

from ..._errors import InvalidInput
from ..._types import COORDINATE_TOLERANCE

if TYPE_CHECKING:
    from ..scene import Scene

# Most frames of a run: a frame holds every field of every node.
MAX_FRAMES = 100_000


def check_frames(scene: Scene) -> None:
    """Not too many frames."""
    for stage in scene.stages:
        duration = stage.duration if stage.moves else None
        if duration is not None and duration / scene.output.field_dt > MAX_FRAMES:
            raise InvalidInput(
                "scene.output.field_dt",
                scene.output.field_dt,
                f"must give at most {MAX_FRAMES:g} frames in {duration:g} s",
                f"at least {duration / MAX_FRAMES:.3g} s",
            )


def check_depths(scene: Scene) -> None:
    """Depths lie in the mid column, each once."""
    left, bottom, right, top = scene.bounds
    for i, depth in enumerate(scene.output.depths):
        if depth in scene.output.depths[:i]:
            raise InvalidInput(f"scene.output.depths[{i}]", depth, "is named twice", "leave it out")
    x = 0.5 * (left + right)
    ends = shapely.LineString([(x, bottom), (x, top)]).intersection(scene.section).bounds
    thickness = ends[3] - scene.outline.base_elevation(x)
    for i, depth in enumerate(scene.output.depths):
        if not 0.0 <= depth <= thickness + COORDINATE_TOLERANCE:
            raise InvalidInput(
                f"scene.output.depths[{i}]",
                depth,
                f"must lie in the mid column, [0, {thickness:g}] m",
                "depths are positive downwards from the surface",
            )


def check_points(scene: Scene) -> None:
    """Points lie in the section."""
    left, bottom, right, top = scene.bounds
    section = shapely.buffer(scene.section, COORDINATE_TOLERANCE)
    for i, point in enumerate(scene.output.points):
        if not section.covers(shapely.Point(point)):
            raise InvalidInput(
                f"scene.output.points[{i}]",
                point,
                f"must lie in the section, x {left:g} to {right:g}, y {bottom:g} to {top:g} m",
                "points are (x, y) in the section's own coordinates",
            )
