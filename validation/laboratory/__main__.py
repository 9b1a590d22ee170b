"""Measures the tables of README.md and draws its pictures, in some seconds.

python -m validation.laboratory
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import sandboil as sb

from validation.laboratory.comparison import (
    CASES,
    CONVERGED,
    CYCLIC,
    MONOTONIC,
    PATHS,
    SANDS,
    cycles,
    cyclic,
    darendeli,
    monotonic,
    path_difference,
    peaks,
    reference,
    stresses,
)
from validation.page import write_tables

FOLDER = Path(__file__).parent


def _cycle_lines() -> list[str]:
    labels = ("r_u 0.95", "r_u 0.98", "1 %", "3 %", "5 %")
    lines = [
        f"| sand, CSR | {' | '.join(labels)} | peaks, largest difference |",
        f"|---|{'---|' * len(labels)}---|",
    ]
    for name in CYCLIC:
        test, case = cyclic(name), CASES[name]
        counts = [f"{ours:.2f} ({theirs:.2f})" for theirs, ours in cycles(name, test).values()]
        theirs, ours = peaks(name, test)
        worst = 100.0 * np.abs(ours / theirs - 1.0).max()
        lines.append(
            f"| D_r {case['Dr']:g}, {case['csr']:g} | {' | '.join(counts)} | {worst:.1f} % of {len(ours)} |"
        )
    return lines


def _monotonic_lines() -> list[str]:
    lines = [
        "| test | increment of OpenSees | to | tau, largest difference | vertical stress |",
        "|---|---|---|---|---|",
    ]
    for name in MONOTONIC:
        case = CASES[name]
        for limit in sorted({CONVERGED.get(name, 0.1), 0.1}):
            gamma, tau, sigma = stresses(name, monotonic(name))
            within = (gamma > 0.0) & (gamma <= limit)
            off = [
                100.0 * np.abs(ours / theirs - 1.0).max()
                for theirs, ours in (tau[:, within], sigma[:, within])
            ]
            kind = "drained" if case["drained"] else "undrained"
            lines.append(
                f"| {kind}, D_r {case['Dr']:g} | {case['increment']:g} | {100 * limit:g} % "
                f"| {off[0]:.2f} % | {off[1]:.2f} % |"
            )
    return lines


def _path_lines() -> list[str]:
    lines = ["| strain path | integrator | rms, kPa | largest, kPa |", "|---|---|---|---|"]
    for name in PATHS:
        for integrator in ("reference", "default"):
            difference = path_difference(name, integrator)
            rms, largest = np.sqrt(np.mean(difference**2)), np.abs(difference).max()
            lines.append(f"| {name} | {integrator} | {rms:.4f} | {largest:.3f} |")
    return lines


def _draw() -> None:
    for name in CYCLIC:
        figure = cyclic(name).plot(reference=reference(name))
        figure.savefig(FOLDER / f"dss_Dr{100 * CASES[name]['Dr']:.0f}.png", dpi=110)
    for name in MONOTONIC:
        figure = monotonic(name).plot(reference=reference(name))
        figure.savefig(FOLDER / f"{name}.png", dpi=110)
    test = sb.lab.modulus_reduction(SANDS[0.55])
    figure = test.plot(reference=darendeli(test.gamma, 101.3 * 2.0 / 3.0))
    figure.savefig(FOLDER / "modulus_reduction.png", dpi=110)


def main() -> None:
    """Measure the tables, write them to README.md, and draw the pictures."""
    tables = [_cycle_lines(), _monotonic_lines(), _path_lines()]
    print("\n\n".join("\n".join(lines) for lines in tables))
    write_tables(FOLDER / "README.md", tables)
    _draw()


if __name__ == "__main__":
    main()
