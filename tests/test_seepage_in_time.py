"""Seepage in time against consolidation theory and an independent solution of the Richards equation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sandboil as sb
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.sparse import diags_array

Floats = NDArray[np.float64]

# Clay: conductivity (m/s), confined modulus (kPa), Poisson's ratio, porosity; 10 m of it.
CLAY_K, CLAY_M, CLAY_NU, POROSITY, DEPTH = 1.0e-9, 5000.0, 0.2, 0.4, 10.0
GAMMA, BULK = 10.0, 1.0e6
# gamma_w (1/M + n/K_f), 1/m.
STORAGE = GAMMA * (1.0 / CLAY_M + POROSITY / BULK)

# Sand, 1 m: conductivity (m/s), van Genuchten's alpha (1/m) and n, residual saturation, confined
# modulus (kPa).
SAND_K, ALPHA, N, RESIDUAL, SAND_M = 1.0e-4, 3.5, 2.0, 0.1, 2.7e4
ROWS, CELLS = 50, 2000


def hooke(confined_modulus: float, nu: float) -> sb.Elastic:
    """Elastic soil by its modulus of confined compression."""
    return sb.Elastic(E=confined_modulus * (1 + nu) * (1 - 2 * nu) / (1 - nu), nu=nu)


def raised_head(time_factor: float, spacing: float, **settings: Any) -> sb.Simulation:
    """Full clay at a time after the head at its base has risen by 1 m."""
    clay = sb.Region(
        "clay",
        sb.box(x=(0, spacing), y=(0, DEPTH)),
        hooke(CLAY_M, CLAY_NU),
        hydraulic_conductivity=CLAY_K,
        Gs=2.65,
        porosity=POROSITY,
    )
    rises = sb.Head("base", head=[(0, DEPTH), (1, DEPTH + 1)])
    duration = time_factor * DEPTH**2 * STORAGE / CLAY_K
    scene = sb.Scene(
        spacing=spacing,
        water=sb.Water(unit_weight=GAMMA, bulk_modulus=BULK),
        water_table=sb.WaterTable(elevation=DEPTH),
        regions=[clay],
        stages=[sb.Seepage([rises, sb.Head("surface", head=DEPTH)], duration=duration, **settings)],
    )
    simulation = sb.Simulation(scene, threads=1)
    simulation.run_stage()
    return simulation


def consolidation(height: Floats, time_factor: float) -> Floats:
    """Rise of head in m at a height over the depth, by Terzaghi."""
    terms = np.arange(1, 400) * np.pi
    decay = 2.0 / terms * np.exp(-(terms**2) * time_factor)
    rise: Floats = 1.0 - height - np.sin(np.outer(height, terms)) @ decay
    return rise


def error_of_heads(time_factor: float, spacing: float, **settings: Any) -> tuple[float, int]:
    """Largest error of the rise of 1 m, and the number of steps."""
    simulation = raised_head(time_factor, spacing, **settings)
    height = simulation.particles.position[:, 1] / DEPTH
    error = simulation.field("head") - DEPTH - consolidation(height, time_factor)
    return float(np.abs(error).max()), simulation.steps


@pytest.mark.parametrize("time_factor", [0.02, 0.1, 0.4])
def test_clay_stores_water_in_its_skeleton(time_factor: float) -> None:
    error, _ = error_of_heads(time_factor, 0.25)
    assert error < 0.01


def test_the_tolerance_decides_the_error() -> None:
    tolerances = [0.02, 0.005, 0.002, 0.001, 0.0002]
    found = [error_of_heads(0.1, 0.25, tolerance=tolerance) for tolerance in tolerances]
    for tolerance, (error, steps) in zip(tolerances, found, strict=True):
        print(f"tolerance {tolerance}: largest error {100 * error:.2f} % of the rise, {steps} steps")
    errors, steps = zip(*found, strict=True)
    assert list(errors) == sorted(errors, reverse=True)
    assert list(steps) == sorted(steps)
    assert errors[-1] < 0.3 * errors[0]


def test_storage_loses_no_water() -> None:
    balance = raised_head(0.1, 0.5).water_balance
    assert balance is not None
    inflow, stored = balance
    assert stored == pytest.approx(sum(inflow), rel=1e-9)


def retained(head: Floats) -> tuple[Floats, Floats, Floats]:
    """Saturation, its slope (1/m) and relative conductivity at pressure heads (m)."""
    m = 1.0 - 1.0 / N
    suction = np.maximum(-head, 1e-14)
    x = (ALPHA * suction) ** N
    effective = (1.0 + x) ** -m
    slope = (1.0 - RESIDUAL) * m * N * x / suction * effective / (1.0 + x)
    relative = np.sqrt(effective) * (1.0 - (1.0 - effective ** (1.0 / m)) ** m) ** 2
    return RESIDUAL + (1.0 - RESIDUAL) * effective, slope, np.maximum(relative, 1e-6)


def drained_column(times: list[float]) -> list[tuple[Floats, float]]:
    """Saturations of fine cells from below, and outflow in m, by the method of lines."""
    dz = 1.0 / CELLS
    z = (np.arange(CELLS) + 0.5) * dz

    def rate(_: float, head: Floats) -> Floats:
        saturation, slope, relative = retained(head)
        up = np.zeros(CELLS + 1)
        between = 0.5 * SAND_K * (relative[1:] + relative[:-1])
        up[1:-1] = between * ((head[:-1] - head[1:]) / dz - 1.0)
        up[0] = -SAND_K * relative[0] * (2.0 * head[0] / dz + 1.0)
        storage = POROSITY * (slope + GAMMA * saturation / BULK) + GAMMA * saturation**2 / SAND_M
        change: Floats = (up[:-1] - up[1:]) / dz / storage
        return change

    solved = solve_ivp(
        rate,
        (0.0, times[-1]),
        1.0 - z,
        method="BDF",
        t_eval=times,
        rtol=1e-6,
        atol=1e-8,
        jac_sparsity=diags_array([1.0, 1.0, 1.0], offsets=[-1, 0, 1], shape=(CELLS, CELLS)).tocsc(),
    )

    def stored(head: Floats) -> float:
        """Water of the column, m. What it holds by compression alone is below a hundredth."""
        saturation, _, _ = retained(head)
        compression = (POROSITY * GAMMA * saturation / BULK + GAMMA * saturation**2 / SAND_M) * head
        return float((POROSITY * saturation + compression).sum() * dz)

    return [(retained(head)[0], stored(1.0 - z) - stored(head)) for head in solved.y.T]


def test_drained_sand_follows_a_fine_solution() -> None:
    times = [7.2, 48.0, 240.0, 1200.0, 4800.0]
    spacing = 1.0 / ROWS
    sand = sb.Region(
        "sand",
        sb.box(x=(0, 2 * spacing), y=(0, 1)),
        hooke(SAND_M, 0.3),
        hydraulic_conductivity=SAND_K,
        retention=sb.VanGenuchten(ALPHA, N, residual_saturation=RESIDUAL),
        Gs=2.65,
        porosity=POROSITY,
    )
    for time, (fine, outflow) in zip(times, drained_column(times), strict=True):
        scene = sb.Scene(
            spacing=spacing,
            water=sb.Water(unit_weight=GAMMA, bulk_modulus=BULK),
            water_table=sb.WaterTable(elevation=1.0),
            regions=[sand],
            sides=sb.Roller(),
            stages=[sb.Seepage([sb.Head("base", head=0.0)], duration=time)],
        )
        simulation = sb.Simulation(scene, threads=1)
        simulation.run_stage()
        assert simulation.water_balance is not None
        ((inflow,), _) = simulation.water_balance
        error = -inflow / (2 * spacing) / outflow - 1.0
        print(f"{time:g} s: outflow {100 * error:+.2f} %, {simulation.steps} steps")
        assert -inflow / (2 * spacing) == pytest.approx(outflow, rel=0.02)
        difference = simulation.field("saturation")[::2] - fine.reshape(ROWS, -1).mean(axis=1)
        assert np.sqrt(np.mean(difference**2)) < 0.02
