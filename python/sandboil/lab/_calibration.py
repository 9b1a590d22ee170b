"""Calibration of the contraction rate of PM4Sand to a cyclic resistance."""

from __future__ import annotations

import inspect
import math
import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from .._errors import InvalidInput, SandboilWarning, nearest_name
from .._types import Number
from ..scene.soils import PM4Sand, calibrated_sand
from . import _resistance_plots, correlations
from ._arguments import Bias, EarthPressure, Integrator, Limit, Pressure, VoidRatio, checked
from ._resistance import (
    Conditions,
    Cycles,
    PressureRatio,
    ResistanceCurve,
    bisect,
    bracket,
    criterion_of,
    crr_curve,
    falls_short,
    resistance,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Target = Annotated[
    Number,
    Field(
        gt=0.0,
        description="cyclic resistance ratio",
        json_schema_extra={
            "remedy": "usual values are 0.05 to 0.6; sb.lab.correlations estimates it from SPT or CPT"
        },
    ),
]

# Range of contraction rates that is searched. Below it sand contracts too fast, above it hardly at all.
_HPO_RANGE = (1e-3, 50.0)
# Factor between the trials that bracket the solution; the first guess is within a factor of about 1.5.
_BRACKETING = 1.5
# Relative tolerance on the resistance, beyond which the user is warned. Cycles are counted by halves, so the
# count is not a smooth function of the stress ratio: it varies by a half within one per cent.
_MET = 0.01
# Relative step of the search for the resistance of the calibrated sand, which starts at the target.
_STEP = 0.0025


class CalibrationWarning(SandboilWarning):
    """The target of a calibration was not met; the closest sand was returned."""


@dataclass(frozen=True)
class Calibration:
    """A calibrated sand, the target, and the resistance that was achieved."""

    soil: PM4Sand
    target: float
    """Required cyclic resistance ratio."""
    achieved: float
    """Cyclic resistance ratio of `soil` in `cycles`; nan if it has none in the searched range."""
    cycles: float
    """Number of uniform cycles."""
    criterion: dict[str, float]
    """The criterion by name and level, as arguments of :meth:`CyclicTest.cycles_to`."""
    conditions: Conditions = field(repr=False)

    @property
    def met(self) -> bool:
        """Whether the target was met within 1 %."""
        return abs(self.achieved - self.target) <= _MET * self.target

    def curve(self) -> ResistanceCurve:
        """CSR against cycles of the calibrated sand for three criteria; see :func:`crr_curve`."""
        return crr_curve(self.soil, **self.conditions.arguments())

    def plot(self) -> Figure:
        """Plot :meth:`curve` and the target; a matplotlib figure."""
        return _resistance_plots.resistance(self.curve(), target=(self.cycles, self.target))


def _first_guess(density: float, resistance: float) -> float:
    """Contraction rate by the formula of Boulanger and Ziotopoulou (2017), or 0.5 outside its range."""
    denominator = 1.0 - resistance * (12.0 - 12.5 * density)
    guess = resistance * (2.05 - 2.4 * density) / denominator if denominator > 0.0 else math.nan
    return guess if _HPO_RANGE[0] < guess < _HPO_RANGE[1] else 0.5


def calibration(Dr: float, G0: float, crr: float, **options: Any) -> Calibration:
    """Find the contraction rate `hpo` for which the cyclic resistance ratio in `cycles` cycles is `crr`.

    Parameters
    ----------
    Dr, G0 : relative density (fraction) and shear modulus coefficient of :class:`PM4Sand`; all other
        parameters of :class:`PM4Sand` may be given as keywords
    crr : target: cyclic resistance ratio in undrained cyclic direct simple shear
    cycles : number of uniform cycles to the criterion; default 15
    gamma_sa, gamma_da, r_u : the criterion, at most one of them, as for :func:`crr`; default 3 %
        single-amplitude shear strain
    sigma_v0, K0, static_shear_ratio, void_ratio, integrator : as for :func:`cyclic_dss`

    Warns
    -----
    CalibrationWarning : no contraction rate meets the target; the closest sand is returned

    Raises
    ------
    InvalidInput : an unknown keyword, a value out of range, or an initial stress that the soil cannot carry
    """
    unknown = options.keys() - _OPTIONS - PM4Sand.model_fields.keys()
    if unknown or "hpo" in options:
        name = "hpo" if "hpo" in options else sorted(unknown)[0]
        known = sorted(_OPTIONS) + [name for name in PM4Sand.model_fields if name not in _FOUND]
        nearest = nearest_name(name, known)
        raise InvalidInput(
            f"lab.calibration.{name}",
            options[name],
            "is the result of the calibration, not an input"
            if name == "hpo"
            else f"unknown key, known are {', '.join(known)}",
            "leave it out" if name == "hpo" or nearest is None else f"did you mean {nearest!r}?",
        )
    secondary = {name: value for name, value in options.items() if name not in _OPTIONS}
    options = {name: value for name, value in options.items() if name in _OPTIONS}
    return _calibrated(Dr, G0, crr, secondary=secondary, **options)


def calibrate_hpo(Dr: float, G0: float, crr: float, **options: Any) -> PM4Sand:
    """The calibrated sand of :func:`calibration`; same arguments, warnings and errors."""
    return calibration(Dr, G0, crr, **options).soil


@calibrated_sand.by
def _of_field_test(measured: dict[str, float], options: dict[str, Any]) -> PM4Sand:
    """The sand of a field test: estimates by :mod:`correlations` for what the options leave open."""
    given = {name: options[name] for name in ("sigma_v0", "crr") if name in options}
    return calibrate_hpo(**(correlations.estimates(**measured, **given) | options))


def _calibrate(
    Dr: Number,
    G0: Number,
    crr: Target,
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
    secondary: dict[str, Any],
) -> Calibration:
    criterion = criterion_of(gamma_sa, gamma_da, r_u)
    conditions = Conditions(sigma_v0, K0, static_shear_ratio, void_ratio, integrator)

    def sand(hpo: float) -> PM4Sand:
        return PM4Sand(Dr=Dr, G0=G0, hpo=hpo, **secondary)

    def resists(hpo: float) -> bool:
        return not falls_short(sand(hpo), crr, cycles, criterion, conditions)

    found = bracket(resists, _first_guess(Dr, crr), _BRACKETING, _HPO_RANGE)
    if found is not None:
        soil = sand(bisect(resists, *found))
        achieved = resistance(soil, cycles, criterion, conditions, guess=crr, step=1.0 + _STEP)
    else:
        soil = sand(_HPO_RANGE[0] if resists(_HPO_RANGE[0]) else _HPO_RANGE[1])
        achieved = resistance(soil, cycles, criterion, conditions)
    result = Calibration(soil, crr, achieved, cycles, criterion, conditions)
    if not result.met:
        reached = "no cyclic resistance" if math.isnan(achieved) else f"{achieved:.4g}"
        reason = (
            f"cannot be met by any contraction rate between {_HPO_RANGE[0]:g} and {_HPO_RANGE[1]:g}"
            if found is None
            else f"is not met within {100.0 * _MET:g} %, because resistance jumps with the contraction rate"
        )
        warnings.warn(
            f"crr = {crr:g} in {cycles:g} cycles {reason} at Dr = {Dr:g}, G0 = {G0:g}: hpo = {soil.hpo:g} "
            f"gives {reached}",
            CalibrationWarning,
            # Attribute the warning to the caller of `calibration`.
            stacklevel=4,
        )
    return result


_calibrate.__name__ = "calibration"
_calibrated = checked(_calibrate)
# Keywords of `calibration` that are not parameters of the sand; and parameters of the sand that are not
# keywords.
_OPTIONS = {
    name
    for name, parameter in inspect.signature(_calibrate).parameters.items()
    if parameter.kind is inspect.Parameter.KEYWORD_ONLY
} - {"secondary"}
_FOUND = ("kind", "Dr", "G0", "hpo")
