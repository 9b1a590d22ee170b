"""Deconvolution of a motion to the base of level ground by equivalent-linear analysis.

Vertical shear waves in layers of complex stiffness, after Schnabel, Lysmer and Seed (1972).
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, PlainValidator, StrictBool
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from .._checked import checked
from .._errors import InvalidInput, SandboilWarning
from .._types import Number, Positive
from ..motion import Motion
from ..motion._motion import deconvolved
from ..motion._series import Array
from ._profile import SiteProfile

Complex = npt.NDArray[np.complex128]
Place = Literal["surface", "base"]

# Default cut-off frequency, Hz. It includes the frequencies that matter for structures. Above it a record is
# largely noise, which deconvolution through damped ground amplifies most.
DEFAULT_MAX_FREQUENCY = 20.0
# Above the cut-off frequency, amplitudes decrease as a cosine and are zero at this many times the frequency.
CUT_WIDTH = 1.25
# Length of the padded record over its own length. The zeros prevent a motion that arrives before the
# beginning or after the end of the record from wrapping around to the other end.
PADDED_LENGTH = 3

# Limits beyond which a deconvolution is reported as doubtful.
# Largest shear strain, 1. Equivalent-linear and nonlinear analyses begin to differ between 0.04 and 1 %,
# depending on the result considered (Carlton and Tokimatsu 2016).
STRAIN_LIMIT = 0.005
# Largest amplification from the record to the base motion. Undamped ground on a stiffer base has none. Above
# this limit, high frequencies of the base motion depend mainly on the assumed damping and on noise of the
# record.
AMPLIFICATION_LIMIT = 3.0
# Largest share of the squared motion before the beginning or after the end of the record.
LOST_LIMIT = 0.01


class DeconvolutionWarning(SandboilWarning):
    """A deconvolved motion is doubtful."""


@dataclass(frozen=True)
class Deconvolution:
    """Result of :func:`deconvolution`: the base motion, and the state of the ground. `str` gives a report.

    Attributes
    ----------
    motion : outcrop motion of the half-space, with the time step and length of the record
    profile : the ground
    strain : (m,) largest engineering shear strain in the middle of each layer, 1
    G_ratio : (m,) shear modulus over that at small strain, 1
    damping : (m,) damping ratio, 1
    iterations : number of analyses
    converged : whether stiffness and damping agree with the strains within the tolerance
    amplification : largest ratio of the Fourier amplitudes of the base motion to those of the record, up to
        the cut-off frequency
    amplified_frequency : frequency of the largest amplification, Hz
    lost : share of the squared base motion outside the time of the record, which `motion` does not contain
    """

    motion: Motion
    profile: SiteProfile
    strain: Array
    G_ratio: Array
    damping: Array
    iterations: int
    converged: bool
    amplification: float
    amplified_frequency: float
    lost: float

    @property
    def doubts(self) -> list[str]:
        """Reasons why the motion is doubtful; empty if there are none."""
        reasons = [
            (
                not self.converged,
                f"stiffness and strain do not agree after {self.iterations} iterations",
            ),
            (
                self.strain.max() > STRAIN_LIMIT,
                f"a shear strain of {_weakest(self.profile, self.strain)} exceeds the "
                f"{100.0 * STRAIN_LIMIT:g} % that an equivalent-linear analysis can represent",
            ),
            (
                self.amplification > AMPLIFICATION_LIMIT,
                f"waves of {self.amplified_frequency:.3g} Hz, and their noise, are amplified "
                f"{self.amplification:.3g} times: lower max_frequency",
            ),
            (
                self.lost > LOST_LIMIT,
                f"{100.0 * self.lost:.2g} % of the squared motion lies before or after the record, which "
                f"needs {self.profile.travel_time:.2g} s of zeros at both ends",
            ),
        ]
        return [reason for doubtful, reason in reasons if doubtful]

    def __str__(self) -> str:
        lines = [
            f"{self.motion!r}",
            f"{self.iterations} iterations, {'' if self.converged else 'not '}converged",
            "depth (m)  strain (%)   G/Gmax  damping (%)",
            *(
                f"{depth:9.2f}  {100.0 * strain:10.4f}  {ratio:7.3f}  {100.0 * damping:11.2f}"
                for depth, strain, ratio, damping in zip(
                    self.profile.depth, self.strain, self.G_ratio, self.damping, strict=True
                )
            ),
            *(f"doubtful: {reason}" for reason in self.doubts),
        ]
        return "\n".join(lines)


def _as_motion(value: object) -> Motion:
    if not isinstance(value, Motion):
        raise ValueError("must be a Motion")
    return value


@deconvolved.by
def _with_warnings(motion: Motion, profile: SiteProfile, options: dict[str, Any]) -> Motion:
    """The motion of :func:`deconvolution`, with a warning for each of its doubts."""
    found = deconvolution(motion, profile, **options)
    for doubt in found.doubts:
        # At the line that called the method of the motion.
        warnings.warn(doubt, DeconvolutionWarning, stacklevel=4)
    return found.motion


@checked("site")
def deconvolution(
    motion: Annotated[Motion, PlainValidator(_as_motion)],
    profile: SiteProfile,
    *,
    at: Place = "surface",
    linear: StrictBool = False,
    max_frequency: Positive | None = None,
    strain_ratio: Annotated[Number, Field(gt=0.0, le=1.0)] = 0.65,
    tolerance: Annotated[Number, Field(gt=0.0, lt=1.0)] = 0.01,
    max_iterations: Annotated[int, Field(strict=True, ge=1)] = 50,
) -> Deconvolution:
    """Outcrop motion of the half-space of a profile, from a motion recorded at its surface or base.

    Equivalent-linear analysis of vertical shear waves (Schnabel, Lysmer and Seed 1972).

    Parameters
    ----------
    motion : the record; its kind defines which waves it contains
    profile : the ground below the instrument
    at : place of the record: the "surface" of the profile or its "base"
    linear : use stiffness and damping at small strain, without iteration
    max_frequency : cut-off frequency, Hz, at most half the sampling rate; higher frequencies are removed.
        Default 20 Hz, or half the sampling rate if that is lower
    strain_ratio : effective strain, at which stiffness and damping are computed, over the largest strain
    tolerance : largest relative change of the complex stiffness of any layer at which the iteration ends
    max_iterations : largest number of analyses

    Raises
    ------
    InvalidInput : an option out of range, a motion shorter than the travel time of a wave through the
        profile, or a base motion beyond that of any earthquake
    """
    if motion.duration <= profile.travel_time:
        raise InvalidInput(
            "site.deconvolution.motion.duration",
            motion.duration,
            f"must exceed the travel time of a shear wave through the profile, {profile.travel_time:.4g} s",
            "use the whole record, and check the units of thickness (m) and Vs (m/s)",
        )
    cut = _cut(motion, max_frequency)
    samples: Array = getattr(motion, motion.quantity)
    size = next_fast_len(PADDED_LENGTH * samples.size, real=True)
    frequency = rfftfreq(size, motion.dt)
    frequency = frequency[frequency < CUT_WIDTH * cut]
    passing = _low_pass(frequency, cut)
    velocity = passing * rfft(motion.velocity, size)[: frequency.size]

    state = _states(profile, np.zeros(len(profile.layers)))
    converged = linear
    for iterations in itertools.count(1):
        speed = complex_speed(profile, *state)
        up, down = waves(profile, speed, frequency)
        row = 0 if at == "surface" else -1
        record = {"outcrop": 2.0 * up[row], "within": up[row] + down[row], "upgoing": up[row]}[motion.kind]
        with np.errstate(divide="ignore", invalid="ignore"):
            to_base = 2.0 * up[-1] / record
        if not np.isfinite(to_base).all():
            raise _excessive(motion, cut, "amplitudes too large to compute")
        strain = np.array(
            [
                np.abs(irfft(velocity / record * of_layer, size)[: samples.size]).max()
                for of_layer in _strains(profile, speed, up, down, frequency)
            ]
        )
        if linear:
            break
        found = _states(profile, strain_ratio * strain)
        change = (complex_speed(profile, *found) / speed) ** 2 - 1.0
        converged = bool(np.abs(change).max() <= tolerance)
        if converged or iterations == max_iterations:
            break
        state = found

    base = irfft(passing * to_base * rfft(samples, size)[: frequency.size], size)
    try:
        outcrop = Motion(dt=motion.dt, **{motion.quantity: base[: samples.size]})
    except InvalidInput as error:
        peak = f"a base motion with {motion.quantity} = {error.value:.3g}"
        raise _excessive(motion, cut, f"{peak} and a shear strain of {_weakest(profile, strain)}") from None
    total = float(np.sum(base**2))
    amplification = np.abs(to_base[frequency <= cut])
    return Deconvolution(
        motion=outcrop,
        profile=profile,
        strain=strain,
        G_ratio=state[0],
        damping=state[1],
        iterations=iterations,
        converged=converged,
        amplification=float(amplification.max()),
        amplified_frequency=float(frequency[amplification.argmax()]),
        lost=float(np.sum(base[samples.size :] ** 2)) / total if total > 0.0 else 0.0,
    )


def _cut(motion: Motion, max_frequency: float | None) -> float:
    """Cut-off frequency, Hz, checked against the sampling rate of the record."""
    nyquist = 0.5 / motion.dt
    if max_frequency is not None and max_frequency > nyquist:
        raise InvalidInput(
            "site.deconvolution.max_frequency",
            max_frequency,
            f"must be at most the Nyquist frequency 1/(2 dt) = {nyquist:.6g} Hz",
            "the record contains no higher frequencies",
        )
    return min(DEFAULT_MAX_FREQUENCY, nyquist) if max_frequency is None else max_frequency


def _excessive(motion: Motion, cut: float, found: str) -> InvalidInput:
    return InvalidInput(
        "site.deconvolution.motion",
        motion,
        f"must be one that this ground can carry up to {cut:g} Hz; the analysis gives {found}",
        "lower max_frequency or scale the motion down; check units, damping and curves of the profile",
    )


def _weakest(profile: SiteProfile, strain: Array) -> str:
    """The largest strain and its depth, as text."""
    weakest = int(np.argmax(strain))
    return f"{100.0 * strain[weakest]:.2g} % at {profile.depth[weakest]:.3g} m depth"


def _low_pass(frequency: Array, cut: float) -> Array:
    """Factor on the amplitudes, (n,): 1 up to the cut-off frequency, Hz, then decreasing to 0 as a cosine."""
    over = np.clip((frequency / cut - 1.0) / (CUT_WIDTH - 1.0), 0.0, 1.0)
    passing: Array = 0.5 * (1.0 + np.cos(np.pi * over))
    return passing


def _states(profile: SiteProfile, strain: Array) -> Array:
    """Modulus ratio and damping ratio, (2, m), of the layers at their strains (m,), 1."""
    pairs = [layer.at(amplitude) for layer, amplitude in zip(profile.layers, strain.tolist(), strict=True)]
    return np.array(pairs).T


def complex_speed(profile: SiteProfile, G_ratio: Array, damping: Array) -> Complex:
    """Complex shear wave velocity of the layers, m/s, (m,).

    For a damping ratio D its square is G/rho (1 - 2 D^2 + 2 i D sqrt(1 - D^2)), whose absolute value is G/rho
    for any damping.
    """
    Vs = np.array([layer.Vs for layer in profile.layers])
    speed: Complex = Vs * np.sqrt(G_ratio) * (np.sqrt(1.0 - damping**2) + 1j * damping)
    return speed


def waves(profile: SiteProfile, speed: Complex, frequency: Array) -> tuple[Complex, Complex]:
    """Complex amplitudes of the up- and downgoing wave, each (m + 1, n).

    They are those at the top of each layer and of the half-space, and 1 at the free surface. The time
    dependence is exp(i 2 pi f t).

    Parameters
    ----------
    speed : (m,) complex shear wave velocity of the layers, m/s
    frequency : (n,) Hz
    """
    unit_weight = [layer.unit_weight for layer in profile.layers]
    impedance = np.append(unit_weight * speed, profile.base.unit_weight * profile.base.Vs)
    up, down = np.ones((2, len(profile.layers) + 1, frequency.size), dtype=np.complex128)
    # The caller refuses amplitudes that overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        for i, layer in enumerate(profile.layers):
            phase = np.exp(2j * np.pi * frequency * layer.thickness / speed[i])
            ratio = impedance[i] / impedance[i + 1]
            rising, falling = up[i] * phase, down[i] / phase
            up[i + 1] = 0.5 * ((1.0 + ratio) * rising + (1.0 - ratio) * falling)
            down[i + 1] = 0.5 * ((1.0 - ratio) * rising + (1.0 + ratio) * falling)
    return up, down


def _strains(
    profile: SiteProfile, speed: Complex, up: Complex, down: Complex, frequency: Array
) -> Iterator[Complex]:
    """Shear strain in the middle of each layer, over the velocity amplitudes `up` and `down`, s/m, (n,)."""
    for i, layer in enumerate(profile.layers):
        phase = np.exp(1j * np.pi * frequency * layer.thickness / speed[i])
        yield (up[i] * phase - down[i] / phase) / speed[i]
