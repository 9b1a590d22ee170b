"""Water through ground at rest beside its references: draws water.png and dam_seepage.png.

    python -m validation.seepage [--geometry FILE]

where FILE is the section of the Lower San Fernando Dam with its zones and Table 2 of Mhaski and Ramana (2025)
as JSON, which is not distributed here.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import sandboil as sb
from matplotlib.tri import Triangulation
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Floats = NDArray[np.float64]

FIGURES = Path(__file__).parent
SOIL = sb.Elastic(E=2.0e4, nu=0.3)

# Sand of the columns: van Genuchten's alpha (1/m), n, residual saturation; conductivity (m/s), porosity.
ALPHA, N, RESIDUAL, K, POROSITY = 3.5, 2.0, 0.1, 1.0e-4, 0.4


def curve(head: Floats) -> tuple[Floats, Floats, Floats]:
    """Saturation, its slope (1/m), and relative conductivity at pressure heads (m), without the core."""
    m = 1.0 - 1.0 / N
    suction = np.maximum(-head, 1e-12)
    x = (ALPHA * suction) ** N
    effective = (1.0 + x) ** -m
    slope = (1.0 - RESIDUAL) * m * N * x / suction * effective / (1.0 + x)
    relative = np.sqrt(effective) * (1.0 - (1.0 - effective ** (1.0 / m)) ** m) ** 2
    wet = head >= 0.0
    return (
        np.where(wet, 1.0, RESIDUAL + (1.0 - RESIDUAL) * effective),
        np.where(wet, 0.0, slope),
        np.where(wet, 1.0, np.maximum(relative, 1e-6)),
    )


def fine_column(
    start: float, rain: float | None, open_base: bool, duration: float, cells: int = 300
) -> Floats:
    """Saturation of the cells of a column of 1 m, from below, by the method of lines: not by the package."""
    dz = 1.0 / cells

    def rate(_: float, head: Floats) -> Floats:
        _, slope, relative = curve(head)
        between = K * 0.5 * (relative[1:] + relative[:-1])
        up = between * ((head[:-1] - head[1:]) / dz - 1.0)
        flux = np.zeros(cells + 1)
        flux[1:-1] = up
        flux[-1] = -rain if rain is not None else 2.0 * K * (head[-1] / dz - 0.5)
        flux[0] = -2.0 * K * relative[0] * (head[0] / dz + 0.5) if open_base else 0.0
        change: Floats = (flux[:-1] - flux[1:]) / dz / (POROSITY * slope + 1e-4)
        return change

    solved = solve_ivp(
        rate, (0.0, duration), np.full(cells, start), method="LSODA", rtol=1e-5, atol=1e-6, lband=1, uband=1
    )
    return curve(solved.y[:, -1])[0]


def column(start: float, conditions: list[Any], duration: float, spacing: float) -> tuple[Floats, Floats]:
    """Elevations and saturations of a column of 1 m by the package."""
    region = sb.Region(
        "sand",
        sb.box(x=(0, 2 * spacing), y=(0, 1)),
        SOIL,
        hydraulic_conductivity=K,
        retention=sb.VanGenuchten(ALPHA, N, residual_saturation=RESIDUAL),
        Gs=2.65,
        porosity=POROSITY,
    )
    scene = sb.Scene(
        spacing=spacing,
        water=sb.Water(),
        # Suction at rest is not uniform over a still water table: it starts about `start` at mid height.
        water_table=sb.WaterTable(elevation=start + 0.5),
        regions=[region],
        sides=sb.Roller(),
        stages=[sb.Seepage(conditions, duration=duration)],
    )
    simulation = sb.Simulation(scene)
    simulation.run_stage()
    y = simulation.particles.position[:, 1]
    return y[::2], simulation.field("saturation")[::2]


def draw_closed_forms() -> None:
    """The dam with vertical faces, and columns that take up and lose water."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 6), constrained_layout=True)
    region = sb.Region(
        "dam",
        sb.box(x=(0, 16), y=(0, 24)),
        SOIL,
        hydraulic_conductivity=K,
        retention=sb.VanGenuchten(8.0, 3.0, residual_saturation=0.05),
        Gs=2.65,
        porosity=POROSITY,
    )
    conditions = [sb.Reservoir("left", level=24.0), sb.Reservoir("right", level=4.0)]
    scene = sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(points=[(0, 24), (16, 4)]),
        regions=[region],
        sides=sb.Roller(),
        stages=[sb.Seepage(conditions)],
    )
    simulation = sb.Simulation(scene)
    simulation.run_stage()
    x, y = simulation.particles.position.T
    heads = left.tricontourf(x, y, simulation.field("head"), levels=20)
    figure.colorbar(heads, ax=left, label="total head, m")
    left.tricontour(x, y, simulation.field("pore_pressure"), levels=[0.0], colors="white")
    left.plot([16.0], [12.79], "r<", label="seepage point 12.79 m (Hornung and Krueger 1985)", clip_on=False)
    exact = K * (24.0**2 - 4.0**2) / 32.0
    found = simulation.discharge[0][1]
    left.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    left.set_title(f"discharge {found:.4e} m²/s, exact {exact:.4e}: {found / exact - 1.0:+.2%}", fontsize=9)
    left.legend(loc="lower left", fontsize=8)
    cases: list[tuple[str, float, list[Any], float | None, bool, float]] = [
        ("pond on dry sand, 1200 s", -8.0, [sb.Head("surface", head=1.0)], None, False, 1200.0),
        ("rain on dry sand, 5000 s", -8.0, [sb.Rain("surface", rate=2e-5)], 2e-5, False, 5000.0),
    ]
    for (name, start, conditions, rain, open_base, duration), colour in zip(cases, ("C0", "C1"), strict=True):
        fine = fine_column(start, rain, open_base, duration)
        centres = (np.arange(len(fine)) + 0.5) / len(fine)
        right.plot(fine, centres, colour, label=f"{name}: method of lines, 300 cells")
        elevation, saturation = column(start, conditions, duration, 0.05)
        right.plot(saturation, elevation, f"{colour}o", ms=4, label="20 rows")
    right.set(xlabel="degree of saturation, 1", ylabel="elevation, m")
    right.legend(fontsize=8)
    figure.savefig(FIGURES / "water.png", dpi=110)


def dam(geometry: dict[str, Any], spacing: float, conditions: list[Any], duration: float | None) -> sb.Scene:
    """The Lower San Fernando Dam with its reservoir."""
    table = geometry["materials"]["table"]
    regions = []
    for zone in geometry["zones"]:
        soil = table[zone["material"]] if zone["material"] in table else table[zone["material"].split("_")[0]]
        across, ratio = soil["k_v_m_s"], soil["kh_over_kv"]
        regions.append(
            sb.Region(
                zone["name"],
                sb.polygon([tuple(corner) for corner in zone["polygon"]]),
                sb.DruckerPrager(
                    c=soil["c_kPa"], phi=soil["phi_deg"], psi=0.0, G=soil["G_kPa"], K=soil["K_kPa"]
                ),
                hydraulic_conductivity=across if ratio == 1 else sb.Conductivity(ratio * across, across),
                # No retention is published: a fine sand's, of half a metre of capillary rise.
                retention=sb.VanGenuchten(2.0, 2.0, residual_saturation=0.1),
                saturated_unit_weight=soil["gamma_sat_kN_m3"],
                Gs=2.7,
            )
        )
    return sb.Scene(
        spacing=spacing,
        water=sb.Water(),
        water_table=sb.WaterTable(points=[(-29.3, 338.0), (0.0, 330.0), (100.0, 305.0)]),
        regions=regions,
        sides=sb.Roller(),
        stages=[sb.Seepage(conditions, duration=duration)],
    )


def triangles(simulation: sb.Simulation) -> Triangulation:
    """Triangles between neighbouring nodes, none across the air above a slope."""
    x, y = simulation.particles.position.T
    joined = Triangulation(x, y)
    corners = simulation.particles.position[joined.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    joined.set_mask(longest > 2.5 * max(simulation.particles.spacing))
    return joined


def draw_dam(geometry: dict[str, Any]) -> None:
    """Steady seepage through the Lower San Fernando Dam, and the phreatic line while the reservoir rises."""
    drain = sb.Drain(
        [(98.2, 306.4), (86.8, 311.0), (77.0, 315.0), (69.7, 318.0), (62.4, 321.0), (40.0, 330.1)]
    )
    tail = sb.Reservoir("surface", level=305.0, x=(0.0, 280.0))
    figure, axes = plt.subplots(2, 1, figsize=(12, 5), constrained_layout=True)
    steady = dam(geometry, 0.8, [sb.Reservoir("surface", level=338.0, x=(-220.0, 0.0)), tail, drain], None)
    simulation = sb.Simulation(steady)
    start = time.perf_counter()
    simulation.run_stage()
    spent = time.perf_counter() - start
    flows = [flow for _, flow in simulation.discharge]
    net = abs(sum(flows)) / flows[0]
    print(
        f"steady, 0.8 m, {len(simulation.particles.position)} nodes: {spent:.0f} s, {simulation.counters()}"
    )
    print(f"inflow {flows[0]:.3e} m2/s, downstream {flows[1]:.3e}, drain {flows[2]:.3e}, net {net:.1e}")
    joined = triangles(simulation)
    heads = axes[0].tricontourf(joined, simulation.field("head"), levels=np.arange(304.0, 340.0, 2.0))
    figure.colorbar(heads, ax=axes[0], label="total head, m")
    axes[0].tricontour(joined, simulation.field("pore_pressure"), levels=[0.0], colors="red")
    axes[0].plot(*np.transpose(drain.points), "m--", label="chimney drain")
    axes[0].set_title(
        f"steady state: inflow {flows[0]:.2e} m²/s, downstream {-flows[1]:.2e}, drain {-flows[2]:.2e}",
        fontsize=9,
    )
    year = 365.0 * 86_400.0
    rising = sb.Reservoir("surface", level=[(0.0, 308.0), (year, 338.0)], x=(-220.0, 0.0))
    rise = dam(geometry, 2.5, [rising, tail, drain], 3.0 * year)
    rise = rise.changed(water_table=sb.WaterTable(points=[(-100.0, 308.0), (100.0, 305.0)]))
    simulation = sb.Simulation(rise)
    for k, months in enumerate((6, 12, 18, 24, 36)):
        while not simulation.advance(months / 12.0 * year, 60.0):
            pass
        pressure = simulation.field("pore_pressure")
        axes[1].tricontour(triangles(simulation), pressure, levels=[0.0], colors=[f"C{k}"], linewidths=1.2)
        axes[1].plot([], [], f"C{k}", label=f"{months} months")
    balance = simulation.water_balance
    assert balance is not None
    lost = abs(sum(balance[0]) - balance[1]) / max(abs(flow) for flow in balance[0])
    print(f"rising for a year: {simulation.steps} steps, water lost {lost:.1e}, {simulation.counters()}")
    axes[1].set_title("reservoir rising from 308 to 338 m within a year: phreatic line", fontsize=9)
    for ax in axes:
        ax.plot(*steady.outline.surface.T, "k", lw=0.8)
        ax.set(xlabel="x, m", ylabel="elevation, m", aspect="equal")
        ax.legend(fontsize=8)
    figure.savefig(FIGURES / "dam_seepage.png", dpi=110)


def main() -> None:
    """Draw the closed forms, and the dam if its section is given."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--geometry", type=Path)
    arguments = parser.parse_args()
    matplotlib.use("Agg")
    draw_closed_forms()
    if arguments.geometry is not None:
        draw_dam(json.loads(arguments.geometry.read_text()))


if __name__ == "__main__":
    main()
