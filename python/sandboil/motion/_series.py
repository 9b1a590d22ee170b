"""Operations on series with a constant time step: checks, integration, baseline correction, filter."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.integrate import cumulative_trapezoid
from scipy.signal import butter, sosfiltfilt

from .._errors import InvalidInput

Array = npt.NDArray[np.float64]
Quantity = Literal["acceleration_g", "velocity"]

# The unit g, m/s2; the value of gravity in the whole project (9.80665 would be 0.03 % less).
STANDARD_GRAVITY = 9.81
# Largest accepted acceleration, g. The largest recorded values are about 4 g (Iwate 2008). A record in m/s2
# or cm/s2 that is read as g usually exceeds the limit.
MAX_PGA_G = 20.0
# Largest accepted velocity, m/s. The largest recorded values are about 4 m/s; a record in cm/s exceeds the
# limit.
MAX_PGV = 20.0
# Largest number of samples, 2000 s at 1 kHz: longer than any earthquake record. It limits the memory.
MAX_SAMPLES = 2_000_000
# Degree of the polynomial baseline of the acceleration: two coefficients for the two end conditions, two for
# the drift.
BASELINE_DEGREE = 3
# Largest time step, s. Digitised accelerograms have 0.02 s; a larger value than the limit is probably in ms.
MAX_DT = 0.5
# Zero padding before and after a filtered series, in units of order / corner frequency, after Boore (2005).
PADDING_PER_ORDER = 1.5


def positive(path: str, value: Any, unit: str, hint: str = "check its unit and its sign") -> float:
    """Return `value` as a float; raise InvalidInput unless it is a finite number above zero."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise InvalidInput(path, value, f"must be a finite number of {unit} above 0", hint)
    return number


def finite_series(values: Any, name: str, where: Callable[[int], str]) -> Array:
    """Return a read-only copy of (n,) finite numbers; raise InvalidInput for any other input.

    Parameters
    ----------
    values : (n,) numbers
    name : name of the series for the user
    where : function that returns the place of number i for the user
    """
    try:
        series = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(
            name, type(values).__name__, "must be an array of numbers", "for example [0.0, 0.1, 0.0]"
        ) from error
    if series.ndim != 1:
        raise InvalidInput(
            f"{name}.shape",
            series.shape,
            "must be one-dimensional, with one number per time",
            "use one component of the record",
        )
    if not 2 <= series.size <= MAX_SAMPLES:
        raise InvalidInput(
            f"{name}.size",
            series.size,
            f"must lie between 2 and {MAX_SAMPLES}",
            "use the whole record of one earthquake",
        )
    bad = np.flatnonzero(~np.isfinite(series))
    if bad.size:
        at = int(bad[0])
        raise InvalidInput(
            where(at),
            float(series[at]),
            f"must be finite; {bad.size} of {series.size} values are not",
            "correct the record or use another copy",
        )
    series.flags.writeable = False
    return series


def ground_motion(values: Any, quantity: Quantity, dt: float, where: Callable[[int], str]) -> Array:
    """`finite_series` of an acceleration in g or a velocity in m/s, with values possible in an earthquake."""
    series = finite_series(values, f"motion.{quantity}", where)
    if quantity == "acceleration_g":
        hint = "the values are probably in m/s2 or cm/s2: give their unit"
        _bounded(series, MAX_PGA_G, "g", hint, dt, where)
    else:
        hint = "the values are probably in cm/s: divide them by 100"
        _bounded(series, MAX_PGV, "m/s", hint, dt, where)
        hint = "check the unit, the time step, and the velocity for jumps"
        acceleration_g = differentiate(series, dt) / STANDARD_GRAVITY
        _bounded(acceleration_g, MAX_PGA_G, "g when differentiated", hint, dt, where)
    return series


def _bounded(
    series: Array, limit: float, unit: str, hint: str, dt: float, where: Callable[[int], str]
) -> None:
    at = int(np.argmax(np.abs(series)))
    if abs(series[at]) > limit:
        allowed = f"must not exceed {limit:g} {unit} (peak at {at * dt:.6g} s)"
        raise InvalidInput(where(at), float(series[at]), allowed, hint)


def integrate(series: Array, dt: float) -> Array:
    """Integral from zero along the last axis by the trapezoidal rule.

    It is exact at the samples for a series that is linear between them.
    """
    return np.asarray(cumulative_trapezoid(series, dx=dt, initial=0.0), dtype=np.float64)


def differentiate(series: Array, dt: float) -> Array:
    """Central differences, one-sided at the two ends, (n,).

    The inverse of the trapezoidal rule would be exact, but an alternating error would never decay.
    """
    return np.gradient(series, dt)


def baseline(velocity: Array, dt: float) -> tuple[Array, Array]:
    """Baseline of a velocity: the (acceleration, velocity) to subtract, each (n,).

    The baseline of the acceleration is a polynomial of degree 3 in time, after Berg and Housner (1961). It
    minimises the squared velocity, with velocity and displacement zero at the end. The end conditions hold
    for the trapezoidal integrals, which are those of a run. The velocity is first shifted to begin at zero.
    """
    shifted = velocity - velocity[0]
    time = np.linspace(0.0, 1.0, velocity.size)
    step = time[1]
    shapes = np.stack([time**power for power in range(BASELINE_DEGREE + 1)])
    basis = integrate(shapes, step)
    # Constrained least squares with Lagrange multipliers: unknowns are the coefficients and two multipliers.
    ends = np.stack([basis[:, -1], integrate(basis, step)[:, -1]])
    at_end = np.array([shifted[-1], integrate(shifted, step)[-1]])
    system = np.block([[basis @ basis.T / velocity.size, ends.T], [ends, np.zeros((2, 2))]])
    right = np.concatenate([basis @ shifted / velocity.size, at_end])
    # With few samples the system is singular; lstsq then gives the solution of least norm.
    coefficients = np.linalg.lstsq(system, right, rcond=None)[0][: BASELINE_DEGREE + 1]
    duration = dt * (velocity.size - 1)
    return coefficients @ shapes / duration, velocity[0] + coefficients @ basis


def butterworth(series: Array, dt: float, low: float | None, high: float | None, order: int) -> Array:
    """Zero-phase Butterworth filter: forwards and backwards over the zero-padded series, (n,).

    The gain is -6 dB at each corner; the slope is that of order 2 * `order`. Padding after Boore (2005).
    """
    nyquist = 0.5 / dt
    if low is None and high is None:
        raise InvalidInput(
            "filtered(low, high)",
            (low, high),
            "must have at least one corner frequency, Hz",
            "for example low = 0.1 to remove drift, or high = 25",
        )
    corners = [
        positive(f"filtered({name})", value, "Hz")
        for name, value in (("low", low), ("high", high))
        if value is not None
    ]
    if max(corners) >= nyquist:
        raise InvalidInput(
            "filtered(low, high)",
            (low, high),
            f"must lie below the Nyquist frequency 1/(2 dt) = {nyquist:.6g} Hz",
            "the record contains no higher frequencies",
        )
    if len(corners) == 2 and corners[0] >= corners[1]:
        raise InvalidInput(
            "filtered(low, high)",
            (low, high),
            "must have low below high: frequencies between them are kept",
            "exchange them",
        )
    band = "bandpass" if len(corners) == 2 else "highpass" if high is None else "lowpass"
    sections = butter(order, corners if len(corners) == 2 else corners[0], band, fs=1.0 / dt, output="sos")
    padding = min(math.ceil(PADDING_PER_ORDER * order / (corners[0] * dt)), MAX_SAMPLES)
    filtered = sosfiltfilt(sections, np.pad(series, padding), padtype=None)
    return np.asarray(filtered[padding : padding + series.size], dtype=np.float64)
