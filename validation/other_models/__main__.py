"""Draws other_models.png.

python -m validation.other_models
"""

from __future__ import annotations

from pathlib import Path

import sandboil as sb
from sandboil import lab

from validation.other_models.comparison import COHESIVE, FRICTIONAL, LATERAL, compression_strength

COLOURS = ("#0072B2", "#009E73", "#D55E00", "#CC79A7")


def main() -> None:
    """Draw the picture."""
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
    figure.savefig(Path(__file__).with_name("other_models.png"), dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()
