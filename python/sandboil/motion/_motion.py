"""The ground motion of a scene."""

from __future__ import annotations

import math
import os
import warnings
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

import numpy as np
import numpy.typing as npt

from .._errors import InvalidInput, nearest_name
from . import _files, _generators
from ._series import (
    MAX_DT,
    STANDARD_GRAVITY,
    Array,
    Quantity,
    baseline,
    butterworth,
    differentiate,
    ground_motion,
    integrate,
    positive,
)
from ._spectrum import ResponseSpectrum, response_spectrum

if TYPE_CHECKING:
    from ..site import SiteProfile

Kind = Literal["outcrop", "within", "upgoing"]
# Fractions of the Arias intensity that bound the significant duration.
SIGNIFICANT = (0.05, 0.95)


class Motion:
    """A horizontal ground motion, equally spaced in time and immutable.

    One quantity is given, the other follows from it: a velocity from an acceleration by the trapezoidal
    rule (exact for an acceleration straight between samples) from rest; an acceleration from a velocity by
    central differences.

    Parameters
    ----------
    dt : spacing, s
    acceleration_g : (n,) acceleration in g = 9.81 m/s2, n at least 2
    velocity : (n,) velocity in m/s; exactly one of the two is given
    kind : where the motion is one of: "outcrop" (free surface of the rock; twice the upgoing wave),
        "within" (at depth: up- and downgoing waves together) or "upgoing" (the upgoing wave alone)

    Attributes
    ----------
    dt, kind : as given
    quantity : "acceleration_g" or "velocity": which one was given
    source : arguments that make the same motion again, as a scene file writes them, or None
        if it was given by numbers or transformed

    Raises
    ------
    InvalidInput : dt not above 0, fewer than 2 points, a value that is not finite, a peak over 20 g (or 20
        m/s), unknown kind
    """

    dt: float
    kind: Kind
    quantity: Quantity
    source: dict[str, Any] | None
    _samples: Array

    def __init__(
        self,
        *,
        dt: float,
        acceleration_g: npt.ArrayLike | None = None,
        velocity: npt.ArrayLike | None = None,
        kind: Kind = "outcrop",
    ) -> None:
        if (acceleration_g is None) == (velocity is None):
            raise InvalidInput(
                "motion",
                "neither" if velocity is None else "both",
                "must have one of acceleration_g and velocity",
                "the other follows from it",
            )
        quantity: Quantity = "velocity" if acceleration_g is None else "acceleration_g"
        samples = velocity if acceleration_g is None else acceleration_g
        spacing = positive("motion.dt", dt, "seconds")
        if isinstance(dt, bool) or spacing > MAX_DT:
            raise InvalidInput(
                "motion.dt",
                dt,
                f"must be a number of seconds, at most {MAX_DT:g}",
                "it is probably in milliseconds",
            )
        self.__dict__.update(
            dt=spacing,
            kind=_kind(kind),
            quantity=quantity,
            source=None,
            _samples=ground_motion(samples, quantity, spacing, lambda at: f"motion.{quantity}[{at}]"),
        )

    @classmethod
    def _made(cls, source: dict[str, Any], kind: Kind, **given: Any) -> Motion:
        motion = cls(kind=kind, **given)
        motion.__dict__["source"] = {**source, "kind": motion.kind}
        return motion

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a Motion is immutable: make another one instead of setting {name}")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Motion):
            return NotImplemented
        same = (self.dt, self.kind, self.quantity) == (other.dt, other.kind, other.quantity)
        return same and np.array_equal(self._samples, other._samples)

    def __hash__(self) -> int:
        return hash((self.dt, self.kind, self.quantity, self._samples.tobytes()))

    def __repr__(self) -> str:
        return (
            f"Motion({self.kind}, {self._samples.size} points of {self.dt:g} s, "
            f"PGA {self.pga_g:.4g} g, PGV {self.pgv:.4g} m/s)"
        )

    # Constructors

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        *,
        unit: str | None = None,
        column: str | int | None = None,
        kind: Kind = "outcrop",
    ) -> Motion:
        """Read an .AT2 file (known by its suffix) or else a CSV, to which `unit` and `column` belong."""
        if Path(path).suffix.lower() != ".at2":
            return cls.from_csv(path, unit=unit, column=column, kind=kind)
        for name, value in (("unit", unit), ("column", column)):
            if value is not None:
                raise InvalidInput(
                    name, value, "belongs to a CSV file only", "leave it out: an .AT2 file says it"
                )
        return cls.from_at2(path, kind=kind)

    @classmethod
    def from_at2(cls, path: str | os.PathLike[str], *, kind: Kind = "outcrop") -> Motion:
        """Read an acceleration in PEER's .AT2 form.

        The header ends with the line that holds the number of points and the spacing, as
        ``NPTS=   7990, DT=  0.0050 SEC`` or ``7990 .0050 NPTS, DT``; a line before must state the unit
        (G, CM/S2, M/S2). Numbers may stand in columns of any width.

        Raises
        ------
        InvalidInput : with file and line: unreadable file, no such header, unit missing or of another
            quantity, spacing not above 0, a count that differs from NPTS, a value that is no finite
            number, a peak over 20 g
        """
        record = _files.read_at2(path)
        source = {"file": os.fspath(path)}
        return cls._made(source, kind, dt=record.dt, **{record.quantity: record.samples})

    @classmethod
    def from_csv(
        cls,
        path: str | os.PathLike[str],
        *,
        unit: str | None = None,
        column: str | int | None = None,
        kind: Kind = "outcrop",
    ) -> Motion:
        """Read one column of a CSV with a header row and a time column.

        Separated by comma, semicolon or tab; lines that begin with # are passed over. The time column is
        the one named t or time, else the first; only its even spacing is used.

        Parameters
        ----------
        unit : "g", "m/s2", "cm/s2" for an acceleration, "m/s" for a velocity; may be left out if the
            column's name ends with it, as acc_g or velocity_m/s, and must not contradict it
        column : name of the column, or its number from 0; default the acceleration (with unit="m/s" the
            velocity), else the first besides time

        Raises
        ------
        InvalidInput : with file and line: unreadable file, no header row, unit missing or contradictory,
            unknown column, uneven time, ragged row, fewer than 2 points, a value that is no finite number, a
            peak over 20 g or 20 m/s
        """
        record = _files.read_csv(path, unit, column)
        source: dict[str, Any] = {"file": os.fspath(path), "unit": record.unit}
        if column is not None:
            source["column"] = column
        return cls._made(source, kind, dt=record.dt, **{record.quantity: record.samples})

    @classmethod
    def ricker(
        cls,
        frequency: float,
        pga_g: float,
        dt: float | None = None,
        duration: float | None = None,
        *,
        kind: Kind = "outcrop",
    ) -> Motion:
        """Ricker pulse a = pga (1 - 2 s) exp(-s), s = (pi frequency (t - t0))^2, t0 = 1.5 periods.

        Velocity and displacement return to zero.

        Parameters
        ----------
        frequency : of the greatest spectral amplitude, Hz
        pga_g : peak, reached at the sample t0, g
        dt : spacing, s; default the smaller of 0.005 s and a hundredth of the period
        duration : s, at least 2 t0, which is the default
        """
        spacing, samples = _generators.ricker(frequency, pga_g, dt, duration)
        given = _given(frequency=frequency, pga_g=pga_g, dt=dt, duration=duration)
        return cls._made({"ricker": given}, kind, dt=spacing, acceleration_g=samples)

    @classmethod
    def synthetic(
        cls,
        pga_g: float = 0.47,
        duration: float = 12.0,
        seed: int = 1,
        *,
        dt: float = _generators.DEFAULT_DT,
        pgv: float | None = None,
        ground_frequency: float | None = None,
        d5_95: float | None = None,
        kind: Kind = "outcrop",
    ) -> Motion:
        """Seeded synthetic earthquake, by default like Loma Prieta 1989, Gilroy Array #1, component 090.

        White noise in a Saragoni-Hart envelope, through the Kanai-Tajimi ground with the Clough-Penzien
        high-pass (0.5 Hz) and f_max 25 Hz, baseline corrected and scaled. The same arguments give the
        same motion.

        Parameters
        ----------
        pga_g : peak acceleration, met exactly, g
        duration : s; the shaking is strongest after 0.35 of it
        seed : whole number, 0 or above
        dt : spacing, s, at most 0.02
        pgv : peak velocity, m/s, met by choice of the ground frequency; default the record's share of
            `pga_g`, 0.0730 s (0.34 m/s for 0.47 g)
        ground_frequency : Kanai-Tajimi frequency, Hz, instead of `pgv`
        d5_95 : significant duration of the envelope, s (the motion's own scatters about it); default
            0.307 of `duration`, the record's 3.68 s for 12 s
        """
        samples = _generators.synthetic(pga_g, duration, seed, dt, pgv, ground_frequency, d5_95)
        given = {
            "seed": int(seed),
            **_given(
                pga_g=pga_g, duration=duration, dt=dt, pgv=pgv, ground_frequency=ground_frequency, d5_95=d5_95
            ),
        }
        return cls._made({"synthetic": given}, kind, dt=dt, acceleration_g=samples)

    # Series

    @cached_property
    def acceleration_g(self) -> Array:
        """(n,) acceleration, g."""
        if self.quantity == "acceleration_g":
            return self._samples
        return _read_only(differentiate(self._samples, self.dt) / STANDARD_GRAVITY)

    @cached_property
    def velocity(self) -> Array:
        """(n,) velocity, m/s."""
        if self.quantity == "velocity":
            return self._samples
        return _read_only(integrate(self._samples * STANDARD_GRAVITY, self.dt))

    @cached_property
    def displacement(self) -> Array:
        """(n,) displacement, m: the integral of the velocity straight between samples, as it is applied."""
        return _read_only(integrate(self.velocity, self.dt))

    @cached_property
    def time(self) -> Array:
        """(n,) time of the samples from 0, s."""
        return _read_only(self.dt * np.arange(self._samples.size, dtype=np.float64))

    def velocity_at(self, time: npt.ArrayLike) -> Array:
        """Velocity in m/s at any times (s, any shape): straight between samples, zero outside the record."""
        return np.interp(np.asarray(time, dtype=np.float64), self.time, self.velocity, left=0.0, right=0.0)

    def upgoing_velocity(self) -> tuple[float, Array]:
        """Spacing in s and (n,) velocity in m/s of the upgoing wave, which a compliant base takes.

        Half an outcrop motion (the free surface doubles the wave); an upgoing one as it is.

        Raises
        ------
        InvalidInput : the motion is "within"
        """
        if self.kind == "within":
            raise InvalidInput(
                "motion.kind",
                self.kind,
                'must be "outcrop" or "upgoing" for a compliant base: a motion within the ground holds the '
                "downgoing wave too, which the base would send up again",
                "give the outcrop motion of the same rock, or the upgoing wave alone",
            )
        return self.dt, self.velocity if self.kind == "upgoing" else _read_only(0.5 * self.velocity)

    # Measures

    @property
    def duration(self) -> float:
        """Time of the last sample, s."""
        return self.dt * (self._samples.size - 1)

    @cached_property
    def pga_g(self) -> float:
        """Peak ground acceleration, g."""
        return float(np.max(np.abs(self.acceleration_g)))

    @cached_property
    def pgv(self) -> float:
        """Peak ground velocity, m/s."""
        return float(np.max(np.abs(self.velocity)))

    @cached_property
    def _husid(self) -> Array:
        """Arias intensity up to each sample, m/s."""
        acceleration = self.acceleration_g * STANDARD_GRAVITY
        return integrate(acceleration**2, self.dt) * (math.pi / (2.0 * STANDARD_GRAVITY))

    @property
    def arias(self) -> float:
        """Arias intensity pi/(2 g) int a^2 dt, m/s (Arias 1970)."""
        return float(self._husid[-1])

    @cached_property
    def cav(self) -> float:
        """Cumulative absolute velocity int |a| dt, m/s (EPRI 1988)."""
        return float(integrate(np.abs(self.acceleration_g), self.dt)[-1]) * STANDARD_GRAVITY

    @cached_property
    def d5_95(self) -> float:
        """Significant duration, s: from 5 to 95 % of the Arias intensity; 0 without motion."""
        if self.arias == 0.0:
            return 0.0
        begin, end = np.interp(SIGNIFICANT, self._husid / self.arias, self.time)
        return float(end - begin)

    def response_spectrum(
        self, damping: float = 0.05, periods: npt.ArrayLike | None = None
    ) -> ResponseSpectrum:
        """Pseudo-acceleration spectrum; see :func:`response_spectrum`. Default 200 periods, 0.01 to 10 s."""
        return response_spectrum(self.acceleration_g, self.dt, periods, damping)

    # Transformations: each gives a new motion

    def _changed(self, samples: Array) -> Motion:
        given: dict[str, Any] = {self.quantity: samples}
        return Motion(dt=self.dt, kind=self.kind, **given)

    def scaled(self, *, pga_g: float | None = None, factor: float | None = None) -> Motion:
        """Multiplied so that the peak is `pga_g`, or by `factor` (finite)."""
        if (pga_g is None) == (factor is None):
            raise InvalidInput(
                "scaled(pga_g, factor)", (pga_g, factor), "exactly one of the two must be given"
            )
        if pga_g is not None:
            pga_g = positive("scaled(pga_g)", pga_g, "g", "to reverse the motion use flipped()")
            if self.pga_g == 0.0:
                raise InvalidInput("scaled(pga_g)", pga_g, "cannot be reached: the motion is zero throughout")
            factor = pga_g / self.pga_g
        if factor is None or not math.isfinite(factor):
            raise InvalidInput("scaled(factor)", factor, "must be a finite number")
        return self._changed(factor * self._samples)

    def flipped(self) -> Motion:
        """The motion in the opposite direction."""
        return self.scaled(factor=-1.0)

    def baseline_corrected(self) -> Motion:
        """With velocity and displacement zero at the end and the squared velocity least.

        A polynomial of degree 3 is taken from the acceleration (Berg and Housner 1961, with the end
        conditions as constraints), and its integral from the velocity.
        """
        acceleration, velocity = baseline(self.velocity, self.dt)
        if self.quantity == "velocity":
            return self._changed(self._samples - velocity)
        return self._changed(self._samples - acceleration / STANDARD_GRAVITY)

    def filtered(self, low: float | None = None, high: float | None = None, *, order: int = 4) -> Motion:
        """Frequencies from `low` to `high` (Hz) alone; either may be left out.

        Butterworth of `order`, forwards and backwards: no delay, 6 dB down at each corner. The record is
        padded by zeros and cut back to its length, so that after a high-pass a little velocity may be left
        at the end: `baseline_corrected` takes it away.
        """
        return self._changed(butterworth(self._samples, self.dt, low, high, order))

    def deconvolved(self, profile: SiteProfile, **options: Any) -> Motion:
        """The outcrop motion at the base of the ground on which this one was recorded.

        By equivalent-linear analysis; :func:`sandboil.site.deconvolution` takes the same arguments and tells
        strains and stiffnesses too. The record counts as taken at the surface unless `at="base"`.

        Warns with :class:`DeconvolutionWarning` where the motion is doubtful. Raises :class:`InvalidInput`.
        """
        # The analysis needs motions: they know of it only when asked for it.
        from ..site import DeconvolutionWarning, deconvolution

        found = deconvolution(self, profile, **options)
        for doubt in found.doubts:
            warnings.warn(doubt, DeconvolutionWarning, stacklevel=2)
        return found.motion

    # Files

    def write_at2(self, path: str | os.PathLike[str]) -> None:
        """Write the acceleration in PEER's .AT2 form: g, eight significant digits, the kind in the title."""
        title = f"GROUND MOTION WRITTEN BY SANDBOIL, {self.kind.upper()}"
        _files.write_at2(path, self.dt, self.acceleration_g, title)

    def write_csv(self, path: str | os.PathLike[str]) -> None:
        """Write time_s, acceleration_g and velocity_m/s with every digit."""
        _files.write_csv(path, self.dt, self.acceleration_g, self.velocity)


def _read_only(series: Array) -> Array:
    series.flags.writeable = False
    return series


def _given(**arguments: float | None) -> dict[str, float]:
    return {name: float(value) for name, value in arguments.items() if value is not None}


def _kind(kind: str) -> Kind:
    if kind not in get_args(Kind):
        nearest = nearest_name(str(kind), get_args(Kind))
        raise InvalidInput(
            "motion.kind",
            kind,
            f"must be one of {', '.join(get_args(Kind))}",
            f'did you mean "{nearest}"?' if nearest else None,
        )
    return cast(Kind, kind)
