"""Heaps and columns that run out by the conservative operators and by those of the dual lattice.

    python -m validation.dual_lattice --threads 2

Prints the table and draws `dual_lattice.png`.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from validation.run_out.__main__ import LAW, Floats, heap, result

PICTURE = Path(__file__).with_name("dual_lattice.png")
OPERATORS = ("conservative", "dual")
# Distance to the nearest node, in spacings, below which a node counts as clumped.
CLUMPED = 0.5
# Width of the columns, m, and their friction angle, degrees.
WIDTH, FRICTION = 0.1, 30.0


def row(name: str, spacing: float, threads: int, **heap_options: Any) -> list[Floats]:
    """Print the figures of a heap by both operators; returns the places of the nodes at rest, m."""
    places = []
    for operators in OPERATORS:
        begun = time.process_time()
        at, shown = result(heap(spacing=spacing, operators=operators, **heap_options), threads)
        seconds = time.process_time() - begun
        nearest = KDTree(at).query(at, 2)[0][:, 1] / spacing
        reach = float(np.quantile(at[:, 0], 0.99))
        print(
            f"| {name} | {operators} | {shown['front, m']:.3f} | {reach:.3f} | "
            f"{np.mean(nearest < CLUMPED):.3f} | {seconds:.0f} |",
            flush=True,
        )
        places.append(at)
    return places


def main() -> None:
    """Measure and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--threads", type=int, default=2)
    threads = parser.parse_args().threads
    mpl.use("Agg")
    print("| case | operators | front, m | 99 % of the nodes within, m | share of clumped nodes | CPU s |")
    print("|---|---|---|---|---|---|")
    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    for rows, axes in zip((10, 20), panels, strict=True):
        found = row(f"undrained heap, {rows} rows", WIDTH / rows, threads, k=0.0, duration=2.0)
        for operators, at, marker in zip(OPERATORS, found, (".", "x"), strict=True):
            axes.plot(*at.T, marker, ms=3.0, label=operators)
        axes.set(ylabel="y, m", title=f"undrained heap at rest, {rows} rows", aspect="equal")
    panels[0].legend()
    panels[1].set(xlabel="x, m")
    figure.savefig(PICTURE, dpi=120)
    for aspect in (0.5, 1.0, 3.0):
        # Lube et al. (2005): below a = 1.8, and beyond.
        law = 1.0 + (LAW * aspect if aspect < 1.8 else 1.9 * aspect ** (2.0 / 3.0))
        for rows in (10, 20):
            name = f"dry column, a {aspect:g}, {rows} nodes wide, law {WIDTH * law:.3f} m"
            row(name, WIDTH / rows, threads, height=aspect * WIDTH, width=WIDTH, phi=FRICTION, duration=1.0)


if __name__ == "__main__":
    main()
