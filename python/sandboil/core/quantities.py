"""What can be read of a simulation: names, units, signs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._types import Floats

if TYPE_CHECKING:
    from ..scene.scene import Scene


@dataclass(frozen=True)
class Quantity:
    """Unit of a stored quantity, and one line that describes it, with its sign."""

    unit: str
    description: str


# Every quantity that can be read of a run, in the order in which it is written.
FIELDS: dict[str, Quantity] = {
    "displacement": Quantity("m", "since the scene was made, (x, y)"),
    "velocity": Quantity("m/s", "(x, y)"),
    "acceleration": Quantity("m/s2", "(x, y)"),
    "excess_pore_pressure": Quantity("kPa", "since shaking began, compression positive"),
    "pore_pressure": Quantity("kPa", "at rest and excess, compression positive, suction negative"),
    "head": Quantity("m", "total head, pressure head and elevation"),
    "saturation": Quantity("1", "water per volume of pores"),
    "r_u": Quantity("1", "excess pore pressure over the geostatic vertical effective stress"),
    "r_u_stress": Quantity("1", "one minus vertical effective stress over its geostatic value"),
    "sigma_v_eff": Quantity("kPa", "vertical effective stress, compression positive"),
    "sigma_h_eff": Quantity("kPa", "horizontal effective stress, compression positive"),
    "p_eff": Quantity(
        "kPa", "mean (sigma_v_eff + sigma_h_eff)/2 in the plane, as in PM4Sand, compression positive"
    ),
    "tau_xy": Quantity("kPa", "shear stress, positive with a positive gamma_xy"),
    "gamma_xy": Quantity("1", "engineering shear strain since the stage began"),
    "gamma_max": Quantity("1", "largest engineering shear strain in the plane since the stage began"),
}

# Fields that exist only with water.
WATER_FIELDS = ("excess_pore_pressure", "pore_pressure", "r_u")

# Fields of a seepage stage.
SEEPAGE_FIELDS = ("pore_pressure", "head", "saturation")

# Fields with two components.
VECTOR_FIELDS = ("displacement", "velocity", "acceleration")

# Fields of which the largest value over all steps can be kept.
ENVELOPES = ("r_u", "gamma_max")

# The core's history channels: the name here, and the factor from tension positive to compression positive.
CHANNELS: dict[str, tuple[str, float]] = {
    "stress_xx": ("sigma_h_eff", -1.0),
    "stress_yy": ("sigma_v_eff", -1.0),
    "stress_xy": ("tau_xy", 1.0),
    "strain_xx": ("epsilon_h", -1.0),
    "strain_yy": ("epsilon_v", -1.0),
}

# What histories hold besides the components of the fields.
HISTORIES: dict[str, Quantity] = {
    **{
        f"{name}_{axis}": Quantity(FIELDS[name].unit, f"{axis} component")
        for name in ("acceleration", "velocity", "displacement")
        for axis in "xy"
    },
    **{name: FIELDS[name] for name in (*WATER_FIELDS, "r_u_stress", "sigma_v_eff", "sigma_h_eff", "tau_xy")},
    "epsilon_h": Quantity("1", "horizontal strain since the stage began, shortening positive"),
    "epsilon_v": Quantity("1", "vertical strain since the stage began, shortening positive"),
    "gamma_xy": FIELDS["gamma_xy"],
}

# Histories that are kept only if `output.stress_paths` is set.
STRESS_HISTORIES = (
    "r_u_stress",
    "sigma_v_eff",
    "sigma_h_eff",
    "tau_xy",
    "epsilon_h",
    "epsilon_v",
    "gamma_xy",
)


# Names whose sum is the work of all constant forces.
CONSTANT_FORCES = ("weight", "still_water", "reaction", "renewal_force", "load")

# Energies and masses of a stage of shaking, in the core's order. Works count from its beginning.
ENERGY: dict[str, Quantity] = {
    "kinetic": Quantity("kJ/m", "kinetic energy"),
    "stress": Quantity("kJ/m", "work of effective stress on the soil: stored, and dissipated by plasticity"),
    "water": Quantity("kJ/m", "work on the pore water beyond its state at rest"),
    "damping": Quantity("kJ/m", "dissipated by the velocity filter and Rayleigh damping"),
    "local_damping": Quantity("kJ/m", "dissipated by local damping"),
    "weight": Quantity("kJ/m", "work of the weight"),
    "still_water": Quantity("kJ/m", "work of the pore pressure at rest"),
    "reaction": Quantity("kJ/m", "work of the forces that balance the state at the start of the stage"),
    "renewal_force": Quantity("kJ/m", "work of the forces that balance renewed weights"),
    "load": Quantity("kJ/m", "work of loads"),
    "base": Quantity("kJ/m", "inflow through the base, less outflow"),
    "sides": Quantity("kJ/m", "inflow through free-field sides, less outflow"),
    "renewal": Quantity("kJ/m", "kinetic energy gained where a renewal of the geometry changes masses"),
    "solid_mass": Quantity("Mg/m", "mass of the grains"),
    "water_mass": Quantity("Mg/m", "mass of water that fills the pores, as of the last geometry"),
}


def written_fields(scene: Scene) -> list[str]:
    """Names of the fields that a run of a scene writes: of the water alone if nothing else may move."""
    return list(SEEPAGE_FIELDS) if scene.is_at_rest else moving_fields(scene)


def moving_fields(scene: Scene) -> list[str]:
    absent = {"head"}
    if scene.water is None:
        absent |= set(WATER_FIELDS)
    if not scene.is_partly_saturated:
        absent.add("saturation")
    return [name for name in FIELDS if name not in absent]


def pore_pressure_ratio(pressure: Floats, sigma_v_eff0: Floats) -> Floats:
    """Pressure over the geostatic vertical effective stress; nan where that is not positive (the surface)."""
    positive = sigma_v_eff0 > 0.0
    ratio: Floats = np.where(positive, pressure / np.where(positive, sigma_v_eff0, 1.0), np.nan)
    return ratio
