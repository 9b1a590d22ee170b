"""Stresses at rest above a base that is not level, against closed form and finite elements."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sandboil as sb

from validation.uneven_base.finite_elements import Floats, Line, vertical_stress

UNIT_WEIGHT = 20.0
# With Poisson's ratio K0/(1 + K0) level ground keeps it.
K0 = 0.5


OPERATORS = ("conservative", "dual")


def at_rest(points: list[tuple[float, float]], spacing: float, operators: str) -> sb.Simulation:
    """Elastic ground between smooth sides, at rest."""
    soil = sb.Region("soil", sb.polygon(points), sb.Elastic(G=4e4, K=8e4), dry_unit_weight=UNIT_WEIGHT, K0=K0)
    simulation = sb.Simulation(
        sb.Scene(
            spacing=spacing,
            regions=[soil],
            sides=sb.Roller(),
            stages=[sb.Gravity()],
            numerics=sb.Numerics(operators=operators),
        ),
        threads=1,
    )
    assert not simulation.doubts
    simulation.run_stage()
    return simulation


def largest_by_row(error: Floats, height: Floats, rows: int) -> list[float]:
    """Largest error of the nodes in each row of heights (in spacings) over the base."""
    return [float(error[(height >= row) & (height < row + 1)].max()) for row in range(rows)]


def on_infinite_slope(angle: float, spacing: float, operators: str) -> tuple[list[float], list[float]]:
    """Errors of normal and shear stress along the slope over the normal stress, in rows of the lower half.

    Six metres of soil in a slope 60 m long, of which the middle third is looked at.
    """
    width, thickness = 60.0, 6.0
    slope = math.tan(math.radians(angle))
    left = max(0.0, -slope * width)
    right = left + slope * width
    simulation = at_rest(
        [(0, left), (width, right), (width, right + thickness), (0, left + thickness)], spacing, operators
    )
    x, y = simulation.particles.position.T
    stress = simulation.fields(["sigma_h_eff", "sigma_v_eff", "tau_xy"])
    horizontal, vertical, shear = -stress["sigma_h_eff"], -stress["sigma_v_eff"], stress["tau_xy"]
    cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    normal = horizontal * sin**2 + vertical * cos**2 - 2.0 * shear * sin * cos
    along = (vertical - horizontal) * sin * cos + shear * (cos**2 - sin**2)
    height = y - left - slope * x
    middle = np.abs(x - 0.5 * width) < width / 6.0
    weight = UNIT_WEIGHT * (thickness - height[middle])
    rows = round(0.5 * thickness / spacing)
    of_rows = (height[middle] / spacing, rows)
    errors = np.abs(normal[middle] + weight * cos**2), np.abs(along[middle] + weight * sin * cos)
    found = [largest_by_row(error / (weight * cos**2), *of_rows) for error in errors]
    shown = [" ".join(f"{100.0 * error:.1f}" for error in one) for one in found]
    print(f"{operators}, {angle:g} degrees, dx {spacing:g} m: normal {shown[0]}; shear {shown[1]} %")
    return found[0], found[1]


@pytest.mark.parametrize("operators", OPERATORS)
@pytest.mark.parametrize("angle", [3.0, 6.0, -6.0, 15.0, math.degrees(math.atan(0.5))])
def test_infinite_slope(angle: float, operators: str) -> None:
    """gamma z cos2 b across and gamma z sin b cos b along planes at a depth z."""
    normal, shear = on_infinite_slope(angle, 0.5, operators)
    assert max(normal) < 0.05
    assert max(shear) < 0.02


@pytest.mark.parametrize("operators", OPERATORS)
def test_stresses_on_a_slope_converge(operators: str) -> None:
    coarse, fine = (on_infinite_slope(6.0, spacing, operators)[0] for spacing in (0.5, 0.25))
    assert max(fine) < 0.6 * max(coarse)


# Corners of base and surface from left to right, m.
SHAPES = {
    "wedge": ([(0, 0), (30, 3)], [(0, 9), (30, 9)]),
    "step of 27 degrees": ([(0, 0), (10, 0), (20, 5), (30, 5)], [(0, 11), (30, 11)]),
    "step of 45 degrees": ([(0, 0), (12, 0), (17, 5), (30, 5)], [(0, 11), (30, 11)]),
    "valley": (
        [(x, 4.0 + 3.0 * math.cos(2.0 * math.pi * x / 30.0)) for x in range(31)],
        [(0, 14), (30, 14)],
    ),
}


def line(corners: list[tuple[float, float]]) -> Line:
    x, y = np.array(corners, dtype=float).T
    return lambda at: np.interp(at, x, y)


@pytest.mark.parametrize("operators", OPERATORS)
@pytest.mark.parametrize("shape", SHAPES)
def test_vertical_stress_is_that_of_finite_elements(shape: str, operators: str) -> None:
    corners, top = SHAPES[shape]
    spacing = 0.5
    simulation = at_rest([*corners, *top[::-1]], spacing, operators)
    base, surface = line(corners), line(top)
    cells = (90, 24)
    stress = vertical_stress(base, surface, 30.0, cells, unit_weight=UNIT_WEIGHT, nu=K0 / (1.0 + K0))
    x, y = simulation.particles.position.T
    # The mesh is a lattice in x and in the share of the height over the base.
    share = (y - base(x)) / (surface(x) - base(x))
    across = np.arange(cells[0]) * 30.0 / cells[0] + 15.0 / cells[0]
    up = (np.arange(cells[1]) + 0.5) / cells[1]
    by_column = np.array([np.interp(share, up, column) for column in stress])
    right = np.clip(np.searchsorted(across, x), 1, cells[0] - 1)
    part = (x - across[right - 1]) / (across[right] - across[right - 1])
    nodes = np.arange(len(x))
    exact = (1.0 - part) * by_column[right - 1, nodes] + part * by_column[right, nodes]
    error = np.abs(simulation.field("sigma_v_eff") / exact - 1.0)
    found = largest_by_row(error, (y - base(x)) / spacing, 10)
    print(f"{operators}, {shape}: {' '.join(f'{100.0 * one:.1f}' for one in found)} %")
    assert max(found) < 0.05
