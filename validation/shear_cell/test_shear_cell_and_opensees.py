"""The paper's simple shear cell beside OpenSees."""

from __future__ import annotations

import numpy as np
import pytest

from validation.laboratory.comparison import CASES
from validation.shear_cell import comparison


def test_the_first_cycles_strain_as_much_as_in_the_reference() -> None:
    """Loose sand, from peak to trough, before anything liquefies."""
    found = comparison.run("cyclic_N06_Dr35", max_cycles=3)
    expected = np.array(CASES["cyclic_N06_Dr35"]["peaks"])[: found.turns[-1]]
    # The reference's own increments are 2.5e-6.
    np.testing.assert_allclose(found.peaks().gamma, expected, atol=5e-6)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", comparison.TESTS)
def test_cycles_to_liquefaction_are_those_of_the_reference(name: str) -> None:
    """The soils of Table 1, no velocity reset: every level within a cycle, r_u within half of one."""
    found = comparison.run(name)
    differences = comparison.differences(name, found)
    print(comparison.TESTS[name], differences, found.report)
    assert max(map(abs, differences.values())) <= 1.0
    assert max(abs(differences[key]) for key in ("N_ru_0p95", "N_ru_0p98")) <= 0.5
    # A hundredth of the strain, and of the confining stress.
    assert found.report.gamma_spread <= 5e-4
    assert found.report.sigma_v_spread <= 1.0
    assert found.report.overshoot <= 0.01
