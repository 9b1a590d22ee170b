"""The specimen of a test: a soil model at one point, under the stress at which the test begins.

The core drives ours and yours alike, so every test runs on a model that you write in Python
(:class:`SoilModel`), only slower.
"""

from __future__ import annotations

import typing
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from .._errors import InvalidInput
from ..materials import Material, PM4Sand

Components = tuple[float, float, float, float]

# Bisections for the edge of what a soil carries: six digits of the range they begin with.
_BISECTIONS = 24
# Largest K0, and largest vertical effective stress, kPa: far beyond any sand and any depth, so slips.
K0_MAX = 100.0
SIGMA_MAX = 1.0e5


@runtime_checkable
class SoilModel(Protocol):
    """A constitutive model of your own, in Python, for every test of the laboratory.

    Effective stresses are ``(xx, yy, xy, zz)`` in kPa, strains ``(xx, yy, xy)`` with engineering shear, both
    tension positive; plane strain, ``zz`` strain 0. A state is whatever you like, but must never be changed
    in place: the laboratory goes back to earlier ones. An exception of yours ends the test and reaches you.
    The integrator does not apply: `update` gets increments of 1e-5 at most and integrates as it likes. ::

        class Hooke:
            def initialise(self, stress, void_ratio):
                return stress

            def update(self, state, strain):
                (xx, yy, xy, zz), (exx, eyy, gxy) = state, strain
                p, g = 7.0e4 * (exx + eyy), 3.0e4  # K - 2G/3, and G
                return xx + p + 2 * g * exx, yy + p + 2 * g * eyy, xy + g * gxy, zz + p

            def stress(self, state):
                return state

            def moduli(self, state):
                return 3.0e4, 9.0e4


        sb.lab.strain_path(Hooke(), stress0=(-50, -100, 0), strain=[(0, 0, 1e-3)])
    """

    def initialise(self, stress: Components, void_ratio: float | None, /) -> Any:
        """State at rest under a stress, at zero strain; `void_ratio` as the user gave it, or None."""

    def update(self, state: Any, strain: tuple[float, float, float], /) -> Any:
        """A new state, after an increment of strain."""

    def stress(self, state: Any, /) -> Components:
        """Effective stress of a state."""

    def moduli(self, state: Any, /) -> tuple[float, float]:
        """Elastic shear and bulk modulus of a state, kPa: the first guess where stress is prescribed."""


Soil = Material | SoilModel
"""What can be tested."""

_OURS = typing.get_args(typing.get_args(Material)[0])


def as_soil(value: object) -> object:
    """A material of ours or an object with the methods of :class:`SoilModel`; else ValueError."""
    if isinstance(value, _OURS) or (isinstance(value, SoilModel) and not isinstance(value, type)):
        return value
    ours = ", ".join(f"sb.{kind.__name__}" for kind in _OURS)
    raise ValueError(
        f"must be a material ({ours}) or an object with the methods initialise, update, stress and moduli "
        "(sb.lab.SoilModel); make one by its parameters"
    )


def consolidated(
    where: str,
    soil: Soil,
    *,
    sigma_v0: float,
    K0: float,
    static_shear_ratio: float,
    void_ratio: float | None,
    integrator: str,
    tolerance: float | None,
) -> _core.Specimen:
    """A specimen under vertical stress `sigma_v0` (kPa), K0 times that sideways, and a static shear stress.

    Raises :class:`InvalidInput`, with `where` before the argument's name, if the soil cannot carry that.
    """

    def stress(sigma_v0: float, K0: float, static_shear_ratio: float) -> Components:
        return -K0 * sigma_v0, -sigma_v0, static_shear_ratio * sigma_v0, -K0 * sigma_v0

    def carried(sigma_v0: float, K0: float, static_shear_ratio: float) -> bool:
        return carries(soil, stress(sigma_v0, K0, static_shear_ratio))

    if not carried(sigma_v0, K0, static_shear_ratio):
        if not carried(sigma_v0, 1.0, 0.0):
            least = _edge(lambda value: carried(value, 1.0, 0.0), SIGMA_MAX, sigma_v0)
            raise InvalidInput(
                f"{where}.sigma_v0",
                sigma_v0,
                f"must be at least {least:.4g} kPa for this soil to carry it",
                "stresses are in kPa: 0.1 MPa is written 100",
            )
        if not carried(sigma_v0, K0, 0.0):
            least, most = (
                _edge(lambda value: carried(sigma_v0, value, 0.0), 1.0, end) for end in (0.0, K0_MAX)
            )
            raise InvalidInput(
                f"{where}.K0",
                K0,
                f"must lie in [{least:.3f}, {most:.3f}]: beyond it this soil fails before the test begins",
                "1 - sin(phi) is that of normally consolidated soil",
            )
        most = abs(_edge(lambda value: carried(sigma_v0, K0, value), 0.0, static_shear_ratio))
        raise InvalidInput(
            f"{where}.static_shear_ratio",
            static_shear_ratio,
            f"must lie in [-{most:.3f}, {most:.3f}] at K0 = {K0:g}: beyond it this soil fails before the "
            "test begins",
            "a K0 nearer to 1 leaves room for more",
        )
    return specimen(where, soil, stress(sigma_v0, K0, static_shear_ratio), void_ratio, integrator, tolerance)


def under_stress(
    where: str,
    soil: Soil,
    stress0: ArrayLike,
    void_ratio: float | None,
    integrator: str,
    tolerance: float | None,
) -> _core.Specimen:
    """A specimen under a tensor of effective stress xx, yy, xy and perhaps zz, kPa, tension positive.

    Raises :class:`InvalidInput`, with `where` before the argument's name, if the soil cannot carry that.
    """
    given = np.asarray(stress0, dtype=np.float64)
    xx, yy, xy, zz = (*given.tolist(), given[0])[:4]
    mean = 0.5 * (xx + yy)

    def carried(share: float) -> bool:
        xx_share, yy_share, zz_share = (mean + share * (normal - mean) for normal in (xx, yy, zz))
        return carries(soil, (xx_share, yy_share, share * xy, zz_share))

    if not carried(1.0):
        path, shown = f"{where}.stress0", tuple(given.tolist())
        if not carried(0.0):
            raise InvalidInput(
                path,
                shown,
                "must be compression in the mean, xx + yy < 0, that the soil can carry",
                "tension is positive here: compression has a minus sign",
            )
        raise InvalidInput(
            path,
            shown,
            f"must be {_edge(carried, 0.0, 1.0):.3f} times that far from isotropic, or nearer: "
            "this soil carries no more",
            "take normal stresses nearer to each other, or less shear stress",
        )
    return specimen(where, soil, (xx, yy, xy, zz), void_ratio, integrator, tolerance)


def specimen(
    where: str,
    soil: Soil,
    stress: Components,
    void_ratio: float | None,
    integrator: str,
    tolerance: float | None,
) -> _core.Specimen:
    """A specimen under an effective stress `(xx, yy, xy, zz)`, kPa, tension positive."""
    if not isinstance(soil, PM4Sand):
        _refuse_idle(where, soil, void_ratio, integrator, tolerance)
    if tolerance is not None and integrator != "default":
        raise InvalidInput(
            f"{where}.tolerance",
            tolerance,
            f"has no effect on the {integrator!r} integrator, which has its own sub-step rule",
            "integrator = 'default' is controlled by its error",
        )
    if isinstance(soil, PM4Sand) and void_ratio is not None:
        e_max, e_min = soil.void_ratio_limits
        if not e_min <= void_ratio < e_max:
            raise InvalidInput(
                f"{where}.void_ratio",
                void_ratio,
                f"must lie in [{e_min:g}, {e_max:g}), e_min to e_max of the sand",
                f"without it the test begins at that of Dr, {soil.initial_void_ratio:g}",
            )
    material = soil.core() if isinstance(soil, _OURS) else soil
    return _core.Specimen(material, stress, void_ratio, scheme=integrator, tolerance=tolerance)


def _refuse_idle(
    where: str, soil: Soil, void_ratio: float | None, integrator: str, tolerance: float | None
) -> None:
    """Refuse what would be said in vain of a soil other than PM4Sand."""
    name = type(soil).__name__
    ours = isinstance(soil, _OURS)
    reason = "is integrated in closed form" if ours else "integrates as it likes"
    for argument, value, default, told in (
        # A model of one's own is given the void ratio.
        ("void_ratio", void_ratio, void_ratio if not ours else None, f"{name} has none"),
        ("integrator", integrator, "default", f"{name} {reason}"),
        ("tolerance", tolerance, None, f"{name} {reason}"),
    ):
        if value != default:
            raise InvalidInput(
                f"{where}.{argument}", value, f"has no effect: {told}", "leave it out; PM4Sand takes it"
            )


def carries(soil: Soil, stress: Components) -> bool:
    """Whether a soil carries an effective stress `(xx, yy, xy, zz)`, kPa, tension positive; yours all do."""
    return not isinstance(soil, _OURS) or _core.carries(soil.core(), stress)


def _edge(carried: Callable[[float], bool], good: float, bad: float) -> float:
    """The last value that is carried between one that is and one that is not."""
    for _ in range(_BISECTIONS):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if carried(middle) else (good, middle)
    return good
