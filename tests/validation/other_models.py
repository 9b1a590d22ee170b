"""The soil models beside PM4Sand under test: compression, shear and cycles, with their closed-form strengths.

As a script it draws docs/figures/other_models.png:

    python tests/validation/other_models.py
"""

from __future__ import annotations

import math
from pathlib import Path

import sandboil as sb
from sandboil import lab

PICTURE = Path(__file__).parents[2] / "docs" / "figures" / "other_models.png"
# Stiffness of all soils here, kPa, and the lateral stress of compression, kPa.
MODULI = {"G": 3.0e4, "K": 6.5e4}
LATERAL = 100.0
COLOURS = ("#0072B2", "#009E73", "#D55E00", "#CC79A7")

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


def main() -> None:
    """Draw the picture anew."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(13.5, 4.2), layout="constrained")
    left, middle, right = axes
    for (name, soil), colour in zip(FRICTIONAL.items(), COLOURS, strict=True):
        test = lab.plane_strain_compression(
            soil, sigma_v0=LATERAL, K0=1.0, drained=True, axial_strain_max=0.06
        )
        left.plot(100.0 * test.axial_strain, test.q, color=colour, label=name)
    for c, phi in ((5.0, 32.0), (0.0, 24.0)):
        left.axhline(compression_strength(c, phi), color="black", ls=":", lw=0.9)
    left.set(xlabel="vertical strain, %", ylabel="vertical less horizontal stress, kPa", ylim=(0.0, None))
    left.set_title("drained compression at 100 kPa; dotted: closed form", loc="left", fontsize=9)

    for (name, cohesive), colour in zip(COHESIVE.items(), COLOURS, strict=True):
        sheared = lab.monotonic_dss(cohesive, sigma_v0=100.0, K0=0.8, gamma_max=0.06)
        middle.plot(100.0 * sheared.gamma, sheared.tau, color=colour, label=name)
    for strength in (40.0, 15.0):
        middle.axhline(strength, color="black", ls=":", lw=0.9)
    middle.set(xlabel="shear strain, %", ylabel="shear stress, kPa", ylim=(0.0, None))
    middle.set_title("undrained strength in simple shear; dotted: S_u, S_r", loc="left", fontsize=9)

    elastic = sb.PressureElastic(G=3.0e4, K=6.5e4, exponent=0.5)
    loops: dict[str, sb.PressureElastic | sb.MohrCoulomb | sb.TotalStress] = {
        "PressureElastic": elastic,
        "Mohr-Coulomb": FRICTIONAL["Mohr-Coulomb"],
        "TotalStress": COHESIVE["in-plane Tresca"],
    }
    for (name, looped), colour in zip(loops.items(), COLOURS, strict=False):
        cycled = lab.cyclic_dss(looped, K0=0.6, gamma_reversals=[0.006, -0.006, 0.006], drained=True)
        right.plot(100.0 * cycled.gamma, cycled.tau, color=colour, label=name)
    right.set(xlabel="shear strain, %", ylabel="shear stress, kPa")
    right.set_title("drained cycle of shear at 101.3 kPa", loc="left", fontsize=9)
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.legend(frameon=False, fontsize=7.5, loc="lower right")
    figure.savefig(PICTURE, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()
