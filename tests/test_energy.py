"""Energy and mass of a shaken section: what comes in is what is held, stored, and lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from sandboil import (
    CompliantBase,
    Elastic,
    FreeField,
    Gravity,
    InvalidInput,
    Motion,
    Output,
    Rayleigh,
    Region,
    Run,
    Shaking,
    Water,
    box,
    polygon,
    run,
)
from sandboil.core.quantities import CONSTANT_FORCES, ENERGY

# What damping takes without filter and Rayleigh damping, over what came in at most: the error of the balance.
# Works are second order in the strain of a step.
CLOSURE = 1.0e-6

TALL = [Region("rock", box(x=(0, 0.5), y=(0, 40)), scenes.ROCK, dry_unit_weight=20.0)]
SHORT_PULSE = Motion.ricker(frequency=8.0, pga_g=0.1)


def unfiltered(**changes: Any) -> dict[str, Any]:
    return {"numerics": {"velocity_filter": 0.0}, **changes}


def constant_forces(energy: dict[str, Any]) -> Any:
    return sum(energy[name] for name in CONSTANT_FORCES)


def test_elastic_ground_holds_what_the_wave_brings_and_gives_it_back(tmp_path: Path) -> None:
    """A short pulse is once all inside: the integral of rho Vs v^2 of the upgoing wave."""
    stages = [Gravity(), Shaking(SHORT_PULSE, duration=1.2)]
    results = run(scenes.dry_column(**unfiltered(spacing=0.5, regions=TALL, stages=stages)), tmp_path)
    energy = results.energy()
    dt, velocity = SHORT_PULSE.upgoing_velocity()
    impedance = np.sqrt(scenes.ROCK.shear_modulus * 20.0 / 9.81)
    brought = 0.5 * impedance * float(np.sum(velocity**2)) * dt
    held = energy["kinetic"] + energy["stress"] - constant_forces(energy)
    assert held.max() == pytest.approx(brought, rel=0.01)
    assert energy["base"].max() == pytest.approx(brought, rel=0.01)
    assert abs(energy["base"][-1]) < 0.01 * brought
    assert np.abs(energy["damping"]).max() < CLOSURE * brought
    for name in ("water", "local_damping", "sides", "renewal"):
        assert not energy[name].any(), name


def test_the_balance_closes_in_liquefying_sand(tmp_path: Path) -> None:
    energy = run(scenes.column(**unfiltered()), tmp_path).energy()
    assert np.abs(energy["damping"]).max() < CLOSURE * energy["base"].max()
    lost = energy["stress"][-1] - constant_forces(energy)[-1] + energy["water"][-1]
    assert lost > 0.2 * energy["base"].max()


def test_the_parts_add_up_and_damping_only_takes(finished: Run) -> None:
    energy = finished.energy()
    assert set(energy) == {"time", *ENERGY}
    spent = sum(energy[name] for name in ("kinetic", "stress", "water", "damping", "local_damping"))
    given = sum(energy[name] for name in (*CONSTANT_FORCES, "base", "sides", "renewal"))
    np.testing.assert_allclose(spent, given, atol=1e-9 * np.abs(energy["stress"]).max())
    assert energy["damping"][-1] > 0.0
    assert np.diff(energy["damping"]).min() > -CLOSURE * energy["base"].max()
    # At every interval of the histories, the last step included.
    assert energy["time"][-1] == finished.times[-1]
    np.testing.assert_allclose(np.diff(energy["time"])[:-1], 0.005, atol=1e-3)


def test_grains_keep_their_mass(finished: Run) -> None:
    energy = finished.energy()
    solid = finished.scene.regions[0].Gs * 10.0 / 9.81
    porosities = [region.resolved(finished.scene).porosity for region in finished.scene.regions]
    assert energy["solid_mass"][0] == pytest.approx(sum((1.0 - n) * solid for n in porosities), rel=1e-12)
    assert (energy["solid_mass"] == energy["solid_mass"][0]).all()
    # Gravity has strained the ground by less than a millionth.
    assert energy["water_mass"][0] == pytest.approx(sum(porosities) * 10.0 / 9.81, rel=1e-6)


HILL = [(0, 0), (16, 0), (16, 4), (10, 4), (9, 6), (7, 6), (6, 4), (0, 4)]
SOFT = Elastic(E=5.0e4, nu=0.3)
CONTACT = [
    Region("rock", box(x=(0, 4), y=(0, 4)), scenes.ROCK, dry_unit_weight=20.0),
    Region("soft", box(x=(4, 8), y=(0, 4)), SOFT, dry_unit_weight=18.0),
]


@pytest.mark.parametrize(
    "regions",
    [[Region("hill", polygon(HILL), scenes.ROCK, dry_unit_weight=20.0)], CONTACT],
    ids=["hill", "contact"],
)
def test_free_field_sides_bring_what_the_balance_lacks(regions: list[Region], tmp_path: Path) -> None:
    stages = [Gravity(), Shaking(SHORT_PULSE, duration=0.8)]
    settings = unfiltered(spacing=0.5, regions=regions, sides=FreeField(), stages=stages, output=Output())
    energy = run(scenes.dry_column(**settings), tmp_path).energy()
    brought = energy["base"].max()
    assert np.abs(energy["sides"]).max() > 0.1 * brought
    assert np.abs(energy["damping"]).max() < CLOSURE * brought


def test_masses_that_a_renewal_changes_are_accounted(tmp_path: Path) -> None:
    """Undrained elastic ground with air in its water, which a vertical motion presses out of it and in."""
    ground = Region("soft", box(x=(0, 0.5), y=(0, 4)), Elastic(E=1.0e4, nu=0.3), Gs=2.67, porosity=0.4)
    stages = [Gravity(), Shaking(scenes.PULSE, vertical=scenes.PULSE, duration=0.8)]
    numerics = {"velocity_filter": 0.0, "geometry_strain_limit": 1.0e-4}
    scene = scenes.column(water=Water(bulk_modulus=1.0e4), regions=[ground], stages=stages, numerics=numerics)
    energy = run(scene, tmp_path).energy()
    brought = energy["base"].max()
    assert np.abs(energy["renewal"]).max() > 50.0 * CLOSURE * brought
    assert np.abs(energy["damping"]).max() < CLOSURE * brought


def test_rayleigh_damping_takes_what_a_pulse_loses_on_its_way(tmp_path: Path) -> None:
    """A wave of w fades as exp(-xi w t), with 2 xi w = a + b w^2, on its way up and down."""
    damping = Rayleigh(ratio=0.02, frequencies=(2.0, 16.0))
    stages = [Gravity(), Shaking(SHORT_PULSE, duration=1.2, rayleigh=damping)]
    energy = run(scenes.dry_column(**unfiltered(spacing=0.5, regions=TALL, stages=stages)), tmp_path).energy()
    dt, velocity = SHORT_PULSE.upgoing_velocity()
    way = 2.0 * 40.0 / np.sqrt(scenes.ROCK.shear_modulus * 9.81 / 20.0)
    low, high = (2.0 * np.pi * frequency for frequency in damping.frequencies)
    drag, viscosity = (2.0 * damping.ratio * factor / (low + high) for factor in (low * high, 1.0))
    power = np.abs(np.fft.rfft(velocity)) ** 2
    frequency = 2.0 * np.pi * np.fft.rfftfreq(len(velocity), dt)
    left = float(np.sum(power * np.exp(-(drag + viscosity * frequency**2) * way)) / np.sum(power))
    brought = 0.5 * np.sqrt(scenes.ROCK.shear_modulus * 20.0 / 9.81) * float(np.sum(velocity**2)) * dt
    assert left < 0.7
    assert energy["damping"][-1] == pytest.approx((1.0 - left) * brought, rel=0.02)
    assert np.diff(energy["damping"]).min() > -CLOSURE * brought


def test_local_damping_is_told_apart(tmp_path: Path) -> None:
    energy = run(scenes.dry_column(numerics={"local_damping": 0.05}), tmp_path).energy()
    assert (np.diff(energy["local_damping"]) >= 0.0).all()
    assert energy["local_damping"][-1] > 0.0


def test_only_shaking_has_energies(finished: Run) -> None:
    with pytest.raises(InvalidInput, match="only they have energies"):
        finished.energy("gravity")


def test_counts_are_those_of_their_stage(finished: Run) -> None:
    summary = finished.summary()
    for stage in ("gravity", "shaking"):
        assert summary[stage]["counts"]["steps"] == summary[stage]["steps"]
    assert summary["gravity"]["counts"]["plastic_updates"] == 0
    assert summary["shaking"]["counts"]["reversals"] > 0


def test_weight_does_the_work_of_its_fall(tmp_path: Path) -> None:
    """Under a vertical motion: the unit weight of a cell times the lowering of all cells."""
    stages = [
        Gravity(),
        Shaking(scenes.PULSE, vertical=scenes.PULSE, base=CompliantBase(vertical="absorbing"), duration=0.4),
    ]
    output = Output(depths=[1.0], points=[], field_dt=0.2)
    results = run(scenes.dry_column(stages=stages, output=output), tmp_path)
    energy = results.energy()
    lowered = -results.field("displacement")[:, 1]
    cell = 20.0 * 0.25**2
    fall = cell * lowered.sum()
    assert abs(fall) > 0.1
    assert energy["weight"][-1] == pytest.approx(fall, rel=1e-2)
    # The reaction carries the whole weight at the base.
    lowest = results.position[:, 1] < 0.25
    assert energy["reaction"][-1] == pytest.approx(-cell * len(lowered) * lowered[lowest].mean(), rel=1e-2)
    assert not energy["still_water"].any()
    assert not energy["load"].any()
