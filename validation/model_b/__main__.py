"""Runs models A and B, prints how they differ and draws model_b.png.

python -m validation.model_b --records FOLDER [--spacing 0.2]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import sandboil as sb

from validation.level_ground.site import DATA, DEPTHS, RECORD, Table, figures
from validation.model_b.comparison import difference, scenes, surface_acceleration


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
    figure.savefig(Path(__file__).with_name("model_b.png"), dpi=110)
    plt.close(figure)


def main() -> None:
    """Run models A and B, print how they differ, and draw model_b.png."""
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
        print(figures(run_b))
        draw(run_a, run_b)


if __name__ == "__main__":
    main()
