"""Tests along a path that is given: of strain, of stress, of compression, and back to the first stress."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import StrictBool

from .. import _core
from ..discretise import Floats
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
    """Lead a specimen through given strains, straight between rows. Tension positive throughout.

    Parameters
    ----------
    soil : a material, or a model of your own (:class:`SoilModel`)
    stress0 : effective stress xx, yy, xy, and zz if it is not that of xx, kPa, at zero strain
    strain : xx, yy and engineering xy at the end of each leg, shape (n, 3), the first from zero strain
    void_ratio : at the start; default the soil's own
    integrator, tolerance : as of :func:`cyclic_dss`

    Raises
    ------
    InvalidInput : an argument that has no sense, or a first stress that the soil cannot carry
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
    """Lead a specimen through given effective stresses, shape (n, 3), kPa; else as :func:`strain_path`.

    Where the soil cannot carry a stress the test ends there, incomplete.
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
    """Compression from above in plane strain, the lateral stress held (drained) or the volume (undrained).

    Parameters
    ----------
    axial_strain_max : vertical strain at the end, 1, compression positive
    soil, sigma_v0, K0, void_ratio, integrator, tolerance : as of :func:`cyclic_dss`
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
    record, ending = _led(
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
    """Go on with the specimen of an undrained shear test: let its pore pressure dissipate.

    First the shear stress goes back, undrained, to what it was before the test; it is held from there on.
    Then the vertical effective stress goes back to `sigma_v0` without lateral strain. The test itself stays
    as it is.

    Parameters
    ----------
    test : of :func:`cyclic_dss` or :func:`monotonic_dss`
    post_shaking : let the model soften as soil does that settles out of suspension; for PM4Sand the factor
        F_sed on its elastic moduli (Boulanger and Ziotopoulou 2017), without which it contracts
        a fraction of what sands do. Models without such a state make no difference.

    Raises
    ------
    InvalidInput : a test without its specimen
    """
    assert test.specimen is not None
    specimen, shear_stress = test.specimen.copy(), float(test.tau[0])
    released, ending = sheared(specimen, [("stress", shear_stress)], drained=False, sigma_v0=test.sigma_v0)
    if ending != "complete":
        return _reconsolidation(test, released, f"the shear stress did not come back: {ending}", False)
    if post_shaking:
        specimen.reconsolidate()
    record, ending = _led(
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
    # Rows where they were asked for, and none between.
    record, ending = _led(specimen, rows, (by_stress,) * 3, np.inf, np.inf)
    strain, stress, void_ratio = (record[name][1:] for name in ("strain", "stress", "void_ratio"))
    complete = ending == "complete"
    return PathTest(
        strain=strain,
        stress=stress[:, :3],
        stress_zz=stress[:, 3],
        void_ratio=void_ratio,
        complete=complete,
        ended="the whole path was made" if complete else f"in leg {len(strain)} of {len(rows)}: {ending}",
    )


def _led(
    specimen: _core.Specimen,
    rows: Floats,
    by_stress: tuple[bool, bool, bool],
    stress_resolution: float,
    strain_resolution: float,
) -> tuple[dict[str, NDArray[Any]], str]:
    """The core's record of a path, and how it ended."""
    return specimen.path(
        rows,
        by_stress=by_stress,
        strain_step=STRAIN_STEP,
        stress_resolution=stress_resolution,
        strain_resolution=strain_resolution,
    )
