"""Run-out: released heaps against experiments, and the effect of each numerical choice.

    python -m validation.run_out --threads 2

Prints the tables and draws `run_out.png`. Dry columns of sand on a rough bed, released by a
gate, run out by (L - L0)/L0 = 1.2 a for a = H0/L0 below 1.8, for any sand (Lube, Huppert, Sparks &
Freundt 2005, Phys. Rev. E 72, 041301). The other heap is that of Bui et al. (2008).
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import sandboil as sb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

# Nodes further apart than this, in spacings, are not connected.
LINK = 2.0
# The factor of the law of the experiments, and the friction angle used here for their sands, degrees.
LAW = 1.2
SANDS = 31.0
DEFAULT_VISCOSITY = 0.1
PICTURE = Path(__file__).with_name("run_out.png")

Floats = NDArray[np.float64]


def heap(
    height: float = 0.1,
    width: float = 0.2,
    spacing: float = 0.005,
    phi: float = 19.8,
    duration: float = 1.2,
    *,
    k: float | None = None,
    bulk_modulus: float = 1e4,
    level: float | None = None,
    viscosity: float = DEFAULT_VISCOSITY,
    **numerics: Any,
) -> sb.Scene:
    """A heap whose right wall is removed; full of water with `k` (m/s), in air or below `level` (m)."""
    soil = sb.DruckerPrager(E=840.0, nu=0.3, phi=phi, c=0.0)
    wet: dict[str, Any] = {}
    if k is not None:
        wet = {
            "water": sb.Water(unit_weight=9.81, bulk_modulus=bulk_modulus),
            "water_table": sb.WaterTable(elevation=height if level is None else level),
        }
    still: list[tuple[float, float]] | None = [] if k is not None and level is None else None
    return sb.Scene(
        regions=[
            sb.Region(
                "heap",
                sb.Box(x=(0, width), y=(0, height)),
                soil,
                porosity=0.4,
                Gs=2.65,
                hydraulic_conductivity=k or 0.0,
            )
        ],
        spacing=spacing,
        sides=sb.Roller(),
        stages=[
            sb.Gravity(),
            sb.RunOut(duration, open_sides=["right"], viscosity=viscosity, still_water=still),
        ],
        numerics=sb.Numerics(**numerics),
        **wet,
    )


def run(scene: sb.Scene, threads: int) -> tuple[sb.Simulation, float]:
    """A scene run to its end, and the seconds of its run-out."""
    simulation = sb.Simulation(scene, threads=threads)
    while simulation.stage == "gravity":
        simulation.step(64)
    start = time.perf_counter()
    while not simulation.is_complete:
        simulation.step(1000)
    return simulation, time.perf_counter() - start


def front(places: Floats, spacing: float) -> float:
    """Largest x of the nodes connected to the heap, m."""
    tree = KDTree(places)
    _, parts = connected_components(tree.sparse_distance_matrix(tree, LINK * spacing))
    return float(places[parts == np.bincount(parts).argmax(), 0].max())


def result(scene: sb.Scene, threads: int) -> tuple[Floats, dict[str, float]]:
    """Places of the nodes at rest, shape (n, 2), m, and the figures of a row."""
    simulation, seconds = run(scene, threads)
    places = simulation.particles.position + simulation.field("displacement")
    speed = np.hypot(*simulation.field("velocity").T)
    return places, {
        "front, m": front(places, scene.spacing),
        "top, m": float(places[:, 1].max()),
        "mean speed, m/s": float(np.sqrt((speed**2).mean())),
        "nodes": len(places),
        "steps": simulation.steps,
        "geometries": simulation.counters()["geometry_builds"],
        "s": seconds,
    }


def row(name: str, shown: dict[str, float]) -> None:
    """Print a row of a table."""
    print(f"| {name} | " + " | ".join(f"{value:.4g}" for value in shown.values()) + " |", flush=True)


def head(first: str) -> None:
    """Print the head of a table."""
    names = ["front, m", "top, m", "mean speed, m/s", "nodes", "steps", "geometries", "s"]
    print(f"\n| {first} | " + " | ".join(names) + " |")
    print("|---" * (len(names) + 1) + "|")


def against_experiments(figure: Figure, threads: int) -> None:
    """Columns of four heights against the law, at two spacings."""
    head(f"column, phi {SANDS:g}, against 1 + {LAW:g} a")
    axes = figure.add_subplot(1, 3, 1)
    aspect = np.linspace(0.0, 1.8)
    axes.plot(aspect, LAW * aspect, color="black", label="experiments, 1.2 a")
    for rows, marker in ((10, "o"), (20, "s")):
        found = []
        for a in (0.5, 1.0, 1.5):
            width = 0.1
            scene = heap(a * width, width, width / rows, SANDS, 1.0)
            _, shown = result(scene, threads)
            found.append(shown["front, m"] / width - 1.0)
            row(f"a {a:g}, L0/dx {rows}: (L - L0)/L0 {found[-1]:.3f} of {LAW * a:.2f}", shown)
        axes.plot((0.5, 1.0, 1.5), found, marker, label=f"L0/dx {rows}")
    axes.set(xlabel="a = H0/L0", ylabel="(L - L0)/L0")
    axes.legend(fontsize=7)


def trades(figure: Figure, threads: int) -> None:
    """Effect of viscosity, spacing, and the numerics of the geometry and the step."""
    head("dry heap")
    curves: dict[str, tuple[list[float], list[float]]] = {}
    for name, values in {
        "viscosity": (0.0, 0.05, 0.1, 0.2, 0.5),
        "spacing": (0.01, 0.0067, 0.005, 0.0033),
        "geometry_strain_limit": (0.05, 0.1, 0.2, 0.4),
        "time_step_factor": (0.3, 0.6, 0.9),
        "velocity_filter": (0.0, 0.1, 0.2, 0.4),
    }.items():
        curves[name] = ([], [])
        for value in values:
            _, shown = result(heap(**{name: value}), threads)
            row(f"{name} {value:g}", shown)
            curves[name][0].append(shown["steps"] * shown["nodes"] / 1e6)
            curves[name][1].append(shown["front, m"])
    axes = figure.add_subplot(1, 3, 2)
    for name, (work, fronts) in curves.items():
        axes.semilogx(work, fronts, "o-", ms=3.0, label=name)
    axes.set(xlabel="updates of a node, millions", ylabel="front, m", title="what choices cost and change")
    axes.legend(fontsize=7)


def waters(figure: Figure, threads: int) -> None:
    """Saturated heaps, in air and below water, and the ends of the range."""
    head("heap full of water, spacing 0.01 m")
    axes = figure.add_subplot(1, 3, 3)
    spacing = 0.01
    for name, changes in {
        "wet, k 0": {"k": 0.0},
        "wet, k 1e-12 m/s": {"k": 1e-12},
        "wet, k 1e-5 m/s": {"k": 1e-5},
        "wet, k 1e-3 m/s": {"k": 1e-3},
        "wet, k 1e-2 m/s": {"k": 1e-2},
        "wet, k 1 m/s": {"k": 1.0},
        "wet, K_f x 0.01": {"k": 1e-3, "bulk_modulus": 1e2},
        "wet, K_f x 100": {"k": 1e-3, "bulk_modulus": 1e6, "duration": 0.4},
        "submerged, k 1e-3 m/s": {"k": 1e-3, "level": 0.3},
        "under 100 m": {"k": 1e-3, "level": 100.0},
        "viscosity 0": {"k": 1e-3, "viscosity": 0.0},
        "viscosity 10": {"k": 1e-3, "viscosity": 10.0},
    }.items():
        places, shown = result(heap(spacing=spacing, **changes), threads)
        row(name, shown)
        if name in ("wet, k 0", "wet, k 1e-2 m/s", "submerged, k 1e-3 m/s"):
            axes.plot(*places.T, ".", ms=3.0, label=name)
    axes.plot([0.2, 0.2], [0.0, 0.1], color="black", lw=0.8, label="at rest")
    axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    axes.legend(fontsize=7)


def main() -> None:
    """Parse the arguments, run every table, draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=1)
    asked = parser.parse_args()
    mpl.use("Agg")
    figure = Figure(figsize=(15.0, 4.5), layout="constrained")
    against_experiments(figure, asked.threads)
    trades(figure, asked.threads)
    waters(figure, asked.threads)
    figure.savefig(PICTURE, dpi=130)


if __name__ == "__main__":
    main()
