"""What a scene would cost, measured on the scene itself before anything is written."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._errors import SandboilWarning, SimulationDiverged
from ..core.doubts import doubts
from ..core.motions import loaded_motions
from ..core.quantities import VECTOR_FIELDS, written_fields
from ..core.simulation import LOOK_INTERVAL, Simulation
from ..ground.discretise import discretise
from ..motion import Motion
from ..motion._motion import SIGNIFICANT
from ..scene.motion_spec import MotionSpec
from ..scene.physics import Physics, computed_physics
from ..scene.stages import AnyStage
from .accuracy import with_accuracy

if TYPE_CHECKING:
    from ..scene.scene import Scene

# Wall time for which each stage is tried, s: long enough for thousands of steps of a column.
TRIAL_SECONDS = 1.5

# Skempton's B below which compressible water, not the soil, begins to decide the pore pressure: stiff sand
# under natural water (2.2e6 kPa) has 0.95.
LEAST_COEFFICIENT = 0.9

_BYTES_PER_KB, _BYTES_PER_MB = 1.0e3, 1.0e6


@dataclass(frozen=True)
class StagePlan:
    """Cost of one stage.

    Attributes
    ----------
    name : of the stage
    duration : s; None for gravity, which ends at rest, and for seepage to its steady state
    dt, dt_limit : time step at the beginning, s, and what limits it; 0 where no time passes
    undamped_dt : time step without the stage's Rayleigh damping, s; None if it has none
    steps : expected; None where they cannot be known in advance
    step_time : wall time of a step in the trial, s
    trial_steps : number of steps of the trial
    wall_time : expected, s; None where it cannot be known in advance
    """

    name: str
    duration: float | None
    dt: float
    dt_limit: str
    undamped_dt: float | None
    steps: int | None
    step_time: float
    trial_steps: int
    wall_time: float | None


@dataclass(frozen=True)
class Plan:
    """What would be computed and what it would cost. As text, a page for people.

    Attributes
    ----------
    nodes, stress_nodes, pairs : numbers of nodes and of stress-velocity node pairs
    spacing : (dx, dy), m
    threads : that the trial ran on
    accuracy : preset that filled what the scene leaves open
    physics : (name, on, why) of all that a scene can leave out; on if the core computes it in any stage
    stages : cost of each
    arrays : bytes of the core's arrays by name, in the last stage
    file_size : fields and histories in the results before compression, bytes
    pore_pressure_coefficients : Skempton's B of each region, the lowest in it; empty without water
    doubts : why the answer may not be what was meant; a run warns of them
    """

    nodes: int
    stress_nodes: int
    pairs: int
    spacing: tuple[float, float]
    threads: int
    accuracy: str
    physics: list[Physics]
    stages: list[StagePlan]
    arrays: dict[str, int]
    file_size: int
    pore_pressure_coefficients: dict[str, float]
    doubts: list[str]

    @property
    def wall_time(self) -> float | None:
        """Expected wall time of all stages, s; None if that of one is not known."""
        known = [stage.wall_time for stage in self.stages if stage.wall_time is not None]
        return sum(known) if len(known) == len(self.stages) else None

    def __str__(self) -> str:
        dx, dy = self.spacing
        width = max(len(name) for name, _, _ in self.physics)
        lines = [
            f"nodes         {self.nodes}, spacing {dx:g} x {dy:g} m",
            f"stress nodes  {self.stress_nodes}, {self.pairs} pairs with nodes",
            "",
            "physics",
            *(f"  {'on ' if on else 'off'}  {name:<{width}}  {reason}" for name, on, reason in self.physics),
            "",
            "stages",
            *(f"  {line}" for stage in self.stages for line in _stage_lines(stage)),
            "",
            f"wall time     {_duration(self.wall_time)}, threads: {self.threads}. From a trial of up to "
            f"{TRIAL_SECONDS:g} s a stage, of shaking in its strong",
            "              part: a step costs less at rest, and more in liquefied sand.",
            f"memory        {_size(sum(self.arrays.values()))}: "
            f"{', '.join(f'{name} {_size(size)}' for name, size in self.arrays.items())}",
            f"results file  {_size(self.file_size)} before compression",
        ]
        if self.pore_pressure_coefficients:
            lines += ["", "pore pressure coefficient B, the lowest in each region"]
            lines += [
                f"  {name}  {described_coefficient(value)}"
                for name, value in self.pore_pressure_coefficients.items()
            ]
        lines += [
            "",
            f"accuracy      {self.accuracy}; what presets save and cost is measured on the level ground,",
            "              see validation/README.md",
        ]
        if self.doubts:
            lines += ["", *(f"warning: {doubt}" for doubt in self.doubts)]
        return "\n".join(lines)


def _stage_lines(stage: StagePlan) -> list[str]:
    steps = f"{stage.steps} steps" if stage.steps is not None else "number of steps not known in advance"
    without = f" ({stage.undamped_dt:.3g} s without Rayleigh damping)" if stage.undamped_dt else ""
    timed = f"{steps} of {stage.dt:.3g} s, limited by the {stage.dt_limit}{without}"
    if stage.duration is not None:
        expected = f"{stage.duration:g} s, {timed}"
    else:
        expected = f"to rest, {timed}" if stage.dt > 0.0 else f"to its {stage.dt_limit}, {steps}"
    return [
        f"{stage.name}: {expected}",
        f"  {_duration(stage.wall_time)}, {stage.step_time * 1e3:.3g} ms a step in a trial of "
        f"{stage.trial_steps} steps",
    ]


def _duration(seconds: float | None) -> str:
    if seconds is None:
        return "not known in advance"
    if seconds < 90.0:
        return f"about {seconds:.2g} s"
    return f"about {seconds / 60.0:.2g} min" if seconds < 5400.0 else f"about {seconds / 3600.0:.2g} h"


def _size(count: int) -> str:
    if count < _BYTES_PER_MB:
        return f"{count / _BYTES_PER_KB:.3g} kB"
    return f"{count / _BYTES_PER_MB:.4g} MB"


def described_coefficient(value: float) -> str:
    """Skempton's B with a warning where it is too low for water that hardly compresses."""
    if value >= LEAST_COEFFICIENT:
        return f"{value:.3f}"
    return (
        f"{value:.3f}, below {LEAST_COEFFICIENT:g}: the water's bulk modulus is low for this soil, and pore "
        "pressures will be too"
    )


def pore_pressure_coefficients(scene: Scene) -> dict[str, float]:
    """Skempton's B = (K_f/n)/(K_f/n + K) of each region where it is lowest: at its highest geostatic stress.

    K is the small-strain bulk modulus of the region's soil. Empty without water.
    """
    if scene.water is None:
        return {}
    particles = discretise(scene)
    coefficients = {}
    for index, region in enumerate(scene.regions):
        vertical = -float(particles.sigma_v_eff0[particles.region == index].max())
        lateral = region.K0 * vertical
        _, bulk = _core.small_strain_moduli(region.material.core(), (lateral, vertical, 0.0, lateral))
        water = scene.water.bulk_modulus / region.resolved(scene).porosity
        coefficients[region.name] = water / (water + bulk)
    return coefficients


def plan(scene: Scene, threads: int = 2, accuracy: str = "standard") -> Plan:
    """What a run of the scene would compute and cost, from a trial of some seconds that writes nothing.

    Raises :class:`InvalidInput` for what a run would refuse.
    """
    scene = with_accuracy(scene, accuracy)
    found = doubts(scene, loaded_motions(scene))
    with warnings.catch_warnings():
        # The doubts about the scene are on the page; these are about its cut motions.
        warnings.simplefilter("ignore", SandboilWarning)
        simulation = Simulation(_from_strong_part(scene), threads)
    computed: dict[str, bool] = {}
    try:
        stages = _trials(scene, simulation, computed)
    except SimulationDiverged:
        # There will be no page that tells them.
        for doubt in found:
            warnings.warn(doubt, SandboilWarning, stacklevel=2)
        raise
    return Plan(
        nodes=len(simulation.particles.position),
        stress_nodes=simulation.stress_nodes,
        pairs=simulation.pairs,
        spacing=simulation.particles.spacing,
        threads=threads,
        accuracy=accuracy,
        physics=computed_physics(scene, computed),
        stages=stages,
        arrays=simulation.arrays(),
        file_size=_file_size(scene, simulation, stages),
        pore_pressure_coefficients=pore_pressure_coefficients(scene),
        doubts=found,
    )


def _trials(scene: Scene, simulation: Simulation, computed: dict[str, bool]) -> list[StagePlan]:
    """A trial of every stage; adds the physics that one of them computes to `computed`."""
    stages = []
    for index, stage in enumerate(scene.stages):
        if index > 0:
            simulation.begin_next_stage()
        for name, is_on in simulation.physics.items():
            computed[name] = is_on or computed.get(name, False)
        dt, dt_limit, undamped_dt = simulation.dt, simulation.dt_limit, simulation.undamped_dt
        start = time.perf_counter()
        trial_end = start + TRIAL_SECONDS
        done = False
        while not done and time.perf_counter() < trial_end:
            done = simulation.advance(np.inf, LOOK_INTERVAL)
        spent, made = time.perf_counter() - start, simulation.steps
        duration = scene.duration(stage)
        step_time = spent / max(made, 1)
        # Steps of a seepage stage grow as it goes.
        foreseen = round(duration / dt) if stage.moves and duration is not None else None
        steps = made if done else foreseen
        stages.append(
            StagePlan(
                name=scene.stage_names[index],
                duration=duration,
                dt=dt,
                dt_limit=dt_limit,
                undamped_dt=undamped_dt,
                steps=steps,
                step_time=step_time,
                trial_steps=made,
                wall_time=None if steps is None else steps * step_time,
            )
        )
    return stages


def _from_strong_part(scene: Scene) -> Scene:
    """The scene with its motions cut to begin with strong shaking: steps of a quiet start are cheaper."""
    return scene.changed(stages=[stage.with_motions(_cut_at(_strong_time(stage))) for stage in scene.stages])


def _strong_time(stage: AnyStage) -> float:
    """When strong shaking begins in the first motion of a stage, s; 0 without one."""
    spec = next((spec for _, spec in stage.motions if spec is not None), None)
    if spec is None:
        return 0.0
    motion = spec.load()
    intensity = np.cumsum(motion.acceleration_g**2)
    return float(motion.time[np.searchsorted(intensity, SIGNIFICANT[0] * intensity[-1])])


def _cut_at(begin: float) -> Callable[[MotionSpec], MotionSpec]:
    """A change that removes the first `begin` s of a motion, and leaves at least two samples."""

    def cut(spec: MotionSpec) -> MotionSpec:
        motion = spec.load()
        first = min(round(begin / motion.dt), len(motion.time) - 2)
        return MotionSpec.of(Motion(dt=motion.dt, velocity=motion.velocity[first:], kind=motion.kind))

    return cut


def _file_size(scene: Scene, simulation: Simulation, stages: list[StagePlan]) -> int:
    """Bytes of the frames and histories of a whole run, uncompressed."""
    # A seepage stage before others writes no frames.
    written = [stage for stage in stages if scene.is_at_rest or stage.name != "seepage"]
    lasting = [(stage.duration, stage.dt) for stage in written if stage.duration is not None]
    duration = sum(duration for duration, _ in lasting)
    components = 3 + sum(3 if name in VECTOR_FIELDS else 1 for name in written_fields(scene))
    frames = sum(duration / max(scene.output.field_dt, dt) for duration, dt in lasting) + len(stages)
    samples = duration / scene.output.history_dt
    channels = len(simulation.take_histories()[1]) * len(simulation.probes)
    return round(
        np.float64().nbytes * (frames * components * len(simulation.particles.position) + samples * channels)
    )
