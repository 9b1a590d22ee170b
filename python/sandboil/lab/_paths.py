"""Tests along a given path: strain path, stress path, plane-strain compression and reconsolidation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import StrictBool

from .. import _core
from .._types import Floats
from ._arguments import (
    AxialStrain,
    EarthPressure,
    Integrator,
    Pressure,
    Soil,
    StrainPath,
    Stress,
    StressPath,
    Tested,
    Tolerance,
    VoidRatio,
    checked,
)
from ._results import CompressionTest, PathTest, Reconsolidation, ShearTest
from ._shear import STRAIN_RESOLUTION, STRAIN_STEP, STRESS_RESOLUTION, shear_columns, sheared
from ._specimen import consolidated, under_stress


@checked
def strain_path(
    soil: Soil,
    *,
    stress0: Stress,
    strain: StrainPath,
    void_ratio: VoidRatio = None,
    integrator: Integrator = "default",
    tolerance: Tolerance = None,
) -> PathTest:
    """Test along a given strain path. Stress and strain are tension positive.

    Parameters
    ----------
    soil : a material, or a model written by the user (:class:`SoilModel`)
    stress0 : effective stress at zero strain, kPa, shape (3,) or (4,): xx, yy, xy and zz; default of zz is xx
    strain : shape (n, 3): xx, yy and engineering xy, 1, at the end of each leg. The path is linear between
        rows and begins at zero strain
    void_ratio : initial void ratio; default that of the soil
    integrator, tolerance : as for :func:`cyclic_dss`

    Raises
    ------
    InvalidInput : an invalid argument, or an initial stress that the soil cannot carry
    """
    specimen = under_stress("lab.strain_path", soil, stress0, void_ratio, integrator, tolerance)
    return _path_test(specimen, np.asarray(strain, dtype=np.float64), by_stress=False)


@checked
def stress_path(
    soil: Soil,
    *,
    stress0: Stress,
    stress: StressPath,
    void_ratio: VoidRatio = None,
    integrator: Integrator = "default",
    tolerance: Tolerance = None,
) -> PathTest:
    """Test along a given effective stress path. Stress and strain are tension positive.

    If the soil cannot carry a stress, the test ends there and is incomplete.

    Parameters
    ----------
    stress : shape (n, 3): xx, yy and xy, kPa, at the end of each leg. The path is linear between rows and
        begins at `stress0`
    soil, stress0, void_ratio, integrator, tolerance : as for :func:`strain_path`

    Raises
    ------
    InvalidInput : an invalid argument, or an initial stress that the soil cannot carry
    """
    specimen = under_stress("lab.stress_path", soil, stress0, void_ratio, integrator, tolerance)
    return _path_test(specimen, np.asarray(stress, dtype=np.float64), by_stress=True)


@checked
def plane_strain_compression(
    soil: Soil,
    *,
    sigma_v0: Pressure = 101.3,
    K0: EarthPressure = 1.0,
    void_ratio: VoidRatio = None,
    drained: StrictBool = False,
    axial_strain_max: AxialStrain = 0.10,
    integrator: Integrator = "default",
    tolerance: Tolerance = None,
) -> CompressionTest:
    """Vertical compression in plane strain.

    Parameters
    ----------
    drained : True: constant lateral effective stress. False: constant volume (undrained)
    axial_strain_max : vertical strain at the end, 1, compression positive
    soil, sigma_v0, K0, void_ratio, integrator, tolerance : as for :func:`cyclic_dss`

    Raises
    ------
    InvalidInput : an invalid argument, or an initial stress that the soil cannot carry
    """
    specimen = consolidated(
        "lab.plane_strain_compression",
        soil,
        sigma_v0=sigma_v0,
        K0=K0,
        static_shear_ratio=0.0,
        void_ratio=void_ratio,
        integrator=integrator,
        tolerance=tolerance,
    )
    end = (-K0 * sigma_v0 if drained else axial_strain_max, -axial_strain_max, 0.0)
    record, ending = _along_path(
        specimen, np.array([end]), (drained, False, False), STRESS_RESOLUTION * sigma_v0, STRAIN_RESOLUTION
    )
    strain, stress = record["strain"], record["stress"]
    return CompressionTest(
        axial_strain=-strain[:, 1],
        sigma_v_eff=-stress[:, 1],
        sigma_h_eff=-stress[:, 0],
        eps_v=-(strain[:, 0] + strain[:, 1]),
        void_ratio=record["void_ratio"],
        complete=ending == "complete",
        ended=f"axial_strain_max = {axial_strain_max:g} was reached" if ending == "complete" else ending,
    )


@checked
def reconsolidation(test: Tested, *, post_shaking: StrictBool = True) -> Reconsolidation:
    """Dissipation of the excess pore pressure after an undrained shear test.

    First the shear stress returns, undrained, to its value before the test, and is then constant. Then the
    vertical effective stress returns to `sigma_v0` without lateral strain. The test uses a copy of the
    specimen, so `test` is unchanged.

    Parameters
    ----------
    test : result of :func:`cyclic_dss` or :func:`monotonic_dss`
    post_shaking : use the reduced stiffness of sand that settles after liquefaction: for PM4Sand the factor
        F_sed on its elastic moduli (Boulanger and Ziotopoulou 2017). Without it the model contracts much less
        than sand does. No effect on the other models

    Raises
    ------
    InvalidInput : a test without its specimen
    """
    assert test.specimen is not None
    specimen, shear_stress = test.specimen.copy(), float(test.tau[0])
    released, ending = sheared(specimen, [("stress", shear_stress)], drained=False, sigma_v0=test.sigma_v0)
    if ending != "complete":
        return _reconsolidation(
            test, released, f"the shear stress did not return to its initial value: {ending}", False
        )
    if post_shaking:
        specimen.reconsolidate()
    record, ending = _along_path(
        specimen,
        np.array([(specimen.strain[0], -test.sigma_v0, shear_stress)]),
        (False, True, True),
        STRESS_RESOLUTION * test.sigma_v0,
        STRAIN_RESOLUTION,
    )
    return _reconsolidation(test, record, ending, ending == "complete")


def _reconsolidation(
    test: ShearTest, record: dict[str, NDArray[Any]], ending: str, complete: bool
) -> Reconsolidation:
    columns = shear_columns(record)
    return Reconsolidation(
        **columns | {"eps_v": columns["eps_v"] - columns["eps_v"][0]},
        complete=complete,
        ended=f"sigma_v0 = {test.sigma_v0:g} kPa was reached" if complete else ending,
    )


def _path_test(specimen: _core.Specimen, rows: Floats, *, by_stress: bool) -> PathTest:
    # Infinite resolutions: record the ends of the legs only.
    record, ending = _along_path(specimen, rows, (by_stress,) * 3, np.inf, np.inf)
    strain, stress, void_ratio = (record[name][1:] for name in ("strain", "stress", "void_ratio"))
    complete = ending == "complete"
    return PathTest(
        strain=strain,
        stress=stress[:, :3],
        stress_zz=stress[:, 3],
        void_ratio=void_ratio,
        complete=complete,
        ended="the end of the path was reached"
        if complete
        else f"in leg {len(strain)} of {len(rows)}: {ending}",
    )


def _along_path(
    specimen: _core.Specimen,
    rows: Floats,
    by_stress: tuple[bool, bool, bool],
    stress_resolution: float,
    strain_resolution: float,
) -> tuple[dict[str, NDArray[Any]], str]:
    """Record of a path as the core returns it (tension positive), and why the test ended."""
    return specimen.path(
        rows,
        by_stress=by_stress,
        strain_step=STRAIN_STEP,
        stress_resolution=stress_resolution,
        strain_resolution=strain_resolution,
    )
