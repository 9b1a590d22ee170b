"""The numerical core. Private: users take `sandboil.Simulation` and `sandboil.lab`.

Units kN, m, s, Mg; x horizontal, y up. Stresses and strains are tension positive, shear strains engineering;
pore pressures are compression positive. Arrays that are given are copied, and arrays that are returned are
copies. Descriptions are immutable, are equal if all their values are, and refuse unknown names.
"""

from collections.abc import Sequence
from os import PathLike
from typing import Any, Literal, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ACCELERATION_TERM_CONDUCTIVITY",
    "ENERGY_NAMES",
    "RULES",
    "Base",
    "BaseSegment",
    "Choices",
    "ColumnRecord",
    "Condition",
    "Conductivity",
    "Gravity",
    "HalfSpace",
    "MovingCondition",
    "Numerics",
    "Outline",
    "Output",
    "Rayleigh",
    "Region",
    "Retention",
    "RunOut",
    "Section",
    "Seepage",
    "Shaking",
    "ShearCell",
    "Side",
    "Simulation",
    "Soil",
    "Specimen",
    "Water",
    "Wave",
    "__revision__",
    "__version__",
    "broken_rules",
    "carries",
    "column_identities",
    "pm4sand_constants",
    "small_strain_moduli",
    "stored_note",
]

__revision__: str
__version__: str
# Largest conductivity at which the acceleration term is chosen by itself, m/s.
ACCELERATION_TERM_CONDUCTIVITY: float
# Columns of `Simulation.take_energy`.
ENERGY_NAMES: list[str]
# Names of all rules on choices that exclude each other.
RULES: list[str]

# The section at rest

@final
class Water:
    """Pore water: unit weight (kN/m3) and bulk modulus (kPa)."""

    def __new__(cls, *, unit_weight: float, bulk_modulus: float) -> Water: ...

@final
class Conductivity:
    """Largest and smallest hydraulic conductivity, m/s, and the unit vector (x, y) of the largest."""

    def __new__(cls, *, major: float, minor: float, direction: tuple[float, float]) -> Conductivity: ...
    @property
    def major(self) -> float: ...
    @property
    def minor(self) -> float: ...
    @property
    def direction(self) -> tuple[float, float]: ...

@final
class Retention:
    """Water retention of van Genuchten: alpha (1/m), n, and the saturations at great and at no suction."""

    def __new__(cls, *, alpha: float, n: float, residual: float, full: float) -> Retention: ...
    def saturation(self, pressure_head: NDArray[np.float64]) -> NDArray[np.float64]:
        """Degree of saturation (n,) at pressure heads (n,) in m, negative in suction."""

@final
class Soil:
    """A soil model with its parameters, by the names of `sandboil.scene.soils`. Moduli and strengths in kPa.

    Every constructor raises :class:`InvalidInput` with the name of a parameter out of range.
    """

    @staticmethod
    def elastic(*, G: float, K: float) -> Soil: ...
    @staticmethod
    def pressure_elastic(*, G: float, K: float, exponent: float, p_ref: float) -> Soil: ...
    @staticmethod
    def mohr_coulomb(
        *, G: float, K: float, c: float, phi: float, psi: float, tension_cutoff: float | None = None
    ) -> Soil: ...
    @staticmethod
    def drucker_prager(
        *,
        G: float,
        K: float,
        c: float,
        phi: float,
        psi: float,
        matching: Literal["usual", "general"],
        tension_cutoff: float | None = None,
        c_residual: float | None = None,
        phi_residual: float | None = None,
        psi_residual: float | None = None,
        softening_strain: float | None = None,
    ) -> Soil: ...
    @staticmethod
    def total_stress(
        *,
        G: float,
        K: float,
        Su: float,
        criterion: Literal["tresca", "von_mises"],
        softening: Literal["exponential", "linear"],
        Sr: float | None = None,
        softening_strain: float | None = None,
    ) -> Soil: ...
    @staticmethod
    def pm4sand(
        *,
        Dr: float,
        G0: float,
        hpo: float,
        p_atm: float | None = None,
        ho: float | None = None,
        e_max: float | None = None,
        e_min: float | None = None,
        nb: float | None = None,
        nd: float | None = None,
        Ado: float | None = None,
        z_max: float | None = None,
        cz: float | None = None,
        ce: float | None = None,
        phi_cv: float | None = None,
        nu: float | None = None,
        C_GD: float | None = None,
        C_DR: float | None = None,
        C_kaf: float | None = None,
        Q: float | None = None,
        R: float | None = None,
        m: float | None = None,
        F_sed_min: float | None = None,
        p_sed_o: float | None = None,
        gap_memory: bool = False,
    ) -> Soil: ...

def small_strain_moduli(soil: Soil, stress: tuple[float, float, float, float]) -> tuple[float, float]:
    """(G, K) of a soil at rest, kPa, under an effective stress (xx, yy, xy, zz), kPa."""

def carries(soil: Soil, stress: tuple[float, float, float, float]) -> bool:
    """Whether a soil can carry an effective stress (xx, yy, xy, zz), kPa, without a change."""

def pm4sand_constants(soil: Soil, stress: tuple[float, float, float, float]) -> dict[str, float]:
    """Every constant of PM4Sand by its name at an initial effective stress (xx, yy, xy, zz), kPa.

    Raises :class:`ValueError` for another soil.
    """

@final
class Region:
    """A soil with its porosity (1), density of the grains (Mg/m3) and conductivity.

    Without `retention` all pores stay full. The ground starts at the earth pressure coefficient, and is
    elastic in the static stage with the Poisson's ratio.
    """

    def __new__(
        cls,
        *,
        soil: Soil,
        porosity: float,
        solid_density: float,
        hydraulic_conductivity: Conductivity,
        retention: Retention | None,
        earth_pressure_coefficient: float,
        static_poisson_ratio: float,
    ) -> Region: ...

@final
class Side:
    """A vertical side at `x` from `bottom` to `top`, m, and its support in statics."""

    def __new__(
        cls, *, x: float, bottom: float, top: float, support: Literal["no-slip", "free-slip"]
    ) -> Side: ...

@final
class Outline:
    """The base from left to right, (n, 2) in m, with its support in statics, and the sides if any."""

    def __new__(
        cls,
        *,
        base: NDArray[np.float64],
        base_support: Literal["no-slip", "free-slip"],
        left: Side | None,
        right: Side | None,
    ) -> Outline: ...

@final
class Numerics:
    """Numerical choices, as in `sandboil.Numerics`. None takes the default."""

    def __new__(
        cls,
        *,
        operators: Literal["conservative", "dual", "printed"],
        smoothing_ratio: float,
        velocity_filter: float,
        diffusion: Literal["auto", "implicit", "explicit"],
        acceleration_term: Literal["auto", "on", "off"],
        dispersion_correction: bool,
        geometry_strain_limit: float | None,
        integrator: str,
        integrator_tolerance: float | None,
    ) -> Numerics: ...

@final
class Section:
    """A section at rest, of n velocity nodes with two stress nodes each.

    `spacing` (dx, dy) in m; `position` (n, 2) in m; `volume` (n,) in m2; `region` (n,), the index in
    `regions` of each node; `surface_elevation` (n,) above each node, m; `vertical_effective_stress` (2 n,)
    of the stress nodes, kPa, compression positive; `pore_pressure` (n,) in kPa, (0,) without water;
    `saturation` (n,), (0,) where all pores are full; `gravity` in m/s2; `period`, the width between periodic
    sides, m.
    """

    def __new__(
        cls,
        *,
        spacing: tuple[float, float],
        position: NDArray[np.float64],
        volume: NDArray[np.float64],
        region: NDArray[np.uint32],
        regions: Sequence[Region],
        surface_elevation: NDArray[np.float64],
        vertical_effective_stress: NDArray[np.float64],
        pore_pressure: NDArray[np.float64],
        saturation: NDArray[np.float64],
        water: Water | None,
        gravity: float,
        period: float | None,
        outline: Outline,
        numerics: Numerics,
    ) -> Section: ...
    @property
    def period(self) -> float | None: ...
    def stress_positions(self) -> NDArray[np.float64]:
        """Places of the stress points at rest (m, 2), m: the order of `vertical_effective_stress`."""

    def parts(self) -> dict[str, bytes]:
        """Every part by its name, as bytes: equal parts have equal bytes."""

# Hydraulic conditions

@final
class Condition:
    """A hydraulic condition on a line, (m, 2) in m.

    `kind` is that of `sandboil.scene.conditions`; `value`s are given at ascending `time`s, s, linear between
    them and constant beyond: head and level in m, pressure in kPa, inflow and rain in m/s.
    """

    def __new__(
        cls, *, kind: str, line: NDArray[np.float64], time: Sequence[float], value: Sequence[float]
    ) -> Condition: ...

@final
class MovingCondition:
    """A condition while the ground moves, and its value at rest if it held there."""

    def __new__(cls, *, condition: Condition, at_rest: float | None) -> MovingCondition: ...

# Stages

@final
class Gravity:
    """Static stage with elastic soils, until the largest acceleration over gravity is `tolerance`."""

    def __new__(cls, *, tolerance: float, max_steps: int) -> Gravity: ...
    def __bytes__(self) -> bytes:
        """All of the stage: equal stages have equal bytes."""

@final
class Wave:
    """Velocities of an upgoing wave every `interval` s, (k,) in m/s; vertical None: zero."""

    def __new__(
        cls, *, interval: float, horizontal: NDArray[np.float64], vertical: NDArray[np.float64] | None
    ) -> Wave: ...

@final
class HalfSpace:
    """A half-space below the base: wave speeds in m/s, density in Mg/m3."""

    def __new__(cls, *, shear_speed: float, compression_speed: float | None, density: float) -> HalfSpace: ...

@final
class BaseSegment:
    """A stretch of the base between two x, m, and the index of its wave; None: no wave.

    The wave is at its left end after `delay` s, and `slowness` s later for each m to the right.
    """

    def __new__(
        cls, *, extent: tuple[float, float], wave: int | None, delay: float, slowness: float
    ) -> BaseSegment: ...

@final
class Base:
    """A compliant base. Without `half_space` its impedance is that of the soil above.

    Raises :class:`ValueError` for a segment with the index of no wave.
    """

    def __new__(
        cls,
        *,
        vertical: Literal["roller", "absorbing"],
        half_space: HalfSpace | None,
        waves: Sequence[Wave],
        segments: Sequence[BaseSegment],
    ) -> Base: ...

@final
class Rayleigh:
    """Damping of a ratio of critical (1) at two ascending frequencies, Hz."""

    def __new__(cls, *, ratio: float, frequencies: tuple[float, float]) -> Rayleigh: ...

@final
class Output:
    """What is recorded: histories at `probes`, (p, 2) in m, at an interval in s, and largest values."""

    def __new__(
        cls,
        *,
        probes: NDArray[np.float64],
        history_interval: float,
        stress_histories: bool,
        pressure_envelope: bool,
        strain_envelope: bool,
    ) -> Output: ...

@final
class Shaking:
    """Small displacements on a compliant base for `duration` s.

    `free_field` says of the left and the right side whether a free-field column stands there; `local_damping`
    is that of Eq. 16; `time_step_factor` is relative to the stability limit, None takes the default.
    """

    def __new__(
        cls,
        *,
        duration: float,
        base: Base,
        free_field: tuple[bool, bool],
        local_damping: float,
        rayleigh: Rayleigh | None,
        conditions: Sequence[MovingCondition],
        time_step_factor: float | None,
        output: Output,
    ) -> Shaking: ...
    def with_columns(
        self, *, records: tuple[ColumnRecord | None, ColumnRecord | None], record_interval: float | None
    ) -> Shaking:
        """The same stage, which reads records of the left and right columns where they are given.

        Its columns are recorded every `record_interval` s; None: not at all.
        """
    def __bytes__(self) -> bytes:
        """All of the stage: equal stages have equal bytes."""

@final
class RunOut:
    """Large displacements for `duration` s on base and sides that are held as in statics.

    `viscosity` is the coefficient of the artificial viscosity, 1; `open` says of the left and the right side
    whether it is taken away; `still_water` is the surface of the water around the ground from left to right,
    (m, 2) in m, (0, 2) without any, None: that at rest.
    """

    def __new__(
        cls,
        *,
        duration: float,
        viscosity: float,
        open: tuple[bool, bool],
        still_water: NDArray[np.float64] | None,
        local_damping: float,
        time_step_factor: float | None,
        output: Output,
    ) -> RunOut: ...
    def __bytes__(self) -> bytes:
        """All of the stage: equal stages have equal bytes."""

# Free-field columns

@final
class ColumnRecord:
    """What a free-field column did in a stage.

    `interval` between frames, s; `impedance` (rows, 3): density (Mg/m3), shear and compression wave speed
    (m/s) of every row from below; `wet`: whether pore pressure is among the values; `values` (frames, width):
    increments of nominal stress and pore pressure (kPa), velocities (m/s) and the base's traction (kPa).
    Raises :class:`ValueError` for arrays of other widths.
    """

    def __new__(
        cls, *, interval: float, impedance: NDArray[np.float64], wet: bool, values: NDArray[np.float64]
    ) -> ColumnRecord: ...
    @property
    def interval(self) -> float: ...
    @property
    def impedance(self) -> NDArray[np.float64]: ...
    @property
    def wet(self) -> bool: ...
    @property
    def values(self) -> NDArray[np.float64]: ...

def column_identities(
    section: Section, gravity: Gravity | None, stage: Shaking
) -> tuple[bytes | None, bytes | None]:
    """What identifies the left and the right column in a stage after `gravity`; None where there is none.

    Columns with equal bytes move equally, whatever stands between the sides.
    """

# Rules

@final
class Choices:
    """The choices of a scene in one of its stages that rules look at."""

    def __new__(
        cls,
        *,
        printed_operators: bool = False,
        dispersion_correction: bool = False,
        water: bool = False,
        periodic_sides: bool = False,
        free_field: bool = False,
        open_sides: bool = False,
        rayleigh_damping: bool = False,
        large_displacements: bool = False,
        hydraulic_conditions: bool = False,
        still_water: bool = False,
    ) -> Choices: ...

def broken_rules(choices: Choices) -> list[str]:
    """Names of the rules that some choices break, in the order of `RULES`."""

# Computation

@final
class Seepage:
    """Flow of water through a section at rest for `duration` s; None: to the steady state.

    `tolerance` is the error of a step in time, of saturations and of heads over their range.

    Raises :class:`InvalidInput`, :class:`SandboilError`.
    """

    def __new__(
        cls,
        section: Section,
        *,
        conditions: Sequence[Condition],
        duration: float | None,
        tolerance: float,
    ) -> Seepage: ...
    def advance(self, *, steps: int, until: float, seconds: float) -> bool:
        """Step until `until` (s), `steps` are made or `seconds` have passed; returns if it is complete."""
    @property
    def time(self) -> float: ...
    @property
    def step(self) -> int: ...
    @property
    def time_step(self) -> float: ...
    @property
    def is_complete(self) -> bool: ...
    def head(self) -> NDArray[np.float64]:
        """Total head (n,), m."""
    def pore_pressure(self) -> NDArray[np.float64]:
        """Pore pressure (n,), kPa, negative in suction."""
    def saturation(self) -> NDArray[np.float64]:
        """Degree of saturation (n,)."""
    def discharge(self) -> NDArray[np.float64]:
        """Inflow through each condition, m3/s per m."""
    def outlets(self, condition: int) -> NDArray[np.float64]:
        """Places and inflow along a condition, (k, 3): x, y (m) and m3/s per m."""
    def balance(self) -> tuple[NDArray[np.float64], float]:
        """Inflow through each condition since the start, and increase of the stored water, m3 per m."""
    def physics(self) -> dict[str, bool]:
        """Names of the physics of such a stage, and whether this one computes it."""
    def arrays(self) -> list[tuple[str, int]]:
        """Names and bytes of the arrays that exist."""
    def counters(self) -> dict[str, int]:
        """Counts of operations by name."""

@final
class Simulation:
    """A section of moving ground of n nodes and its stages.

    Raises :class:`InvalidInput`, :class:`SimulationDiverged`, :class:`SandboilError`.
    """

    def __new__(cls, section: Section, threads: int) -> Simulation: ...
    def store(self, path: str | PathLike[str], note: bytes) -> None:
        """Write the whole state and a note to a file. Raises :class:`OSError`."""
    @staticmethod
    def restore(section: Section, path: str | PathLike[str], threads: int) -> Simulation:
        """Continue from a state of the same section. Raises :class:`DamagedState`, :class:`OSError`."""
    def begin(self, stage: Gravity | Shaking | RunOut) -> None:
        """End the present stage and begin another."""
    def advance(self, *, steps: int, until: float, seconds: float) -> bool:
        """Step until `until` (s), `steps` are made or `seconds` have passed; returns if it is complete."""
    def physics(self) -> dict[str, bool]:
        """Names of the physics that a stage may compute, and whether the present stage does."""
    @property
    def time(self) -> float: ...
    @property
    def step(self) -> int: ...
    @property
    def time_step(self) -> tuple[float, str]:
        """Present time step, s, and what limits it."""
    @property
    def undamped_time_step(self) -> float | None:
        """Time step without the stage's Rayleigh damping, s; None if it has none."""
    @property
    def is_complete(self) -> bool: ...
    @property
    def residual(self) -> float:
        """Largest unbalanced acceleration over gravity in a static stage; infinite before its first step."""
    @property
    def stress_points(self) -> int: ...
    @property
    def pairs(self) -> int: ...
    @property
    def base_impedance(self) -> list[float]:
        """Dashpot coefficients of the base points, kPa s/m; empty without a compliant base."""
    @property
    def flow_scheme(self) -> str: ...
    def arrays(self) -> list[tuple[str, int]]:
        """Names and bytes of the arrays that exist."""
    def counters(self) -> dict[str, int]:
        """Counts of operations in the stage by name."""
    def position(self) -> NDArray[np.float64]:
        """Positions (n, 2), m."""
    def displacement(self) -> NDArray[np.float64]:
        """Displacements since the section was made (n, 2), m."""
    def velocity(self) -> NDArray[np.float64]:
        """Velocities (n, 2), m/s."""
    def acceleration(self) -> NDArray[np.float64]:
        """Accelerations (n, 2), m/s2."""
    def excess_pore_pressure(self) -> NDArray[np.float64] | None:
        """Excess pore pressure (n,), kPa; None without water."""
    def saturation(self) -> NDArray[np.float64] | None:
        """Degree of saturation (n,); None where it cannot change."""
    def largest_excess_pore_pressure(self) -> NDArray[np.float64] | None:
        """Largest excess pore pressure in the stage (n,), kPa; None if it is not kept."""
    def largest_shear_strain(self) -> NDArray[np.float64] | None:
        """Largest engineering shear strain in the stage (n,); None if it is not kept."""
    def stress(self) -> NDArray[np.float64]:
        """Effective stress at the stress points of each node (n, points, 4): xx, yy, xy, zz, kPa."""
    def strain(self) -> NDArray[np.float64]:
        """Strain at the stress points of each node in the stage (n, points, 3): xx, yy, xy."""
    def take_column_records(self) -> tuple[ColumnRecord | None, ColumnRecord | None]:
        """What the left and the right column did in the stage, if it is recorded; once."""
    def take_energy(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times (m,) in s, and energies and masses since the last call, (m, names of `ENERGY_NAMES`)."""
    def channel_names(self) -> list[str]: ...
    def finish_histories(self) -> None:
        """Close the samples that are not complete, where a run ends before its stage."""
    def take_histories(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times (m,) in s, and history samples since the last call, (m, probes, channels)."""

def stored_note(path: str | PathLike[str]) -> bytes:
    """The note stored with a state. Raises :class:`DamagedState`, :class:`OSError`."""

# Laboratory

@final
class Specimen:
    """A material point under an effective stress (xx, yy, xy, zz), kPa.

    `material` is a :class:`Soil`, or an object with the methods of `sandboil.lab.SoilModel`.
    """

    def __new__(
        cls,
        material: object,
        stress: tuple[float, float, float, float],
        void_ratio: float | None,
        *,
        scheme: str,
        tolerance: float | None = None,
        max_increment: float | None = None,
    ) -> Specimen: ...
    def shear(
        self,
        turns: Sequence[tuple[str, float]],
        *,
        drained: bool,
        count: int | None = None,
        strain_step: float,
        strain_limit: float,
        stress_resolution: float,
        strain_resolution: float,
    ) -> tuple[dict[str, NDArray[Any]], str]:
        """Simple shear from turn to turn, each ("stress", kPa) or ("strain", 1); with `count` two alternate.

        Returns the columns of the record by name, and how the test ended.
        """
    def path(
        self,
        rows: NDArray[np.float64],
        *,
        by_stress: tuple[bool, bool, bool],
        strain_step: float,
        stress_resolution: float,
        strain_resolution: float,
    ) -> tuple[dict[str, NDArray[Any]], str]:
        """A path through rows (m, 3) of xx, yy, xy: stresses (kPa) or total strains; returns as `shear`."""
    def copy(self) -> Specimen: ...
    def reconsolidate(self) -> bool:
        """Switch to reconsolidation after shaking; returns whether the soil has another law for it."""
    @property
    def stress(self) -> tuple[float, float, float, float]: ...
    @property
    def strain(self) -> tuple[float, float, float]: ...
    @property
    def moduli(self) -> tuple[float, float]:
        """Present (G, K), kPa."""
    @property
    def void_ratio(self) -> float | None: ...
    @property
    def plastic_shear_strain(self) -> float | None: ...
    def report(self) -> dict[str, int]:
        """Counts of operations by name."""

@final
class ShearCell:
    """Cyclic simple shear of a block of n particles; see `sandboil.lab.shear_cell`.

    `density` in Mg/m3; `vertical_stress` in kPa, compression positive; lengths in m. Raises
    :class:`InvalidInput`, :class:`SandboilError`.
    """

    def __new__(
        cls,
        *,
        soil: Soil,
        void_ratio: float | None,
        density: float,
        vertical_stress: float,
        earth_pressure_coefficient: float,
        stress_ratio: float,
        size: float,
        free_size: float,
        spacing: float,
        strain_step: float,
        inertia: float,
        local_damping: float,
        strain_limit: float,
        turn_limit: int,
        stress_resolution: float,
        strain_resolution: float,
        every_stress_node: bool,
        numerics: Numerics,
        threads: int,
    ) -> ShearCell: ...
    def advance(self, seconds: float) -> bool:
        """Step until `seconds` have passed; returns whether the test is over."""
    def record(self) -> dict[str, NDArray[Any]]:
        """Means over the centre, by name, as of :meth:`Specimen.shear`."""
    def departure(self) -> dict[str, float]:
        """Largest departures from homogeneous shear, by name."""
    @property
    def progress(self) -> tuple[float, float]:
        """Cycles made, and present shear strain."""
    @property
    def time_step(self) -> float: ...
    @property
    def computed_stress_nodes(self) -> int: ...
    def counters(self) -> dict[str, int]:
        """Counts of operations by name."""
    def is_free(self) -> NDArray[np.bool_]:
        """Whether each node moves freely (n,)."""
    def position(self) -> NDArray[np.float64]:
        """Positions (n, 2) about the centre of the block, m."""
    def velocity(self) -> NDArray[np.float64]:
        """Velocities (n, 2), m/s."""
    def stress(self) -> NDArray[np.float64]:
        """Effective stress (n, 2, 4): xx, yy, xy, zz of both stress nodes, kPa; nan if not computed."""
    def strain(self) -> NDArray[np.float64]:
        """Strain (n, 2, 3): xx, yy, xy of both stress nodes; nan if not computed."""
