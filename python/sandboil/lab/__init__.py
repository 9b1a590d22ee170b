"""The laboratory: tests on one material point, with a material of sandboil or with a model of the user.

Stresses are effective, in kPa, compression positive; strains are fractions, contraction positive. Exceptions
are :func:`strain_path` and :func:`stress_path`: their tensors are tension positive. Shear strain is
engineering strain. `docs/guide/laboratory.md` describes each test.
"""

from . import correlations
from ._calibration import Calibration, CalibrationWarning, calibrate_hpo, calibration
from ._cell import CellNodes, CellReport, ShearCell, shear_cell
from ._modulus import modulus_reduction
from ._paths import plane_strain_compression, reconsolidation, strain_path, stress_path
from ._resistance import FactorCurve, ResistanceCurve, crr, crr_curve, k_alpha, k_sigma
from ._results import CompressionTest, CyclicTest, ModulusReduction, PathTest, Reconsolidation, ShearTest
from ._shear import cyclic_dss, monotonic_dss
from ._specimen import SoilModel

__all__ = [
    "Calibration",
    "CalibrationWarning",
    "CellNodes",
    "CellReport",
    "CompressionTest",
    "CyclicTest",
    "FactorCurve",
    "ModulusReduction",
    "PathTest",
    "Reconsolidation",
    "ResistanceCurve",
    "ShearCell",
    "ShearTest",
    "SoilModel",
    "calibrate_hpo",
    "calibration",
    "correlations",
    "crr",
    "crr_curve",
    "cyclic_dss",
    "k_alpha",
    "k_sigma",
    "modulus_reduction",
    "monotonic_dss",
    "plane_strain_compression",
    "reconsolidation",
    "shear_cell",
    "strain_path",
    "stress_path",
]
