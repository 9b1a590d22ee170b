"""Shear modulus and damping as functions of the strain amplitude."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import StrictBool

from ._arguments import (
    Amplitudes,
    Count,
    EarthPressure,
    Integrator,
    Pressure,
    Soil,
    Tolerance,
    VoidRatio,
    checked,
)
from ._results import ModulusReduction
from ._shear import STRAIN_STEP, sheared
from ._specimen import consolidated

# Smallest number of increments, and of rows, per amplitude of strain: the area of a loop is accurate to 1e-4.
_STEPS = 100
_AMPLITUDES = tuple(np.logspace(-6.0, -2.0, 17).tolist())


@checked
def modulus_reduction(
    soil: Soil,
    *,
    sigma_v0: Pressure = 101.3,
    K0: EarthPressure = 0.5,
    strains: Amplitudes = _AMPLITUDES,
    cycles: Count = 3,
    drained: StrictBool = True,
    void_ratio: VoidRatio = None,
    integrator: Integrator = "default",
    tolerance: Tolerance = None,
) -> ModulusReduction:
    """Secant shear modulus and damping ratio in cyclic simple shear, for several strain amplitudes.

    Parameters
    ----------
    strains : amplitudes of the engineering shear strain, 1, shape (n,), positive; each is tested on a new
        specimen
    cycles : number of cycles at each amplitude; modulus and damping are those of the last cycle
    drained : True: constant vertical effective stress, as in resonant column and torsional shear tests.
        False: constant volume
    soil, sigma_v0, K0, void_ratio, integrator, tolerance : as for :func:`cyclic_dss`

    Raises
    ------
    InvalidInput : an invalid argument, or an initial stress that the soil cannot carry
    """
    amplitudes = np.asarray(strains, dtype=np.float64)
    found: list[tuple[float, float]] = []
    ended = "all strains were tested"
    for amplitude in amplitudes.tolist():
        specimen = consolidated(
            "lab.modulus_reduction",
            soil,
            sigma_v0=sigma_v0,
            K0=K0,
            static_shear_ratio=0.0,
            void_ratio=void_ratio,
            integrator=integrator,
            tolerance=tolerance,
        )
        largest, _ = specimen.moduli
        record, ending = sheared(
            specimen,
            [("strain", amplitude), ("strain", -amplitude)],
            count=2 * cycles + 1,
            drained=drained,
            sigma_v0=sigma_v0,
            strain_step=min(STRAIN_STEP, amplitude / _STEPS),
            strain_resolution=amplitude / _STEPS,
        )
        if ending != "complete":
            ended = f"at the strain {amplitude:g}: {ending}"
            break
        found.append(_of_last_loop(record))
    modulus, damping = np.array(found).reshape(-1, 2).T
    return ModulusReduction(
        gamma=amplitudes[: len(found)],
        G=modulus,
        damping=damping,
        G_max=largest,
        complete=len(found) == len(amplitudes),
        ended=ended,
    )


def _of_last_loop(record: dict[str, NDArray[Any]]) -> tuple[float, float]:
    """Secant modulus, kPa, and damping ratio: energy loss over 4 pi times stored energy (Kramer 1996)."""
    begin, back, end = np.flatnonzero(np.diff(record["turns"], prepend=0))[-3:]
    gamma, tau = record["strain"][:, 2], record["stress"][:, 2]
    modulus = (tau[end] - tau[back]) / (gamma[end] - gamma[back])
    amplitude = 0.5 * (gamma[end] - gamma[back])
    gamma, tau = gamma[begin : end + 1], tau[begin : end + 1]
    lost = 0.5 * np.sum((tau[1:] + tau[:-1]) * np.diff(gamma))
    return float(modulus), float(lost / (2.0 * math.pi * modulus * amplitude**2))
