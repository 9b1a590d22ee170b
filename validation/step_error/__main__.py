"""Draws PM4Sand's error against the part from step_error.csv.

cargo run --release -p sandboil-soil --example step_error > validation/step_error/step_error.csv
python -m validation.step_error
"""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt

FOLDER = Path(__file__).parent
TABLE, PICTURE = FOLDER / "step_error.csv", FOLDER / "step_error.png"

PANELS = (
    ("first_loading_kPa", "first loading to 0.04 %: error, kPa"),
    ("sp1_rms_kPa", "sp1, liquefaction: rms to OpenSees, kPa"),
    ("sp3_rms_kPa", "sp3, changing directions: rms to OpenSees, kPa"),
    ("cycles_to_3_percent", "cycles to 3 % shear strain"),
)
CURVES = {
    ("modified Euler", "3e-5"): ("modified Euler, 3e-5 (default)", "C0", "o-"),
    ("modified Euler", "1e-4"): ("modified Euler, 1e-4", "C2", "^-"),
    ("modified Euler", "1e-3"): ("modified Euler, 1e-3", "C1", "s-"),
    ("modified Euler", "inf"): ("modified Euler, no error control", "C3", "x--"),
    ("Runge-Kutta", "NaN"): ("Runge-Kutta 4, at most 0.5 m p/G", "C4", "d-"),
    ("reference", "NaN"): ("reference", "k", "*-"),
}
DEFAULT_PART = 5e-6
# Number of cycles drawn for a test that never liquefies.
NEVER = 18.0
# Lines of order two and four: their value at a part of 1e-6, kPa.
ORDERS = ((2, 1.2e-3), (4, 3e-7))


def main() -> None:
    curves: dict[tuple[str, str], list[dict[str, str]]] = defaultdict(list)
    with TABLE.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            curves[row["integrator"], row["tolerance"]].append(row)
    figure, axes = plt.subplots(2, 2, figsize=(10, 8), layout="constrained", sharex=True)
    for axis, (column, title) in zip(axes.flat, PANELS, strict=True):
        for key, (label, color, style) in CURVES.items():
            parts = [float(row["part"]) for row in curves[key]]
            values = [float(row[column]) for row in curves[key]]
            shown = [value if math.isfinite(value) else NEVER for value in values]
            axis.plot(parts, shown, style, color=color, label=label, markersize=5, linewidth=1.2)
        axis.axvline(DEFAULT_PART, color="0.7", linewidth=0.8)
        axis.set_xscale("log")
        axis.set_title(title, fontsize=10)
        axis.grid(alpha=0.25)
    for axis in axes.flat[:3]:
        axis.set_yscale("log")
    first, cycles = axes.flat[0], axes.flat[3]
    for order, start in ORDERS:
        ends = (5e-7, 5e-6)
        first.plot(ends, [start * (part / 1e-6) ** order for part in ends], ":", color="0.4", linewidth=1)
        first.annotate(f"order {order}", (ends[0], 1.5 * start / 2**order), fontsize=8, color="0.3")
    cycles.axhline(NEVER, color="0.7", linestyle=":")
    cycles.annotate("never", (6e-7, NEVER - 0.25), fontsize=8, color="0.3")
    for axis in axes[1]:
        axis.set_xlabel("largest strain component of a part")
    cycles.legend(fontsize=8, loc="center left")
    figure.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    main()
