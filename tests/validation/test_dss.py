"""Direct simple shear and strain paths through the public laboratory, held to OpenSees."""

from __future__ import annotations

import laboratory
import numpy as np
import pytest


@pytest.mark.parametrize("integrator", ["default", "rk4", "reference"])
@pytest.mark.parametrize("name", laboratory.CYCLIC)
def test_cycles_and_peaks_are_those_of_the_reference(name: str, integrator: str) -> None:
    """Counts within a tenth of a cycle (the resolution of a count is half a cycle), peaks within 10 %."""
    test = laboratory.cyclic(name, integrator=integrator)
    for label, (theirs, ours) in laboratory.cycles(name, test).items():
        assert ours == pytest.approx(theirs, abs=0.1), label
    theirs, ours = laboratory.peaks(name, test)
    assert len(ours) >= len(laboratory.CASES[name]["peaks"]) - 1
    np.testing.assert_allclose(ours, theirs, rtol=0.1)


@pytest.mark.parametrize("name", laboratory.MONOTONIC)
def test_monotonic_shear_follows_the_reference(name: str) -> None:
    """tau within 2 %, vertical stress within the larger of 1 kPa and 2 %, at every strain."""
    gamma, tau, sigma = laboratory.stresses(name, laboratory.monotonic(name))
    within = (gamma > 0.0) & (gamma <= laboratory.CONVERGED.get(name, 0.1))
    np.testing.assert_allclose(tau[1, within], tau[0, within], rtol=0.02)
    allowed = np.maximum(1.0, 0.02 * sigma[0])
    assert (np.abs(sigma[1] - sigma[0]) <= allowed)[within].all()


@pytest.mark.parametrize(("integrator", "allowed"), [("default", 4.0e-4), ("reference", 1.0e-5)])
def test_drained_shear_contracts_and_dilates_as_the_reference(integrator: str, allowed: float) -> None:
    """0.88 % of dilation at the end, of which the default has 0.03 % less (docs/validation.md)."""
    theirs = laboratory.reference("mono_drained_Dr55")
    ours = laboratory.monotonic("mono_drained_Dr55", integrator=integrator)
    eps_v = np.interp(theirs["gamma"], ours.gamma, ours.eps_v)
    np.testing.assert_allclose(eps_v, theirs["eps_v"], rtol=0.0, atol=allowed)


@pytest.mark.parametrize("name", laboratory.PATHS)
def test_strain_paths_are_met(name: str) -> None:
    """rms over the three components within 0.01 kPa with the reference integrator."""
    assert np.sqrt(np.mean(laboratory.path_difference(name) ** 2)) <= 0.01
