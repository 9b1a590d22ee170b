"""Strengths that the laboratory finds for the soil models beside PM4Sand, against closed forms."""

from __future__ import annotations

import pytest
from sandboil import lab

from validation.other_models import comparison


@pytest.mark.parametrize("name", ["Mohr-Coulomb", "Drucker-Prager, general"])
def test_plane_strain_compression_ends_at_the_strength(name: str) -> None:
    test = lab.plane_strain_compression(
        comparison.FRICTIONAL[name],
        sigma_v0=comparison.LATERAL,
        K0=1.0,
        drained=True,
        axial_strain_max=0.06,
    )
    assert test.complete, test.ended
    assert test.q[-1] == pytest.approx(comparison.compression_strength(5.0, 32.0), rel=1e-4)


def test_usual_match_is_weak_and_softening_ends_at_the_residual() -> None:
    last = {}
    for name, soil in comparison.FRICTIONAL.items():
        test = lab.plane_strain_compression(
            soil, sigma_v0=comparison.LATERAL, K0=1.0, drained=True, axial_strain_max=0.06
        )
        last[name] = test.q[-1]
    assert last["Drucker-Prager, usual"] == pytest.approx(222.0, abs=1.0)
    residual = comparison.compression_strength(0.0, 24.0)
    assert last["Drucker-Prager, softening to 24 degrees"] == pytest.approx(residual, rel=1e-4)


@pytest.mark.parametrize(
    ("name", "strength"), list(zip(comparison.COHESIVE, (40.0, 40.0, 15.0, 15.0), strict=True))
)
def test_simple_shear_ends_at_the_undrained_strength(name: str, strength: float) -> None:
    test = lab.monotonic_dss(comparison.COHESIVE[name], sigma_v0=100.0, K0=0.8, gamma_max=0.1)
    assert test.tau[-1] == pytest.approx(strength, rel=2e-3)
    assert test.tau.max() <= 40.0 * (1.0 + 1e-9)
