"""Small scenes that the tests of runs share: seconds of wall time, with all parts of the physics."""

from __future__ import annotations

from typing import Any

from sandboil import (
    Elastic,
    Gravity,
    Motion,
    Output,
    PM4Sand,
    Region,
    Scene,
    Shaking,
    Water,
    WaterTable,
    box,
)

LOOSE = PM4Sand(Dr=0.35, G0=476.0, hpo=0.53)
DENSE = PM4Sand(Dr=0.75, G0=890.0, hpo=0.63)
ROCK = Elastic(E=2.0e5, nu=0.3)
PULSE = Motion.ricker(frequency=4.0, pga_g=0.3)


def column(**changes: Any) -> Scene:
    """2 m of loose over 2 m of dense sand under water, shaken by a pulse for 0.8 s, with what is changed."""
    settings: dict[str, Any] = {
        "spacing": 0.25,
        "water": Water(),
        "water_table": WaterTable(depth=0.0),
        "regions": [
            Region("loose", box(x=(0, 0.5), y=(2, 4)), LOOSE, hydraulic_conductivity=1e-4, Gs=2.67),
            Region("dense", box(x=(0, 0.5), y=(0, 2)), DENSE, hydraulic_conductivity=1e-4, Gs=2.67),
        ],
        "stages": [Gravity(), Shaking(PULSE, duration=0.8)],
        "output": Output(depths=[1.0, 3.0], points=[(0.25, 0.6)], field_dt=0.1),
    }
    return Scene(**(settings | changes))


def dry_column(**changes: Any) -> Scene:
    """4 m of elastic ground without water."""
    ground = Region("rock", box(x=(0, 0.5), y=(0, 4)), ROCK, dry_unit_weight=20.0)
    return column(**({"water": None, "water_table": None, "regions": [ground]} | changes))


def diverging_column() -> Scene:
    """The dry column at twice the stable time step."""
    return dry_column(numerics={"time_step_factor": 2.0})
