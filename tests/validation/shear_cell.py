"""The paper's simple shear cell beside OpenSees (Mhaski and Ramana 2025, section 6.1, Table 1).

One place for the soils and the figures that are compared. As a script it runs the three soils, prints the
rows of docs/validation.md and draws its picture:

    python tests/validation/shear_cell.py [--threads N]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import sandboil as sb
from sandboil.lab import ShearCell, shear_cell

DATA = Path(__file__).parent / "data" / "dss"
PICTURE = Path(__file__).parents[2] / "docs" / "figures" / "shear_cell.png"

# Tests of the reference and how they are called here: Table 1 of the paper.
TESTS = {
    "cyclic_N06_Dr35": "Dr 0.35, CSR 0.090",
    "cyclic_N14_Dr55": "Dr 0.55, CSR 0.147",
    "cyclic_N26_Dr75": "Dr 0.75, CSR 0.312",
}
# Levels that are compared: key of the reference, and what `cycles_to` is asked.
LEVELS: dict[str, dict[str, float]] = {
    "N_ru_0p95": {"r_u": 0.95},
    "N_ru_0p98": {"r_u": 0.98},
    "N_gamma_1pct": {"gamma_sa": 0.01},
    "N_gamma_3pct": {"gamma_sa": 0.03},
    "N_gamma_5pct": {"gamma_sa": 0.05},
}


def reference(name: str) -> dict[str, Any]:
    """Parameters and results of OpenSees."""
    found: dict[str, Any] = json.loads((DATA / "summary.json").read_text(encoding="utf-8"))[name]
    return found


def run(name: str, **changes: Any) -> ShearCell:
    """The test as a cell, from the void ratio and stress of the reference."""
    given = reference(name)
    soil = sb.PM4Sand(Dr=given["Dr"], G0=given["G0"], hpo=given["hpo"])
    arguments = {key: given[key] for key in ("sigma_v0", "K0", "csr", "void_ratio")}
    return shear_cell(soil, **(arguments | changes))


def differences(name: str, found: ShearCell) -> dict[str, float]:
    """Cycles to every level less those of the reference."""
    expected = reference(name)["cycles"]
    return {key: found.cycles_to(**level) - expected[key] for key, level in LEVELS.items()}


def _line(name: str, found: ShearCell) -> str:
    expected, report = reference(name)["cycles"], found.report
    cells = [TESTS[name]]
    cells += [f"{found.cycles_to(**level):.2f} ({expected[key]:.2f})" for key, level in LEVELS.items()]
    cells += [f"{report.gamma_spread:.1e}", f"{report.tau_spread:.2f}", f"{report.sigma_v_spread:.2f}"]
    cells += [f"{report.volume_strain:.1e}", f"{100 * report.velocity_deviation:.1f}"]
    cells += [f"{100 * report.overshoot:.1f}", f"{report.steps}", f"{report.wall_time:.0f}"]
    return f"| {' | '.join(cells)} |"


def _peaks(name: str, found: ShearCell) -> str:
    """Strain at the reversals beside the reference's, %, from the last one below 1 % on."""
    expected = np.array(reference(name)["peaks"])
    ours = found.gamma[found.turns]
    count = min(len(ours), len(expected))
    first = max(int(np.argmax(np.abs(expected) > 0.01)) - 1, 0)
    pairs = zip(ours[first:count], expected[first:count], strict=True)
    return "; ".join(f"{100 * a:.2f} ({100 * b:.2f})" for a, b in pairs)


def _draw(results: dict[str, ShearCell]) -> None:
    """Stress paths and stress-strain curves, ours below the reference's dashes."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, len(results), figsize=(11.0, 6.4), layout="constrained")
    for column, (name, found) in zip(axes.T, results.items(), strict=True):
        table = np.genfromtxt(DATA / f"{name}.csv", delimiter=",", names=True)
        for axis, x, theirs, factor in (
            (column[0], found.sigma_v_eff, "sigma_v_eff", 1.0),
            (column[1], found.gamma, "gamma_xy", 100.0),
        ):
            axis.plot(factor * x, found.tau, color="#0072B2", lw=1.1, label="centre of the cell")
            axis.plot(
                factor * table[theirs],
                table["tau_xy"],
                "--",
                color="#D55E00",
                lw=0.7,
                label="OpenSees, one element",
            )
            axis.grid(alpha=0.3)
        column[0].set_title(TESTS[name], loc="left")
        column[0].set_xlabel("vertical effective stress, kPa")
        column[1].set_xlabel("shear strain, %")
    for axis in axes[:, 0]:
        axis.set_ylabel("shear stress, kPa")
    axes[1, 0].legend(frameon=False, loc="lower right", fontsize="small")
    PICTURE.parent.mkdir(exist_ok=True)
    figure.savefig(PICTURE, dpi=110)
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
