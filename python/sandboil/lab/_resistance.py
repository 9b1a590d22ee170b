"""Cyclic resistance: the stress ratio that a criterion wants in a number of cycles, and its curves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, PlainValidator

from .._errors import InvalidInput
from .._model import Number
from ..discretise import Floats
from ..materials import PM4Sand
from . import correlations
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

# Cyclic stress ratios between which a resistance is looked for; ground has none beyond.
_CSR_RANGE = (0.005, 3.0)
# First guess and the factor by which it is moved until it brackets the answer.
_CSR_GUESS, _BRACKETING = 0.15, 1.4
# Relative width at which a bisection ends: far below what resistances are known to.
_WIDTH = 2e-4
# Strain at which a test for a pore pressure ratio or a double amplitude ends: liquefied sand has come so far.
_GAMMA_STOP = 0.06
# A cycle count by halves takes the first stroke, a quarter of a cycle in time, for a half.
_FIRST_STROKE = 0.25
# Cyclic stress ratios of an automatic curve, as fractions of the resistance in 15 cycles.
_CURVE_FRACTIONS = (0.75, 0.82, 0.9, 1.0, 1.1, 1.25, 1.45, 1.7)
# Cycles at which a point of a curve is given up.
_CURVE_CYCLES = 500
# Largest number of cycles of a resistance: no ground is shaken so long.
_CYCLES_MAX = 1e4


def _as_ratios(value: object) -> Floats:
    ratios = as_series(value)
    if not (ratios > 0.0).all():
        raise ValueError("must be greater than 0 throughout; ratios to sigma_v0, for example [0.1, 0.2]")
    return ratios


Ratios = Annotated[ArrayLike, PlainValidator(_as_ratios)]
Cycles = Annotated[Number, Field(gt=0.5, le=_CYCLES_MAX, description="uniform cycles")]
PressureRatio = Annotated[
    Number,
    Field(
        gt=0.0,
        le=1.0,
        description="excess pore pressure ratio, 1",
        json_schema_extra={"remedy": "0.98 is liquefaction in most tests"},
    ),
]


@dataclass(frozen=True)
class Conditions:
    """What the specimens of a series have in common: arguments of :func:`cyclic_dss`."""

    sigma_v0: float = correlations.P_ATM
    K0: float = 0.5
    static_shear_ratio: float = 0.0
    void_ratio: float | None = None
    integrator: str = "default"

    def check(self, where: str, soil: Soil, csr: Floats | None = None) -> None:
        """Refuse, before any test, conditions and stress ratios that a specimen cannot bear."""
        specimen = consolidated(where, soil, **self.arguments(), tolerance=None)
        if csr is not None:
            check_reach(f"{where}.csr", soil, specimen, self.static_shear_ratio + csr, drained=False)

    def arguments(self) -> dict[str, Any]:
        """As keyword arguments."""
        return dict(vars(self))


def criterion_of(gamma_sa: float | None, gamma_da: float | None, r_u: float | None) -> dict[str, float]:
    """The one criterion that was given; 3 % single-amplitude strain if none was."""
    given = {"gamma_sa": gamma_sa, "gamma_da": gamma_da, "r_u": r_u}
    named = {name: value for name, value in given.items() if value is not None}
    if len(named) > 1:
        raise InvalidInput(
            "lab.criterion", named, "must be one of gamma_sa, gamma_da and r_u", "leave out all but one"
        )
    return named or {"gamma_sa": 0.03}


def _stop_strain(criterion: dict[str, float]) -> float:
    if "gamma_sa" in criterion:
        return criterion["gamma_sa"]
    # A double amplitude lies within as much single amplitude on either side of the start.
    return max(_GAMMA_STOP, criterion.get("gamma_da", 0.0))


def falls_short(
    soil: Soil, csr: float, cycles: float, criterion: dict[str, float], conditions: Conditions
) -> bool:
    """Whether a uniform stress ratio meets the criterion in fewer than so many cycles."""
    survived = math.ceil(2.0 * cycles) - 1
    strokes = np.where(np.arange(survived) % 2 == 0, csr, -csr)
    if survived == 0:
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
        # More than the strength: the first stroke goes on without end.
        return True
    return not math.isnan(test.cycles_to(**criterion))


def bisect(condition: Callable[[float], bool], low: float, high: float) -> float:
    """Where a condition turns true between `low` (false) and `high` (true); both positive."""
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
    """Two values around the turn of a condition, false then true; None if it lies outside the limits."""
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
    """Cyclic resistance ratio: the uniform CSR that meets a criterion in `cycles`, in undrained simple shear.

    One criterion: `gamma_sa` or `gamma_da` (single or double amplitude of engineering strain) or `r_u`; 3 %
    single amplitude if none is given. Stress in kPa. Cycles are counted by halves, the one in which the
    criterion is met included, and the first stroke from the static stress counts as a half: the answer is the
    largest stress ratio that needs no fewer than `cycles`. nan where there is none between 0.005 and 3.
    Raises :class:`InvalidInput`.
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
    """The resistance of :func:`crr` next to a guess, from which the search goes out by factors of `step`."""

    def weaker(csr: float) -> bool:
        return falls_short(soil, csr, cycles, criterion, conditions)

    found = bracket(weaker, min(max(guess, _CSR_RANGE[0]), _CSR_RANGE[1]), step, _CSR_RANGE)
    return math.nan if found is None else bisect(weaker, *found)


@dataclass(frozen=True, eq=False)
class ResistanceCurve(Table):
    """CSR against cycles for several criteria. `cycles[name]` goes with `csr`, counted by halves as in
    :func:`crr`; nan where a criterion was not met."""

    csr: Floats
    cycles: dict[str, Floats]
    conditions: Conditions = field(repr=False)

    def csr_at(self, cycles: float, criterion: str = "3 % single amplitude") -> float:
        """CSR at a number of cycles, by interpolation in the logarithms; nan outside the curve."""
        reached = self.cycles[criterion]
        known = np.isfinite(reached)
        order = np.argsort(reached[known])
        x, y = np.log(reached[known][order]), np.log(self.csr[known][order])
        return float(np.exp(np.interp(math.log(cycles), x, y, left=math.nan, right=math.nan)))

    def columns(self) -> dict[str, Floats]:
        """`csr`, and the cycles to each criterion by its name."""
        return {"csr": self.csr, **self.cycles}

    def plot(self) -> Figure:
        """CSR against cycles, logarithmic."""
        from ._resistance_plots import resistance

        return resistance(self)


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

    One test for each `csr`; without them eight around the resistance in 15 cycles. Raises
    :class:`InvalidInput`.
    """
    conditions = Conditions(sigma_v0, K0, static_shear_ratio, void_ratio, integrator)
    if csr is None:
        middle = crr(soil, **conditions.arguments())
        if math.isnan(middle):
            raise InvalidInput(
                "lab.crr_curve.csr",
                None,
                "must be given: this sand has no resistance in 15 cycles to start from",
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
    """A factor on cyclic resistance: the model's, and the published one beside it."""

    name: str
    """`K_sigma` or `K_alpha`."""
    argument: str
    """What it is drawn against, with its unit."""
    x: Floats
    crr: Floats
    """Cyclic resistance ratio of the model at each `x`."""
    factor: Floats
    """`crr` over that of the reference condition."""
    published: Floats
    source: str

    def columns(self) -> dict[str, Floats]:
        """`x`, `crr`, `factor` and `published`."""
        return {"x": self.x, "crr": self.crr, "factor": self.factor, "published": self.published}

    def plot(self) -> Figure:
        """The factor beside the published one."""
        from ._resistance_plots import factor

        return factor(self)


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
    """Effect of overburden on cyclic resistance, beside Boulanger and Idriss (2004). Stresses in kPa."""
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
    """Effect of sustained shear on cyclic resistance, beside Idriss and Boulanger (2003). Stress in kPa."""
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
