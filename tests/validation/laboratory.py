"""The laboratory beside OpenSees: direct simple shear of the three sands, and strain paths.

One place for the tests and the figures that are compared. As a script it measures the tables of
docs/validation.md anew and draws its pictures, in some seconds:

    python tests/validation/laboratory.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import sandboil as sb
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
DATA = Path(__file__).parent / "data" / "dss"
STRAIN_PATHS = ROOT / "crates" / "sandboil-soil" / "tests" / "data" / "pm4sand_strain_paths"

CASES: dict[str, dict[str, Any]] = json.loads((DATA / "summary.json").read_text(encoding="utf-8"))
CYCLIC = [name for name in CASES if name.startswith("cyclic")]
MONOTONIC = [name for name in CASES if name.startswith("mono")]
# Criteria of cycle counts, as the summary and as the laboratory call them.
CRITERIA = {
    "N_ru_0p95": {"r_u": 0.95},
    "N_ru_0p98": {"r_u": 0.98},
    "N_gamma_1pct": {"gamma_sa": 0.01},
    "N_gamma_3pct": {"gamma_sa": 0.03},
    "N_gamma_5pct": {"gamma_sa": 0.05},
}
# Strain up to which a monotonic test of the reference is converged in its increment; the same test is there
# again with a finer one.
CONVERGED = {"mono_undrained_Dr35": 0.05}

SANDS = {
    0.35: sb.PM4Sand(Dr=0.35, G0=476, hpo=0.53),
    0.55: sb.PM4Sand(Dr=0.55, G0=677, hpo=0.40),
    0.75: sb.PM4Sand(Dr=0.75, G0=890, hpo=0.63),
}
# File and sand of the strain paths.
PATHS = {
    "sp1_dss_cyclic_Dr55": SANDS[0.55],
    "sp2_shear_with_volume_change_Dr35": SANDS[0.35],
    "sp3_multidirectional_Dr75": SANDS[0.75],
}


def table(path: Path) -> dict[str, Floats]:
    """A CSV of numbers by column name."""
    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().split(",")
        return dict(zip(names, np.loadtxt(file, delimiter=",").T, strict=True))


def reference(name: str) -> dict[str, Floats]:
    """A test of OpenSees, by the names of a :class:`sandboil.lab.ShearTest`."""
    columns = table(DATA / f"{name}.csv")
    renamed = {"gamma": columns["gamma_xy"], "tau": columns["tau_xy"]} | columns
    return renamed | ({"eps_v": -columns["eps_yy"]} if "eps_yy" in columns else {})


def cyclic(name: str, **changes: Any) -> sb.lab.CyclicTest:
    """The cyclic test of a case, to the largest strain of OpenSees'."""
    case = CASES[name]
    stop = max(map(abs, case["peaks"]))
    return sb.lab.cyclic_dss(SANDS[case["Dr"]], **_start(case), csr=case["csr"], gamma_stop=stop, **changes)


def monotonic(name: str, **changes: Any) -> sb.lab.ShearTest:
    """The monotonic test of a case."""
    case = CASES[name]
    return sb.lab.monotonic_dss(SANDS[case["Dr"]], **_start(case), drained=case["drained"], **changes)


def _start(case: dict[str, Any]) -> dict[str, float]:
    return {name: case[name] for name in ("sigma_v0", "K0", "void_ratio")}


def cycles(name: str, test: sb.lab.CyclicTest) -> dict[str, tuple[float, float]]:
    """Cycles to each criterion, OpenSees' and ours."""
    theirs = CASES[name]["cycles"]
    return {label: (theirs[label], test.cycles_to(**criterion)) for label, criterion in CRITERIA.items()}


def peaks(name: str, test: sb.lab.CyclicTest) -> tuple[Floats, Floats]:
    """Shear strain at each turn that both have, OpenSees' and ours."""
    theirs, ours = np.array(CASES[name]["peaks"]), test.peaks().gamma
    common = min(len(theirs), len(ours))
    return theirs[:common], ours[:common]


def stresses(name: str, test: sb.lab.ShearTest) -> tuple[Floats, Floats, Floats]:
    """Strain, and shear and vertical stress of OpenSees and ours there: shapes (n,), (2, n), (2, n)."""
    theirs = reference(name)
    gamma = theirs["gamma"]
    tau = np.array([theirs["tau"], np.interp(gamma, test.gamma, test.tau)])
    return gamma, tau, np.array([theirs["sigma_v_eff"], np.interp(gamma, test.gamma, test.sigma_v_eff)])


def path_difference(name: str, integrator: str = "reference") -> Floats:
    """Stress less OpenSees' along a strain path, kPa, shape (n, 3)."""
    columns = table(STRAIN_PATHS / f"{name}.csv")
    strain = np.column_stack([columns[key] for key in ("eps_xx", "eps_yy", "gamma_xy")])
    stress = np.column_stack([columns[key] for key in ("sig_xx", "sig_yy", "tau_xy")])
    test = sb.lab.strain_path(PATHS[name], stress0=stress[0], strain=strain, integrator=integrator)
    assert test.complete, test.ended
    return test.stress - stress


def darendeli(gamma: Floats, sigma_m: float) -> dict[str, Floats]:
    """Mean curves of Darendeli (2001) for clean sand at the mean effective stress `sigma_m`, kPa."""
    curve = sb.site.darendeli(sigma_m, strains=gamma.tolist())
    return {"gamma": gamma, "G_ratio": np.array(curve.G_ratio), "damping": np.array(curve.damping)}


PAGE, PICTURES = ROOT / "docs" / "validation.md", ROOT / "docs" / "figures"
BEGIN, END = "<!-- tables of tests/validation/laboratory.py -->", "<!-- end of its tables -->"


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


def _write_page(tables: list[list[str]]) -> None:
    """Replace the tables between the page's marks."""
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    _, after = rest.split(END)
    text = "\n\n".join("\n".join(lines) for lines in tables)
    PAGE.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", encoding="utf-8")


def _draw() -> None:
    for name in CYCLIC:
        figure = cyclic(name).plot(reference=reference(name))
        figure.savefig(PICTURES / f"dss_Dr{100 * CASES[name]['Dr']:.0f}.png", dpi=110)
    for name in MONOTONIC:
        figure = monotonic(name).plot(reference=reference(name))
        figure.savefig(PICTURES / f"{name}.png", dpi=110)
    test = sb.lab.modulus_reduction(SANDS[0.55])
    figure = test.plot(reference=darendeli(test.gamma, 101.3 * 2.0 / 3.0))
    figure.savefig(PICTURES / "modulus_reduction.png", dpi=110)


def main() -> None:
    """Measure the tables anew, show them in docs/validation.md, and draw the pictures."""
    tables = [_cycle_lines(), _monotonic_lines(), _path_lines()]
    print("\n\n".join("\n".join(lines) for lines in tables))
    _write_page(tables)
    _draw()


if __name__ == "__main__":
    main()
