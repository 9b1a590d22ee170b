"""The soil models beside PM4Sand, and closed-form strengths in compression and shear."""

from __future__ import annotations

import math

import sandboil as sb

# Stiffness of all soils here, kPa, and the lateral stress of compression, kPa.
MODULI = {"G": 3.0e4, "K": 6.5e4}
LATERAL = 100.0

FRICTIONAL: dict[str, sb.DruckerPrager | sb.MohrCoulomb] = {
    "Mohr-Coulomb": sb.MohrCoulomb(c=5.0, phi=32.0, psi=0.0, **MODULI),
    "Drucker-Prager, general": sb.DruckerPrager(c=5.0, phi=32.0, psi=0.0, matching="general", **MODULI),
    "Drucker-Prager, usual": sb.DruckerPrager(c=5.0, phi=32.0, psi=0.0, **MODULI),
    "Drucker-Prager, softening to 24 degrees": sb.DruckerPrager(
        c=5.0,
        phi=32.0,
        matching="general",
        c_residual=0.0,
        phi_residual=24.0,
        softening_strain=0.03,
        **MODULI,
    ),
}
COHESIVE: dict[str, sb.TotalStress] = {
    "in-plane Tresca": sb.TotalStress(Su=40.0, **MODULI),
    "von Mises": sb.TotalStress(Su=40.0, criterion="von_mises", **MODULI),
    "softening, exponential": sb.TotalStress(Su=40.0, Sr=15.0, softening_strain=0.01, **MODULI),
    "softening, linear": sb.TotalStress(
        Su=40.0, Sr=15.0, softening_strain=0.02, softening="linear", **MODULI
    ),
}


def compression_strength(c: float, phi_deg: float) -> float:
    """Stress difference of Mohr-Coulomb at the held lateral stress, kPa."""
    ratio = (1.0 + math.sin(math.radians(phi_deg))) / (1.0 - math.sin(math.radians(phi_deg)))
    return (ratio - 1.0) * LATERAL + 2.0 * c * math.sqrt(ratio)
