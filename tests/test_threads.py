"""The number of threads changes no bit of a result."""

from __future__ import annotations

import numpy as np
import pytest
import scenes
from sandboil import Gravity, Numerics, Output, Rayleigh, Region, Shaking, Simulation, box

# Loops over fewer rows than this run on one thread (sandboil-solver, parallel.rs).
FEWEST_THREADED_ROWS = 256


def computed(
    threads: int, corrected: bool
) -> tuple[dict[str, np.ndarray], np.ndarray, dict[str, np.ndarray], dict[str, int]]:
    """Fields, history times, histories and counters of ground that liquefies."""
    ground = scenes.column(
        regions=[
            Region("loose", box(x=(0, 4), y=(2, 4)), scenes.LOOSE, hydraulic_conductivity=1e-4, Gs=2.67),
            Region("dense", box(x=(0, 4), y=(0, 2)), scenes.DENSE, hydraulic_conductivity=1e-4, Gs=2.67),
        ],
        stages=[
            Gravity(),
            Shaking(scenes.PULSE, duration=0.6, rayleigh=Rayleigh(ratio=0.005, frequencies=(1.0, 10.0))),
        ],
        output=Output(depths=[1.0, 3.0]),
        numerics=Numerics(dispersion_correction=corrected),
    )
    simulation = Simulation(ground, threads=threads)
    # Every loop, also that over the stress nodes of one region, is long enough for threads.
    assert len(simulation.particles.position) >= FEWEST_THREADED_ROWS
    assert 2 * np.bincount(simulation.particles.region).min() >= FEWEST_THREADED_ROWS
    simulation.run_stage()
    simulation.run_stage()
    envelope = simulation.envelope("r_u")
    assert envelope is not None
    fields = simulation.fields(simulation.field_names) | {"envelope": envelope}
    return fields, *simulation.take_histories(), simulation.counters()


@pytest.mark.parametrize(("threads", "corrected"), [(2, False), (3, False), (2, True)])
def test_threads_give_the_same_bits(threads: int, corrected: bool) -> None:
    one, several = computed(1, corrected), computed(threads, corrected)
    assert one[0]["r_u"].max() > 0.5, "the ground must be shaken hard enough to matter"
    for name, values in one[0].items():
        np.testing.assert_array_equal(several[0][name], values, err_msg=name, strict=True)
    np.testing.assert_array_equal(several[1], one[1], strict=True)
    assert several[2].keys() == one[2].keys()
    for name, values in one[2].items():
        np.testing.assert_array_equal(several[2][name], values, err_msg=name, strict=True)
    assert several[3] == one[3]
