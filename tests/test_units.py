"""Improbable values are named with the usual range and the unit that was probably meant."""

from __future__ import annotations

from typing import Any

import pytest
import sandboil as sb
import scenes
from frozen import scenes as frozen_scenes
from sandboil import CompliantBase, Elastic, Gravity, MohrCoulomb, Region, Scene, Shaking, Water, box
from sandboil.core.units import improbable

PULSE = scenes.PULSE


def ground(material: Any = scenes.ROCK, base: CompliantBase | None = None, **region: Any) -> Scene:
    """A dry column on a half-space."""
    of_region = {"dry_unit_weight": 18.0} | region
    return scenes.column(
        water=None,
        water_table=None,
        regions=[Region("soil", box(x=(0, 0.5), y=(0, 4)), material, **of_region)],
        stages=[Gravity(), Shaking(PULSE, duration=0.5, base=base or CompliantBase(600.0, 2.2))],
    )


def wet(**changes: Any) -> Scene:
    """Sand under water."""
    return scenes.column(**changes)


CASES: dict[str, tuple[Scene, str, str]] = {
    "density in kg/m3": (ground(base=CompliantBase(600.0, 2200.0)), "stages[1].base.density", "kg/m3"),
    "density in kN/m3": (ground(base=CompliantBase(600.0, 21.5)), "stages[1].base.density", "kN/m3"),
    "speed in km/s": (ground(base=CompliantBase(0.6, 2.2)), "stages[1].base.Vs", "km/s"),
    "unit weight in N/m3": (ground(dry_unit_weight=18000.0), "regions[0].dry_unit_weight", "N/m3"),
    "unit weight in kg/m3": (ground(dry_unit_weight=1800.0), "regions[0].dry_unit_weight", "kg/m3"),
    "unit weight in Mg/m3": (ground(dry_unit_weight=1.8), "regions[0].dry_unit_weight", "Mg/m3"),
    "modulus in MPa": (ground(Elastic(E=60.0, nu=0.3)), "regions[0].material.E", "MPa"),
    "modulus in Pa": (ground(Elastic(G=6e10, K=1e11)), "regions[0].material.G", "Pa"),
    "angle in radians": (
        ground(MohrCoulomb(c=5.0, phi=0.52, E=5e4, nu=0.3)),
        "regions[0].material.phi",
        "radians",
    ),
    "cohesion in Pa": (ground(MohrCoulomb(c=5e4, phi=30.0, E=5e4, nu=0.3)), "regions[0].material.c", "Pa"),
    "conductivity in cm/s": (
        wet(
            regions=[
                Region("sand", box(x=(0, 0.5), y=(0, 4)), scenes.LOOSE, hydraulic_conductivity=10.0, Gs=2.67)
            ]
        ),
        "regions[0].hydraulic_conductivity",
        "cm/s",
    ),
    "G0 in kPa": (
        wet(
            regions=[Region("sand", box(x=(0, 0.5), y=(0, 4)), sb.PM4Sand(Dr=0.5, G0=6e4, hpo=0.5), Gs=2.67)]
        ),
        "regions[0].material.G0",
        "kPa",
    ),
    "water modulus in Pa": (wet(water=Water(bulk_modulus=2.2e9)), "water.bulk_modulus", "Pa"),
    "water modulus in GPa": (wet(water=Water(bulk_modulus=2.2)), "water.bulk_modulus", "GPa"),
}


@pytest.mark.parametrize("name", CASES)
def test_an_improbable_value_is_named_with_its_unit(name: str) -> None:
    scene, path, unit = CASES[name]
    (doubt,) = improbable(scene)
    assert doubt.startswith(f"scene.{path} = ")
    assert "usual" in doubt or "friction" in doubt
    assert f"{unit} meant?" in doubt


def test_plan_and_simulation_tell_the_doubt() -> None:
    scene = CASES["density in kg/m3"][0]
    (doubt,) = improbable(scene)
    assert doubt in scene.plan().doubts
    with pytest.warns(sb.SandboilWarning, match="was kg/m3 meant"):
        sb.Simulation(scene, threads=1)


@pytest.mark.parametrize("name", frozen_scenes.ALL)
def test_probable_scenes_have_no_doubt(name: str, tmp_path: Any) -> None:
    assert improbable(frozen_scenes.ALL[name](tmp_path)) == []


def test_a_plan_that_diverges_tells_the_doubt() -> None:
    scene = ground(scenes.ROCK, dry_unit_weight=1.8e6)
    with (
        pytest.warns(sb.SandboilWarning, match="regions\\[0\\].dry_unit_weight"),
        pytest.raises(sb.SimulationDiverged),
    ):
        scene.plan()
