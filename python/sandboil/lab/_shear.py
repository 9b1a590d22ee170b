"""Direct simple shear: no lateral strain; the volume is held (undrained) or the vertical stress (drained)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import StrictBool

from .. import _core
from .._errors import InvalidInput
from ..discretise import Floats
from ..materials import PM4Sand
from ._arguments import (
    Bias,
    Count,
    EarthPressure,
    Integrator,
    Limit,
    Pressure,
    Ratio,
    Series,
    Soil,
    Tolerance,
    VoidRatio,
    checked,
)
from ._results import CyclicTest, ShearTest
from ._specimen import consolidated

# Shear strain of one increment. Turns are met exactly whatever it is, and the models divide it further.
STRAIN_STEP = 1.0e-5
# Changes that are worth a row: of stress over sigma_v0, and of strain. No picture shows more.
STRESS_RESOLUTION, STRAIN_RESOLUTION = 0.004, 1.0e-4


@checked
def cyclic_dss(
    soil: Soil,
    *,
    sigma_v0: Pressure = 101.3,
    K0: EarthPressure = 0.5,
    csr: Ratio | None = None,
    static_shear_ratio: Bias = 0.0,
    void_ratio: VoidRatio = None,
    gamma_stop: Limit = 0.05,
    max_cycles: Count = 60,
    drained: StrictBool = False,
    reversals: Series | None = None,
    gamma_reversals: Series | None = None,
    integrator: Integrator = "default",
    tolerance: Tolerance = None,
) -> CyclicTest:
    """Cyclic direct simple shear, uniform (`csr`), irregular (`reversals`) or by strain (`gamma_reversals`).

    Parameters
    ----------
    soil : a material, or a model of your own (:class:`SoilModel`)
    sigma_v0 : vertical effective stress at the start, kPa, compression positive
    K0 : horizontal over vertical effective stress at the start
    csr : amplitude of the shear stress over sigma_v0; the test turns at (static_shear_ratio + csr) sigma_v0
        first, then at (static_shear_ratio - csr) sigma_v0, and so on
    static_shear_ratio : shear stress at the start over sigma_v0
    void_ratio : at the start; default the soil's own
    gamma_stop : distance of the shear strain from its start at which the test ends, 1
    max_cycles : cycles of `csr` after which the test ends
    drained : hold the vertical effective stress instead of the volume
    reversals : turning points of shear stress over sigma_v0, shape (n,), the static one included
    gamma_reversals : turning points of the shear strain, shape (n,), engineering, within gamma_stop
    integrator : of rate-type models: "default", "rk4" or "reference" (commits of 2.5e-6)
    tolerance : relative error per sub-step of the default integrator

    Raises
    ------
    InvalidInput : an argument that has no sense, a start that the soil cannot carry, or a shear stress that
        it can never reach
    """
    where = "lab.cyclic_dss"
    asked = {"csr": csr, "reversals": reversals, "gamma_reversals": gamma_reversals}
    given = [name for name, value in asked.items() if value is not None]
    if len(given) != 1:
        raise InvalidInput(
            where, given, f"must be given exactly one of {', '.join(asked)}", "csr = 0.15 is a uniform test"
        )
    specimen = consolidated(
        where,
        soil,
        sigma_v0=sigma_v0,
        K0=K0,
        static_shear_ratio=static_shear_ratio,
        void_ratio=void_ratio,
        integrator=integrator,
        tolerance=tolerance,
    )
    (name,) = given
    if csr is not None:
        turning, count = np.array([static_shear_ratio + csr, static_shear_ratio - csr]), 2 * max_cycles
        finished = f"max_cycles = {max_cycles} were done"
    else:
        turning, count = np.asarray(asked[name], dtype=np.float64), None
        finished = f"all {name} were made"
        begin = static_shear_ratio if name == "reversals" else 0.0
        _check_alternation(f"{where}.{name}", begin, turning)
    if name == "gamma_reversals":
        if np.abs(turning).max() > gamma_stop:
            raise InvalidInput(
                f"{where}.{name}",
                float(turning[np.abs(turning).argmax()]),
                f"must lie within gamma_stop = {gamma_stop:g}",
                "give a larger gamma_stop",
            )
        turns = [("strain", float(value)) for value in turning]
    else:
        check_reach(f"{where}.{name}", soil, specimen, turning, drained=drained)
        turns = [("stress", float(value) * sigma_v0) for value in turning]
    record, ending = sheared(
        specimen, turns, count=count, drained=drained, strain_limit=gamma_stop, sigma_v0=sigma_v0
    )
    limit = limit_told(gamma_stop, record["turns"])
    return CyclicTest(
        **shear_columns(record),
        cycle=record["cycle"],
        turns=record["turns"],
        sigma_v0=sigma_v0,
        drained=drained,
        specimen=specimen,
        complete=ending in ("complete", "strain limit"),
        ended={"complete": finished, "strain limit": limit}.get(ending, ending),
    )


@checked
def monotonic_dss(
    soil: Soil,
    *,
    sigma_v0: Pressure = 101.3,
    K0: EarthPressure = 0.5,
    static_shear_ratio: Bias = 0.0,
    void_ratio: VoidRatio = None,
    drained: StrictBool = False,
    gamma_max: Limit = 0.10,
    integrator: Integrator = "default",
    tolerance: Tolerance = None,
) -> ShearTest:
    """Direct simple shear in one direction, to the shear strain `gamma_max`; else as :func:`cyclic_dss`."""
    specimen = consolidated(
        "lab.monotonic_dss",
        soil,
        sigma_v0=sigma_v0,
        K0=K0,
        static_shear_ratio=static_shear_ratio,
        void_ratio=void_ratio,
        integrator=integrator,
        tolerance=tolerance,
    )
    record, ending = sheared(specimen, [("strain", gamma_max)], drained=drained, sigma_v0=sigma_v0)
    return ShearTest(
        **shear_columns(record),
        sigma_v0=sigma_v0,
        drained=drained,
        specimen=specimen,
        complete=ending == "complete",
        ended=f"gamma_max = {gamma_max:g} was reached" if ending == "complete" else ending,
    )


def sheared(
    specimen: _core.Specimen,
    turns: list[tuple[str, float]],
    *,
    drained: bool,
    sigma_v0: float,
    count: int | None = None,
    strain_limit: float = math.inf,
    strain_step: float = STRAIN_STEP,
    strain_resolution: float = STRAIN_RESOLUTION,
) -> tuple[dict[str, NDArray[Any]], str]:
    """The core's record of a shear from turn to turn, and how it ended."""
    return specimen.shear(
        turns,
        drained=drained,
        count=count,
        strain_step=strain_step,
        strain_limit=strain_limit,
        stress_resolution=STRESS_RESOLUTION * sigma_v0,
        strain_resolution=strain_resolution,
    )


def shear_columns(record: dict[str, NDArray[Any]]) -> dict[str, Any]:
    """The core's record, tension positive, as a :class:`ShearTest` has it."""
    strain, stress = record["strain"], record["stress"]
    return {
        "gamma": strain[:, 2],
        "tau": stress[:, 2],
        "sigma_v_eff": -stress[:, 1],
        "sigma_h_eff": -stress[:, 0],
        "eps_v": -(strain[:, 0] + strain[:, 1]),
        "void_ratio": record["void_ratio"],
    }


def limit_told(gamma_stop: float, turns: NDArray[np.int64]) -> str:
    """How a test ended that reached its largest strain."""
    told = f"the shear strain reached gamma_stop = {gamma_stop:g}"
    return told if turns[-1] else f"{told} before the first turn"


def _check_alternation(path: str, begin: float, turning: Floats) -> None:
    strokes = np.sign(np.diff(turning, prepend=begin))
    wrong = np.flatnonzero((strokes == 0.0) | (strokes == np.append(0.0, strokes[:-1])))
    if len(wrong):
        raise InvalidInput(
            f"{path}[{wrong[0]}]",
            float(turning[wrong[0]]),
            f"must turn back: each lies on the other side of the one before, which begins at {begin:g}",
            "leave out the points on the way",
        )


def check_reach(path: str, soil: Soil, specimen: _core.Specimen, turning: Floats, *, drained: bool) -> None:
    """Refuse turning points that PM4Sand can never reach: others are found out by the test itself."""
    if not isinstance(soil, PM4Sand):
        return
    most = _largest_shear_ratio(soil, specimen, drained)
    beyond = turning[np.abs(turning) > most]
    if len(beyond):
        strength = "bounding stress ratio" if drained else "critical-state strength"
        raise InvalidInput(
            path,
            float(beyond[0]),
            f"must turn within {most:.3f} of sigma_v0: this sand's {strength} allows no more",
            "a ratio to sigma_v0 is meant, not a stress in kPa",
        )


def _largest_shear_ratio(sand: PM4Sand, specimen: _core.Specimen, drained: bool) -> float:
    """Bound of the shear stress over sigma_v0.

    A stress ratio q/p = M mobilises sin(phi) = M/2, under which no plane carries more than tan(phi). At
    constant volume dense sand dilates until it is at critical state, where p follows from its density
    (Boulanger and Ziotopoulou 2017).
    """
    void_ratio = specimen.void_ratio
    assert void_ratio is not None
    e_max, e_min = sand.void_ratio_limits
    density = (e_max - void_ratio) / (e_max - e_min)
    constants = _core.pm4sand_constants(sand.core() | {"Dr": density}, specimen.stress)
    sine = 0.5 * constants["Mb"]
    frictional = math.tan(math.asin(sine)) if sine < 1.0 else math.inf
    if drained:
        return frictional
    pressure = 0.01 * constants["p_atm"] * math.exp(constants["Q"] - constants["R"] / density)
    return max(frictional, 0.5 * constants["M"] * pressure / -specimen.stress[1])
