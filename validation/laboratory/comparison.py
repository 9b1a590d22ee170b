"""The laboratory beside OpenSees: direct simple shear of the three sands, and strain paths.

The tests and the figures that are compared.
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
DATA = Path(__file__).parent / "reference"
STRAIN_PATHS = ROOT / "crates" / "sandboil-soil" / "tests" / "data" / "pm4sand_strain_paths"

CASES: dict[str, dict[str, Any]] = json.loads((DATA / "summary.json").read_text(encoding="utf-8"))
CYCLIC = [name for name in CASES if name.startswith("cyclic")]
MONOTONIC = [name for name in CASES if name.startswith("mono")]
# Criteria of cycle counts, by their names in the summary and in the laboratory.
CRITERIA = {
    "N_ru_0p95": {"r_u": 0.95},
    "N_ru_0p98": {"r_u": 0.98},
    "N_gamma_1pct": {"gamma_sa": 0.01},
    "N_gamma_3pct": {"gamma_sa": 0.03},
    "N_gamma_5pct": {"gamma_sa": 0.05},
}
# Strain up to which a monotonic test of the reference is converged in its increment. The same test
# also exists with a finer increment.
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
