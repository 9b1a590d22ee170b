"""The particles of a scene, and their geostatic stress and water pressure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from .._errors import InvalidInput
from .._types import COORDINATE_TOLERANCE, Floats
from .overburden import Overburden, PoreWater

if TYPE_CHECKING:
    from ..scene.scene import Scene


@dataclass(frozen=True)
class Discretisation:
    """Particles (velocity nodes) of a scene, row by row from the bottom, left to right in each row.

    Attributes
    ----------
    position : (n, 2) m
    volume : (n,) m3 per metre of thickness: a cell, but for those above a base that is not level
    region : (n,) index into scene.regions
    spacing : (dx, dy) m, as close to scene.spacing as divides the section evenly
    bounds : (x0, x1, y0, y1) of the section, m
    surface_elevation : (n,) elevation of the ground above each node, m
    sigma_v_eff0 : (n,) geostatic vertical effective stress, kPa, compression positive
    pore_pressure0 : (n,) at rest, kPa, compression positive; hydrostatic, or that of a seepage stage
    saturation0 : (n,) degree of saturation at rest; None if all pores are full
    porosity0 : (n,)
    dry_density, solid_density : (n,) Mg/m3
    overburden : the geostatic state that gives the two stresses
    """

    position: Floats
    volume: Floats
    region: NDArray[np.int64]
    spacing: tuple[float, float]
    bounds: tuple[float, float, float, float]
    surface_elevation: Floats
    sigma_v_eff0: Floats
    pore_pressure0: Floats
    saturation0: Floats | None
    porosity0: Floats
    dry_density: Floats
    solid_density: Floats
    overburden: Overburden

    def stress_at(self, points: Floats) -> tuple[Floats, Floats]:
        """Geostatic (sigma_v_eff, pore_pressure) at points (m, 2), kPa, compression positive, each (m,)."""
        return self.overburden.stress_at(np.asarray(points, dtype=np.float64))

    def with_pore_water(self, pressure: Floats, saturation: Floats) -> Discretisation:
        """The same section with other pore water, (n,) kPa and (n,), and the stresses at rest that follow."""
        unit_weight = self.overburden.water_unit_weight
        water = PoreWater.of(
            self.position, pressure, saturation, self.porosity0, unit_weight, self.spacing[1]
        )
        overburden = replace(self.overburden, pore_water=water)
        sigma_v_eff, _ = overburden.stress_at(self.position)
        return replace(
            self,
            overburden=overburden,
            sigma_v_eff0=sigma_v_eff,
            pore_pressure0=pressure,
            saturation0=saturation if (saturation < 1.0).any() else None,
        )


def discretise(scene: Scene) -> Discretisation:
    """Fill the section of a scene with particles at the centres of equal cells.

    The bounding box is divided evenly, by the number of cells nearest to scene.spacing, one at least. A cell
    belongs to the region that holds its centre; a centre on a common boundary (within a micrometre) to the
    region listed first. Above a base that is not level the three lowest cells of every column are stretched
    or compressed to reach down to it, and their particles stand in their middle. Raises :class:`InvalidInput`
    if a region gets no particle.
    """
    lattice = _Lattice.of(scene)
    owner = _owners(scene, lattice)
    inside = np.flatnonzero(owner != _OUTSIDE)
    position, height = _above_base(scene, lattice, owner != _OUTSIDE)
    position, region = position[inside], owner[inside]
    soils = [region.resolved(scene) for region in scene.regions]
    overburden = Overburden.of(scene)
    sigma_v_eff, pressure = overburden.stress_at(position)
    x0, y0, x1, y1 = scene.bounds
    particles = Discretisation(
        position=position,
        volume=lattice.dx * height[inside],
        region=region,
        spacing=(lattice.dx, lattice.dy),
        bounds=(x0, x1, y0, y1),
        surface_elevation=overburden.surface_elevation(position[:, 0]),
        sigma_v_eff0=sigma_v_eff,
        pore_pressure0=pressure,
        saturation0=None,
        porosity0=np.array([soil.porosity for soil in soils])[region],
        dry_density=np.array([soil.dry_density for soil in soils])[region],
        solid_density=np.array([soil.solid_density for soil in soils])[region],
        overburden=overburden,
    )
    return (
        particles.with_pore_water(*_water_at_rest(scene, particles))
        if scene.is_partly_saturated
        else particles
    )


# Owner of cells outside all regions.
_OUTSIDE = -1


@dataclass(frozen=True)
class _Lattice:
    """Equal cells of `dx` by `dy` (m) over the bounding box, with their centres row by row, (n, 2)."""

    columns: int
    rows: int
    dx: float
    dy: float
    centres: Floats

    @classmethod
    def of(cls, scene: Scene) -> _Lattice:
        x0, y0, x1, y1 = scene.bounds
        columns, rows = (max(1, round(extent / scene.spacing)) for extent in (x1 - x0, y1 - y0))
        dx, dy = (x1 - x0) / columns, (y1 - y0) / rows
        x = x0 + (np.arange(columns) + 0.5) * dx
        y = y0 + (np.arange(rows) + 0.5) * dy
        return cls(columns, rows, dx, dy, np.column_stack([np.tile(x, rows), np.repeat(y, columns)]))


def _owners(scene: Scene, lattice: _Lattice) -> NDArray[np.int64]:
    """The region of every cell, (n,); `_OUTSIDE` for none."""
    owner = np.full(len(lattice.centres), _OUTSIDE, dtype=np.int64)
    for index, region in enumerate(scene.regions):
        reach = shapely.buffer(region.geometry, COORDINATE_TOLERANCE, join_style="mitre")
        shapely.prepare(reach)
        owner[(owner == _OUTSIDE) & shapely.intersects_xy(reach, *lattice.centres.T)] = index
    for index, region in enumerate(scene.regions):
        if not (owner == index).any():
            raise InvalidInput(
                "scene.spacing",
                scene.spacing,
                f"leaves region {region.name!r} without a particle",
                "reduce it",
            )
    return owner


# Rows above a base that is not level which take up its distance from the lattice. With one row cells are half
# a row to one and a half high, which shortens the time step of ground on a released base by a third.
_STRETCHED_ROWS = 3


def _above_base(scene: Scene, lattice: _Lattice, is_filled: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Middles (n, 2) and heights (n,) of the cells, m; the lowest ones of a column reach down to the base."""
    centres, height = lattice.centres.copy(), np.full(len(lattice.centres), lattice.dy)
    if scene.outline.base_is_level:
        return centres, height
    filled = is_filled.reshape(lattice.rows, lattice.columns)
    column = np.flatnonzero(filled.any(axis=0))
    lowest = filled.argmax(axis=0)[column]
    # Rows from the lowest one up to the first gap or the surface.
    ahead = [
        filled[np.minimum(lowest + k, lattice.rows - 1), column] & (lowest + k < lattice.rows)
        for k in range(_STRETCHED_ROWS)
    ]
    rows = np.logical_and.accumulate(ahead).sum(axis=0)
    first = lowest * lattice.columns + column
    base = np.interp(centres[first, 0], *scene.outline.base.T)
    top = centres[first, 1] + (rows - 0.5) * lattice.dy
    share = (top - base) / rows
    for k in range(_STRETCHED_ROWS):
        own = k < rows
        cell = first[own] + k * lattice.columns
        centres[cell, 1], height[cell] = (base + (k + 0.5) * share)[own], share[own]
    return centres, height


def _water_at_rest(scene: Scene, particles: Discretisation) -> tuple[Floats, Floats]:
    """Pressure (kPa) and saturation of the nodes over and under a still water table."""
    assert scene.water is not None
    assert scene.water_table is not None
    x, y = particles.position.T
    pressure = scene.water.unit_weight * (scene.water_level_at(x) - y)
    saturation = np.ones(len(y))
    for index, region in enumerate(scene.regions):
        above = (particles.region == index) & (pressure < 0.0)
        if not scene.holds_suction:
            pressure[above] = saturation[above] = 0.0
        elif region.retention is not None:
            saturation[above] = region.retention.core.saturation(pressure[above] / scene.water.unit_weight)
    return pressure, saturation
