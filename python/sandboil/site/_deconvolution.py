"""Deconvolution of a motion to the base of level ground by equivalent-linear analysis.

Vertical shear waves in layers of complex stiffness, after Schnabel, Lysmer and Seed (1972).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, PlainValidator, StrictBool
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from .._errors import InvalidInput, SandboilWarning
from .._model import Number, checked
from ..materials import Positive
from ..motion import Motion
from ..motion._series import Array
from ._profile import SiteProfile

Complex = npt.NDArray[np.complex128]
Place = Literal["surface", "base"]

# Frequency up to which a motion is deconvolved unless it is given, Hz: it holds what structures feel, and
# faster waves, which damping amplifies most on the way down, are largely noise.
DEFAULT_MAX_FREQUENCY = 20.0
# Waves above the cut fall to nothing by a cosine up to this many times its frequency.
CUT_WIDTH = 1.25
# Spectra are taken of the record with quiet time of twice its length: what arrives before its beginning or
# after its end then does not come back at the other side.
PADDED_LENGTH = 3

# Limits beyond which a deconvolution is doubtful and says so.
# Largest shear strain, 1: equivalent-linear and nonlinear analyses part between 0.04 and 1 %, by what is
# asked of them (Carlton and Tokimatsu 2016).
STRAIN_LIMIT = 0.005
# Largest amplification on the way down: undamped ground on a stiffer base has none. Beyond this, fast waves
# of the base motion tell more of the damping assumed, and of the record's noise, than of the earthquake.
AMPLIFICATION_LIMIT = 3.0
# Largest share of the squared motion that lies before the record's beginning or after its end.
LOST_LIMIT = 0.01


class DeconvolutionWarning(SandboilWarning):
    """A deconvolved motion is doubtful."""


@dataclass(frozen=True)
class Deconvolution:
    """A motion at the base of a profile, and how it was found. As text, a page for people.

    Attributes
    ----------
    motion : of the outcrop of the half-space, with the record's spacing and length
    profile : the ground
    strain : (m,) largest engineering shear strain in the middle of each layer, 1
    G_ratio : (m,) shear modulus over that at small strain
    damping : (m,) ratio
    iterations : analyses made
    converged : whether the last one left the stiffness as it was
    amplification : largest ratio of the base motion to the record's up to the cut
    amplified_frequency : where it is, Hz
    lost : share of the squared motion that lies outside the record's time
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
        """Why the motion is not to be trusted; empty if there is no reason known."""
        told = [
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
                f"waves of {self.amplified_frequency:.3g} Hz are amplified {self.amplification:.3g} times on "
                "the way down, and noise with them: lower max_frequency",
            ),
            (
                self.lost > LOST_LIMIT,
                f"{100.0 * self.lost:.2g} % of the squared motion lies before or after the record, which "
                f"needs {self.profile.travel_time:.2g} s of quiet at both ends",
            ),
        ]
        return [why for doubtful, why in told if doubtful]

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
            *(f"doubtful: {why}" for why in self.doubts),
        ]
        return "\n".join(lines)


def _as_motion(value: object) -> Motion:
    if not isinstance(value, Motion):
        raise ValueError("must be a Motion")
    return value


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
    """The outcrop motion of a profile's half-space that belongs to a motion recorded on or in the profile.

    Parameters
    ----------
    motion : the record; its kind tells which waves it holds
    profile : the ground below the instrument
    at : where it was recorded: at the ground "surface" of the profile or at its "base"
    linear : keep the stiffness and damping of small strain
    max_frequency : Hz, at most half the sampling rate; faster waves are taken away. Default 20 Hz, or half
        the sampling rate where that is lower
    strain_ratio : strain at which stiffness and damping are taken, over the largest in time
    tolerance : relative change of the complex stiffness of any layer at which iteration ends
    max_iterations : analyses made at most

    Raises
    ------
    InvalidInput : an option out of range, a motion shorter than a wave takes through the profile, or a base
        motion beyond what an earthquake can be
    """
    if motion.duration <= profile.travel_time:
        raise InvalidInput(
            "site.deconvolution.motion.duration",
            motion.duration,
            f"must exceed the {profile.travel_time:.4g} s that a shear wave takes through the profile",
            "take the whole record, and check the units of thickness (m) and Vs (m/s)",
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
            raise _excessive(motion, cut, "waves grow beyond any number")
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
    """Frequency of the cut, Hz, checked against the record's sampling."""
    nyquist = 0.5 / motion.dt
    if max_frequency is not None and max_frequency > nyquist:
        raise InvalidInput(
            "site.deconvolution.max_frequency",
            max_frequency,
            f"must be at most the Nyquist frequency 1/(2 dt) = {nyquist:.6g} Hz",
            "the record holds no faster waves",
        )
    return min(DEFAULT_MAX_FREQUENCY, nyquist) if max_frequency is None else max_frequency


def _excessive(motion: Motion, cut: float, found: str) -> InvalidInput:
    return InvalidInput(
        "site.deconvolution.motion",
        motion,
        f"must be one that this ground can carry up to {cut:g} Hz; found {found}",
        "lower max_frequency or scale the motion down; check the profile's units, damping and curves",
    )


def _weakest(profile: SiteProfile, strain: Array) -> str:
    """The largest strain and its depth in words."""
    weakest = int(np.argmax(strain))
    return f"{100.0 * strain[weakest]:.2g} % in {profile.depth[weakest]:.3g} m depth"


def _low_pass(frequency: Array, cut: float) -> Array:
    """Factor on every wave, (n,): 1 up to the cut (Hz), then falling to 0 as a cosine does."""
    over = np.clip((frequency / cut - 1.0) / (CUT_WIDTH - 1.0), 0.0, 1.0)
    passing: Array = 0.5 * (1.0 + np.cos(np.pi * over))
    return passing


def _states(profile: SiteProfile, strain: Array) -> Array:
    """Modulus ratio and damping ratio of the layers at their strains (m,), 1; shape (2, m)."""
    pairs = [layer.at(amplitude) for layer, amplitude in zip(profile.layers, strain.tolist(), strict=True)]
    return np.array(pairs).T


def complex_speed(profile: SiteProfile, G_ratio: Array, damping: Array) -> Complex:
    """Complex shear wave velocity of the layers, m/s, (m,).

    Its square is G/rho (1 - 2 D^2 + 2 i D sqrt(1 - D^2)) for a damping ratio D, of which the absolute value
    is G/rho whatever the damping.
    """
    Vs = np.array([layer.Vs for layer in profile.layers])
    speed: Complex = Vs * np.sqrt(G_ratio) * (np.sqrt(1.0 - damping**2) + 1j * damping)
    return speed


def waves(profile: SiteProfile, speed: Complex, frequency: Array) -> tuple[Complex, Complex]:
    """Up- and downgoing wave at the top of each layer and of the half-space, each (m + 1, n).

    Both are 1 at the surface, which is free. Amplitudes grow as exp(i 2 pi f t).

    Parameters
    ----------
    speed : (m,) complex shear wave velocity of the layers, m/s
    frequency : (n,) Hz
    """
    unit_weight = [layer.unit_weight for layer in profile.layers]
    impedance = np.append(unit_weight * speed, profile.base.unit_weight * profile.base.Vs)
    up, down = np.ones((2, len(profile.layers) + 1, frequency.size), dtype=np.complex128)
    # What overflows is refused by the caller, with the frequency that causes it.
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
    """Shear strain in the middle of each layer over the velocities `up` and `down`, s/m, (n,)."""
    for i, layer in enumerate(profile.layers):
        phase = np.exp(1j * np.pi * frequency * layer.thickness / speed[i])
        yield (up[i] * phase - down[i] / phase) / speed[i]
