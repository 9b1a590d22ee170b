"""Direct simple shear at constant volume (undrained) or constant vertical stress (drained)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import StrictBool

from .. import _core
from .._errors import InvalidInput
from .._types import Floats
from ..scene.soils import PM4Sand
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

# Shear strain of one increment. Turns are met exactly for any value, and the models divide the increment
# further.
STRAIN_STEP = 1.0e-5
# Changes after which a row is recorded: of stress, over sigma_v0, and of strain. Smaller changes are
# invisible in plots.
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
    """Cyclic direct simple shear: uniform (`csr`), irregular (`reversals`) or by strain (`gamma_reversals`).

    Parameters
    ----------
    soil : a material, or a model written by the user (:class:`SoilModel`)
    sigma_v0 : initial vertical effective stress, kPa, compression positive
    K0 : initial ratio of horizontal to vertical effective stress
    csr : amplitude of the shear stress over sigma_v0. The first turn is at (static_shear_ratio + csr)
        sigma_v0, the second at (static_shear_ratio - csr) sigma_v0, and so on
    static_shear_ratio : initial shear stress over sigma_v0
    void_ratio : initial void ratio; default that of the soil
    gamma_stop : change of the shear strain since the start, 1, at which the test ends
    max_cycles : number of cycles of `csr` after which the test ends
    drained : True: constant vertical effective stress. False: constant volume (undrained)
    reversals : (n,) shear stresses at the turns, over sigma_v0, including the static shear stress
    gamma_reversals : (n,) engineering shear strains at the turns, 1, within gamma_stop
    integrator : for rate-type models: "default", "rk4" or "reference" (commits of 2.5e-6)
    tolerance : relative error per sub-step of the default integrator

    Raises
    ------
    InvalidInput : an invalid argument, an initial stress that the soil cannot carry, or a shear stress that
        it cannot reach
    """
    where = "lab.cyclic_dss"
    loadings = {"csr": csr, "reversals": reversals, "gamma_reversals": gamma_reversals}
    given = [name for name, value in loadings.items() if value is not None]
    if len(given) != 1:
        raise InvalidInput(
            where,
            given,
            f"must have exactly one of {', '.join(loadings)}",
            "csr = 0.15 is a uniform test",
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
        finished = f"max_cycles = {max_cycles} was reached"
    else:
        turning, count = np.asarray(loadings[name], dtype=np.float64), None
        finished = f"all {name} were reached"
        begin = static_shear_ratio if name == "reversals" else 0.0
        _check_alternation(f"{where}.{name}", begin, turning)
    if name == "gamma_reversals":
        if np.abs(turning).max() > gamma_stop:
            raise InvalidInput(
                f"{where}.{name}",
                float(turning[np.abs(turning).argmax()]),
                f"must lie within gamma_stop = {gamma_stop:g}",
                "use a larger gamma_stop",
            )
        turns = [("strain", float(value)) for value in turning]
    else:
        check_reach(f"{where}.{name}", soil, specimen, turning, drained=drained)
        turns = [("stress", float(value) * sigma_v0) for value in turning]
    record, ending = sheared(
        specimen, turns, count=count, drained=drained, strain_limit=gamma_stop, sigma_v0=sigma_v0
    )
    limit = strain_limit_message(gamma_stop, record["turns"])
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
    """Monotonic direct simple shear.

    Parameters
    ----------
    gamma_max : engineering shear strain at the end, 1
    soil, sigma_v0, K0, static_shear_ratio, void_ratio, drained, integrator, tolerance : as for
        :func:`cyclic_dss`

    Raises
    ------
    InvalidInput : an invalid argument, or an initial stress that the soil cannot carry
    """
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
    """Record of a shear test as the core returns it (tension positive), and why the test ended."""
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
    """Arrays of a :class:`ShearTest` from a record of the core, which is tension positive."""
    strain, stress = record["strain"], record["stress"]
    return {
        "gamma": strain[:, 2],
        "tau": stress[:, 2],
        "sigma_v_eff": -stress[:, 1],
        "sigma_h_eff": -stress[:, 0],
        "eps_v": -(strain[:, 0] + strain[:, 1]),
        "void_ratio": record["void_ratio"],
    }


def strain_limit_message(gamma_stop: float, turns: NDArray[np.int64]) -> str:
    """Why a test ended that reached its largest strain."""
    message = f"the shear strain reached gamma_stop = {gamma_stop:g}"
    return message if turns[-1] else f"{message} before the first turn"


def _check_alternation(path: str, begin: float, turning: Floats) -> None:
    """Refuse turning points at which the direction of shear does not change."""
    strokes = np.sign(np.diff(turning, prepend=begin))
    wrong = np.flatnonzero((strokes == 0.0) | (strokes == np.append(0.0, strokes[:-1])))
    if len(wrong):
        raise InvalidInput(
            f"{path}[{wrong[0]}]",
            float(turning[wrong[0]]),
            f"must be a reversal of the direction of shear; the test starts at {begin:g}",
            "leave out points between two reversals",
        )


def check_reach(path: str, soil: Soil, specimen: _core.Specimen, turning: Floats, *, drained: bool) -> None:
    """Refuse turning points that PM4Sand cannot reach. For other soils the test itself shows it."""
    if not isinstance(soil, PM4Sand):
        return
    most = _largest_shear_ratio(soil, specimen, drained)
    beyond = turning[np.abs(turning) > most]
    if len(beyond):
        strength = "strength at the bounding surface" if drained else "critical-state strength"
        raise InvalidInput(
            path,
            float(beyond[0]),
            f"must be at most {most:.3f} in absolute value, the {strength} of this sand over sigma_v0",
            "it is a ratio to sigma_v0, not a stress in kPa",
        )


def _largest_shear_ratio(sand: PM4Sand, specimen: _core.Specimen, drained: bool) -> float:
    """Upper limit of the shear stress over sigma_v0.

    A stress ratio q/p = M mobilises sin(phi) = M/2, so on any plane shear stress over normal stress is at
    most tan(phi). At constant volume, dense sand dilates to the critical state, where p follows from its
    density (Boulanger and Ziotopoulou 2017).
    """
    void_ratio = specimen.void_ratio
    assert void_ratio is not None
    e_max, e_min = sand.void_ratio_limits
    density = (e_max - void_ratio) / (e_max - e_min)
    constants = _core.pm4sand_constants(sand.changed(Dr=density).core(), specimen.stress)
    sine = 0.5 * constants["Mb"]
    frictional = math.tan(math.asin(sine)) if sine < 1.0 else math.inf
    if drained:
        return frictional
    pressure = 0.01 * constants["p_atm"] * math.exp(constants["Q"] - constants["R"] / density)
    return max(frictional, 0.5 * constants["M"] * pressure / -specimen.stress[1])
