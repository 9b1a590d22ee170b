"""The paper's simple shear cell beside OpenSees (Mhaski and Ramana 2025, section 6.1, Table 1).

The soils and the figures that are compared.
"""

from __future__ import annotations

from typing import Any

from sandboil.lab import ShearCell, shear_cell

from validation.laboratory.comparison import CASES, CRITERIA, SANDS

# Tests of the reference and their names here: Table 1 of the paper.
TESTS = {
    "cyclic_N06_Dr35": "Dr 0.35, CSR 0.090",
    "cyclic_N14_Dr55": "Dr 0.55, CSR 0.147",
    "cyclic_N26_Dr75": "Dr 0.75, CSR 0.312",
}


def run(name: str, **changes: Any) -> ShearCell:
    """The test as a cell, from the void ratio and stress of the reference."""
    case = CASES[name]
    arguments = {key: case[key] for key in ("sigma_v0", "K0", "csr", "void_ratio")}
    return shear_cell(SANDS[case["Dr"]], **(arguments | changes))


def differences(name: str, found: ShearCell) -> dict[str, float]:
    """Cycles to every level less those of the reference."""
    expected = CASES[name]["cycles"]
    return {key: found.cycles_to(**level) - expected[key] for key, level in CRITERIA.items()}
