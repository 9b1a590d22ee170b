"""The time step that `plan` announces is the limit: just below it runs hold, a quarter above they burst.

Undrained ground has the limit of a block with free corners, of which a column bears 1.3 times.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sandboil as sb

# Runs are long enough for a mode that grows by a per cent a step to overflow.
DURATION = 4.0
# Largest that the column's velocity can be, m/s: twice the motion's, with the column's own resonance.
BOUND = 1.0


def column(factor: float, conductivity: float | None, **numerics: Any) -> sb.Scene:
    """20 m of elastic ground, dry without a conductivity, at a factor of the stable time step."""
    wet: dict[str, Any] = {"water": sb.Water(), "water_table": sb.WaterTable(depth=0)}
    soil = sb.Elastic(G=4.0e4, K=8.0e4)
    return sb.Scene(
        spacing=0.4,
        regions=[
            sb.Region(
                "soil",
                sb.box(x=(0, 0.4), y=(0, 20)),
                soil,
                hydraulic_conductivity=conductivity,
                Gs=2.67,
                porosity=0.4,
            )
        ],
        stages=[sb.Gravity(), sb.Shaking(sb.Motion.synthetic(pga_g=0.3, duration=DURATION, seed=1))],
        numerics=sb.Numerics(time_step_factor=factor, **numerics),
        **({} if conductivity is None else wet),
    )


def largest_velocity(scene: sb.Scene) -> float:
    simulation = sb.Simulation(scene, threads=1)
    simulation.run_stage()
    simulation.run_stage()
    _, histories = simulation.take_histories()
    return float(np.abs(histories["velocity_x"]).max())


CASES = {
    "dry": (None, {}),
    "dry, h 1.2 dx": (None, {"smoothing_ratio": 1.2}),
    "dry, unfiltered": (None, {"velocity_filter": 0.0}),
    "undrained": (0.0, {}),
    "nearly undrained": (1e-12, {}),
    "draining, implicit": (1e-3, {"diffusion": "implicit"}),
    "draining, explicit": (1e-3, {"diffusion": "explicit"}),
    "very permeable, explicit": (1e-1, {"diffusion": "explicit"}),
    "very permeable, implicit": (1e-1, {"diffusion": "implicit"}),
}


@pytest.mark.parametrize("case", CASES)
def test_the_announced_limit_is_the_limit(case: str) -> None:
    conductivity, numerics = CASES[case]
    above = 1.5 if case == "undrained" else 1.25
    below = largest_velocity(column(0.97, conductivity, **numerics))
    assert below < BOUND
    with pytest.raises(sb.SimulationDiverged) as caught:
        largest_velocity(column(above, conductivity, **numerics))
    assert caught.value.time < DURATION
