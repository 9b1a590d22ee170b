"""The level ground at the ends of the range of input: each case with its verdict, as in README.md."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
import sandboil as sb

from validation.level_ground.site import DEPTHS, LAYERS

DURATION = 12.0


class Response(NamedTuple):
    """The quantities compared: r_u over time at 4, 11 and 17 m, and the state at the end."""

    time: np.ndarray
    r_u: np.ndarray
    surface_velocity: np.ndarray
    simulation: sb.Simulation

    @property
    def r_u_max(self) -> np.ndarray:
        return self.r_u.max(axis=0)


def respond(
    *,
    layers: Any = LAYERS,
    spacing: float = 0.4,
    conductivity: float | None = 1e-3,
    bulk_modulus: float = 1.0e6,
    pga_g: float | None = 0.47,
    duration: float = DURATION,
    **numerics: Any,
) -> Response:
    motion = None if pga_g is None else sb.Motion.synthetic(pga_g=pga_g, duration=duration, seed=1)
    scene = sb.Scene(
        spacing=spacing,
        water=sb.Water(bulk_modulus=bulk_modulus),
        water_table=sb.WaterTable(depth=0),
        regions=[
            sb.Region(name, sb.box(x=(0, spacing), y=y), sand, hydraulic_conductivity=conductivity, Gs=2.67)
            for name, y, sand in layers
        ],
        stages=[sb.Gravity(), sb.Shaking(motion, duration=duration)],
        output=sb.Output(depths=DEPTHS, stress_paths=False),
        numerics=sb.Numerics(**numerics),
    )
    simulation = sb.Simulation(scene, threads=1)
    simulation.run_stage()
    simulation.run_stage()
    time, histories = simulation.take_histories()
    surface, _, *depths = range(len(simulation.probes))
    sigma_v_eff0, _ = simulation.particles.stress_at(np.array([(p.x, p.y) for p in simulation.probes]))
    for name in simulation.field_names:
        assert np.isfinite(simulation.field(name)).all(), name
    return Response(
        time,
        histories["excess_pore_pressure"][:, depths] / sigma_v_eff0[depths],
        histories["velocity_x"][:, surface],
        simulation,
    )


@cache
def usual() -> Response:
    return respond()


def densities(Dr: float) -> Any:
    return [(name, y, sb.PM4Sand(Dr=Dr, G0=sand.G0, hpo=sand.hpo)) for name, y, sand in LAYERS]


def test_conductivity_of_a_trillionth_is_undrained() -> None:
    """Stable; the same as no conductivity at all, and nothing dissipates.

    In the liquefied layer the largest r_u is a moment's peak: it moves with the step by a few hundredths.
    """
    tight, undrained = respond(conductivity=1e-12), respond(conductivity=None)
    assert (np.abs(tight.r_u_max - undrained.r_u_max) < (0.06, 0.005, 0.005)).all()
    assert (tight.r_u[-1] > 0.9 * tight.r_u_max).all()


def test_conductivity_of_one_metre_per_second_is_drained() -> None:
    """Stable at the step of the dry skeleton; pressure dissipates as fast as it is generated."""
    permeable = respond(conductivity=1.0)
    assert permeable.r_u_max.max() < 0.05
    assert permeable.simulation.dt_limit == "drained compression wave"


def test_water_a_hundred_times_softer_is_stable_and_wrong_as_announced() -> None:
    """Stable; pore pressure is too low, as the pressure coefficient B of the plan announces."""
    soft = respond(bulk_modulus=1.0e4)
    assert (soft.r_u_max < usual().r_u_max).all()
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(soft.r_u_max, usual().r_u_max, atol=0.1)
    text = str(soft.simulation.scene.plan())
    assert "0.9" in text
    assert "B" in text


@pytest.mark.filterwarnings("ignore:.*bulk_modulus:sandboil.SandboilWarning")
def test_water_a_hundred_times_stiffer_changes_nothing_but_the_step() -> None:
    """Stable; the default water is nearly incompressible already."""
    stiff = respond(bulk_modulus=1.0e8)
    assert np.abs(stiff.r_u_max - usual().r_u_max).max() < 0.05
    assert stiff.simulation.dt > 0.4 * usual().simulation.dt


def test_a_thousandth_of_gravity_hardly_moves_the_sand() -> None:
    """Stable; elastic response, negligible pore pressure."""
    faint = respond(pga_g=0.001)
    assert faint.r_u_max.max() < 0.01
    assert 1e-4 < np.abs(faint.surface_velocity).max() < 5e-3


def test_three_gravities_liquefy_everything() -> None:
    """Stable; r_u exceeds one for moments, since shaking also changes the total stress."""
    violent = respond(pga_g=3.0)
    assert (violent.r_u_max > 0.95).all()
    assert (violent.r_u_max < 1.3).all()
    # Liquefied ground isolates itself: the surface is slower than the 2 m/s of the motion.
    assert np.abs(violent.surface_velocity).max() < 2.5


def test_sand_next_to_its_loosest_liquefies_to_the_base() -> None:
    """Stable; all of it liquefies."""
    loose = respond(layers=densities(0.05))
    assert (loose.r_u_max > 0.85).all()
    # Soil this soft allows a longer step, which the run takes.
    assert loose.simulation.counters()["time_step_changes"] > 0


def test_sand_at_its_densest_does_not_liquefy() -> None:
    """Stable; less than a third of the way to liquefaction."""
    dense = respond(layers=densities(1.0))
    assert dense.r_u_max.max() < 0.35


def test_a_loose_layer_one_particle_thick_takes_the_strain() -> None:
    """Stable; the strain concentrates in the layer and its neighbours, within one kernel support."""
    dense, loose = LAYERS[2][2], LAYERS[0][2]
    layers = [("top", (10.2, 20), dense), ("thin", (10, 10.2), loose), ("low", (0, 10), dense)]
    response = respond(layers=layers, spacing=0.2)
    simulation = response.simulation
    strain = simulation.envelope("gamma_max")
    elevation = simulation.particles.position[:, 1]
    below_surface = elevation < 19.0
    place = elevation[below_surface][np.argmax(strain[below_surface])]
    assert abs(place - 10.1) < 0.6


def test_a_spacing_that_does_not_divide_the_column() -> None:
    """Stable; 20 m by 0.37 m gives rows of 0.3704 m, and the answer of 0.4 m."""
    odd = respond(spacing=0.37)
    assert odd.simulation.particles.spacing[1] == pytest.approx(20.0 / 54)
    assert np.abs(odd.r_u_max - usual().r_u_max).max() < 0.06


def test_a_hundred_seconds_of_quiet_move_nothing() -> None:
    """Exact: no displacement after the switch to the compliant base."""
    quiet = respond(pga_g=None, duration=100.0)
    assert np.abs(quiet.simulation.field("displacement")).max() < 1e-9
    assert np.abs(quiet.r_u).max() < 1e-12
