"""Simulation of a scene: the numerical core, driven through the stages and read in users' terms."""

from __future__ import annotations

import math
import os
import warnings
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._errors import InvalidInput, SandboilError, SandboilWarning, SuctionWarning, unknown_name
from .._types import Floats
from ..files.fingerprint import fingerprint
from ..ground.discretise import discretise
from ..run.columns import HANDS, Column, columns_of, with_columns
from ..scene.stages import AnyStage, Gravity, Seepage
from .description import condition_description, section_description, stage_description
from .doubts import doubts
from .motions import loaded_motions
from .probes import probes_of
from .quantities import (
    CHANNELS,
    ENVELOPES,
    SEEPAGE_FIELDS,
    moving_fields,
    pore_pressure_ratio,
)

if TYPE_CHECKING:
    from ..scene.scene import Scene

# Wall time after which the core checks for an interruption by the user, s.
LOOK_INTERVAL = 0.1

# Most threads: with more, starting them takes longer than the work that they share.
MAX_THREADS = 256

# Names in :attr:`Simulation.fingerprints` beside those of the section's parts.
STAGE_PREFIX = "stages."
OUTPUT = "output"

# More steps than any stage makes; the core counts in 64 bits.
_NO_LIMIT = 2**62


class Simulation:
    """The computation of a scene, from its geostatic stress through its stages.

    Arrays are copies, one row per node in the order of :func:`discretise` (row by row from the bottom).

    Parameters
    ----------
    scene : what is computed
    threads : that share the work; results are the same bits for any number
    columns : folder of a run that kept its free-field columns: they are read instead of computed
    keep_columns : whether to record the columns for :meth:`take_columns`

    Attributes
    ----------
    scene : as given
    particles : the nodes and their geostatic state
    probes : points of the histories
    threads : that share the work
    motions : the horizontal motion of every stage, for all of the base; None without one
    doubts : why an answer may not be what was meant; each is also a :class:`SandboilWarning`

    Raises
    ------
    InvalidInput : a motion that cannot be read or used, a spacing that leaves a region empty, threads below 1
    SimulationDiverged : from the stepping methods, when a field is no longer finite; fields stay readable
    """

    def __init__(
        self,
        scene: Scene,
        threads: int = 2,
        *,
        columns: str | os.PathLike[str] | None = None,
        keep_columns: bool = False,
    ) -> None:
        if isinstance(threads, bool) or not isinstance(threads, int) or not 1 <= threads <= MAX_THREADS:
            raise InvalidInput(
                "threads",
                threads,
                f"must be a whole number from 1 to {MAX_THREADS}",
                "as many as the machine has cores",
            )
        self.scene = scene
        self.particles = discretise(scene)
        self.probes = probes_of(scene, self.particles)
        loaded = loaded_motions(scene)
        self.motions = [None if motions is None else motions.main for motions in loaded]
        self._durations = [scene.duration(stage) for stage in scene.stages]
        self.doubts = doubts(scene, loaded)
        for doubt in self.doubts:
            warnings.warn(doubt, SandboilWarning, stacklevel=2)
        self._section = section_description(scene, self.particles)
        if scene.seepage is not None and (columns is not None or keep_columns):
            name, value = ("columns", columns) if columns is not None else ("keep_columns", keep_columns)
            raise InvalidInput(
                name,
                value,
                "cannot be used with a seepage stage: columns depend on its water",
                "leave it out",
            )
        self.threads = threads
        self._stages = [
            stage_description(scene, stage, duration, motions, self.probes)
            for stage, duration, motions in zip(scene.stages, self._durations, loaded, strict=True)
        ]
        self._water: _core.Seepage | None = None
        self._grains: _core.Simulation | None = None
        self._columns: list[Column] = []
        if scene.seepage is None:
            if columns is not None or keep_columns:
                stages = dict(zip(scene.stage_names, self._stages, strict=True))
                self._columns = columns_of(self._section, stages, columns, keep_columns)
                self._stages = with_columns(stages, self._columns, columns, keep_columns)
            self._grains = _core.Simulation(self._section, threads)
        self._index = -1
        self._begin_next_stage()

    # Driving

    @property
    def stage(self) -> str:
        """Name of the present stage, as in `scene.stage_names`."""
        return self.scene.stage_names[self._index]

    @property
    def present_stage(self) -> AnyStage:
        """The present stage."""
        return self.scene.stages[self._index]

    @property
    def progress(self) -> str:
        """How far the present stage has come, for people."""
        stage = self.present_stage
        if self.duration is not None:
            return f"{self.time:.2f} of {self.duration:g} s"
        if isinstance(stage, Gravity):
            return f"unbalanced {self.residual:.1e} of gravity, {stage.tolerance:.0e} wanted"
        return f"iteration {self.steps}"

    @property
    def time(self) -> float:
        """Time since the present stage began, s. In the gravity stage it only counts the way to rest."""
        return self._present.time

    @property
    def dt(self) -> float:
        """Present time step, s; 0 on the way to a steady state of seepage, in which no time passes."""
        if isinstance(self._present, _core.Seepage):
            return 0.0 if self.duration is None else self._present.time_step
        return self._present.time_step[0]

    @property
    def dt_limit(self) -> str:
        """What limits the time step."""
        if isinstance(self._present, _core.Seepage):
            return "steady state" if self.duration is None else "error of a step"
        return self._present.time_step[1]

    @property
    def undamped_dt(self) -> float | None:
        """Time step that the stage would have without its Rayleigh damping, s; None if it has none."""
        return None if self._grains is None else self._grains.undamped_time_step

    @property
    def is_seeping(self) -> bool:
        """Whether the present stage is of water alone: the grains do not exist yet."""
        return self._grains is None

    @property
    def follows_seepage(self) -> bool:
        """Whether the present stage is the first one on the water of a seepage stage."""
        return self._index == 1 and self.scene.seepage is not None

    @property
    def steps(self) -> int:
        """Steps made in the present stage."""
        return self._present.step

    @property
    def duration(self) -> float | None:
        """Duration of the present stage, s; None for gravity, which ends when the ground is at rest."""
        return self._durations[self._index]

    @property
    def stage_is_complete(self) -> bool:
        """Whether the present stage has reached its end."""
        return self._present.is_complete

    @property
    def is_complete(self) -> bool:
        """Whether the last stage has reached its end."""
        return self.stage_is_complete and self._index == len(self.scene.stages) - 1

    def step(self, count: int = 1) -> int:
        """Make `count` steps, beginning the next stage where one ends; returns how many were made."""
        made = 0
        while made < count and self._under_way():
            before = self._present.step
            self._advance(count - made, math.inf, LOOK_INTERVAL)
            made += self._present.step - before
        return made

    def run_stage(self) -> None:
        """Run the present stage to its end, or the next one if the present one is at its end."""
        if self._under_way():
            while not self.advance(math.inf, LOOK_INTERVAL):
                pass

    def advance(self, until: float, seconds: float) -> bool:
        """Run the present stage until its time is `until` (s) or `seconds` of wall time have passed.

        Returns whether `until` or the end of the stage is reached, to half a time step: the time step is
        never changed to meet it.
        """
        done = self._advance(_NO_LIMIT, until, seconds)
        return done or self._present.time + 0.5 * self.dt >= until

    def _advance(self, steps: int, until: float, seconds: float) -> bool:
        """Let the core advance the present stage; returns whether the stage is complete."""
        done = self._present.advance(steps=steps, until=until, seconds=seconds)
        if done and isinstance(self._present, _core.Seepage):
            self._warn_of_suction(self._present.pore_pressure())
        return done

    def _warn_of_suction(self, pressure: Floats) -> None:
        """Warn of a suction of more than one spacing's height in soil without a retention curve."""
        scene = self.scene
        assert scene.water is not None
        is_full = np.array([region.retention is None for region in scene.regions])[self.particles.region]
        lowest = int(np.argmin(np.where(is_full, pressure, np.inf)))
        if not is_full[lowest] or pressure[lowest] >= -scene.spacing * scene.water.unit_weight:
            return
        x, y = self.particles.position[lowest]
        message = (
            f"scene.stages[0] leaves a suction of {-pressure[lowest]:.3g} kPa at ({x:g}, {y:g}) m in region "
            f"{scene.regions[self.particles.region[lowest]].name!r}, which was computed as full: give "
            "it a retention curve, or draw less water out"
        )
        self.doubts.append(message)
        warnings.warn(message, SuctionWarning, stacklevel=4)

    def store(self, path: str | os.PathLike[str], note: bytes = b"") -> None:
        """Write the whole state to a file with a note, so that :meth:`restore` can continue.

        Returns when the disk has it. Raises :class:`OSError` if it cannot.
        """
        self._moving.store(path, note)

    @property
    def can_be_stored(self) -> bool:
        """Whether the present stage can be stored. Seepage cannot: it is computed again."""
        return self._grains is not None

    def restore(self, path: str | os.PathLike[str], stage: str) -> None:
        """Continue from a stored state of this scene, with the same bits as without the interruption.

        Raises :class:`DamagedState` for a file whose bytes have changed, :class:`InvalidInput` for one
        of another section or another build, and :class:`OSError`.
        """
        index = self.scene.stage_names.index(stage)
        section = self._section
        if self._water is not None:
            self.run_stage()
            section = self._with_water_of_seepage()
        self._grains = _core.Simulation.restore(section, path, self.threads)
        self._index = index

    @cached_property
    def fingerprints(self) -> dict[str, str]:
        """Fingerprints that identify the scene: of each part of the section, each stage and the output."""
        stages = (
            stage.model_dump_json().encode() if described is None else bytes(described)
            for stage, described in zip(self.scene.stages, self._stages, strict=True)
        )
        return {
            **{name: fingerprint(part) for name, part in self._section.parts().items()},
            **{
                STAGE_PREFIX + name: fingerprint(stage)
                for name, stage in zip(self.scene.stage_names, stages, strict=True)
            },
            OUTPUT: fingerprint(self.scene.output.model_dump_json().encode()),
        }

    def begin_next_stage(self) -> None:
        """End the present stage in its present state and begin the next one."""
        if self._index + 1 == len(self.scene.stages):
            raise SandboilError(f"{self.stage!r} is the last stage")
        self._begin_next_stage()

    def _under_way(self) -> bool:
        """Begin the next stage if the present one is complete; returns whether steps remain."""
        if self.stage_is_complete and not self.is_complete:
            self._begin_next_stage()
        return not self.stage_is_complete

    def _begin_next_stage(self) -> None:
        self._index += 1
        stage, description = self.present_stage, self._stages[self._index]
        if isinstance(stage, Seepage):
            conditions = [condition_description(self.scene, condition) for condition in stage.conditions]
            self._water = _core.Seepage(
                self._section, conditions=conditions, duration=stage.duration, tolerance=stage.tolerance
            )
            return
        if self._grains is None:
            self._grains = _core.Simulation(self._with_water_of_seepage(), self.threads)
        assert description is not None
        self._grains.begin(description)

    def _with_water_of_seepage(self) -> _core.Section:
        """The section at rest with the water at the end of its seepage stage."""
        assert self._water is not None
        pressure, saturation = self._water.pore_pressure(), self._water.saturation()
        self.particles = self.particles.with_pore_water(pressure, saturation)
        return section_description(self.scene, self.particles)

    @property
    def _present(self) -> _core.Simulation | _core.Seepage:
        """The part of the core that computes the present stage."""
        present = self._water if self._grains is None else self._grains
        assert present is not None
        return present

    @property
    def _moving(self) -> _core.Simulation:
        """The grains; refused in a seepage stage, which has none."""
        if self._grains is None:
            raise SandboilError(f"{self.stage!r} is computed without the grains")
        return self._grains

    def take_columns(self) -> list[tuple[Column, _core.ColumnRecord]]:
        """The columns of the present stage and what they did, if they are kept; once."""
        if self._grains is None:
            return []
        records = dict(zip(HANDS, self._grains.take_column_records(), strict=True))
        return [
            (column, record)
            for column in self._columns
            if column.stage == self.stage and (record := records[column.hand]) is not None
        ]

    # Reading

    @property
    def field_names(self) -> list[str]:
        """Names for :meth:`field` in this scene."""
        return list(SEEPAGE_FIELDS) if self._grains is None else moving_fields(self.scene)

    def field(self, name: str) -> Floats:
        """A field at the nodes: (n, 2) for displacement, velocity and acceleration, else (n,).

        Stresses (kPa) are effective and compression positive, means over a node's stress nodes; strains count
        from the beginning of the stage. Pore pressures exist only with water. See `FIELDS` for units.
        Raises :class:`InvalidInput` for an unknown name.
        """
        if name not in self.field_names:
            raise unknown_name("field", name, self.field_names)
        return self.fields([name])[name]

    def fields(self, names: list[str]) -> dict[str, Floats]:
        """Several fields of the same instant; see :meth:`field`."""
        if self._grains is None:
            water = self._water
            assert water is not None
            of_water = {
                "pore_pressure": water.pore_pressure,
                "head": water.head,
                "saturation": water.saturation,
            }
            return {name: of_water[name]() for name in names}
        core, particles = self._grains, self.particles
        excess = core.excess_pore_pressure()
        stress, strain = core.stress(), core.strain()
        # The out-of-plane stress is left out: PM4Sand does not use it, so it may be unphysical.
        sigma_h, sigma_v, tau = (stress.mean(axis=1)[:, :3] * (-1.0, -1.0, 1.0)).T
        values: dict[str, Floats] = {
            "displacement": core.displacement(),
            "velocity": core.velocity(),
            "acceleration": core.acceleration(),
            "r_u_stress": 1.0 - pore_pressure_ratio(sigma_v, particles.sigma_v_eff0),
            "sigma_v_eff": sigma_v,
            "sigma_h_eff": sigma_h,
            "p_eff": 0.5 * (sigma_v + sigma_h),
            "tau_xy": tau,
            "gamma_xy": strain[:, :, 2].mean(axis=1),
            "gamma_max": np.hypot(strain[:, :, 0] - strain[:, :, 1], strain[:, :, 2]).max(axis=1),
        }
        if excess is not None:
            values["excess_pore_pressure"] = excess
            values["pore_pressure"] = particles.pore_pressure0 + excess
            values["r_u"] = pore_pressure_ratio(excess, particles.sigma_v_eff0)
        moved = core.saturation()
        values["saturation"] = next(
            (found for found in (moved, particles.saturation0) if found is not None), np.ones(len(sigma_v))
        )
        return {name: np.ascontiguousarray(values[name]) for name in names}

    def envelope(self, name: str) -> Floats | None:
        """Largest "r_u" or "gamma_max" of all steps of the stage so far, (n,); None where it is not kept.

        Raises :class:`InvalidInput` for another name.
        """
        if name not in ENVELOPES:
            raise unknown_name("envelope", name, list(ENVELOPES))
        if self._grains is None:
            return None
        if name == "gamma_max":
            largest = self._grains.largest_shear_strain()
        else:
            excess = self._grains.largest_excess_pore_pressure()
            largest = None if excess is None else pore_pressure_ratio(excess, self.particles.sigma_v_eff0)
        # The core updates at the beginning of every step, so the present state is not included yet.
        return None if largest is None else np.maximum(largest, self.field(name))

    def take_histories(self) -> tuple[Floats, dict[str, Floats]]:
        """History samples finished since the last call: times (m,) in s, and (m, probes) by name.

        They are low-pass filtered before thinning. Empty outside a shaking stage.
        """
        if self._grains is None:
            return np.empty(0), {}
        time, values = self._grains.take_histories()
        histories = {}
        for k, channel in enumerate(self._grains.channel_names()):
            name, factor = CHANNELS.get(channel, (channel, 1.0))
            histories[name] = factor * values[:, :, k] if len(time) else np.empty((0, len(self.probes)))
        return time, histories

    def take_energy(self) -> tuple[Floats, dict[str, Floats]]:
        """Energy and mass since the last call: times (m,) in s, and (m,) by name, as in `ENERGY`.

        At the end of a step at every interval of the histories, not filtered. Empty outside a shaking stage.
        """
        if self._grains is None:
            return np.empty(0), {}
        time, values = self._grains.take_energy()
        return time, dict(zip(_core.ENERGY_NAMES, values.T, strict=True)) if len(time) else {}

    def finish_histories(self) -> None:
        """Close the last samples where a run ends before its stage."""
        if self._grains is not None:
            self._grains.finish_histories()

    # Accounting

    @property
    def residual(self) -> float:
        """Largest unbalanced acceleration over gravity in the gravity stage; infinite before a step."""
        return self._moving.residual

    @property
    def base_impedance(self) -> float | None:
        """Mean dashpot coefficient rho Cs of the base, kPa s/m; None without a compliant base."""
        impedance = None if self._grains is None else self._grains.base_impedance
        return float(np.mean(impedance)) if impedance else None

    @property
    def physics(self) -> dict[str, bool]:
        """Names of the physics that a stage may compute, and whether the present stage does."""
        return self._present.physics()

    @property
    def flow_scheme(self) -> str:
        """How pore pressure is advanced in the stage: "none", "undrained", "explicit", "implicit", ..."""
        return "seepage" if self._grains is None else self._grains.flow_scheme

    @property
    def stress_nodes(self) -> int:
        """Number of stress nodes."""
        return 0 if self._grains is None else self._grains.stress_points

    @property
    def pairs(self) -> int:
        """Pairs of stress and velocity nodes."""
        return 0 if self._grains is None else self._grains.pairs

    @property
    def discharge(self) -> list[tuple[str, float]]:
        """Kind of each seepage condition and inflow through it, m3/s per m; empty without a seepage stage."""
        seepage = self.scene.seepage
        if self._water is None or seepage is None:
            return []
        kinds = [condition.kind for condition in seepage.conditions]
        return list(zip(kinds, self._water.discharge().tolist(), strict=True))

    @property
    def water_balance(self) -> tuple[list[float], float] | None:
        """Inflow through each condition since the start, and increase of the stored water, m3 per m.

        None without a seepage stage of some duration: a steady state stores nothing.
        """
        seepage = self.scene.seepage
        if self._water is None or seepage is None or seepage.duration is None:
            return None
        inflow, stored = self._water.balance()
        return inflow.tolist(), stored

    def outlets(self, condition: int) -> Floats:
        """Where water passes a condition of the seepage stage: rows of x, y (m) and inflow (m3/s per m)."""
        if self._water is None:
            raise SandboilError("the scene has no seepage stage")
        return self._water.outlets(condition)

    def arrays(self) -> dict[str, int]:
        """Bytes of the core's arrays by name; only those that the scene needs exist."""
        return dict(self._present.arrays())

    def counters(self) -> dict[str, int]:
        """Counts of the present stage: steps, calls, and every guard that acted.

        `porosity_clips` counts porosities kept in the range of a packing, `edge_contacts` times that a
        particle of a run-out was stopped at base or side, `inadmissible_starts` stresses at rest that
        shaken soil cannot carry, `pressure_floors` stresses held at the soil's least pressure,
        `bounding_caps` those returned to PM4Sand's bounding surface, `tension_cutoffs` and `apex_returns`
        updates that ended at a cut-off of tension or at an apex, `forced_acceptances` parts of a step taken
        at the smallest size although their error was above the tolerance, `reversals` updates of a soil's
        reference stress, of which `near_neutral_reversals` could differ with other steps.
        Seepage has its own, `seepage_...`.
        """
        if self._grains is not None:
            return self._grains.counters()
        assert self._water is not None
        return {f"seepage_{name}": count for name, count in self._water.counters().items()}
