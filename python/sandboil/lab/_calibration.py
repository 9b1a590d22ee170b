"""Calibration of PM4Sand's contraction rate to a cyclic resistance."""

from __future__ import annotations

import inspect
import math
import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from .._errors import InvalidInput, SandboilWarning, nearest_name
from .._model import Number
from ..materials import PM4Sand
from . import correlations
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
        json_schema_extra={"remedy": "0.05 to 0.6; sb.lab.correlations has it from SPT and CPT"},
    ),
]

# Contraction rates between which the answer is looked for: beyond, sand does not contract, or only that.
_HPO_RANGE = (1e-3, 50.0)
# Factor by which the first guess is moved until it brackets the answer; the guess is good to 1.5.
_BRACKETING = 1.5
# Resistances are met to this, relatively, or the user is warned. A count by halves is no smooth function of
# the stress ratio: it goes up and down by a half within a per cent.
_MET = 0.01
# Steps in which the resistance of the answer is looked for beside the target, relatively.
_STEP = 0.0025


class CalibrationWarning(SandboilWarning):
    """The target of a calibration cannot be met; the nearest sand was returned."""


@dataclass(frozen=True)
class Calibration:
    """A calibrated sand, with what was asked for and what it does."""

    soil: PM4Sand
    target: float
    """Cyclic resistance ratio asked for."""
    achieved: float
    """Cyclic resistance ratio of `soil` in the same cycles; nan where it has none."""
    cycles: float
    criterion: dict[str, float]
    conditions: Conditions = field(repr=False)

    @property
    def met(self) -> bool:
        """Whether the target was met."""
        return abs(self.achieved - self.target) <= _MET * self.target

    def curve(self) -> ResistanceCurve:
        """CSR against cycles of the calibrated sand, three criteria."""
        return crr_curve(self.soil, **self.conditions.arguments())

    def plot(self) -> Figure:
        """The calibrated sand's curves with the target marked."""
        from ._resistance_plots import resistance

        return resistance(self.curve(), target=(self.cycles, self.target))


def _first_guess(density: float, resistance: float) -> float:
    """Contraction rate after the model's authors (Boulanger and Ziotopoulou 2017), where that has a value."""
    denominator = 1.0 - resistance * (12.0 - 12.5 * density)
    guess = resistance * (2.05 - 2.4 * density) / denominator if denominator > 0.0 else math.nan
    return guess if _HPO_RANGE[0] < guess < _HPO_RANGE[1] else 0.5


def calibration(Dr: float, G0: float, crr: float, **options: Any) -> Calibration:
    """Contraction rate `hpo` for which the cyclic resistance ratio in so many cycles is `crr`.

    Parameters
    ----------
    Dr, G0 : of :class:`PM4Sand`, as are all further keywords that are parameters of it
    crr : cyclic resistance ratio, by undrained cyclic direct simple shear
    cycles : uniform cycles in which `crr` meets the criterion; 15
    gamma_sa, gamma_da, r_u : the criterion, one of them; 3 % single-amplitude shear strain
    sigma_v0, K0, static_shear_ratio, void_ratio, integrator : as for :func:`cyclic_dss`

    Warns with :class:`CalibrationWarning`, and returns the nearest sand, where no contraction rate meets the
    target. Raises :class:`InvalidInput`.
    """
    unknown = options.keys() - _OPTIONS - PM4Sand.model_fields.keys()
    if unknown or "hpo" in options:
        name = "hpo" if "hpo" in options else sorted(unknown)[0]
        known = sorted(_OPTIONS) + [name for name in PM4Sand.model_fields if name not in _FOUND]
        nearest = nearest_name(name, known)
        raise InvalidInput(
            f"lab.calibration.{name}",
            options[name],
            "is what the calibration finds"
            if name == "hpo"
            else f"unknown key, known are {', '.join(known)}",
            "leave it out" if name == "hpo" or nearest is None else f"did you mean {nearest!r}?",
        )
    secondary = {name: value for name, value in options.items() if name not in _OPTIONS}
    options = {name: value for name, value in options.items() if name in _OPTIONS}
    return _calibrated(Dr, G0, crr, secondary=secondary, **options)


def calibrate_hpo(Dr: float, G0: float, crr: float, **options: Any) -> PM4Sand:
    """The sand of :func:`calibration`, with the same arguments, warnings and errors."""
    return calibration(Dr, G0, crr, **options).soil


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
        reached = "no resistance at all" if math.isnan(achieved) else f"{achieved:.4g}"
        reason = (
            f"cannot be met by any contraction rate between {_HPO_RANGE[0]:g} and {_HPO_RANGE[1]:g}"
            if found is None
            else f"is not met within {100.0 * _MET:g} %, since resistance jumps with the contraction rate"
        )
        warnings.warn(
            f"crr = {crr:g} in {cycles:g} cycles {reason} at Dr = {Dr:g}, G0 = {G0:g}: hpo = {soil.hpo:g} "
            f"gives {reached}",
            CalibrationWarning,
            # The frames between here and the caller of `calibration`.
            stacklevel=4,
        )
    return result


_calibrate.__name__ = "calibration"
_calibrated = checked(_calibrate)
# Keywords of `calibration` that are no parameters of the sand, and parameters that are no keywords of it.
_OPTIONS = {
    name
    for name, parameter in inspect.signature(_calibrate).parameters.items()
    if parameter.kind is inspect.Parameter.KEYWORD_ONLY
} - {"secondary"}
_FOUND = ("kind", "Dr", "G0", "hpo")
