"""Cyclic resistance: the stress ratio that meets a criterion in a number of cycles, and curves of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, PlainValidator

from .._errors import InvalidInput
from .._types import Floats, Number
from ..scene.soils import PM4Sand
from . import _resistance_plots, correlations
from ._arguments import (
    Bias,
    Count,
    EarthPressure,
    Integrator,
    Limit,
    Pressure,
    Series,
    Soil,
    VoidRatio,
    as_series,
    checked,
)
from ._results import Table
from ._shear import check_reach, cyclic_dss
from ._specimen import consolidated

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CRITERIA: dict[str, dict[str, float]] = {
    "3 % single amplitude": {"gamma_sa": 0.03},
    "r_u 0.98": {"r_u": 0.98},
    "5 % double amplitude": {"gamma_da": 0.05},
}
"""The three usual criteria of liquefaction in a cyclic test, as arguments of `CyclicTest.cycles_to`."""

# Range of cyclic stress ratios that is searched; the resistance of soil lies inside.
_CSR_RANGE = (0.005, 3.0)
# First guess, and the factor between the trials that bracket the solution.
_CSR_GUESS, _BRACKETING = 0.15, 1.4
# Relative width at which a bisection ends, far below the uncertainty of a resistance.
_WIDTH = 2e-4
# Strain at which a test for a pore pressure ratio or a double amplitude ends. Sand that strains so far is
# liquefied.
_GAMMA_STOP = 0.06
# If cycles are counted by halves, the first stroke counts as half a cycle. `CyclicTest.cycle` counts it as a
# quarter.
_FIRST_STROKE = 0.25
# Cyclic stress ratios of an automatic curve, as fractions of the resistance in 15 cycles.
_CURVE_FRACTIONS = (0.75, 0.82, 0.9, 1.0, 1.1, 1.25, 1.45, 1.7)
# Default largest number of cycles for a point of a curve.
_CURVE_CYCLES = 500
# Largest number of cycles for a resistance, more than in any earthquake.
_CYCLES_MAX = 1e4


def _as_ratios(value: object) -> Floats:
    ratios = as_series(value)
    if not (ratios > 0.0).all():
        raise ValueError("must have only values above 0; ratios to sigma_v0, for example [0.1, 0.2]")
    return ratios


Ratios = Annotated[ArrayLike, PlainValidator(_as_ratios)]
Cycles = Annotated[Number, Field(gt=0.5, le=_CYCLES_MAX, description="uniform cycles")]
PressureRatio = Annotated[
    Number,
    Field(
        gt=0.0,
        le=1.0,
        description="excess pore pressure ratio, 1",
        json_schema_extra={"remedy": "0.98 is the usual criterion of liquefaction"},
    ),
]


@dataclass(frozen=True)
class Conditions:
    """Conditions shared by the specimens of a series; meaning and units as for :func:`cyclic_dss`."""

    sigma_v0: float = correlations.P_ATM
    K0: float = 0.5
    static_shear_ratio: float = 0.0
    void_ratio: float | None = None
    integrator: str = "default"

    def check(self, where: str, soil: Soil, csr: Floats | None = None) -> None:
        """Refuse conditions and stress ratios that a specimen cannot carry, before any test."""
        specimen = consolidated(where, soil, **self.arguments(), tolerance=None)
        if csr is not None:
            check_reach(f"{where}.csr", soil, specimen, self.static_shear_ratio + csr, drained=False)

    def arguments(self) -> dict[str, Any]:
        """The conditions as keyword arguments."""
        return dict(vars(self))


def criterion_of(gamma_sa: float | None, gamma_da: float | None, r_u: float | None) -> dict[str, float]:
    """The given criterion by name and level; 3 % single-amplitude strain if none is given."""
    given = {"gamma_sa": gamma_sa, "gamma_da": gamma_da, "r_u": r_u}
    named = {name: value for name, value in given.items() if value is not None}
    if len(named) > 1:
        raise InvalidInput(
            "lab.criterion", named, "must be only one of gamma_sa, gamma_da and r_u", "leave out all but one"
        )
    return named or {"gamma_sa": 0.03}


def _stop_strain(criterion: dict[str, float]) -> float:
    if "gamma_sa" in criterion:
        return criterion["gamma_sa"]
    # The last turn is on the other side of zero, so the double amplitude is at least this single amplitude.
    return max(_GAMMA_STOP, criterion.get("gamma_da", 0.0))


def falls_short(
    soil: Soil, csr: float, cycles: float, criterion: dict[str, float], conditions: Conditions
) -> bool:
    """Whether a uniform stress ratio meets the criterion in fewer than `cycles` cycles."""
    count = math.ceil(2.0 * cycles) - 1
    strokes = np.where(np.arange(count) % 2 == 0, csr, -csr)
    if count == 0:
        return False
    try:
        test = cyclic_dss(
            soil,
            reversals=conditions.static_shear_ratio + strokes,
            gamma_stop=_stop_strain(criterion),
            **conditions.arguments(),
        )
    except InvalidInput as refusal:
        if refusal.path != "lab.cyclic_dss.reversals":
            raise
        # The stress ratio exceeds the strength: strain grows without limit in the first stroke.
        return True
    return not math.isnan(test.cycles_to(**criterion))


def bisect(condition: Callable[[float], bool], low: float, high: float) -> float:
    """The value where a condition becomes true, between `low` (false) and `high` (true); both positive."""
    while high / low > 1.0 + _WIDTH:
        middle = math.sqrt(low * high)
        if condition(middle):
            high = middle
        else:
            low = middle
    return math.sqrt(low * high)


def bracket(
    condition: Callable[[float], bool], guess: float, factor: float, limits: tuple[float, float]
) -> tuple[float, float] | None:
    """Values for which a condition is false and true, in this order; None if there are none in the limits."""
    low = high = guess
    if condition(guess):
        while True:
            if low <= limits[0]:
                return None
            high, low = low, max(low / factor, limits[0])
            if not condition(low):
                return low, high
    while True:
        if high >= limits[1]:
            return None
        low, high = high, min(high * factor, limits[1])
        if condition(high):
            return low, high


@checked
def crr(
    soil: Soil,
    *,
    cycles: Cycles = 15.0,
    gamma_sa: Limit | None = None,
    gamma_da: Limit | None = None,
    r_u: PressureRatio | None = None,
    sigma_v0: Pressure = correlations.P_ATM,
    K0: EarthPressure = 0.5,
    static_shear_ratio: Bias = 0.0,
    void_ratio: VoidRatio = None,
    integrator: Integrator = "default",
) -> float:
    """Cyclic resistance ratio: the uniform CSR that meets a criterion in `cycles` undrained cycles.

    It is the largest stress ratio that needs at least `cycles` cycles. Cycles are counted by halves,
    including the half cycle in which the criterion is met. The first stroke from the static stress counts as
    half a cycle.

    Parameters
    ----------
    soil : a material, or a model written by the user (:class:`SoilModel`)
    cycles : number of uniform cycles
    gamma_sa, gamma_da : criterion: single or double amplitude of the engineering shear strain, 1
    r_u : criterion: excess pore pressure ratio, 1. At most one criterion is given; default gamma_sa = 0.03
    sigma_v0, K0, static_shear_ratio, void_ratio, integrator : as for :func:`cyclic_dss`

    Returns
    -------
    Cyclic shear stress over sigma_v0; nan if there is no resistance between 0.005 and 3

    Raises
    ------
    InvalidInput : an invalid argument, or an initial stress that the soil cannot carry
    """
    criterion = criterion_of(gamma_sa, gamma_da, r_u)
    conditions = Conditions(sigma_v0, K0, static_shear_ratio, void_ratio, integrator)
    return resistance(soil, cycles, criterion, conditions)


def resistance(
    soil: Soil,
    cycles: float,
    criterion: dict[str, float],
    conditions: Conditions,
    guess: float = _CSR_GUESS,
    step: float = _BRACKETING,
) -> float:
    """The resistance of :func:`crr` by a search from `guess` in steps of the factor `step`."""

    def weaker(csr: float) -> bool:
        return falls_short(soil, csr, cycles, criterion, conditions)

    found = bracket(weaker, min(max(guess, _CSR_RANGE[0]), _CSR_RANGE[1]), step, _CSR_RANGE)
    return math.nan if found is None else bisect(weaker, *found)


@dataclass(frozen=True, eq=False)
class ResistanceCurve(Table):
    """CSR against cycles for several criteria.

    Attributes
    ----------
    csr : (n,) cyclic stress ratios
    cycles : for each criterion by name (n,) cycles to it, counted by halves as in :func:`crr`; nan where it
        was not met
    conditions : conditions of the tests
    """

    csr: Floats
    cycles: dict[str, Floats]
    conditions: Conditions = field(repr=False)

    def csr_at(self, cycles: float, criterion: str = "3 % single amplitude") -> float:
        """CSR at a number of cycles, by linear interpolation of the logarithms; nan outside the curve."""
        reached = self.cycles[criterion]
        known = np.isfinite(reached)
        order = np.argsort(reached[known])
        x, y = np.log(reached[known][order]), np.log(self.csr[known][order])
        return float(np.exp(np.interp(math.log(cycles), x, y, left=math.nan, right=math.nan)))

    def columns(self) -> dict[str, Floats]:
        """`csr`, and the cycles to each criterion by name."""
        return {"csr": self.csr, **self.cycles}

    def plot(self) -> Figure:
        """Plot CSR against cycles on a logarithmic axis; a matplotlib figure."""
        return _resistance_plots.resistance(self)


@checked
def crr_curve(
    soil: Soil,
    csr: Ratios | None = None,
    *,
    max_cycles: Count = _CURVE_CYCLES,
    sigma_v0: Pressure = correlations.P_ATM,
    K0: EarthPressure = 0.5,
    static_shear_ratio: Bias = 0.0,
    void_ratio: VoidRatio = None,
    integrator: Integrator = "default",
) -> ResistanceCurve:
    """CSR against cycles for the three usual criteria: 3 % single amplitude, r_u 0.98, 5 % double amplitude.

    Parameters
    ----------
    csr : (n,) cyclic stress ratios, one test for each; default eight values around the resistance in 15
        cycles
    max_cycles : number of cycles after which a test ends; its criteria that are not met are nan
    soil, sigma_v0, K0, static_shear_ratio, void_ratio, integrator : as for :func:`cyclic_dss`

    Raises
    ------
    InvalidInput : an invalid argument, an initial stress that the soil cannot carry, or a stress ratio that
        it cannot reach
    """
    conditions = Conditions(sigma_v0, K0, static_shear_ratio, void_ratio, integrator)
    if csr is None:
        middle = crr(soil, **conditions.arguments())
        if math.isnan(middle):
            raise InvalidInput(
                "lab.crr_curve.csr",
                None,
                "must be given, because no cyclic resistance in 15 cycles was found to choose it from",
                "for example [0.1, 0.2, 0.3]",
            )
        ratios = middle * np.asarray(_CURVE_FRACTIONS)
    else:
        ratios = np.asarray(csr, dtype=np.float64)
        conditions.check("lab.crr_curve", soil, ratios)
    cycles: dict[str, list[float]] = {name: [] for name in CRITERIA}
    for ratio in ratios:
        test = cyclic_dss(
            soil, csr=float(ratio), gamma_stop=_GAMMA_STOP, max_cycles=max_cycles, **conditions.arguments()
        )
        for name, criterion in CRITERIA.items():
            cycles[name].append(test.cycles_to(**criterion) + _FIRST_STROKE)
    return ResistanceCurve(ratios, {name: np.asarray(values) for name, values in cycles.items()}, conditions)


@dataclass(frozen=True, eq=False)
class FactorCurve(Table):
    """A correction factor on cyclic resistance, of the model and as published. Arrays have shape (n,)."""

    name: str
    """`K_sigma` or `K_alpha`."""
    argument: str
    """Name and unit of `x`."""
    x: Floats
    """Vertical effective stress, kPa, or static shear ratio, 1."""
    crr: Floats
    """Cyclic resistance ratio of the model at each `x`."""
    factor: Floats
    """`crr` over that of the reference condition."""
    published: Floats
    """The published factor at each `x`."""
    source: str
    """Authors and year of the published factor."""

    def columns(self) -> dict[str, Floats]:
        """`x`, `crr`, `factor` and `published`."""
        return {"x": self.x, "crr": self.crr, "factor": self.factor, "published": self.published}

    def plot(self) -> Figure:
        """Plot the factor and the published factor; a matplotlib figure."""
        return _resistance_plots.factor(self)


@checked
def k_sigma(
    soil: PM4Sand,
    sigma_v0: Series = (50.0, correlations.P_ATM, 200.0, 400.0),
    *,
    cycles: Cycles = 15.0,
    gamma_sa: Limit = 0.03,
    K0: EarthPressure = 0.5,
    integrator: Integrator = "default",
) -> FactorCurve:
    """Overburden factor on cyclic resistance of the model, and that of Boulanger and Idriss (2004).

    The reference condition is a vertical effective stress of 101.3 kPa.

    Parameters
    ----------
    sigma_v0 : (n,) vertical effective stresses, kPa
    cycles, gamma_sa : number of cycles and criterion, as for :func:`crr`
    soil, K0, integrator : as for :func:`cyclic_dss`

    Raises
    ------
    InvalidInput : an invalid argument, or an initial stress that the soil cannot carry
    """
    stresses = np.asarray(sigma_v0, dtype=np.float64)
    blows = correlations.spt_from_relative_density(soil.Dr)
    published = np.asarray([correlations.k_sigma(float(s), N160cs=blows) for s in stresses])
    for stress in stresses:
        Conditions(float(stress), K0, integrator=integrator).check("lab.k_sigma", soil)
    reference = crr(soil, cycles=cycles, gamma_sa=gamma_sa, K0=K0, integrator=integrator)
    found = np.asarray(
        [
            crr(soil, cycles=cycles, gamma_sa=gamma_sa, K0=K0, sigma_v0=float(s), integrator=integrator)
            for s in stresses
        ]
    )
    return FactorCurve(
        "K_sigma",
        "vertical effective stress, kPa",
        stresses,
        found,
        found / reference,
        published,
        "Boulanger and Idriss 2004",
    )


@checked
def k_alpha(
    soil: PM4Sand,
    static_shear_ratio: Series = (0.0, 0.05, 0.1, 0.2, 0.3),
    *,
    cycles: Cycles = 15.0,
    gamma_sa: Limit = 0.03,
    sigma_v0: Pressure = correlations.P_ATM,
    K0: EarthPressure = 0.5,
    integrator: Integrator = "default",
) -> FactorCurve:
    """Static shear factor on cyclic resistance of the model, and that of Idriss and Boulanger (2003).

    The reference condition is a static shear ratio of 0.

    Parameters
    ----------
    static_shear_ratio : (n,) static shear stresses over sigma_v0
    cycles, gamma_sa : number of cycles and criterion, as for :func:`crr`
    soil, sigma_v0, K0, integrator : as for :func:`cyclic_dss`

    Raises
    ------
    InvalidInput : an invalid argument, or an initial stress that the soil cannot carry
    """
    ratios = np.asarray(static_shear_ratio, dtype=np.float64)
    published = np.asarray(
        [correlations.k_alpha(float(a), Dr=soil.Dr, sigma_v0=sigma_v0, K0=K0) for a in ratios]
    )
    for ratio in ratios:
        Conditions(sigma_v0, K0, float(ratio), integrator=integrator).check("lab.k_alpha", soil)
    reference = crr(soil, cycles=cycles, gamma_sa=gamma_sa, sigma_v0=sigma_v0, K0=K0, integrator=integrator)
    found = np.asarray(
        [
            crr(
                soil,
                cycles=cycles,
                gamma_sa=gamma_sa,
                sigma_v0=sigma_v0,
                K0=K0,
                static_shear_ratio=float(a),
                integrator=integrator,
            )
            for a in ratios
        ]
    )
    return FactorCurve(
        "K_alpha",
        "static shear ratio",
        ratios,
        found,
        found / reference,
        published,
        "Idriss and Boulanger 2003",
    )
