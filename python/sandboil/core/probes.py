"""Points where histories are taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..ground.discretise import Discretisation

if TYPE_CHECKING:
    from ..scene.scene import Scene


@dataclass(frozen=True)
class Probe:
    """A point where histories are taken: its name and its initial place, m."""

    label: str
    x: float
    y: float


def probes_of(scene: Scene, particles: Discretisation) -> list[Probe]:
    """Where the histories of a scene are taken: surface, base and depths in the mid column, then points."""
    x0, _, x1, _ = scene.bounds
    x = 0.5 * (x0 + x1)
    surface = float(particles.overburden.surface_elevation(np.array([x]))[0])
    column = [("surface", surface), ("base", scene.outline.base_elevation(x))]
    column += [(f"depth {depth:g} m", surface - depth) for depth in scene.output.depths]
    points = [(f"point ({px:g}, {py:g}) m", px, py) for px, py in scene.output.points]
    return [*(Probe(label, x, y) for label, y in column), *(Probe(*point) for point in points)]
