"""The laboratory: tests on one material point, of a material of ours or of a model of your own.

Stresses are effective, in kPa, compression positive, and strains are fractions, contraction positive, save in
:func:`strain_path` and :func:`stress_path`, which take and give tensors, tension positive. Shear strain is
engineering. `docs/laboratory.md` tells what each test does.
"""

from . import correlations
from ._calibration import Calibration, CalibrationWarning, calibrate_hpo, calibration
from ._resistance import FactorCurve, ResistanceCurve, crr, crr_curve, k_alpha, k_sigma
from ._results import CyclicTest, ShearTest
from ._shear import cyclic_dss, monotonic_dss
from ._specimen import SoilModel

__all__ = [
    "Calibration",
    "CalibrationWarning",
    "CyclicTest",
    "FactorCurve",
    "ResistanceCurve",
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
    "monotonic_dss",
]
