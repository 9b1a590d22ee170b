"""The simple shear test of Mhaski and Ramana (2025), section 6.1, as a cell of particles."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._errors import InvalidInput
from ..materials import Elastic, PM4Sand
from ..simulation import LOOK_INTERVAL, MAX_THREADS

Floats = NDArray[np.float64]

# Columns of the core's samples.
(
    _GAMMA,
    _TAU,
    _SIGMA_YY,
    _SIGMA_XX,
    _GAMMA_SPREAD,
    _TAU_SPREAD,
    _SIGMA_SPREAD,
    _VOLUME_STRAIN,
    _VELOCITY_DEVIATION,
    _EDGE_SPEED,
) = range(10)

# Fewest nodes along a side of the free centre: with one there is no field whose freedom could show.
_FEWEST_FREE = 2
# Kernel supports between a free node and the first node missing outside: no stencil that it feels is cut.
_SUPPORTS = 2.0
# Support of the kernel over the smoothing length.
_SUPPORT = 2.0
# Largest shear strain of a test: beyond it weights of the undeformed lattice would have to be renewed.
_GAMMA_MAX = 0.2
# Round-off allowed where a length must be a multiple of the spacing.
_ROUND_OFF = 1e-6


@dataclass(frozen=True)
class CellReport:
    """What a test cost, and how far its centre was from homogeneous shear at the worst moment.

    Attributes
    ----------
    steps : time steps
    time_step : the last one, s
    wall_time : s
    stress_nodes : of the block
    computed_stress_nodes : those whose soil was computed: all that a free node feels
    gamma_spread : standard deviation of the shear strain over the centre
    tau_spread, sigma_v_spread : of the stresses, kPa
    volume_strain : root mean square of the volumetric strain over the centre; zero if exactly undrained
    velocity_deviation : root mean square departure of the free nodes from Eq. 17, over the largest speed of
        the centre's edge
    overshoot : largest stress beyond the target, over the target; negative if it was never reached
    counters : work done, by kind
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


@dataclass(frozen=True)
class ShearCell:
    """Result of :func:`shear_cell`. Stresses are effective, kPa, compression positive.

    Histories (m,) after every step are means over the stress nodes of the free centre, `turns` the samples at
    which the direction reversed. Fields (n,) or (n, 2) are those of the end, nodes row by row from the
    bottom, means over a node's stress nodes, NaN where no soil was computed.

    Attributes
    ----------
    gamma : engineering shear strain
    tau : shear stress, kPa, with the sign of gamma
    sigma_v_eff, sigma_h_eff : vertical and horizontal stress, kPa
    r_u : 1 - sigma_v_eff / sigma_v0
    cycle : 0.25 at the first peak, 0.75 at the first trough, linear in tau between
    position, velocity : m and m/s, in the frame of the block's centre
    node_tau, node_sigma_v_eff, node_sigma_h_eff : stresses, kPa
    node_r_u, node_gamma : as the histories
    free : which nodes are
    report : cost, and departure from homogeneous shear
    """

    gamma: Floats
    tau: Floats
    sigma_v_eff: Floats
    sigma_h_eff: Floats
    r_u: Floats
    cycle: Floats
    turns: NDArray[np.int64]
    position: Floats
    velocity: Floats
    node_tau: Floats
    node_sigma_v_eff: Floats
    node_sigma_h_eff: Floats
    node_r_u: Floats
    node_gamma: Floats
    free: NDArray[np.bool_]
    report: CellReport

    def cycles_to(self, *, r_u: float | None = None, gamma_sa: float | None = None) -> float:
        """Cycles until `r_u` or a single-amplitude shear strain `gamma_sa` is reached; NaN if it never is.

        Raises :class:`InvalidInput` unless exactly one of them is given.
        """
        if (r_u is None) == (gamma_sa is None):
            given = {"r_u": r_u, "gamma_sa": gamma_sa}
            raise InvalidInput("cycles_to", given, "must be given exactly one of r_u and gamma_sa")
        reached = self.r_u >= r_u if r_u is not None else np.abs(self.gamma) >= gamma_sa
        return float(self.cycle[np.argmax(reached)]) if reached.any() else math.nan


def shear_cell(
    soil: PM4Sand | Elastic,
    *,
    sigma_v0: float = 101.3,
    K0: float = 0.5,
    csr: float,
    void_ratio: float | None = None,
    gamma_stop: float = 0.05,
    max_cycles: float = 60,
    spacing: float = 0.01,
    size: float = 0.3,
    free_size: float = 0.1,
    density: float = 2.0,
    strain_step: float = 2e-5,
    inertia: float = 0.002,
    local_damping: float = 0.0,
    velocity_filter: float = 1.0,
    smoothing_ratio: float = 1.4,
    integrator: str = "default",
    integrator_tolerance: float = 1e-4,
    every_stress_node: bool = False,
    progress: Callable[[float, int], None] | None = None,
    threads: int = 1,
) -> ShearCell:
    """Constant-volume cyclic simple shear of a block whose centre moves freely.

    The test of Mhaski and Ramana (2025), section 6.1. The nodes around the centre move as Eq. 17 says,
    v_x = v_x0 y / H, seen from the block's centre. The direction reverses when the mean shear stress of the
    centre reaches `csr * sigma_v0`. The strain rate changes so slowly that inertia takes no more than the
    share `inertia` of the confining stress, so that no velocity is ever reset.

    Parameters
    ----------
    soil : what is tested
    sigma_v0 : initial vertical effective stress, kPa
    K0 : horizontal over vertical effective stress at the start
    csr : shear stress of reversal over `sigma_v0`
    void_ratio : at the start; None takes the soil's own
    gamma_stop : shear strain at which the test ends, at most 0.2
    max_cycles : cycles after which it ends
    spacing, size, free_size : particle spacing, side of the block and of its free centre, m
    density : of the soil, Mg/m3; scales nothing but inertia
    strain_step : largest shear strain of a step
    inertia : largest shear stress that the centre's inertia may take, over the mean confining stress
    local_damping : coefficient of Eq. 16
    velocity_filter : strength of the velocity filter, which vanishes where shear is homogeneous
    smoothing_ratio : smoothing length over spacing
    integrator : "default", "rk4" or "reference"
    integrator_tolerance : relative error of a sub-step of the default integrator
    every_stress_node : compute also the soil that no free node feels; changes no result
    progress : called about ten times a second with the present shear strain and the steps made
    threads : that share the work; results are the same bits for any number

    Raises
    ------
    InvalidInput : before any work
    SimulationDiverged : a field is no longer finite
    """
    if not isinstance(soil, PM4Sand | Elastic):
        raise InvalidInput("soil", soil, "must be a sandboil.PM4Sand or sandboil.Elastic")
    for name, value, most, hint in (
        ("sigma_v0", sigma_v0, math.inf, "kPa, compression positive"),
        ("K0", K0, math.inf, None),
        ("csr", csr, math.inf, "shear stress over sigma_v0, for example 0.147"),
        ("gamma_stop", gamma_stop, _GAMMA_MAX, "it is a fraction: 5 % is written 0.05"),
        ("max_cycles", max_cycles, math.inf, None),
        ("spacing", spacing, math.inf, "m"),
        ("size", size, math.inf, "m"),
        ("free_size", free_size, math.inf, "m"),
        ("density", density, math.inf, "Mg/m3: 2000 kg/m3 is written 2.0"),
        ("strain_step", strain_step, gamma_stop, "it is a strain, for example 2e-5"),
        ("inertia", inertia, 1.0, "it is a share of the confining stress, for example 0.002"),
        ("smoothing_ratio", smoothing_ratio, 3.0, None),
        ("integrator_tolerance", integrator_tolerance, 1.0, None),
    ):
        _within(name, value, most, hint)
    if void_ratio is not None:
        _within("void_ratio", void_ratio, math.inf, None)
    for name, value in (("local_damping", local_damping), ("velocity_filter", velocity_filter)):
        most = 1.0 if name == "local_damping" else math.inf
        if not _is_number(value) or value < 0.0 or value >= most:
            allowed = "must not be negative" if most == math.inf else f"must lie in [0, {most:g})"
            raise InvalidInput(name, value, allowed)
    if integrator not in ("default", "rk4", "reference"):
        raise InvalidInput("integrator", integrator, "must be 'default', 'rk4' or 'reference'")
    if isinstance(threads, bool) or not isinstance(threads, int) or not 1 <= threads <= MAX_THREADS:
        raise InvalidInput("threads", threads, f"must be a whole number from 1 to {MAX_THREADS}")
    _lattice(spacing, size, free_size, smoothing_ratio)

    core = _core.ShearCell(
        {
            "material": soil.core(),
            "void_ratio": void_ratio,
            "density": density,
            "sigma_v0": sigma_v0,
            "K0": K0,
            "csr": csr,
            "size": size,
            "free_size": free_size,
            "spacing": spacing,
            "strain_step": strain_step,
            "inertia": inertia,
            "local_damping": local_damping,
            "gamma_stop": gamma_stop,
            "max_cycles": float(max_cycles),
            "every_stress_node": every_stress_node,
            "numerics": {
                "operators": "conservative",
                "smoothing_ratio": smoothing_ratio,
                "velocity_filter": velocity_filter,
                "diffusion": "auto",
                "acceleration_term": "auto",
                "geometry_strain_limit": None,
                "integrator": integrator,
                "integrator_tolerance": integrator_tolerance,
                "gap_memory": False,
            },
        },
        threads,
    )
    start = time.perf_counter()
    while not core.advance(seconds=LOOK_INTERVAL):
        if progress is not None:
            progress(*core.progress)
    return _result(core, time.perf_counter() - start, sigma_v0, csr * sigma_v0)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _within(name: str, value: float, most: float, hint: str | None) -> None:
    """Refuse what is not a finite number above zero, up to `most`."""
    if not _is_number(value) or not 0.0 < value <= most:
        allowed = "must be positive" if most == math.inf else f"must lie in (0, {most:g}]"
        raise InvalidInput(name, value, allowed, hint)


def _lattice(spacing: float, size: float, free_size: float, smoothing_ratio: float) -> None:
    """Refuse a block that the spacing does not divide or that has no room around its centre."""
    counts = []
    for name, length in (("size", size), ("free_size", free_size)):
        count = length / spacing
        if abs(count - round(count)) > _ROUND_OFF * count:
            nearest = max(round(count), 1) * spacing
            raise InvalidInput(
                name, length, f"must be a multiple of spacing = {spacing:g}", f"try {nearest:g}"
            )
        counts.append(round(count))
    across, free = counts
    if free < _FEWEST_FREE:
        raise InvalidInput(
            "free_size", free_size, f"must be at least {_FEWEST_FREE} spacings", "take a smaller spacing"
        )
    # From the outermost free node to the first one missing outside, in spacings.
    room = 0.5 * (across - free) + 1.0
    needed = _SUPPORTS * _SUPPORT * smoothing_ratio
    if (across - free) % 2 or room < needed:
        least = free + 2 * math.ceil(needed - 1.0)
        raise InvalidInput(
            "size",
            size,
            f"must exceed free_size by an even number of spacings, at least {least - free}",
            f"try {least * spacing:g}, or a smaller spacing",
        )


def _result(core: _core.ShearCell, wall_time: float, sigma_v0: float, target: float) -> ShearCell:
    samples = core.take_samples()
    turns = core.turns().astype(np.int64)
    tau = samples[:, _TAU]
    stress, strain = core.stress().mean(axis=1), core.strain().mean(axis=1)
    counters = core.counters()
    largest = samples.max(axis=0)
    report = CellReport(
        steps=counters["steps"],
        time_step=core.time_step,
        wall_time=wall_time,
        stress_nodes=2 * len(stress),
        computed_stress_nodes=core.computed_stress_nodes,
        gamma_spread=float(largest[_GAMMA_SPREAD]),
        tau_spread=float(largest[_TAU_SPREAD]),
        sigma_v_spread=float(largest[_SIGMA_SPREAD]),
        volume_strain=float(largest[_VOLUME_STRAIN]),
        velocity_deviation=float(largest[_VELOCITY_DEVIATION] / largest[_EDGE_SPEED]),
        overshoot=float(np.abs(tau).max() / target - 1.0),
        counters=counters,
    )
    return ShearCell(
        gamma=np.ascontiguousarray(samples[:, _GAMMA]),
        tau=np.ascontiguousarray(tau),
        sigma_v_eff=-samples[:, _SIGMA_YY],
        sigma_h_eff=-samples[:, _SIGMA_XX],
        r_u=1.0 + samples[:, _SIGMA_YY] / sigma_v0,
        cycle=cycles(tau, turns, target),
        turns=turns,
        position=core.position(),
        velocity=core.velocity(),
        node_tau=stress[:, 2],
        node_sigma_v_eff=-stress[:, 1],
        node_sigma_h_eff=-stress[:, 0],
        node_r_u=1.0 + stress[:, 1] / sigma_v0,
        node_gamma=strain[:, 2],
        free=core.is_free(),
        report=report,
    )


def cycles(tau: Floats, turns: NDArray[np.int64], target: float) -> Floats:
    """Cycles done at every sample: 0.25 at the first turn, half a cycle more at each further one.

    Between turns by the share of the way that `tau` has gone; after the last one the way leads to the
    opposite `target` (kPa).
    """
    counted: Floats = np.zeros_like(tau)
    ends = [0, *(int(turn) for turn in turns)]
    for k, begin in enumerate(ends):
        last = k == len(turns)
        end = len(tau) - 1 if last else ends[k + 1]
        goal = (target if k % 2 == 0 else -target) if last else tau[end]
        before, length = (0.0, 0.25) if k == 0 else (0.5 * k - 0.25, 0.5)
        way = (tau[begin : end + 1] - tau[begin]) / (goal - tau[begin])
        counted[begin : end + 1] = before + length * np.clip(way, 0.0, 1.0)
    # Stress that wavers on its way does not undo what is done.
    return np.maximum.accumulate(counted)
