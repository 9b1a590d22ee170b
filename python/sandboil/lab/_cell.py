"""The simple shear test of Mhaski and Ramana (2025), section 6.1, on a block of particles."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, StrictBool

from .. import _core
from .._errors import InvalidInput, SandboilError
from .._types import Floats, Number
from ..core.simulation import LOOK_INTERVAL, MAX_THREADS
from ..scene.soils import Material
from ._arguments import (
    Count,
    EarthPressure,
    Integrator,
    Limit,
    Pressure,
    Ratio,
    Tolerance,
    VoidRatio,
    checked,
)
from ._results import CyclicTest, Table
from ._shear import STRAIN_RESOLUTION, STRESS_RESOLUTION, check_reach, shear_columns, strain_limit_message
from ._specimen import consolidated

# Smallest number of nodes along a side of the free centre. With one node, departure from homogeneous shear
# could not be measured.
_FEWEST_FREE = 2
# Distance of a free node from the edge of the block in kernel supports: every stencil that acts on it is
# complete.
_SUPPORTS = 2.0
# Support of the kernel over the smoothing length.
_SUPPORT = 2.0
# Round-off allowed where a length must be a multiple of the spacing.
_ROUND_OFF = 1e-6

# The weights are those of the undeformed lattice, which is no longer accurate beyond a shear strain of 0.2.
CellLimit = Annotated[Limit, Field(le=0.2)]
Length = Annotated[Number, Field(gt=0.0, description="m")]
Density = Annotated[
    Number,
    Field(gt=0.0, description="Mg/m3", json_schema_extra={"remedy": "2000 kg/m3 is written 2.0"}),
]
# The largest value that was tested.
StrainStep = Annotated[Number, Field(gt=0.0, le=1e-3, description="shear strain")]
Inertia = Annotated[Number, Field(gt=0.0, le=1.0, description="share of the confining stress")]
Damping = Annotated[Number, Field(ge=0.0, lt=1.0)]
Filter = Annotated[Number, Field(ge=0.0)]
SmoothingRatio = Annotated[Number, Field(ge=1.0, le=3.0, description="h/spacing")]
Threads = Annotated[int, Field(strict=True, ge=1, le=MAX_THREADS)]


@dataclass(frozen=True)
class CellReport:
    """Cost of a test, and the largest departure of its centre from homogeneous shear.

    Attributes
    ----------
    steps : number of time steps
    time_step : the last time step, s
    wall_time : computing time, s
    stress_nodes : number of stress nodes of the block
    computed_stress_nodes : number of stress nodes whose soil was computed: all that act on a free node
    gamma_spread : standard deviation of the shear strain over the centre, 1
    tau_spread, sigma_v_spread : standard deviations of shear and vertical stress over the centre, kPa
    volume_strain : root mean square of the volumetric strain over the centre, 1; zero if exactly undrained
    velocity_deviation : root mean square deviation of the velocities of the free nodes from Eq. 17, over the
        largest speed at the edge of the centre
    overshoot : (largest shear stress - target)/target; negative if the target was never reached
    counters : counts of operations, by name
    """

    steps: int
    time_step: float
    wall_time: float
    stress_nodes: int
    computed_stress_nodes: int
    gamma_spread: float
    tau_spread: float
    sigma_v_spread: float
    volume_strain: float
    velocity_deviation: float
    overshoot: float
    counters: dict[str, int]


@dataclass(frozen=True, eq=False, kw_only=True)
class CellNodes(Table):
    """The nodes of the block at the end of a test, in rows from the bottom.

    Attributes
    ----------
    position, velocity : (n, 2), m and m/s, relative to the centre of the block
    gamma, tau, sigma_v_eff, sigma_h_eff, r_u : (n,), as in :class:`CyclicTest`; means over the stress nodes
        of a node, nan where no soil was computed
    free : (n,), whether the node moves freely
    """

    position: Floats
    velocity: Floats
    gamma: Floats
    tau: Floats
    sigma_v_eff: Floats
    sigma_h_eff: Floats
    r_u: Floats
    free: NDArray[np.bool_]

    def columns(self) -> dict[str, NDArray[Any]]:
        """Every column by its name; a vector has one column for each component."""
        return {
            **dict(zip(("x", "y"), self.position.T, strict=True)),
            **dict(zip(("v_x", "v_y"), self.velocity.T, strict=True)),
            **{name: getattr(self, name) for name in ("gamma", "tau", "sigma_v_eff", "sigma_h_eff", "r_u")},
            "free": self.free,
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class ShearCell(CyclicTest):
    """Result of :func:`shear_cell`: a :class:`CyclicTest` of means over the stress nodes of the free centre.

    Attributes
    ----------
    nodes : nodes of the block at the end
    report : cost of the test and departure from homogeneous shear
    """

    nodes: CellNodes
    report: CellReport


@checked
def shear_cell(
    soil: Material,
    *,
    sigma_v0: Pressure = 101.3,
    K0: EarthPressure = 0.5,
    csr: Ratio,
    void_ratio: VoidRatio = None,
    gamma_stop: CellLimit = 0.05,
    max_cycles: Count = 60,
    spacing: Length = 0.01,
    size: Length = 0.3,
    free_size: Length = 0.1,
    density: Density = 2.0,
    strain_step: StrainStep = 2e-5,
    inertia: Inertia = 0.002,
    local_damping: Damping = 0.0,
    velocity_filter: Filter = 1.0,
    smoothing_ratio: SmoothingRatio = 1.4,
    integrator: Integrator = "default",
    tolerance: Tolerance = None,
    every_stress_node: StrictBool = False,
    progress: Callable[[float, float], None] | None = None,
    threads: Threads = 1,
) -> ShearCell:
    """Constant-volume cyclic simple shear of a block of particles with a freely moving centre.

    The test of Mhaski and Ramana (2025), section 6.1. The nodes around the centre have prescribed velocities
    by Eq. 17, v_x = v_x0 y / H, relative to the centre of the block. The direction reverses when the mean
    shear stress of the centre reaches `csr * sigma_v0`. The strain rate changes gradually, so that the shear
    stress due to inertia is at most `inertia` times the mean confining stress. Velocities are never reset.

    Parameters
    ----------
    soil : a material of sandboil; models written by the user (:class:`SoilModel`) are not possible here
    sigma_v0, K0, csr, void_ratio, max_cycles, integrator, tolerance : as for :func:`cyclic_dss`
    gamma_stop : shear strain at which the test ends, at most 0.2
    spacing, size, free_size : particle spacing, side of the block and side of its free centre, m
    density : total density of the soil, Mg/m3; it affects inertia only
    strain_step : largest shear strain of a time step
    inertia : largest shear stress due to inertia of the centre, over the mean confining stress
    local_damping : coefficient of Eq. 16
    velocity_filter : strength of the velocity filter, which has no effect on homogeneous shear
    smoothing_ratio : smoothing length over spacing
    every_stress_node : compute also the soil at stress nodes that do not act on a free node; the results are
        the same
    progress : called about ten times a second with the number of cycles so far and the present shear strain
    threads : number of threads; results are identical to the bit for any number

    Raises
    ------
    InvalidInput : an invalid argument, an initial stress that the soil cannot carry, or a shear stress that
        it cannot reach
    """
    where = "lab.shear_cell"
    specimen = consolidated(
        where,
        soil,
        sigma_v0=sigma_v0,
        K0=K0,
        static_shear_ratio=0.0,
        void_ratio=void_ratio,
        integrator=integrator,
        tolerance=tolerance,
    )
    check_reach(f"{where}.csr", soil, specimen, np.array([csr]), drained=False)
    _check_lattice(where, spacing, size, free_size, smoothing_ratio)
    core = _core.ShearCell(
        soil=soil.core(),
        void_ratio=void_ratio,
        density=density,
        vertical_stress=sigma_v0,
        earth_pressure_coefficient=K0,
        stress_ratio=csr,
        size=size,
        free_size=free_size,
        spacing=spacing,
        strain_step=strain_step,
        inertia=inertia,
        local_damping=local_damping,
        strain_limit=gamma_stop,
        turn_limit=2 * max_cycles,
        stress_resolution=STRESS_RESOLUTION * sigma_v0,
        strain_resolution=STRAIN_RESOLUTION,
        every_stress_node=every_stress_node,
        numerics=_core.Numerics(
            operators="conservative",
            smoothing_ratio=smoothing_ratio,
            velocity_filter=velocity_filter,
            diffusion="auto",
            acceleration_term="auto",
            dispersion_correction=False,
            geometry_strain_limit=None,
            integrator=integrator,
            integrator_tolerance=tolerance,
        ),
        threads=threads,
    )
    start = time.perf_counter()
    failure: SandboilError | None = None
    try:
        while not core.advance(seconds=LOOK_INTERVAL):
            if progress is not None:
                progress(*core.progress)
    except SandboilError as error:
        failure = error
    record, counters = core.record(), core.counters()
    nodes = _nodes(core, sigma_v0)
    turns = record["turns"]
    finished = f"max_cycles = {max_cycles} was reached"
    ended = finished if turns[-1] == 2 * max_cycles else strain_limit_message(gamma_stop, turns)
    return ShearCell(
        **shear_columns(record),
        cycle=record["cycle"],
        turns=turns,
        sigma_v0=sigma_v0,
        drained=False,
        complete=failure is None,
        ended=ended if failure is None else str(failure),
        nodes=nodes,
        report=CellReport(
            steps=counters["steps"],
            time_step=core.time_step,
            wall_time=time.perf_counter() - start,
            stress_nodes=2 * len(nodes.free),
            computed_stress_nodes=core.computed_stress_nodes,
            **core.departure(),
            counters=counters,
        ),
    )


def _nodes(core: _core.ShearCell, sigma_v0: float) -> CellNodes:
    stress, strain = core.stress().mean(axis=1), core.strain().mean(axis=1)
    return CellNodes(
        position=core.position(),
        velocity=core.velocity(),
        gamma=strain[:, 2],
        tau=stress[:, 2],
        sigma_v_eff=-stress[:, 1],
        sigma_h_eff=-stress[:, 0],
        r_u=1.0 + stress[:, 1] / sigma_v0,
        free=core.is_free(),
    )


def _check_lattice(where: str, spacing: float, size: float, free_size: float, smoothing_ratio: float) -> None:
    """Refuse sides that are not multiples of the spacing, and a block that is too small around its centre."""
    counts = []
    for name, length in (("size", size), ("free_size", free_size)):
        count = length / spacing
        if abs(count - round(count)) > _ROUND_OFF * count:
            nearest = max(round(count), 1) * spacing
            raise InvalidInput(
                f"{where}.{name}", length, f"must be a multiple of spacing = {spacing:g}", f"try {nearest:g}"
            )
        counts.append(round(count))
    across, free = counts
    if free < _FEWEST_FREE:
        raise InvalidInput(
            f"{where}.free_size",
            free_size,
            f"must be at least {_FEWEST_FREE} times the spacing",
            "use a smaller spacing",
        )
    # Distance from the outermost free node to the first position outside the block, in spacings.
    room = 0.5 * (across - free) + 1.0
    needed = _SUPPORTS * _SUPPORT * smoothing_ratio
    if (across - free) % 2 or room < needed:
        least = free + 2 * math.ceil(needed - 1.0)
        raise InvalidInput(
            f"{where}.size",
            size,
            f"must exceed free_size by an even number of spacings, at least {least - free}",
            f"try {least * spacing:g}, or a smaller spacing",
        )
