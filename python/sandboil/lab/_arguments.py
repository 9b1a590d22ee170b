"""The arguments of the tests: their types, and the check of all arguments before a test begins."""

from __future__ import annotations

import operator
from typing import Annotated, Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BeforeValidator, Field, PlainValidator

from .._checked import checked as _checked
from .._types import Floats, Number
from . import _specimen
from ._results import ShearTest

# Largest integrator tolerance at which cycle counts are unbiased (docs/theory/pm4sand.md), as in a scene.
_TOLERANCE_MAX = 1.0e-4
# Largest shear or axial strain of a test: beyond it the deformation of a specimen has no physical meaning.
_STRAIN_MAX = 1.0
# Largest number of cycles: a longer test would take days.
_COUNT_MAX = 10**7


def _finite(value: object, dimensions: int, shape: str) -> Floats:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"must be an array of numbers with {shape}; write numbers without quotes") from None
    if array.ndim != dimensions or array.size == 0:
        raise ValueError(f"must have {shape}, not {array.shape}; reshape or transpose it")
    if not np.isfinite(array).all():
        raise ValueError("must have only finite values; remove nan and inf")
    return array


def _as_integer(value: object) -> int:
    """Accept any integer, also of numpy, but no bool, which is probably a mistake."""
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        return operator.index(cast(Any, value))
    except TypeError:
        raise ValueError("must be a whole number; write it without a decimal point") from None


def as_series(value: object) -> Floats:
    return _finite(value, 1, "shape (n,), n at least 1")


def _as_path(value: object) -> Floats:
    array = _finite(value, 2, "shape (n, 3), n at least 1")
    if array.shape[1] != 3:
        raise ValueError(f"must have shape (n, 3), not {array.shape}; each row is xx, yy, xy")
    return array


def _within(array: Floats, limit: float, remedy: str) -> Floats:
    if np.abs(array).max() > limit:
        raise ValueError(f"must lie within {limit:g}; {remedy}")
    return array


def _as_strain_path(value: object) -> Floats:
    return _within(_as_path(value), _STRAIN_MAX, "strains are fractions, 5 % is written 0.05")


def _as_stress_path(value: object) -> Floats:
    return _within(_as_path(value), _specimen.SIGMA_MAX, "stresses are in kPa")


def _as_amplitudes(value: object) -> Floats:
    strains = as_series(value)
    if not ((strains > 0.0) & (strains <= _STRAIN_MAX)).all():
        raise ValueError(f"must lie in (0, {_STRAIN_MAX:g}]; strains are fractions, 1 % is written 0.01")
    return strains


def _as_tested(value: object) -> ShearTest:
    if not isinstance(value, ShearTest) or value.specimen is None:
        raise ValueError(
            "must be a result of sb.lab.cyclic_dss or sb.lab.monotonic_dss that still has its specimen; "
            "pass the result unchanged"
        )
    return value


def _as_stress(value: object) -> Floats:
    array = _finite(value, 1, "shape (3,) or (4,)")
    if len(array) not in (3, 4):
        raise ValueError(
            f"must have 3 components xx, yy, xy, or 4 with zz, not {len(array)}; tension is positive"
        )
    return _within(array, _specimen.SIGMA_MAX, "stresses are in kPa")


Soil = Annotated[_specimen.Soil, PlainValidator(_specimen.as_soil)]
Pressure = Annotated[
    Number,
    Field(
        gt=0.0,
        le=_specimen.SIGMA_MAX,
        description="vertical effective stress, kPa, compression positive",
        json_schema_extra={"remedy": "100 kPa is about one atmosphere, or 5 to 10 m of soil"},
    ),
]
EarthPressure = Annotated[
    Number,
    Field(
        gt=0.0,
        le=_specimen.K0_MAX,
        description="horizontal over vertical effective stress",
        json_schema_extra={"remedy": "usual values are 0.4 to 1"},
    ),
]
Ratio = Annotated[
    Number,
    Field(
        gt=0.0,
        description="cyclic shear stress over sigma_v0",
        json_schema_extra={"remedy": "it is a ratio, not a stress: 0.05 to 0.5 for sand"},
    ),
]
Bias = Annotated[Number, Field(description="static shear stress over sigma_v0")]
VoidRatio = (
    Annotated[
        Number,
        Field(
            gt=0.0,
            description="void ratio at the start of the test",
            json_schema_extra={"remedy": "leave it out for the default of the soil"},
        ),
    ]
    | None
)
Limit = Annotated[
    Number,
    Field(
        gt=0.0,
        le=_STRAIN_MAX,
        description="engineering shear strain, 1",
        json_schema_extra={"remedy": "it is a fraction, not a percentage: 5 % is written 0.05"},
    ),
]
AxialStrain = Annotated[
    Number,
    Field(
        gt=0.0,
        lt=_STRAIN_MAX,
        description="compression, 1",
        json_schema_extra={"remedy": "it is a fraction, not a percentage: 5 % is written 0.05"},
    ),
]
Count = Annotated[int, BeforeValidator(_as_integer), Field(ge=1, le=_COUNT_MAX)]
Integrator = Literal["default", "rk4", "reference"]
Tolerance = (
    Annotated[
        Number,
        Field(
            gt=0.0,
            le=_TOLERANCE_MAX,
            description="relative error per sub-step of the default integrator",
            json_schema_extra={"remedy": "leave it out for 1e-5; a larger error biases the number of cycles"},
        ),
    ]
    | None
)
Series = Annotated[ArrayLike, PlainValidator(as_series)]
StrainPath = Annotated[ArrayLike, PlainValidator(_as_strain_path)]
StressPath = Annotated[ArrayLike, PlainValidator(_as_stress_path)]
Amplitudes = Annotated[ArrayLike, PlainValidator(_as_amplitudes)]
Tested = Annotated[ShearTest, PlainValidator(_as_tested)]
Stress = Annotated[ArrayLike, PlainValidator(_as_stress)]

checked = _checked("lab")
