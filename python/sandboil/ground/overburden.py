"""Geostatic stress below the outlines of regions, and pore water between nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from .._types import COORDINATE_TOLERANCE, Floats

if TYPE_CHECKING:
    from ..scene.scene import Scene


@dataclass(frozen=True)
class Overburden:
    """Weight of the ground above any point of a scene, from the exact outlines of its regions.

    Stress and pressure in kPa, compression positive. The integral runs straight down, which is the geostatic
    state of level ground; under slopes it is the initial state of the gravity stage.
    """

    outlines: NDArray[np.object_]
    unit_weights: Floats
    section: shapely.Geometry
    bounds: tuple[float, float, float, float]
    water_level: Callable[[Floats], Floats] | None
    water_unit_weight: float
    is_periodic: bool
    pore_water: PoreWater | None = None

    @classmethod
    def of(cls, scene: Scene) -> Overburden:
        """Overburden of a scene; its soils are saturated if it has water, else dry."""
        phases = [region.resolved(scene) for region in scene.regions]
        densities = [soil.dry_density if scene.water is None else soil.saturated_density for soil in phases]
        return cls(
            outlines=np.array([region.geometry for region in scene.regions], dtype=object),
            unit_weights=scene.gravity * np.array(densities),
            section=scene.section,
            bounds=scene.bounds,
            water_level=None if scene.water is None else scene.water_level_at,
            water_unit_weight=0.0 if scene.water is None else scene.water.unit_weight,
            is_periodic=scene.is_periodic,
        )

    def surface_elevation(self, x: Floats) -> Floats:
        """Elevation of the top of the section above each x, m, shape (n,)."""
        lines, column = self._verticals(x)
        tops: Floats = shapely.bounds(shapely.intersection(lines, self.section))[:, 3]
        return tops[column]

    def pore_pressure(self, points: Floats) -> Floats:
        """Pressure at rest at points (n, 2), kPa: zero in a dry scene, else that of the pore water."""
        if self.water_level is None:
            return np.zeros(len(points))
        if self.pore_water is not None:
            return self.pore_water.state(points)[0]
        return self.water_unit_weight * np.maximum(self.water_level(points[:, 0]) - points[:, 1], 0.0)

    def stress_at(self, points: Floats) -> tuple[Floats, Floats]:
        """Vertical effective stress and pore pressure at points (n, 2), kPa, each of shape (n,)."""
        x, y = points[:, 0], points[:, 1]
        total = np.zeros(len(points))
        lines, column = self._verticals(x)
        for outline, unit_weight in zip(self.outlines, self.unit_weights, strict=True):
            parts, line = shapely.get_parts(shapely.intersection(lines, outline), return_index=True)
            crossed = ~shapely.is_empty(parts)
            parts, line = parts[crossed], line[crossed]
            extents = shapely.bounds(parts)
            # A line crosses most regions once; the n-th crossing of every line is added in one go.
            order = np.arange(len(line)) - np.searchsorted(line, line)
            for crossing in range(order.max(initial=-1) + 1):
                bottom, top = np.zeros((2, len(lines)))
                chosen = order == crossing
                bottom[line[chosen]], top[line[chosen]] = extents[chosen, 1], extents[chosen, 3]
                total += unit_weight * np.maximum(top[column] - np.maximum(bottom[column], y), 0.0)
        pressure = self.pore_pressure(points)
        if self.pore_water is not None:
            surface = self.surface_elevation(x)
            # The weight of water above the ground is the pressure at the surface.
            pond = np.maximum(self.pore_water.state(np.column_stack([x, surface]))[0], 0.0)
            total += np.where(y < surface, pond, np.maximum(pressure, 0.0))
        elif self.water_level is not None:
            pond = np.maximum(self.water_level(x) - np.maximum(self.surface_elevation(x), y), 0.0)
            total += self.water_unit_weight * pond
        if self.pore_water is None:
            return total - pressure, pressure
        # Bishop's stress: the pressure of the water counts by its saturation.
        _, saturation = self.pore_water.state(points)
        return total - self.pore_water.missing_weight(points) - saturation * pressure, pressure

    def _verticals(self, x: Floats) -> tuple[NDArray[np.object_], NDArray[np.intp]]:
        """One vertical line through the whole section per distinct x, and the line of each point.

        Points beyond a periodic side are shifted into the section, others beyond a side to that side.
        """
        x0, y0, x1, y1 = self.bounds
        beyond = x0 + np.mod(x - x0, x1 - x0) if self.is_periodic else np.clip(x, x0, x1)
        inside = np.where((x < x0) | (x > x1), beyond, x)
        # A vertical along an upright edge would count the soils on both of its sides: it is moved to the
        # right, or at the right side of the section to the left.
        corners = np.unique(shapely.get_coordinates(self.outlines)[:, 0])
        near = corners[np.minimum(np.searchsorted(corners, inside - COORDINATE_TOLERANCE), len(corners) - 1)]
        on_edge = np.abs(near - inside) <= COORDINATE_TOLERANCE
        aside = np.where(near < x1, near + 2.0 * COORDINATE_TOLERANCE, near - 2.0 * COORDINATE_TOLERANCE)
        inside = np.where(on_edge, aside, inside)
        distinct, column = np.unique(inside, return_inverse=True)
        ends = np.empty((len(distinct), 2, 2))
        ends[:, :, 0] = distinct[:, None]
        ends[:, :, 1] = y0, y1
        return shapely.linestrings(ends), column


@dataclass(frozen=True)
class PoreWater:
    """Pressure and saturation of nodes. Between them heads and saturations are those of the nearest node.

    Attributes
    ----------
    position : (n, 2) m
    pressure : (n,) kPa, compression positive, suction negative
    saturation : (n,)
    missing : (n,) kPa, weight of the water that pores above a node lack
    density : (n,) kN/m3, weight of the water that pores at a node lack, per volume of soil
    unit_weight : of water, kN/m3
    """

    position: Floats
    pressure: Floats
    saturation: Floats
    missing: Floats
    density: Floats
    unit_weight: float

    @classmethod
    def of(
        cls,
        position: Floats,
        pressure: Floats,
        saturation: Floats,
        porosity: Floats,
        unit_weight: float,
        dy: float,
    ) -> PoreWater:
        """Pore water of nodes on a lattice of rows `dy` apart."""
        density = unit_weight * porosity * (1.0 - saturation)
        missing = np.zeros(len(position))
        _, column = np.unique(np.round(position[:, 0] / COORDINATE_TOLERANCE), return_inverse=True)
        # From the top of every column down: what lies above a node, and half of its own cell.
        order = np.lexsort((-position[:, 1], column))
        weight = dy * density[order]
        total = np.cumsum(weight)
        first = np.searchsorted(column[order], column[order])
        missing[order] = total - 0.5 * weight - (total[first] - weight[first])
        return cls(position, pressure, saturation, missing, density, unit_weight)

    def state(self, points: Floats) -> tuple[Floats, Floats]:
        """Pressure (kPa) and degree of saturation at points (m, 2)."""
        nearest, above = self._nearest(points)
        # Within a cell the head is that of its node.
        held = np.where(self.saturation[nearest] > 0.0, self.unit_weight * above, 0.0)
        return self.pressure[nearest] + held, self.saturation[nearest]

    def missing_weight(self, points: Floats) -> Floats:
        """Weight that the soil above points (m, 2) lacks for being saturated, kPa."""
        nearest, above = self._nearest(points)
        weight: Floats = np.maximum(self.missing[nearest] + self.density[nearest] * above, 0.0)
        return weight

    def _nearest(self, points: Floats) -> tuple[NDArray[np.intp], Floats]:
        """The node nearest to each point, and how far above the point it lies, m."""
        # Imported where it is used: that takes a quarter of a second.
        from scipy.spatial import cKDTree

        _, nearest = cKDTree(self.position).query(points)
        return nearest, self.position[nearest, 1] - points[:, 1]
