"""The specimen of a test: a soil model at one point, under the initial stress of the test.

Every test except :func:`shear_cell` also works with a model written by the user in Python
(:class:`SoilModel`), only more slowly.
"""

from __future__ import annotations

import typing
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from .._errors import InvalidInput
from ..scene.soils import Material, PM4Sand

Components = tuple[float, float, float, float]

# Number of bisections for the limit of the stress that a soil carries: about seven digits of the initial
# interval.
_BISECTIONS = 24
# Largest K0, and largest vertical effective stress, kPa. Larger values do not occur in soil and are input
# errors.
K0_MAX = 100.0
SIGMA_MAX = 1.0e5


@runtime_checkable
class SoilModel(Protocol):
    """Interface of a constitutive model written by the user in Python.

    Effective stresses are ``(xx, yy, xy, zz)`` in kPa, strains ``(xx, yy, xy)`` with engineering shear, both
    tension positive; plane strain, so strain ``zz`` is 0. A state may be any object. It must not be changed
    in place, because the laboratory returns to earlier states. An exception in the model ends the test and is
    raised to the caller. The argument `integrator` of the tests has no effect: `update` receives increments
    of at most 1e-5 and integrates them by its own method. ::

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
        """State at rest under a stress, at zero strain; `void_ratio` as given to the test, or None."""

    def update(self, state: Any, strain: tuple[float, float, float], /) -> Any:
        """New state after a strain increment."""

    def stress(self, state: Any, /) -> Components:
        """Effective stress of a state."""

    def moduli(self, state: Any, /) -> tuple[float, float]:
        """Elastic shear and bulk modulus of a state, kPa: first estimate of its stiffness."""


Soil = Material | SoilModel
"""A soil that can be tested."""

_BUILT_IN = typing.get_args(typing.get_args(Material)[0])


def as_soil(value: object) -> object:
    """Return a material, or an object with the methods of :class:`SoilModel`; otherwise raise ValueError."""
    if isinstance(value, _BUILT_IN) or (isinstance(value, SoilModel) and not isinstance(value, type)):
        return value
    materials = ", ".join(f"sb.{kind.__name__}" for kind in _BUILT_IN)
    raise ValueError(
        f"must be a material ({materials}) or an object with the methods initialise, update, stress and "
        "moduli (sb.lab.SoilModel); create it with its parameters, for example sb.Elastic(G=3e4, K=7e4)"
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
    """A specimen under vertical effective stress `sigma_v0`, kPa, horizontal `K0 sigma_v0`, and static shear.

    Raises :class:`InvalidInput`, with `where` before the name of the argument, if the soil cannot carry the
    stress.
    """

    def stress(sigma_v0: float, K0: float, static_shear_ratio: float) -> Components:
        return -K0 * sigma_v0, -sigma_v0, static_shear_ratio * sigma_v0, -K0 * sigma_v0

    def carried(sigma_v0: float, K0: float, static_shear_ratio: float) -> bool:
        return carries(soil, stress(sigma_v0, K0, static_shear_ratio))

    if not carried(sigma_v0, K0, static_shear_ratio):
        if not carried(sigma_v0, 1.0, 0.0):
            least = _limit(lambda value: carried(value, 1.0, 0.0), SIGMA_MAX, sigma_v0)
            raise InvalidInput(
                f"{where}.sigma_v0",
                sigma_v0,
                f"must be at least {least:.4g} kPa, the smallest isotropic stress that this soil can carry",
                "stresses are in kPa: 0.1 MPa is written 100",
            )
        if not carried(sigma_v0, K0, 0.0):
            least, most = (
                _limit(lambda value: carried(sigma_v0, value, 0.0), 1.0, end) for end in (0.0, K0_MAX)
            )
            raise InvalidInput(
                f"{where}.K0",
                K0,
                f"must lie in [{least:.3f}, {most:.3f}], where this soil can carry the initial stress",
                "1 - sin(phi) is usual for normally consolidated soil",
            )
        most = abs(_limit(lambda value: carried(sigma_v0, K0, value), 0.0, static_shear_ratio))
        raise InvalidInput(
            f"{where}.static_shear_ratio",
            static_shear_ratio,
            f"must lie in [-{most:.3f}, {most:.3f}] at K0 = {K0:g}, where this soil can carry the stress",
            "a K0 closer to 1 allows a larger ratio",
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
    """A specimen under an effective stress xx, yy, xy and optionally zz (default xx), kPa, tension positive.

    Raises :class:`InvalidInput`, with `where` before the name of the argument, if the soil cannot carry the
    stress.
    """
    given = np.asarray(stress0, dtype=np.float64)
    xx, yy, xy, zz = (*given.tolist(), given[0])[:4]
    mean = 0.5 * (xx + yy)

    def carried(share: float) -> bool:
        xx_share, yy_share, zz_share = (mean + share * (normal - mean) for normal in (xx, yy, zz))
        return carries(soil, (xx_share, yy_share, share * xy, zz_share))

    if not carried(1.0):
        path, value = f"{where}.stress0", tuple(given.tolist())
        if not carried(0.0):
            raise InvalidInput(
                path,
                value,
                "must have a compressive mean, xx + yy < 0, that the soil can carry",
                "tension is positive here: compression has a minus sign",
            )
        raise InvalidInput(
            path,
            value,
            "must be closer to isotropic: this soil can carry "
            f"{_limit(carried, 0.0, 1.0):.3f} times the deviator",
            "reduce the difference of the normal stresses, or the shear stress",
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
        _refuse_unused(where, soil, void_ratio, integrator, tolerance)
    if tolerance is not None and integrator != "default":
        raise InvalidInput(
            f"{where}.tolerance",
            tolerance,
            f"has no effect with the {integrator!r} integrator",
            "leave it out, or use integrator = 'default'",
        )
    if isinstance(soil, PM4Sand) and void_ratio is not None:
        e_max, e_min = soil.void_ratio_limits
        if not e_min <= void_ratio < e_max:
            raise InvalidInput(
                f"{where}.void_ratio",
                void_ratio,
                f"must lie in [{e_min:g}, {e_max:g}), between e_min and e_max of the sand",
                f"leave it out for the void ratio that belongs to Dr, {soil.initial_void_ratio:g}",
            )
    material = soil.core() if isinstance(soil, _BUILT_IN) else soil
    return _core.Specimen(material, stress, void_ratio, scheme=integrator, tolerance=tolerance)


def _refuse_unused(
    where: str, soil: Soil, void_ratio: float | None, integrator: str, tolerance: float | None
) -> None:
    """Refuse arguments that have no effect on a soil other than PM4Sand."""
    name = type(soil).__name__
    built_in = isinstance(soil, _BUILT_IN)
    reason = "is integrated in closed form" if built_in else "has its own integration"
    for argument, value, default, why in (
        # A model of the user receives the void ratio.
        ("void_ratio", void_ratio, None if built_in else void_ratio, f"{name} does not depend on it"),
        ("integrator", integrator, "default", f"{name} {reason}"),
        ("tolerance", tolerance, None, f"{name} {reason}"),
    ):
        if value != default:
            raise InvalidInput(
                f"{where}.{argument}", value, f"has no effect: {why}", "leave it out; it is for PM4Sand"
            )


def carries(soil: Soil, stress: Components) -> bool:
    """Whether a soil carries an effective stress `(xx, yy, xy, zz)`, kPa, tension positive.

    Always true for a model written by the user.
    """
    return not isinstance(soil, _BUILT_IN) or _core.carries(soil.core(), stress)


def _limit(carried: Callable[[float], bool], good: float, bad: float) -> float:
    """The last carried value between `good`, which is carried, and `bad`, which is not."""
    for _ in range(_BISECTIONS):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if carried(middle) else (good, middle)
    return good
