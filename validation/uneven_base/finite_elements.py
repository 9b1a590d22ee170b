"""Plane-strain finite elements for statics of uneven ground: bilinear quadrilaterals from base to surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Line = Callable[[Floats], Floats]

# Corners of the element, and the points at which its stiffness is summed.
CORNERS = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
GAUSS = CORNERS / np.sqrt(3.0)


def vertical_stress(
    base: Line, surface: Line, width: float, cells: tuple[int, int], *, unit_weight: float, nu: float
) -> Floats:
    """Vertical stress at rest of elastic ground on a rough base between smooth sides.

    Parameters
    ----------
    base, surface : elevation at x, m
    width : of the section, which begins at x = 0, m
    cells : number of elements along and up, of equal width, and of equal height in each column
    unit_weight : kN/m3
    nu : Poisson's ratio; the ground starts with the stress of level ground, K0 = nu/(1 - nu)

    Returns the stress in the middle of the elements, kPa, compression positive, of shape `cells`.
    """
    columns, rows = cells
    x = np.linspace(0.0, width, columns + 1)[:, None] * np.ones(rows + 1)
    share = np.linspace(0.0, 1.0, rows + 1)
    y = base(x) + (surface(x) - base(x)) * share
    index = np.arange(x.size).reshape(x.shape)
    corners = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    element = np.stack([corner.ravel() for corner in corners], axis=1)
    place = np.stack([x.ravel(), y.ravel()], axis=1)[element]
    # Stresses and stiffness in units of Young's modulus: of no influence on the stress at rest.
    lame, shear = nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), 0.5 / (1.0 + nu)
    elastic = np.diag([2.0 * shear, 2.0 * shear, shear])
    elastic[:2, :2] += lame

    def strain(point: Floats) -> tuple[Floats, Floats, Floats]:
        """Places, strain matrices (n, 3, 8) and areas at a point of all elements."""
        along, up = 1.0 + CORNERS[:, 0] * point[0], 1.0 + CORNERS[:, 1] * point[1]
        slopes = 0.25 * np.stack([CORNERS[:, 0] * up, CORNERS[:, 1] * along])
        jacobian = slopes @ place
        gradient = np.linalg.solve(jacobian, np.broadcast_to(slopes, (len(place), 2, 4)))
        matrix = np.zeros((len(place), 3, 8))
        matrix[:, 0, 0::2] = matrix[:, 2, 1::2] = gradient[:, 0]
        matrix[:, 1, 1::2] = matrix[:, 2, 0::2] = gradient[:, 1]
        return 0.25 * (along * up) @ place, matrix, np.linalg.det(jacobian)

    def geostatic(at: Floats) -> Floats:
        vertical = -unit_weight * (surface(at[:, 0]) - at[:, 1])
        return np.stack([nu / (1.0 - nu) * vertical, vertical, 0.0 * vertical], axis=1)

    unknown = np.stack([2 * element, 2 * element + 1], axis=2).reshape(-1, 8)
    stiffness, force = np.zeros((2 * x.size, 2 * x.size)), np.zeros(2 * x.size)
    for point in GAUSS:
        at, matrix, area = strain(point)
        own = np.einsum("nai,ab,nbj,n->nij", matrix, elastic, matrix, area)
        np.add.at(stiffness, (unknown[:, :, None], unknown[:, None, :]), own)
        load = -np.einsum("nai,na,n->ni", matrix, geostatic(at), area)
        shape = 0.25 * (1.0 + CORNERS[:, 0] * point[0]) * (1.0 + CORNERS[:, 1] * point[1])
        load[:, 1::2] -= unit_weight * shape * area[:, None]
        np.add.at(force, unknown, load)
    held = np.zeros((*x.shape, 2), dtype=bool)
    held[:, 0] = held[[0, -1], :, 0] = True
    free = np.flatnonzero(~held.ravel())
    moved = np.zeros(2 * x.size)
    moved[free] = np.linalg.solve(stiffness[np.ix_(free, free)], force[free])
    at, matrix, _ = strain(np.zeros(2))
    stress = geostatic(at) + np.einsum("ab,nbi,ni->na", elastic, matrix, moved[unknown])
    return -stress[:, 1].reshape(cells)
