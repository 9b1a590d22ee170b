"""Published correlations between in-situ tests, density, stiffness and cyclic resistance of clean sand.

All are for a vertical effective stress of one atmosphere, magnitude 7.5 and level ground, except the factors
for other conditions (`k_sigma`, `k_alpha`). Arguments are numbers; stresses are in kPa, compression positive.
Each function gives its source, and raises :class:`InvalidInput` for a value outside its range.
"""

from __future__ import annotations

import math

from .._errors import InvalidInput
from .._types import as_float

P_ATM = 101.3
"""Atmospheric pressure, kPa."""

# Blow count at a relative density of 1.
_N_MAX = 46.0
# Largest blow count and cone resistance of the triggering curves, at cyclic resistance ratios of 2 and 3.7.
# Denser sand does not liquefy, and beyond them the polynomials diverge.
_N_TRIGGERING_MAX = 37.5
_QC_TRIGGERING_MAX = 211.0
# Largest overburden stress for the overburden factor, kPa: above about 3000 kPa the factor would be negative.
_OVERBURDEN_MAX = 2000.0
# Range of the fit of the static shear factor: static shear ratio and state index.
_ALPHA_MAX = 0.35
_STATE_INDEX_RANGE = (-0.6, 0.1)


def _within(name: str, value: float, low: float, high: float, meaning: str) -> float:
    """Return the value as a float; refuse it unless it is a number above `low` and at most `high`."""
    upper = "" if math.isinf(high) else f" and at most {high:g}"
    try:
        number = as_float(value)
    except ValueError:
        number = math.nan
    if not low < number <= high or math.isinf(number):
        raise InvalidInput(
            f"correlations.{name}", value, f"must be above {low:g}{upper} ({meaning})", "check its unit"
        )
    return number


def _overburden(sigma_v0: float) -> float:
    return _within("sigma_v0", sigma_v0, 0.0, _OVERBURDEN_MAX, "vertical effective stress, kPa")


def relative_density_from_spt(N160cs: float) -> float:
    """Relative density, fraction: sqrt((N1)60cs / 46) (Idriss and Boulanger 2008)."""
    return math.sqrt(_within("N160cs", N160cs, 0.0, _N_MAX, "clean-sand corrected blow count") / 46.0)


def spt_from_relative_density(Dr: float) -> float:
    """(N1)60cs = 46 Dr^2 (Idriss and Boulanger 2008)."""
    density = _within("Dr", Dr, 0.0, 1.0, "relative density, fraction")
    return 46.0 * density * density


def relative_density_from_cpt(qc1Ncs: float) -> float:
    """Relative density, fraction: 0.465 (q_c1Ncs / 0.9)^0.264 - 1.063 (Boulanger and Ziotopoulou 2017)."""
    value = _within("qc1Ncs", qc1Ncs, 0.0, math.inf, "normalised cone resistance, clean sand")
    density = 0.465 * math.pow(value / 0.9, 0.264) - 1.063
    if not 0.0 < density <= 1.0:
        raise InvalidInput(
            "correlations.qc1Ncs",
            qc1Ncs,
            "must give a relative density above 0 and at most 1, that is 21 to 254",
            "it is normalised by atmospheric pressure, not in MPa",
        )
    return density


def shear_modulus_coefficient(N160cs: float) -> float:
    """PM4Sand's G0 = 167 sqrt((N1)60cs + 2.5) (Boulanger and Ziotopoulou 2017)."""
    return 167.0 * math.sqrt(_within("N160cs", N160cs, 0.0, _N_MAX, "clean-sand corrected blow count") + 2.5)


def crr_from_spt(N160cs: float) -> float:
    """Cyclic resistance ratio in 15 cycles from (N1)60cs (Idriss and Boulanger 2008)."""
    n = _within("N160cs", N160cs, 0.0, _N_TRIGGERING_MAX, "denser sand does not liquefy")
    return math.exp(n / 14.1 + (n / 126.0) ** 2 - (n / 23.6) ** 3 + (n / 25.4) ** 4 - 2.8)


def crr_from_cpt(qc1Ncs: float) -> float:
    """Cyclic resistance ratio in 15 cycles from q_c1Ncs (Boulanger and Idriss 2014)."""
    q = _within("qc1Ncs", qc1Ncs, 0.0, _QC_TRIGGERING_MAX, "denser sand does not liquefy")
    return math.exp(q / 113.0 + (q / 1000.0) ** 2 - (q / 140.0) ** 3 + (q / 137.0) ** 4 - 2.8)


def k_sigma(sigma_v0: float, *, N160cs: float | None = None, qc1Ncs: float | None = None) -> float:
    """Overburden factor on cyclic resistance at the vertical effective stress `sigma_v0`, kPa.

    min(1.1, 1 - C ln(sigma_v0 / p_A)), C = 1/(18.9 - 2.55 sqrt((N1)60cs)) or 1/(37.3 - 8.27 q_c1Ncs^0.264),
    at most 0.3 (Boulanger and Idriss 2004, 2014).
    """
    overburden = _overburden(sigma_v0)
    if (N160cs is None) == (qc1Ncs is None):
        raise InvalidInput(
            "correlations.k_sigma",
            (N160cs, qc1Ncs),
            "needs exactly one of N160cs and qc1Ncs",
            "leave one of them out",
        )
    if N160cs is not None:
        n = _within("N160cs", N160cs, 0.0, _N_MAX, "clean-sand corrected blow count")
        slope = 18.9 - 2.55 * math.sqrt(n)
    else:
        assert qc1Ncs is not None
        q = _within("qc1Ncs", qc1Ncs, 0.0, _QC_TRIGGERING_MAX, "normalised cone resistance, clean sand")
        slope = 37.3 - 8.27 * q**0.264
    c = min(0.3, 1.0 / slope) if slope > 0.0 else 0.3
    return min(1.1, 1.0 - c * math.log(overburden / P_ATM))


def k_alpha(static_shear_ratio: float, *, Dr: float, sigma_v0: float, K0: float = 0.5) -> float:
    """Static shear factor on cyclic resistance (Idriss and Boulanger 2003, 2008).

    It depends on the relative state parameter index xi_R = 1/(10 - ln(100 p'/p_A)) - Dr, limited to [-0.6,
    0.1], with p' = (1 + 2 K0) sigma_v0 / 3.

    Parameters
    ----------
    static_shear_ratio : static shear stress over `sigma_v0`, at most 0.35 in absolute value
    Dr : relative density, fraction
    sigma_v0 : vertical effective stress, kPa
    K0 : horizontal over vertical effective stress
    """
    try:
        alpha = abs(as_float(static_shear_ratio))
    except ValueError:
        alpha = math.nan
    if not alpha <= _ALPHA_MAX:
        raise InvalidInput(
            "correlations.static_shear_ratio",
            static_shear_ratio,
            f"must lie in [-{_ALPHA_MAX}, {_ALPHA_MAX}] (static shear stress over sigma_v0)",
            "the relation was fitted to this range only",
        )
    density = _within("Dr", Dr, 0.0, 1.0, "relative density, fraction")
    earth_pressure = _within("K0", K0, 0.0, math.inf, "horizontal over vertical effective stress")
    p = (1.0 + 2.0 * earth_pressure) * _overburden(sigma_v0) / 3.0
    index = 1.0 / (10.0 - math.log(100.0 * p / P_ATM)) - density
    index = min(max(index, _STATE_INDEX_RANGE[0]), _STATE_INDEX_RANGE[1])
    a = 1267.0 + 636.0 * alpha**2 - 634.0 * math.exp(alpha) - 632.0 * math.exp(-alpha)
    b = math.exp(-1.11 + 12.3 * alpha**2 + 1.31 * math.log(alpha + 0.0001))
    c = 0.138 + 0.126 * alpha + 2.52 * alpha**3
    return a + b * math.exp(-index / c)


def estimates(
    *,
    N160cs: float | None = None,
    qc1Ncs: float | None = None,
    Dr: float | None = None,
    sigma_v0: float = P_ATM,
    crr: float | None = None,
) -> dict[str, float]:
    """`Dr`, `G0` and `crr` of a sand from one field test or from its density, by these correlations.

    Parameters
    ----------
    N160cs, qc1Ncs, Dr : clean-sand corrected blow count, normalised cone resistance or relative density
        (fraction); exactly one of them
    sigma_v0 : vertical effective stress, kPa, for which `crr` is corrected by :func:`k_sigma`
    crr : cyclic resistance ratio, if it is known. The triggering curve is then not used, so the sand may be
        denser than its range
    """
    given = [
        name for name, value in {"N160cs": N160cs, "qc1Ncs": qc1Ncs, "Dr": Dr}.items() if value is not None
    ]
    if len(given) != 1:
        raise InvalidInput(
            "correlations.estimates",
            given,
            "needs exactly one of N160cs, qc1Ncs and Dr",
            "use the most reliable one",
        )
    if qc1Ncs is not None:
        density = relative_density_from_cpt(qc1Ncs)
    elif N160cs is not None:
        density = relative_density_from_spt(N160cs)
    else:
        assert Dr is not None
        density = _within("Dr", Dr, 0.0, 1.0, "relative density, fraction")
    blows = spt_from_relative_density(density)
    if crr is None:
        at_one_atmosphere = crr_from_spt(blows) if qc1Ncs is None else crr_from_cpt(qc1Ncs)
        crr = at_one_atmosphere * k_sigma(sigma_v0, N160cs=blows)
    return {"Dr": density, "G0": shear_modulus_coefficient(blows), "crr": crr}
