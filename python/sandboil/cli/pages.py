"""What the commands `sandboil lab ...` print of a test."""

from __future__ import annotations

import numpy as np

from .. import lab

# Levels that the summary of a cyclic test counts cycles to.
_LEVELS = (
    *(("r_u", level) for level in (0.90, 0.95, 0.98)),
    *((measure, level) for measure in ("gamma_sa", "gamma_da") for level in (0.01, 0.03, 0.05)),
)
# Shear strains at which the summary of a monotonic test reads stresses.
_STRAINS = (0.001, 0.005, 0.01, 0.02, 0.05, 0.1)


def cyclic_lines(test: lab.CyclicTest) -> list[str]:
    """Cycles to the usual criteria, and the largest pressure and strain."""
    names = {"r_u": "r_u", "gamma_sa": "single amplitude", "gamma_da": "double amplitude"}
    lines = [f"{'criterion':<28}{'cycles':>8}"]
    for measure, level in _LEVELS:
        cycles = test.cycles_to(**{measure: level})
        shown = f"{level:.2f}" if measure == "r_u" else f"{100.0 * level:g} %"
        lines.append(f"{names[measure] + ' ' + shown:<28}{cycles:>8.2f}".replace("     nan", "   never"))
    lines.append(f"{'cycles made':<28}{test.cycle[-1]:>8.2f}")
    lines.append(f"{'largest r_u':<28}{test.r_u.max():>8.3f}")
    lines.append(f"{'largest shear strain, %':<28}{100.0 * test.gamma_sa.max():>8.2f}")
    return lines


def monotonic_lines(test: lab.ShearTest) -> list[str]:
    """Stresses and contraction at some shear strains."""
    lines = [f"{'shear strain, %':<18}{'shear stress, kPa':>20}{'vertical, kPa':>16}{'contraction, %':>16}"]
    # The last increment leaves round-off.
    reached = [strain for strain in _STRAINS if strain <= round(float(test.gamma[-1]), 9)]
    for strain in reached:
        tau, sigma, volume = (
            np.interp(strain, test.gamma, column) for column in (test.tau, test.sigma_v_eff, test.eps_v)
        )
        lines.append(f"{100.0 * strain:<18g}{tau:>20.2f}{sigma:>16.2f}{100.0 * volume:>16.3f}")
    lines.append(f"{'largest':<18}{test.tau.max():>20.2f}")
    return lines


def resistance_lines(curve: lab.ResistanceCurve) -> list[str]:
    """Cycles to every criterion, a line for each stress ratio."""
    lines = [f"{'CSR':>8}" + "".join(f"{name:>24}" for name in curve.cycles)]
    for row, ratio in enumerate(curve.csr):
        cells = (f"{cycles[row]:>24.2f}".replace("  nan", "never") for cycles in curve.cycles.values())
        lines.append(f"{ratio:>8.4f}" + "".join(cells))
    return lines
