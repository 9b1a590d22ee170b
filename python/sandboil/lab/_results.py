"""Results of the tests: arrays, and the quantities derived from them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._errors import InvalidInput
from .._types import Floats
from . import _plots

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Table(ABC):
    """Columns of equal length."""

    @abstractmethod
    def columns(self) -> dict[str, NDArray[Any]]:
        """Every column by name."""

    def to_dataframe(self) -> Any:
        """The columns as a pandas DataFrame.

        Raises
        ------
        ImportError : pandas is not installed; the message says how to install it
        """
        try:
            import pandas
        except ImportError as error:
            raise ImportError("to_dataframe needs pandas: pip install 'sandboil[studies]'") from error
        return pandas.DataFrame(self.columns())


@dataclass(frozen=True, eq=False, kw_only=True)
class Record(Table):
    """Recorded rows of a test, and why it ended.

    Attributes
    ----------
    complete : False if the test ended early because the soil failed
    ended : why the test ended, in words
    """

    complete: bool
    ended: str

    def columns(self) -> dict[str, NDArray[Any]]:
        """Every one-dimensional array by name."""
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
    void_ratio : nan for a model without void ratio
    sigma_v0 : initial vertical effective stress, kPa, compression positive
    drained : True: constant vertical effective stress. False: constant volume
    specimen : the soil after the test; None if it was not kept
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
        """Plot stress-strain curve, stress path, and pore pressure (drained: contraction) against strain.

        Returns a matplotlib figure. `reference` as for :meth:`CyclicTest.plot`, without `cycle`.
        """
        return _plots.monotonic(self, reference)


@dataclass(frozen=True, eq=False, kw_only=True)
class CyclicTest(ShearTest):
    """Cyclic direct simple shear: a :class:`ShearTest` with turns.

    Attributes
    ----------
    cycle : (n,) number of cycles so far: 0.25 at the first turn, 0.5 more at each further turn. Between turns
        it is linear in the shear stress (in the shear strain, if the turns are given by strain)
    turns : (n,) number of turns so far, including one at this row; integers
    """

    cycle: Floats
    turns: NDArray[np.int64]

    def cycles_to(
        self, *, r_u: float | None = None, gamma_sa: float | None = None, gamma_da: float | None = None
    ) -> float:
        """Number of cycles until one measure first reaches a level; nan if it does not.

        Parameters
        ----------
        r_u : level of the excess pore pressure ratio, 1
        gamma_sa : level of the single amplitude, the change of shear strain since the start, 1
        gamma_da : level of the double amplitude, the change of shear strain since the last turn, 1; it is
            zero before the first turn

        Raises
        ------
        InvalidInput : not exactly one measure, or a level that is not positive
        """
        measures = {"r_u": r_u, "gamma_sa": gamma_sa, "gamma_da": gamma_da}
        given = {name: level for name, level in measures.items() if level is not None}
        if len(given) != 1:
            raise InvalidInput("cycles_to", given, f"must have exactly one measure of {', '.join(measures)}")
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
        """Double amplitude of the shear strain, |gamma - gamma at the last turn|, 1, shape (n,).

        At a turn it is the change since the turn before; up to the first turn it is 0.
        """
        at_turn = self._rows_of_turns()
        passed = self.turns.copy()
        passed[at_turn] -= 1
        # For rows before the first turn the index is -1: the appended nan.
        turned = np.append(self.gamma[at_turn], np.nan)[passed - 1]
        amplitude: Floats = np.nan_to_num(np.abs(self.gamma - turned))
        return amplitude

    def _rows_of_turns(self) -> NDArray[np.intp]:
        return np.flatnonzero(np.diff(self.turns, prepend=0))

    def peaks(self) -> Self:
        """A copy that contains only the rows at the turns, without the specimen."""
        at_turn = self._rows_of_turns()
        stored = self.columns().keys() & {each.name for each in fields(self)}
        return replace(self, specimen=None, **{name: getattr(self, name)[at_turn] for name in stored})

    def plot(self, reference: object | None = None) -> Figure:
        """Plot stress path, stress-strain loops, and pore pressure (or contraction) and strain over cycles.

        Returns a matplotlib figure. `reference` is added to each plot: another test, or any object with
        `gamma`, `tau`, `sigma_v_eff`, `r_u` and `cycle` (drained: `eps_v` instead of `r_u`) as attributes or
        keys.
        """
        return _plots.cyclic(self, reference)


@dataclass(frozen=True, eq=False, kw_only=True)
class PathTest(Record):
    """A strain or stress path, with one row for each row of the given path; tension positive.

    An incomplete test has fewer rows; the last one is the state at failure.

    Attributes
    ----------
    strain : (n, 3), xx, yy and engineering xy, 1
    stress : (n, 3), effective stress xx, yy and xy, kPa
    stress_zz : (n,), out-of-plane effective stress, kPa
    void_ratio : (n,); nan for a model without void ratio
    """

    strain: Floats
    stress: Floats
    stress_zz: Floats
    void_ratio: Floats

    def columns(self) -> dict[str, NDArray[Any]]:
        """Every component by name."""
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
        """Plot shear stress against shear strain and against mean stress, and mean stress against volume.

        Returns a matplotlib figure. `reference` is added to each plot; it must have `gamma_xy`, `tau_xy`,
        `mean` and `volume`.
        """
        return _plots.path(self, reference)


@dataclass(frozen=True, eq=False, kw_only=True)
class CompressionTest(Record):
    """Vertical compression in plane strain. Each array has shape (n,); compression and contraction positive.

    Attributes
    ----------
    axial_strain : vertical strain, 1
    sigma_v_eff, sigma_h_eff : vertical and horizontal effective stress, kPa
    eps_v : volumetric strain, 1
    void_ratio : nan for a model without void ratio
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
        """Stress difference, vertical minus horizontal, kPa."""
        return self.sigma_v_eff - self.sigma_h_eff

    @property
    def excess_pore_pressure(self) -> Floats:
        """Excess pore pressure at constant total lateral stress, kPa; 0 in a drained test."""
        pressure: Floats = self.sigma_h_eff[0] - self.sigma_h_eff
        return pressure

    @classmethod
    def _names(cls) -> list[str]:
        return [*super()._names(), "p", "q", "excess_pore_pressure"]

    def plot(self, reference: object | None = None) -> Figure:
        """Plot stress difference over strain and mean stress, and pore pressure or contraction over strain.

        Returns a matplotlib figure. `reference` is added to each plot; it must have arrays of the same names.
        """
        return _plots.compression(self, reference)


@dataclass(frozen=True, eq=False, kw_only=True)
class Reconsolidation(Record):
    """Dissipation of excess pore pressure after shear. Each array has shape (n,).

    Attributes
    ----------
    sigma_v_eff, sigma_h_eff : vertical and horizontal effective stress, kPa, compression positive
    eps_v : volumetric strain since the beginning of the dissipation, 1, contraction positive
    gamma : engineering shear strain since the start of the shear test, 1
    tau : shear stress, kPa
    void_ratio : nan for a model without void ratio
    """

    sigma_v_eff: Floats
    sigma_h_eff: Floats
    eps_v: Floats
    gamma: Floats
    tau: Floats
    void_ratio: Floats

    def plot(self, reference: object | None = None) -> Figure:
        """Plot vertical effective stress over contraction, and shear stress over vertical effective stress.

        Returns a matplotlib figure. `reference` is added to each plot; it must have arrays of the same names.
        """
        return _plots.reconsolidation(self, reference)


@dataclass(frozen=True, eq=False, kw_only=True)
class ModulusReduction(Record):
    """Secant shear modulus and damping against strain amplitude. Each array has shape (n,).

    Attributes
    ----------
    gamma : amplitude of the engineering shear strain, 1
    G : secant shear modulus, kPa
    damping : damping ratio, 1
    G_max : initial elastic shear modulus, kPa
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
        """Plot modulus ratio and damping ratio against strain.

        Returns a matplotlib figure. `reference` is added to each plot; it must have `gamma`, `G_ratio` and
        `damping`.
        """
        return _plots.modulus(self, reference)
