"""Consolidation under a load in waves beside finite elements: draws consolidation.png.

    python -m validation.consolidation

The numbers are those that the test of the same name in crates/sandboil-solver prints: the Python interface
cannot prescribe an excess pore pressure.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

ROOT = Path(__file__).parents[2]
PICTURE = Path(__file__).with_name("consolidation.png")
TEST = "consolidation::waves_of_load::pressure_rises_inside_before_it_falls"
PRINTED = re.compile(
    r"(\d+) rows, T ([\d.]+): rms p/p0 ([\d.]+), lowest row over its start ([\d.]+), exact ([\d.]+)"
)


def main() -> None:
    """Run the test and draw what it prints."""
    matplotlib.use("Agg")
    command = ["cargo", "test", "--release", "-p", "sandboil-solver", "--test", "validation"]
    run = subprocess.run(
        [*command, "--", "--exact", "--nocapture", TEST],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    printed = np.array([[float(number) for number in found] for found in PRINTED.findall(run.stdout)])
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), constrained_layout=True)
    for k, rows in enumerate(np.unique(printed[:, 0])):
        _, time, rms, rise, exact = printed[printed[:, 0] == rows].T
        # The lowest row is half a spacing above the base: every spacing has its own reference.
        left.plot(time, exact, f"C{k}-", lw=1, label=f"finite elements, lowest of {rows:.0f} rows")
        left.plot(time, rise, f"C{k}o", ms=5, label=f"{rows:.0f} rows")
        right.loglog(time, rms, f"C{k}o-", ms=5, label=f"{rows:.0f} rows")
    left.axhline(1.0, color="0.6", lw=0.8)
    left.set(xlabel="time factor c_v t/H², 1", ylabel="excess pressure near the base over its start, 1")
    right.axhline(0.01, color="0.6", lw=0.8)
    right.set(xlabel="time factor c_v t/H², 1", ylabel="rms difference over the largest start, 1")
    for ax in (left, right):
        ax.legend(fontsize=8)
    figure.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    main()
