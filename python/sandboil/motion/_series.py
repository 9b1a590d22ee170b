"""Operations on equally spaced series: checks on entry, integration, baseline, filter."""

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

# The unit g, m/s2, as the project writes gravity everywhere (9.80665 would be 0.03 % less).
STANDARD_GRAVITY = 9.81
# Largest acceleration taken for a ground motion, g. The largest ever recorded are near 4 g (Iwate 2008);
# a record read in m/s2 or cm/s2 as if it were g usually lies above.
MAX_PGA_G = 20.0
# Largest ground velocity taken for one, m/s: the largest recorded are near 4 m/s; cm/s lie above.
MAX_PGV = 20.0
# 2e6 samples are 2000 s at 1 kHz: more is not an earthquake record, and memory stays bounded.
MAX_SAMPLES = 2_000_000
# Degree of the polynomial taken from the acceleration: two coefficients meet the two end conditions and
# two follow the drift.
BASELINE_DEGREE = 3
# Coarsest spacing of a strong motion, s: digitised accelerograms have 0.02; above, dt is in ms.
MAX_DT = 0.5
# Zero padding before and after a filtered series, in (order / corner frequency), after Boore (2005).
PADDING_PER_ORDER = 1.5


def positive(path: str, value: Any, unit: str, hint: str = "check its unit and its sign") -> float:
    """`value` as a float, or InvalidInput unless it is a finite number above zero."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise InvalidInput(path, value, f"must be a finite number of {unit} above 0", hint)
    return number


def finite_series(values: Any, name: str, where: Callable[[int], str]) -> Array:
    """A read-only copy of (n,) finite numbers, or InvalidInput.

    Parameters
    ----------
    values : (n,) numbers
    name : what they are, in the user's terms
    where : tells the place of number i in the user's terms
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
            "must be one-dimensional, one number per time",
            "take one component of the record",
        )
    if not 2 <= series.size <= MAX_SAMPLES:
        raise InvalidInput(
            f"{name}.size",
            series.size,
            f"must lie between 2 and {MAX_SAMPLES}",
            "take the whole record, and no more than the earthquake",
        )
    bad = np.flatnonzero(~np.isfinite(series))
    if bad.size:
        at = int(bad[0])
        raise InvalidInput(
            where(at),
            float(series[at]),
            f"must be finite; {bad.size} of {series.size} values are not",
            "repair the gap in the record or take another copy",
        )
    series.flags.writeable = False
    return series


def ground_motion(values: Any, quantity: Quantity, dt: float, where: Callable[[int], str]) -> Array:
    """`finite_series` of an acceleration in g or a velocity in m/s that an earthquake can have."""
    series = finite_series(values, f"motion.{quantity}", where)
    if quantity == "acceleration_g":
        hint = "the values are probably in m/s2 or cm/s2: state their unit"
        _bounded(series, MAX_PGA_G, "g", hint, dt, where)
    else:
        hint = "the values are probably in cm/s: divide them by 100"
        _bounded(series, MAX_PGV, "m/s", hint, dt, where)
        hint = "check the unit, the time step and steps in the velocity"
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
    """Integral from zero along the last axis: the trapezoidal rule, exact at the samples if the series is
    straight between them."""
    return np.asarray(cumulative_trapezoid(series, dx=dt, initial=0.0), dtype=np.float64)


def differentiate(series: Array, dt: float) -> Array:
    """Central differences, one-sided at the two ends, (n,). (The trapezoidal rule read backwards would be
    exact, but it keeps an alternating error for ever.)"""
    return np.gradient(series, dt)


def baseline(velocity: Array, dt: float) -> tuple[Array, Array]:
    """Baseline of a velocity, as the (acceleration, velocity) to be taken away, each (n,).

    The acceleration's baseline is a polynomial of degree 3 in time, after Berg and Housner (1961): the one
    that leaves the least squared velocity among those that leave velocity and displacement zero at the
    end. The end conditions hold for the trapezoidal integrals, that is for the sums used in a run.
    A velocity that does not begin at zero is also shifted by its first value.
    """
    shifted = velocity - velocity[0]
    time = np.linspace(0.0, 1.0, velocity.size)
    step = time[1]
    shapes = np.stack([time**power for power in range(BASELINE_DEGREE + 1)])
    basis = integrate(shapes, step)
    # Lagrange conditions of the constrained least squares: rows are the coefficients, then the two ends.
    ends = np.stack([basis[:, -1], integrate(basis, step)[:, -1]])
    at_end = np.array([shifted[-1], integrate(shifted, step)[-1]])
    system = np.block([[basis @ basis.T / velocity.size, ends.T], [ends, np.zeros((2, 2))]])
    right = np.concatenate([basis @ shifted / velocity.size, at_end])
    # Two samples leave fewer distinct shapes than conditions: lstsq still meets those that can be met.
    coefficients = np.linalg.lstsq(system, right, rcond=None)[0][: BASELINE_DEGREE + 1]
    duration = dt * (velocity.size - 1)
    return coefficients @ shapes / duration, velocity[0] + coefficients @ basis


def butterworth(series: Array, dt: float, low: float | None, high: float | None, order: int) -> Array:
    """Zero-phase Butterworth filter: run forwards and backwards over the zero-padded series, (n,).

    Each corner is 6 dB down, and the fall-off that of order 2 * `order`. Padding after Boore (2005).
    """
    nyquist = 0.5 / dt
    if low is None and high is None:
        raise InvalidInput(
            "filtered(low, high)",
            (low, high),
            "at least one corner frequency, Hz, is needed",
            "for example low = 0.1 against drift, or high = 25",
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
            "the record holds nothing above it",
        )
    if len(corners) == 2 and corners[0] >= corners[1]:
        raise InvalidInput(
            "filtered(low, high)", (low, high), "low must be below high: those between pass", "exchange them"
        )
    band = "bandpass" if len(corners) == 2 else "highpass" if high is None else "lowpass"
    sections = butter(order, corners if len(corners) == 2 else corners[0], band, fs=1.0 / dt, output="sos")
    padding = min(math.ceil(PADDING_PER_ORDER * order / (corners[0] * dt)), MAX_SAMPLES)
    filtered = sosfiltfilt(sections, np.pad(series, padding), padtype=None)
    return np.asarray(filtered[padding : padding + series.size], dtype=np.float64)
