"""Runs the three soils, prints the rows of README.md and draws shear_cell.png.

python -m validation.shear_cell [--threads N]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from sandboil._style import OURS, REFERENCE, STYLE
from sandboil.lab import ShearCell

from validation.laboratory.comparison import CASES, CRITERIA, reference
from validation.shear_cell.comparison import TESTS, run


def _line(name: str, found: ShearCell) -> str:
    expected, report = CASES[name]["cycles"], found.report
    cells = [TESTS[name]]
    cells += [f"{found.cycles_to(**level):.2f} ({expected[key]:.2f})" for key, level in CRITERIA.items()]
    cells += [f"{report.gamma_spread:.1e}", f"{report.tau_spread:.2f}", f"{report.sigma_v_spread:.2f}"]
    cells += [f"{report.volume_strain:.1e}", f"{100 * report.velocity_deviation:.1f}"]
    cells += [f"{100 * report.overshoot:.1f}", f"{report.steps}", f"{report.wall_time:.0f}"]
    return f"| {' | '.join(cells)} |"


def _peaks(name: str, found: ShearCell) -> str:
    """Strain at the reversals beside the reference's, %, from the last one below 1 % on."""
    expected = np.array(CASES[name]["peaks"])
    ours = found.peaks().gamma
    count = min(len(ours), len(expected))
    first = max(int(np.argmax(np.abs(expected) > 0.01)) - 1, 0)
    pairs = zip(ours[first:count], expected[first:count], strict=True)
    return "; ".join(f"{100 * a:.2f} ({100 * b:.2f})" for a, b in pairs)


def _draw(results: dict[str, ShearCell]) -> None:
    """Stress paths and stress-strain curves, ours below the reference's dashes."""
    import matplotlib.pyplot as plt

    plt.rcParams.update(STYLE)
    figure, axes = plt.subplots(2, len(results), figsize=(11.0, 6.4), layout="constrained")
    for column, (name, found) in zip(axes.T, results.items(), strict=True):
        theirs = reference(name)
        for axis, quantity, factor in ((column[0], "sigma_v_eff", 1.0), (column[1], "gamma", 100.0)):
            x = factor * getattr(found, quantity)
            axis.plot(x, found.tau, color=OURS, lw=1.1, label="centre of the cell")
            x = factor * theirs[quantity]
            axis.plot(x, theirs["tau"], "--", color=REFERENCE, lw=0.7, label="OpenSees, one element")
        column[0].set_title(TESTS[name], loc="left")
        column[0].set_xlabel("vertical effective stress, kPa")
        column[1].set_xlabel("shear strain, %")
    for axis in axes[:, 0]:
        axis.set_ylabel("shear stress, kPa")
    axes[1, 0].legend(loc="lower right", fontsize="small")
    figure.savefig(Path(__file__).with_name("shear_cell.png"), dpi=110)
    plt.close(figure)


def main() -> None:
    """Run the three soils, print the table's rows and the strains at the reversals, draw the picture."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--threads", type=int, default=1)
    threads = parser.parse_args().threads
    results = {}
    for name in TESTS:
        results[name] = run(name, threads=threads)
        print(_line(name, results[name]), _peaks(name, results[name]), sep="\n", flush=True)
    _draw(results)


if __name__ == "__main__":
    main()
