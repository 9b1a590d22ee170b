"""What the tests give back: plain arrays, with the few questions that one asks of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._errors import InvalidInput
from ..discretise import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Table(ABC):
    """Columns of equal length."""

    @abstractmethod
    def columns(self) -> dict[str, NDArray[Any]]:
        """Every column by its name."""

    def to_dataframe(self) -> Any:
        """One row per record, one column per array, as a pandas DataFrame.

        Raises :class:`ImportError` that says how to get pandas where it is missing.
        """
        try:
            import pandas
        except ImportError as error:
            raise ImportError("to_dataframe needs pandas: pip install 'sandboil[studies]'") from error
        return pandas.DataFrame(self.columns())


@dataclass(frozen=True, eq=False, kw_only=True)
class Record(Table):
    """Rows of a test, and how it ended.

    Attributes
    ----------
    complete : False if the soil gave up before the end that was asked for
    ended : why the test ended, in words
    """

    complete: bool
    ended: str

    def columns(self) -> dict[str, NDArray[Any]]:
        """Every one-dimensional array by its name."""
        values = {name: getattr(self, name) for name in self._names()}
        return {name: value for name, value in values.items() if np.ndim(value) == 1}

    @classmethod
    def _names(cls) -> list[str]:
        return [each.name for each in fields(cls)]


@dataclass(frozen=True, eq=False, kw_only=True)
class ShearTest(Record):
    """Direct simple shear. Each array has shape (n,).

    Attributes
    ----------
    gamma : engineering shear strain since the start, 1
    tau : shear stress, kPa
    sigma_v_eff, sigma_h_eff : vertical and horizontal effective stress, kPa, compression positive
    eps_v : volumetric strain since the start, 1, contraction positive
    void_ratio : nan for models that have none
    sigma_v0 : vertical effective stress at the start, kPa
    drained : whether the vertical effective stress was held, not the volume
    specimen : the soil after the test, or None where it is not at hand
    """

    gamma: Floats
    tau: Floats
    sigma_v_eff: Floats
    sigma_h_eff: Floats
    eps_v: Floats
    void_ratio: Floats
    sigma_v0: float
    drained: bool
    specimen: _core.Specimen | None = field(default=None, repr=False)

    @property
    def r_u(self) -> Floats:
        """Excess pore pressure ratio of a constant-volume test, 1 - sigma_v_eff/sigma_v0."""
        return 1.0 - self.sigma_v_eff / self.sigma_v0

    @classmethod
    def _names(cls) -> list[str]:
        return [*super()._names(), "r_u"]

    def plot(self, reference: object | None = None) -> Figure:
        """Stress-strain curve, stress path, and pore pressure or volume over strain, as a matplotlib figure;
        `reference` as for :meth:`CyclicTest.plot`, without `cycle`."""
        from ._plots import monotonic

        return monotonic(self, reference)


@dataclass(frozen=True, eq=False, kw_only=True)
class CyclicTest(ShearTest):
    """Cyclic direct simple shear: a :class:`ShearTest` with turns.

    Attributes
    ----------
    cycle : cycles so far, shape (n,): 0.25 at the first turn, half a cycle from turn to turn, in between in
        proportion to the shear stress (to the shear strain where that is turned)
    turns : turns made so far, that at this row included, shape (n,), integers
    """

    cycle: Floats
    turns: NDArray[np.int64]

    def cycles_to(
        self, *, r_u: float | None = None, gamma_sa: float | None = None, gamma_da: float | None = None
    ) -> float:
        """Cycles until one measure first reaches a level, or nan if it never does.

        Parameters
        ----------
        r_u : excess pore pressure ratio, 1
        gamma_sa : single amplitude, the distance of the shear strain from its value at the start, 1
        gamma_da : double amplitude, the distance of the shear strain from its value at the last turn, 1;
            there is none before the first turn

        Raises
        ------
        InvalidInput : not exactly one measure, or a level that is not positive
        """
        asked = {"r_u": r_u, "gamma_sa": gamma_sa, "gamma_da": gamma_da}
        given = {name: level for name, level in asked.items() if level is not None}
        if len(given) != 1:
            raise InvalidInput("cycles_to", given, f"must be given exactly one measure of {', '.join(asked)}")
        ((name, level),) = given.items()
        if not level > 0.0:
            raise InvalidInput(f"cycles_to.{name}", level, "must be greater than 0")
        measure = {"r_u": self.r_u, "gamma_sa": self.gamma_sa, "gamma_da": self.gamma_da}[name]
        reached = measure >= level
        if not reached.any():
            return float("nan")
        row = int(np.argmax(reached))
        if row == 0:
            return 0.0
        before, after = measure[row - 1 : row + 1]
        return float(np.interp(level, (before, after), self.cycle[row - 1 : row + 1]))

    @property
    def gamma_sa(self) -> Floats:
        """Single amplitude of the shear strain, |gamma|, 1, shape (n,)."""
        return np.abs(self.gamma)

    @property
    def gamma_da(self) -> Floats:
        """Double amplitude of the shear strain, |gamma - gamma at the last turn|, 1, shape (n,): at a turn
        the whole stroke from the turn before, 0 up to the first turn."""
        at_turn = self._rows_of_turns()
        passed = self.turns.copy()
        passed[at_turn] -= 1
        # Rows that no turn precedes take the last entry.
        turned = np.append(self.gamma[at_turn], np.nan)[passed - 1]
        amplitude: Floats = np.nan_to_num(np.abs(self.gamma - turned))
        return amplitude

    def _rows_of_turns(self) -> NDArray[np.intp]:
        return np.flatnonzero(np.diff(self.turns, prepend=0))

    def peaks(self) -> Self:
        """The rows at the turns only, without the specimen."""
        at_turn = self._rows_of_turns()
        stored = self.columns().keys() & {each.name for each in fields(self)}
        return replace(self, specimen=None, **{name: getattr(self, name)[at_turn] for name in stored})

    def plot(self, reference: object | None = None) -> Figure:
        """Stress path, stress-strain loops, and pore pressure and strain over cycles, as a matplotlib figure.

        `reference` is drawn beside: another test, or anything with `gamma`, `tau`, `sigma_v_eff`, `r_u` and
        `cycle` as attributes or as keys.
        """
        from ._plots import cyclic

        return cyclic(self, reference)


@dataclass(frozen=True, eq=False, kw_only=True)
class PathTest(Record):
    """A path of strain or of stress, one row for each that was asked for; tension positive.

    An incomplete test has fewer rows, and its last one is where the soil gave up.

    Attributes
    ----------
    strain : xx, yy and engineering xy, 1, shape (n, 3)
    stress : effective, xx, yy and xy, kPa, shape (n, 3)
    stress_zz : out of the plane, kPa, shape (n,)
    void_ratio : shape (n,); nan for models that have none
    """

    strain: Floats
    stress: Floats
    stress_zz: Floats
    void_ratio: Floats

    def columns(self) -> dict[str, NDArray[Any]]:
        """Every component by its name."""
        return {
            **dict(zip(("eps_xx", "eps_yy", "gamma_xy"), self.strain.T, strict=True)),
            **dict(zip(("sig_xx", "sig_yy", "tau_xy"), self.stress.T, strict=True)),
            "sig_zz": self.stress_zz,
            "void_ratio": self.void_ratio,
        }

    @property
    def gamma_xy(self) -> Floats:
        """Engineering shear strain, 1."""
        return self.strain[:, 2]

    @property
    def tau_xy(self) -> Floats:
        """Shear stress, kPa."""
        return self.stress[:, 2]

    @property
    def mean(self) -> Floats:
        """Mean stress in the plane, kPa, tension positive."""
        return 0.5 * (self.stress[:, 0] + self.stress[:, 1])

    @property
    def volume(self) -> Floats:
        """Volumetric strain, 1, expansion positive."""
        return self.strain[:, 0] + self.strain[:, 1]

    def plot(self, reference: object | None = None) -> Figure:
        """Shear stress over shear strain and over mean stress, and mean stress over volume; `reference` has
        `gamma_xy`, `tau_xy`, `mean` and `volume`."""
        from ._plots import path

        return path(self, reference)


@dataclass(frozen=True, eq=False, kw_only=True)
class CompressionTest(Record):
    """Compression in plane strain. Each array has shape (n,); compression and contraction positive.

    Attributes
    ----------
    axial_strain : vertical strain, 1
    sigma_v_eff, sigma_h_eff : vertical and horizontal effective stress, kPa
    eps_v : volumetric strain, 1
    void_ratio : nan for models that have none
    """

    axial_strain: Floats
    sigma_v_eff: Floats
    sigma_h_eff: Floats
    eps_v: Floats
    void_ratio: Floats

    @property
    def p(self) -> Floats:
        """Mean effective stress in the plane, kPa."""
        return 0.5 * (self.sigma_v_eff + self.sigma_h_eff)

    @property
    def q(self) -> Floats:
        """Stress difference, vertical less horizontal, kPa."""
        return self.sigma_v_eff - self.sigma_h_eff

    @property
    def excess_pore_pressure(self) -> Floats:
        """Excess pore pressure where the total lateral stress is held, kPa; 0 in a drained test."""
        pressure: Floats = self.sigma_h_eff[0] - self.sigma_h_eff
        return pressure

    @classmethod
    def _names(cls) -> list[str]:
        return [*super()._names(), "p", "q", "excess_pore_pressure"]

    def plot(self, reference: object | None = None) -> Figure:
        """Stress difference over strain and over mean stress, and pore pressure or contraction over strain;
        `reference` has arrays of the same names."""
        from ._plots import compression

        return compression(self, reference)


@dataclass(frozen=True, eq=False, kw_only=True)
class Reconsolidation(Record):
    """Dissipation after shear. Each array has shape (n,).

    Attributes
    ----------
    sigma_v_eff, sigma_h_eff : vertical and horizontal effective stress, kPa, compression positive
    eps_v : volumetric strain since the dissipation began, 1, contraction positive
    gamma : engineering shear strain since the start of the shear test, 1
    tau : shear stress, kPa
    void_ratio : nan for models that have none
    """

    sigma_v_eff: Floats
    sigma_h_eff: Floats
    eps_v: Floats
    gamma: Floats
    tau: Floats
    void_ratio: Floats

    def plot(self, reference: object | None = None) -> Figure:
        """Vertical effective stress over contraction, and shear stress over it; `reference` has arrays of the
        same names."""
        from ._plots import reconsolidation

        return reconsolidation(self, reference)


@dataclass(frozen=True, eq=False, kw_only=True)
class ModulusReduction(Record):
    """Secant shear modulus and damping over strain. Each array has shape (n,).

    Attributes
    ----------
    gamma : amplitude of the engineering shear strain, 1
    G : secant shear modulus, kPa
    damping : damping ratio, 1
    G_max : elastic shear modulus at the start, kPa
    """

    gamma: Floats
    G: Floats
    damping: Floats
    G_max: float

    @property
    def G_ratio(self) -> Floats:
        """G over G_max, 1."""
        return self.G / self.G_max

    @classmethod
    def _names(cls) -> list[str]:
        return [*super()._names(), "G_ratio"]

    def plot(self, reference: object | None = None) -> Figure:
        """Modulus ratio and damping over strain; `reference` has `gamma`, `G_ratio` and `damping`."""
        from ._plots import modulus

        return modulus(self, reference)
