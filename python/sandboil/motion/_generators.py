"""Generated ground motions: the Ricker pulse and a synthetic earthquake from a random seed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaincinv

from .._errors import InvalidInput
from ._series import MAX_SAMPLES, STANDARD_GRAVITY, Array, baseline, integrate, positive

# Default sample spacing of generated motions, s, as in most PEER records.
DEFAULT_DT = 0.005
# Time from the start of a Ricker pulse to its peak, in periods; the velocity at the start is 1e-8 of the
# largest.
RICKER_LEAD = 1.5
# Smallest number of samples per period of a Ricker pulse: the limit, and that of the default spacing.
RICKER_MIN_SAMPLES = 10
RICKER_DEFAULT_SAMPLES = 100
# PGV/PGA, s, of the record on which the synthetic motion is modelled (Loma Prieta 1989, Gilroy Array #1,
# 090).
PGV_TO_PGA = 0.3386 / (0.4731 * STANDARD_GRAVITY)
# D5-95 (3.68 s) and time of the peak (4.2 s) of that record, over the 12 s of shaking.
D5_95_FRACTION = 3.68 / 12.0
PEAK_FRACTION = 0.35
# Range of D5-95 over the duration. A smaller value is a pulse; with a larger one the motion would be cut at
# its end.
D5_95_FRACTIONS = (0.03, 0.6)
# Range of ln(k - 1), where k is the shape of the envelope, for this range of D5-95.
SHAPE_EXCESS = (-3.0, 10.0)
# Time in which the response of the slowest filter decays to 1e-4, exp(-2 pi 0.5 0.6 5), s.
FILTER_MEMORY = 5.0
# Damping ratio of the Kanai-Tajimi ground, and frequency (Hz) and damping ratio of the Clough-Penzien
# high-pass. Chosen by trial for the mean spectrum over seeds closest to that of the record
# (docs/theory/motion.md).
GROUND_DAMPING = 0.3
HIGH_PASS_FREQUENCY = 0.5
HIGH_PASS_DAMPING = 0.6
# f_max of Hanks (1982), Hz, and the order of the decay above it.
MAX_FREQUENCY = 25.0
MAX_FREQUENCY_ORDER = 4
# Range of ground frequencies searched for a given PGV, Hz.
GROUND_FREQUENCIES = (0.3, 20.0)


def ricker(frequency: float, pga_g: float, dt: float | None, duration: float | None) -> tuple[float, Array]:
    """Spacing and (n,) acceleration in g of a Ricker pulse; see :meth:`Motion.ricker`."""
    frequency = positive("ricker.frequency", frequency, "Hz")
    pga_g = positive("ricker.pga_g", pga_g, "g", "use flipped() to reverse the pulse")
    if dt is None:
        dt = min(DEFAULT_DT, 1.0 / (RICKER_DEFAULT_SAMPLES * frequency))
    dt = positive("ricker.dt", dt, "seconds")
    coarsest = 1.0 / (RICKER_MIN_SAMPLES * frequency)
    if dt > coarsest:
        raise InvalidInput(
            "ricker.dt",
            dt,
            f"must be at most {coarsest:.6g} s, {RICKER_MIN_SAMPLES} samples per period",
        )
    before = math.ceil(RICKER_LEAD / (frequency * dt))
    shortest = 2 * before * dt
    length = shortest if duration is None else positive("ricker.duration", duration, "seconds")
    count = _count("ricker.duration", length, dt)
    if count < 2 * before + 1:
        raise InvalidInput(
            "ricker.duration",
            duration,
            f"must be at least {shortest:.6g} s",
            "a shorter motion would not contain the whole pulse",
        )
    squared = (math.pi * frequency * dt * (np.arange(count) - before)) ** 2
    return dt, np.asarray(pga_g * (1.0 - 2.0 * squared) * np.exp(-squared), dtype=np.float64)


def synthetic(
    pga_g: float,
    duration: float,
    seed: int,
    dt: float,
    pgv: float | None,
    ground_frequency: float | None,
    d5_95: float | None,
) -> Array:
    """(n,) acceleration in g of a synthetic earthquake; see :meth:`Motion.synthetic`."""
    pga_g = positive("synthetic.pga_g", pga_g, "g")
    duration = positive("synthetic.duration", duration, "seconds")
    dt = positive("synthetic.dt", dt, "seconds")
    if 2.0 * MAX_FREQUENCY * dt > 1.0:
        raise InvalidInput(
            "synthetic.dt",
            dt,
            f"must be at most {0.5 / MAX_FREQUENCY:g} s to represent {MAX_FREQUENCY:g} Hz",
        )
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise InvalidInput("synthetic.seed", seed, "must be a whole number, 0 or above")
    if pgv is not None and ground_frequency is not None:
        raise InvalidInput(
            "synthetic.pgv",
            pgv,
            "cannot be combined with ground_frequency",
            "each defines the spectrum: leave one of them out",
        )
    count = _count("synthetic.duration", duration, dt)
    noise = np.random.Generator(np.random.PCG64(int(seed))).standard_normal(count)
    burst = noise * _envelope(count, dt, duration, d5_95)

    def scaled_to_pga(frequency: float) -> Array:
        shaped = _ground_filtered(burst, dt, frequency)
        shaped -= baseline(integrate(shaped, dt), dt)[0]
        return np.asarray(shaped * (pga_g / np.max(np.abs(shaped))))

    if ground_frequency is not None:
        return scaled_to_pga(positive("synthetic.ground_frequency", ground_frequency, "Hz"))
    target = PGV_TO_PGA * pga_g * STANDARD_GRAVITY if pgv is None else positive("synthetic.pgv", pgv, "m/s")

    def excess(log_frequency: float) -> float:
        acceleration = STANDARD_GRAVITY * scaled_to_pga(math.exp(log_frequency))
        return float(np.max(np.abs(integrate(acceleration, dt)))) / target - 1.0

    softest, stiffest = (math.log(frequency) for frequency in GROUND_FREQUENCIES)
    most, least = excess(softest), excess(stiffest)
    if not least < 0.0 < most:
        raise InvalidInput(
            "synthetic.pgv",
            target,
            f"must lie between {target * (1.0 + least):.3g} and {target * (1.0 + most):.3g} m/s "
            "for this pga_g, duration and seed",
        )
    return scaled_to_pga(math.exp(brentq(excess, softest, stiffest, xtol=1e-10)))


def _count(path: str, duration: float, dt: float) -> int:
    count = round(duration / dt) + 1
    if not 2 <= count <= MAX_SAMPLES:
        raise InvalidInput(
            path,
            duration,
            f"must give 2 to {MAX_SAMPLES} samples of {dt:.6g} s, not {count}",
            "change dt accordingly",
        )
    return count


def _envelope(count: int, dt: float, duration: float, d5_95: float | None) -> Array:
    """Envelope of Saragoni and Hart (1974), (count,): root of the intensity t^(k-1) exp(-t/theta), peak 1.

    k and theta are such that the peak is at PEAK_FRACTION of the duration, and that `d5_95` seconds are
    between 5 and 95 % of the cumulative intensity.
    """
    peak = PEAK_FRACTION * duration
    target = D5_95_FRACTION * duration if d5_95 is None else positive("synthetic.d5_95", d5_95, "seconds")
    shortest, longest = (fraction * duration for fraction in D5_95_FRACTIONS)
    if not shortest <= target <= longest:
        raise InvalidInput(
            "synthetic.d5_95",
            target,
            f"must lie between {shortest:.4g} and {longest:.4g} s for this duration",
        )

    def spread(log_excess: float) -> float:
        shape = 1.0 + math.exp(log_excess)
        span = float(gammaincinv(shape, 0.95) - gammaincinv(shape, 0.05))
        return span / (shape - 1.0) * peak - target

    excess = math.exp(brentq(spread, *SHAPE_EXCESS))
    relative = np.arange(count) * dt / peak
    with np.errstate(divide="ignore"):
        return np.asarray(np.exp(0.5 * excess * (np.log(relative) + 1.0 - relative)), dtype=np.float64)


def _ground_filtered(burst: Array, dt: float, ground_frequency: float) -> Array:
    """A series after the filters of Kanai-Tajimi, Clough-Penzien (high-pass) and f_max, (n,)."""
    length = burst.size + math.ceil(FILTER_MEMORY / dt)
    frequency = np.fft.rfftfreq(length, dt)
    ground: Any = frequency / ground_frequency
    slow: Any = frequency / HIGH_PASS_FREQUENCY
    response = (1.0 + 2j * GROUND_DAMPING * ground) / (1.0 - ground**2 + 2j * GROUND_DAMPING * ground)
    response *= -(slow**2) / (1.0 - slow**2 + 2j * HIGH_PASS_DAMPING * slow)
    response /= np.sqrt(1.0 + (frequency / MAX_FREQUENCY) ** (2 * MAX_FREQUENCY_ORDER))
    filtered = np.fft.irfft(np.fft.rfft(burst, length) * response, length)
    return np.asarray(filtered[: burst.size], dtype=np.float64)
