"""Model B of the level ground site (Mhaski and Ramana 2025, section 6.2), between free-field sides.

Compared with the column of model A and with OpenSees.

As a script it runs both, prints how they differ and draws docs/figures/model_b.png:

    python tests/validation/model_b.py --records FOLDER [--spacing 0.2]
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import level_ground
import numpy as np
import sandboil as sb
from level_ground import CORNER, DATA, DEPTHS, DOCS, RECORD, Floats, Table
from scipy.signal import butter, sosfiltfilt

# Width of the paper's main domain, m.
WIDTH = 5.0
PICTURE = DOCS / "figures" / "model_b.png"


@dataclass(frozen=True)
class Difference:
    """Model B less model A. Tuples go over 4, 11 and 17 m."""

    pga_10hz: float
    r_u_largest: tuple[float, ...]
    r_u_rms: tuple[float, ...]
    side_r_u_largest: tuple[float, ...]


def scenes(motion: sb.Motion, spacing: float) -> tuple[sb.Scene, sb.Scene]:
    """Models A, one particle wide, and B, which also keeps histories beside its left side."""
    model_a = level_ground.scene(motion, spacing=spacing)
    model_b = level_ground.scene(motion, spacing=spacing, width=WIDTH, sides=sb.FreeField())
    beside = [(0.5 * spacing, model_b.bounds[3] - depth) for depth in DEPTHS]
    return model_a, model_b.changed(**{"output.points": beside})


def surface_acceleration(run: sb.Run) -> tuple[Floats, Floats]:
    """Time (s) and horizontal acceleration at the surface below 10 Hz (g)."""
    surface = run.history("acceleration_x", unit="g")
    rate = 1.0 / (surface.time[1] - surface.time[0])
    return surface.time, sosfiltfilt(butter(4, CORNER, fs=rate, output="sos"), surface.values)


def difference(run_a: sb.Run, run_b: sb.Run) -> Difference:
    """Compare two runs."""
    peaks = [float(np.abs(surface_acceleration(run)[1]).max()) for run in (run_a, run_b)]
    largest, rms, beside = [], [], []
    for depth in DEPTHS:
        column = run_a.history("r_u", depth=depth)
        centre = run_b.history("r_u", depth=depth)
        side = run_b.history("r_u", at=(0.5 * run_b.scene.spacing, run_b.scene.bounds[3] - depth))
        apart = np.interp(column.time, centre.time, centre.values) - column.values
        largest.append(float(np.abs(apart).max()))
        rms.append(float(np.sqrt(np.mean(apart**2))))
        apart = np.interp(column.time, side.time, side.values) - column.values
        beside.append(float(np.abs(apart).max()))
    return Difference(peaks[1] / peaks[0] - 1.0, tuple(largest), tuple(rms), tuple(beside))


def draw(run_a: sb.Run, run_b: sb.Run) -> None:
    """Surface acceleration and r_u at three depths: A, B and OpenSees."""
    import matplotlib.pyplot as plt

    reference = Table.read(DATA / "histories.csv")
    figure, axes = plt.subplots(4, 1, figsize=(9.0, 10.0), sharex=True, layout="constrained")
    runs = (("model A, periodic column", run_a, "#0072B2", "-"), ("model B, centre", run_b, "#D55E00", "--"))
    for label, run, colour, style in runs:
        axes[0].plot(*surface_acceleration(run), style, color=colour, lw=0.9, label=label)
        for axis, depth in zip(axes[1:], DEPTHS, strict=True):
            r_u = run.history("r_u", depth=depth)
            axis.plot(r_u.time, r_u.values, style, color=colour, label=label)
    for axis, depth in zip(axes[1:], DEPTHS, strict=True):
        side = run_b.history("r_u", at=(0.5 * run_b.scene.spacing, run_b.scene.bounds[3] - depth))
        axis.plot(side.time, side.values, ":", color="#009E73", label="model B, beside its side")
        axis.plot(reference["time_s"], reference[f"ru_{depth}m"], color="0.4", lw=0.8, label="OpenSees")
        axis.set_ylabel(f"r_u at {depth} m, 1")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("surface acceleration\nbelow 10 Hz, g")
    axes[0].grid(alpha=0.3)
    axes[0].legend(frameon=False)
    axes[1].legend(frameon=False)
    axes[-1].set_xlabel("time, s")
    axes[-1].set_xlim(0.0, run_a.history("r_u", depth=DEPTHS[0]).time[-1])
    figure.savefig(PICTURE, dpi=110)
    plt.close(figure)


def main() -> None:
    """Run models A and B and show how they differ."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--records", type=Path, required=True, help=f"folder that holds {RECORD}")
    parser.add_argument("--spacing", type=float, default=0.2, help="m")
    asked = parser.parse_args()
    motion = sb.Motion.from_at2(asked.records / RECORD)
    with tempfile.TemporaryDirectory() as folder:
        model_a, model_b = scenes(motion, asked.spacing)
        run_a = sb.run(model_a, Path(folder) / "a", threads=1)
        run_b = sb.run(model_b, Path(folder) / "b", threads=2)
        print(difference(run_a, run_b))
        print(level_ground.figures(run_b))
        draw(run_a, run_b)


if __name__ == "__main__":
    main()
