"""Horizontal ground motions."""

from __future__ import annotations

import math
import os
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

import numpy as np
import numpy.typing as npt

from .._errors import InvalidInput, nearest_name
from .._provided import Provided
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


# The motion at the base of the ground below a record, with options, by `sandboil.site`.
deconvolved: Provided[[Motion, SiteProfile, dict[str, Any]], Motion] = Provided()


class Motion:
    """A horizontal ground motion with constant time step; immutable.

    Either acceleration or velocity is given; the other is computed. Velocity follows from acceleration by the
    trapezoidal rule, starting from rest (exact for an acceleration that is linear between samples).
    Acceleration follows from velocity by central differences.

    Parameters
    ----------
    dt : time step, s
    acceleration_g : (n,) acceleration in g = 9.81 m/s2, n at least 2
    velocity : (n,) velocity, m/s. Exactly one of acceleration_g and velocity is given
    kind : "outcrop" (free surface of the rock: twice the upgoing wave), "within" (at depth: sum of upgoing
        and downgoing waves) or "upgoing" (the upgoing wave alone)

    Attributes
    ----------
    dt, kind : as given
    quantity : "acceleration_g" or "velocity": the given one
    source : arguments that reproduce the motion, as written to a scene file; None for a motion given by
        numbers or a transformed one

    Raises
    ------
    InvalidInput : dt not above 0, fewer than 2 points, a value that is not finite, a peak above 20 g (or 20
        m/s), or an unknown kind
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
                "must have exactly one of acceleration_g and velocity",
                "the other one is computed from it",
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
    def _from_source(cls, source: dict[str, Any], kind: Kind, **given: Any) -> Motion:
        motion = cls(kind=kind, **given)
        motion.__dict__["source"] = {**source, "kind": motion.kind}
        return motion

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a Motion is immutable: create a new one instead of setting {name}")

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
        """Read a PEER .AT2 file, recognised by its suffix, or a CSV file.

        Parameters
        ----------
        path : the file
        unit, column : for CSV only; see :meth:`from_csv`
        kind : see :class:`Motion`

        Raises
        ------
        InvalidInput : see :meth:`from_at2` and :meth:`from_csv`; or `unit` or `column` given for an .AT2 file
        """
        if Path(path).suffix.lower() != ".at2":
            return cls.from_csv(path, unit=unit, column=column, kind=kind)
        for name, value in (("unit", unit), ("column", column)):
            if value is not None:
                raise InvalidInput(
                    name, value, "is only for CSV files", "leave it out: an .AT2 file contains it"
                )
        return cls.from_at2(path, kind=kind)

    @classmethod
    def from_at2(cls, path: str | os.PathLike[str], *, kind: Kind = "outcrop") -> Motion:
        """Read an acceleration from a PEER .AT2 file.

        The header ends with the line of the number of points and the time step, such as
        ``NPTS=   7990, DT=  0.0050 SEC`` or ``7990 .0050 NPTS, DT``. A line before it must contain the unit
        (G, CM/S2 or M/S2). Columns of numbers may have any width.

        Raises
        ------
        InvalidInput : with file and line: unreadable file, no such header, unit missing or not of an
            acceleration, time step not above 0, number of values other than NPTS, a value that is not a
            finite number, or a peak above 20 g
        """
        record = _files.read_at2(path)
        source = {"file": os.fspath(path)}
        return cls._from_source(source, kind, dt=record.dt, **{record.quantity: record.samples})

    @classmethod
    def from_csv(
        cls,
        path: str | os.PathLike[str],
        *,
        unit: str | None = None,
        column: str | int | None = None,
        kind: Kind = "outcrop",
    ) -> Motion:
        """Read one column of a CSV file with a header row and a time column.

        The separator is comma, semicolon or tab. Lines that begin with # are skipped. The time column is the
        one named t or time, or the first column; it must have a constant step, which is used as `dt`.

        Parameters
        ----------
        path : the file
        unit : "g", "m/s2" or "cm/s2" for an acceleration, "m/s" for a velocity. Not needed if the name of the
            column ends with the unit, as acc_g or velocity_m/s; a contradiction is refused
        column : name of the column, or its number from 0. Default: the acceleration (the velocity for
            unit="m/s"), recognised by its name, or the first column other than time
        kind : see :class:`Motion`

        Raises
        ------
        InvalidInput : with file and line: unreadable file, no header row, missing or contradictory unit,
            unknown column, uneven time, row of another length, fewer than 2 points, a value that is not a
            finite number, or a peak above 20 g or 20 m/s
        """
        record = _files.read_csv(path, unit, column)
        source: dict[str, Any] = {"file": os.fspath(path), "unit": record.unit}
        if column is not None:
            source["column"] = column
        return cls._from_source(source, kind, dt=record.dt, **{record.quantity: record.samples})

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

        Velocity and displacement are zero at the end.

        Parameters
        ----------
        frequency : frequency of the largest Fourier amplitude, Hz
        pga_g : peak acceleration, g, at the sample t0
        dt : time step, s; default the smaller of 0.005 s and a hundredth of the period
        duration : duration, s, at least 2 t0; default 2 t0
        kind : see :class:`Motion`

        Raises
        ------
        InvalidInput : a value out of range
        """
        spacing, samples = _generators.ricker(frequency, pga_g, dt, duration)
        given = _given(frequency=frequency, pga_g=pga_g, dt=dt, duration=duration)
        return cls._from_source({"ricker": given}, kind, dt=spacing, acceleration_g=samples)

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
        """Synthetic earthquake, with defaults modelled on Loma Prieta 1989, Gilroy Array #1, component 090.

        White noise with a Saragoni-Hart envelope is filtered (Kanai-Tajimi ground, Clough-Penzien high-pass
        at 0.5 Hz and f_max of 25 Hz), baseline corrected and scaled. The same arguments give the same motion.

        Parameters
        ----------
        pga_g : peak acceleration, g, met exactly
        duration : duration, s; the envelope has its peak at 0.35 of it
        seed : seed of the noise, a whole number, 0 or above
        dt : time step, s, at most 0.02
        pgv : peak velocity, m/s; the ground frequency is chosen to meet it. Default: the ratio of the record
            to PGA, 0.0730 s (0.34 m/s for 0.47 g)
        ground_frequency : Kanai-Tajimi frequency, Hz, instead of `pgv`
        d5_95 : significant duration of the envelope, s; that of the motion varies around it. Default: 0.307
            of `duration`, as in the record (3.68 s of 12 s)
        kind : see :class:`Motion`

        Raises
        ------
        InvalidInput : a value out of range, or a `pgv` that no ground frequency gives
        """
        samples = _generators.synthetic(pga_g, duration, seed, dt, pgv, ground_frequency, d5_95)
        given = {
            "seed": int(seed),
            **_given(
                pga_g=pga_g, duration=duration, dt=dt, pgv=pgv, ground_frequency=ground_frequency, d5_95=d5_95
            ),
        }
        return cls._from_source({"synthetic": given}, kind, dt=dt, acceleration_g=samples)

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
        """(n,) displacement, m: integral of the velocity, which is linear between samples, as in a run."""
        return _read_only(integrate(self.velocity, self.dt))

    @cached_property
    def time(self) -> Array:
        """(n,) time of the samples, s, from 0."""
        return _read_only(self.dt * np.arange(self._samples.size, dtype=np.float64))

    def velocity_at(self, time: npt.ArrayLike) -> Array:
        """Velocity, m/s, at times in s (any shape): linear between samples, zero outside the record."""
        return np.interp(np.asarray(time, dtype=np.float64), self.time, self.velocity, left=0.0, right=0.0)

    def upgoing_velocity(self) -> tuple[float, Array]:
        """Time step, s, and (n,) velocity, m/s, of the upgoing wave: the input of a compliant base.

        It is half of an outcrop motion, because the free surface doubles the wave, or the whole upgoing
        motion.

        Raises
        ------
        InvalidInput : the kind of the motion is "within"
        """
        if self.kind == "within":
            raise InvalidInput(
                "motion.kind",
                self.kind,
                'must be "outcrop" or "upgoing" for a compliant base: a motion within the ground contains '
                "the downgoing wave, which the base would apply as an upgoing wave",
                "use the outcrop motion of the same rock, or the upgoing wave alone",
            )
        return self.dt, self.velocity if self.kind == "upgoing" else _read_only(0.5 * self.velocity)

    # Measures

    @property
    def duration(self) -> float:
        """Duration, s: the time of the last sample."""
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
        """(n,) Arias intensity up to each sample, m/s."""
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
        """Significant duration, s: between 5 and 95 % of the Arias intensity; 0 for a motion of zeros."""
        if self.arias == 0.0:
            return 0.0
        begin, end = np.interp(SIGNIFICANT, self._husid / self.arias, self.time)
        return float(end - begin)

    def response_spectrum(
        self, damping: float = 0.05, periods: npt.ArrayLike | None = None
    ) -> ResponseSpectrum:
        """Pseudo-acceleration spectrum; see :func:`response_spectrum`. Default 200 periods, 0.01 to 10 s."""
        return response_spectrum(self.acceleration_g, self.dt, periods, damping)

    # Transformations: each returns a new motion

    def _changed(self, samples: Array) -> Motion:
        given: dict[str, Any] = {self.quantity: samples}
        return Motion(dt=self.dt, kind=self.kind, **given)

    def scaled(self, *, pga_g: float | None = None, factor: float | None = None) -> Motion:
        """The motion scaled to the peak acceleration `pga_g`, g, or multiplied by `factor`.

        Raises
        ------
        InvalidInput : not exactly one of the two, `pga_g` not above 0 or `factor` not finite, or a motion of
            zeros
        """
        if (pga_g is None) == (factor is None):
            raise InvalidInput(
                "scaled(pga_g, factor)", (pga_g, factor), "must have exactly one of the two values"
            )
        if pga_g is not None:
            pga_g = positive("scaled(pga_g)", pga_g, "g", "use flipped() to reverse the motion")
            if self.pga_g == 0.0:
                raise InvalidInput(
                    "scaled(pga_g)", pga_g, "cannot be reached: all values of the motion are 0"
                )
            factor = pga_g / self.pga_g
        if factor is None or not math.isfinite(factor):
            raise InvalidInput("scaled(factor)", factor, "must be a finite number")
        return self._changed(factor * self._samples)

    def flipped(self) -> Motion:
        """The motion in the opposite direction."""
        return self.scaled(factor=-1.0)

    def baseline_corrected(self) -> Motion:
        """The motion after baseline correction, with zero velocity and displacement at the end.

        A polynomial of degree 3 is subtracted from the acceleration, and its integral from the velocity. It
        minimises the squared velocity under the two end conditions (after Berg and Housner 1961).
        """
        acceleration, velocity = baseline(self.velocity, self.dt)
        if self.quantity == "velocity":
            return self._changed(self._samples - velocity)
        return self._changed(self._samples - acceleration / STANDARD_GRAVITY)

    def filtered(self, low: float | None = None, high: float | None = None, *, order: int = 4) -> Motion:
        """The motion after a zero-phase Butterworth filter.

        The filter runs forwards and backwards, so it causes no delay and is 6 dB down at each corner. The
        record is padded with zeros and then cut to its original length. A high-pass may therefore leave a
        small velocity at the end, which `baseline_corrected` removes.

        Parameters
        ----------
        low, high : corner frequencies, Hz; frequencies below `low` and above `high` are removed. One of the
            two may be left out
        order : order of the filter

        Raises
        ------
        InvalidInput : no corner frequency, one that is not below the Nyquist frequency, or `low` not below
            `high`
        """
        return self._changed(butterworth(self._samples, self.dt, low, high, order))

    def deconvolved(self, profile: SiteProfile, **options: Any) -> Motion:
        """The outcrop motion at the base of the ground profile on which this motion was recorded.

        By equivalent-linear analysis. :func:`sandboil.site.deconvolution` has the same arguments and also
        returns strains and stiffnesses. The motion was recorded at the surface of the profile unless
        `at="base"`.

        Warns
        -----
        DeconvolutionWarning : the result is doubtful

        Raises
        ------
        InvalidInput : see :func:`sandboil.site.deconvolution`
        """
        return deconvolved(self, profile, options)

    # Files

    def write_at2(self, path: str | os.PathLike[str]) -> None:
        """Write the acceleration to a PEER .AT2 file: in g, eight significant digits, kind in the title."""
        title = f"GROUND MOTION WRITTEN BY SANDBOIL, {self.kind.upper()}"
        _files.write_at2(path, self.dt, self.acceleration_g, title)

    def write_csv(self, path: str | os.PathLike[str]) -> None:
        """Write a CSV file with the columns time_s, acceleration_g and velocity_m/s, with all digits."""
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
