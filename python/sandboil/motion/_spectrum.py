"""Response spectrum of a damped oscillator, exact for an acceleration that is linear between its samples."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from .._errors import InvalidInput
from ._series import Array, finite_series, positive

# Default periods, s: the range of design spectra, logarithmically spaced, enough for a smooth curve.
DEFAULT_PERIODS: Array = np.geomspace(0.01, 10.0, 200)
DEFAULT_PERIODS.flags.writeable = False
# Computed values of the response per period: a peak between them is underestimated by at most 1 - cos(pi/20)
# = 1.2 %.
SAMPLES_PER_PERIOD = 20
# Largest number of computed values in one time step: a stiffer oscillator moves with the ground.
MAX_SUBSTEPS = 40
# |mu| below which (exp(mu) - 1 - mu)/mu^2 is summed as a series, to avoid cancellation.
SERIES_BELOW = 1.0
# Number of terms of that series: 1/(18 + 2)! is below the round-off of a double.
SERIES_TERMS = 18


@dataclass(frozen=True)
class ResponseSpectrum:
    """Pseudo-acceleration response spectrum.

    Attributes
    ----------
    periods : (m,) natural periods, s
    psa_g : (m,) pseudo-spectral acceleration (2 pi/T)^2 max|relative displacement|, g
    damping : damping ratio, fraction of critical
    """

    periods: Array
    psa_g: Array
    damping: float


def response_spectrum(
    acceleration_g: npt.ArrayLike,
    dt: float,
    periods: npt.ArrayLike | None = None,
    damping: float = 0.05,
) -> ResponseSpectrum:
    """Pseudo-acceleration spectrum of a base acceleration, for an oscillator initially at rest.

    Duhamel's integral is exact for an acceleration that is linear between samples (the solution of Nigam and
    Jennings 1969, in complex form). For short periods the response is also computed between the samples. The
    free vibration after the record is included.

    Parameters
    ----------
    acceleration_g : (n,) base acceleration, g
    dt : time step, s
    periods : (m,) natural periods, s, 0 or above (at 0 the spectrum is the peak ground acceleration); default
        200 values from 0.01 to 10 s
    damping : damping ratio, fraction of critical, in [0, 1)

    Raises
    ------
    InvalidInput : a value is not finite or out of range
    """
    dt = positive("dt", dt, "seconds")
    ground = finite_series(acceleration_g, "acceleration_g", lambda at: f"acceleration_g[{at}]")
    if not 0.0 <= damping < 1.0:
        raise InvalidInput("damping", damping, "must lie in [0, 1)", "5 % of critical is written 0.05")
    natural = np.array(DEFAULT_PERIODS if periods is None else periods, dtype=np.float64)
    if natural.ndim != 1 or natural.size == 0 or not np.all(np.isfinite(natural) & (natural >= 0.0)):
        raise InvalidInput("periods", periods, "must be a list of finite periods, s, 0 or above")
    psa = np.array([_pseudo_acceleration(ground, dt, float(period), float(damping)) for period in natural])
    return ResponseSpectrum(natural, psa, float(damping))


def _pseudo_acceleration(ground: Array, dt: float, period: float, damping: float) -> float:
    """Peak of omega^2 |u|, in the unit of `ground`.

    y' = lambda y - a with lambda = omega (-damping + i sqrt(1 - damping^2)) is Duhamel's integral, and the
    relative displacement is u = Im(y)/(omega sqrt(1 - damping^2)).
    """
    if period == 0.0:
        return float(np.max(np.abs(ground)))
    substeps = min(math.ceil(SAMPLES_PER_PERIOD * dt / period), MAX_SUBSTEPS)
    step = dt / substeps
    if substeps > 1:
        fine = np.arange((ground.size - 1) * substeps + 1) / substeps
        ground = np.interp(fine, np.arange(ground.size), ground)
    ground = np.append(ground, 0.0)

    omega = 2.0 * math.pi / period
    damped = math.sqrt(1.0 - damping**2)
    root = complex(-damping, damped)
    mu = omega * step * root
    late = _phi2(mu)
    early = (np.exp(mu) - 1.0) / mu - late
    forcing = -step * (early * ground[:-1] + late * ground[1:])
    response = lfilter([1.0], [1.0, -np.exp(mu)], forcing)
    # Free vibration y exp(lambda t): its first peak is where the rate Im(lambda y exp(lambda t)) is first 0.
    to_peak = -np.angle(root * response[-1]) % math.pi
    free = response[-1] * np.exp(root / damped * to_peak)
    return float(omega / damped * max(np.max(np.abs(response.imag)), abs(free.imag)))


def _phi2(mu: complex) -> complex:
    """(exp(mu) - 1 - mu)/mu^2: the weight of the value at the end of a step of a linear forcing."""
    if abs(mu) >= SERIES_BELOW:
        return complex((np.exp(mu) - 1.0 - mu) / mu**2)
    total = 0.0 + 0.0j
    for power in reversed(range(SERIES_TERMS)):
        total = total * mu + 1.0 / math.factorial(power + 2)
    return total
