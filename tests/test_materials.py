"""Every soil model from Python: refusals, its form in TOML, and a small scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import scenes
from sandboil import (
    DruckerPrager,
    InvalidInput,
    MohrCoulomb,
    PressureElastic,
    Region,
    Scene,
    Simulation,
    TotalStress,
    box,
)

STIFF: dict[str, float] = {"G": 3.0e4, "K": 6.5e4}

SOUND: dict[str, tuple[type, dict[str, Any]]] = {
    "drucker_prager": (DruckerPrager, {"c": 10.0, "phi": 30.0, "psi": 5.0, **STIFF}),
    "mohr_coulomb": (MohrCoulomb, {"c": 10.0, "phi": 30.0, "psi": 5.0, **STIFF}),
    "pressure_elastic": (PressureElastic, {"exponent": 0.5, "p_ref": 100.0, **STIFF}),
    "total_stress": (TotalStress, {"Su": 20.0, "Sr": 5.0, "softening_strain": 0.05, **STIFF}),
}

# model, change, path, value, part of what is allowed, part of the hint (None: no hint)
REFUSED: list[tuple[str, dict[str, Any], str, object, str, str | None]] = [
    ("drucker_prager", {"phi": 90.0}, "material.phi", 90.0, "must lie in [0, 90)", "in degrees"),
    ("drucker_prager", {"phi": -1.0}, "material.phi", -1.0, "must lie in [0, 90)", "in degrees"),
    ("drucker_prager", {"c": -1.0}, "material.c", -1.0, "must be at least 0", "apparent cohesion"),
    ("drucker_prager", {"c": math.nan}, "material.c", None, "must be finite", "apparent cohesion"),
    ("drucker_prager", {"c": "ten"}, "material.c", "ten", "must be a number", "apparent cohesion"),
    (
        "drucker_prager",
        {"c": 0.0, "phi": 0.0, "psi": 0.0},
        "material.c",
        0.0,
        "no strength",
        "apparent cohesion",
    ),
    ("drucker_prager", {"psi": 31.0}, "material.psi", 31.0, "must be in [0, phi]", "associated flow"),
    ("drucker_prager", {"psi": -1.0}, "material.psi", -1.0, "must be at least 0", "0 keeps volume"),
    ("drucker_prager", {"cohesion": 3.0}, "material.c", 10.0, "was given twice", None),
    ("drucker_prager", {"Phi": 3.0}, "material.Phi", 3.0, "unknown key", "did you mean 'phi'?"),
    ("drucker_prager", {"E": 3.0e4}, "material", None, "exactly one pair", None),
    ("drucker_prager", {"G": 0.0}, "material.G", 0.0, "must be greater than 0", None),
    (
        "drucker_prager",
        {"tension_cutoff": 18.0},
        "material.tension_cutoff",
        18.0,
        "must be in [0, c/tan(phi)]",
        "leave it out",
    ),
    (
        "drucker_prager",
        {"matching": "usul"},
        "material.matching",
        "usul",
        "must be one of 'usual', 'general'",
        "did you mean 'usual'?",
    ),
    (
        "drucker_prager",
        {"phi_residual": 35.0, "softening_strain": 0.1},
        "material.phi_residual",
        35.0,
        "must be at most phi",
        None,
    ),
    (
        "drucker_prager",
        {"c_residual": 1.0},
        "material.softening_strain",
        None,
        "is required with c_residual",
        "shear band",
    ),
    (
        "drucker_prager",
        {"softening_strain": 0.1},
        "material.softening_strain",
        0.1,
        "needs a residual strength: c_residual, phi_residual, psi_residual",
        "leave it out",
    ),
    (
        "drucker_prager",
        {"c_residual": 1.0, "softening_strain": 1e-5},
        "material.softening_strain",
        1e-5,
        "must be larger than the loss of cohesion divided by G",
        "5 % is written 0.05",
    ),
    ("mohr_coulomb", {"phi": 90.0}, "material.phi", 90.0, "must lie in [0, 90)", "in degrees"),
    ("mohr_coulomb", {"c": -1.0}, "material.c", -1.0, "must be at least 0", "apparent cohesion"),
    ("mohr_coulomb", {"psi": 31.0}, "material.psi", 31.0, "must be in [0, phi]", "associated flow"),
    ("mohr_coulomb", {"matching": "usual"}, "material.matching", "usual", "unknown key", None),
    ("mohr_coulomb", {"K": None}, "material", {"G": 3.0e4}, "exactly one pair", None),
    (
        "mohr_coulomb",
        {"tension_cutoff": 18.0},
        "material.tension_cutoff",
        18.0,
        "must be in [0, c/tan(phi)]",
        "leave it out",
    ),
    ("pressure_elastic", {"exponent": 1.5}, "material.exponent", 1.5, "must lie in [0, 1]", "0.5 for sand"),
    ("pressure_elastic", {"p_ref": 0.0}, "material.p_ref", 0.0, "must be greater than 0", None),
    ("pressure_elastic", {"pref": 1.0}, "material.pref", 1.0, "unknown key", "did you mean 'p_ref'?"),
    ("pressure_elastic", {"nu": 0.3}, "material", None, "exactly one pair", None),
    ("total_stress", {"Su": 0.0}, "material.Su", 0.0, "must be greater than 0", "grows with pressure"),
    ("total_stress", {"Sr": 21.0}, "material.Sr", 21.0, "must be at most Su", "a soil that does not soften"),
    ("total_stress", {"SU": 3.0}, "material.SU", 3.0, "unknown key", "did you mean 'Su'?"),
    ("total_stress", {"undrained_strength": 3.0}, "material.Su", 20.0, "was given twice", None),
    (
        "total_stress",
        {"softening_strain": None},
        "material.softening_strain",
        None,
        "is required with Sr",
        "shear band",
    ),
    (
        "total_stress",
        {"Sr": None},
        "material.softening_strain",
        0.05,
        "needs a residual strength: Sr",
        "leave it out",
    ),
    (
        "total_stress",
        {"softening_strain": 1e-4},
        "material.softening_strain",
        1e-4,
        "must be larger than (Su - Sr)/G",
        "5 % is written 0.05",
    ),
    (
        "total_stress",
        {"criterion": "mises"},
        "material.criterion",
        "mises",
        "must be one of 'tresca', 'von_mises'",
        "did you mean 'von_mises'?",
    ),
    (
        "total_stress",
        {"softening": "exponental"},
        "material.softening",
        "exponental",
        "must be one of 'exponential', 'linear'",
        "did you mean 'exponential'?",
    ),
]


@pytest.mark.parametrize(("kind", "change", "path", "value", "allowed", "hint"), REFUSED)
def test_slip_is_refused_with_path_value_allowed_and_remedy(
    kind: str, change: dict[str, Any], path: str, value: object, allowed: str, hint: str | None
) -> None:
    model, sound = SOUND[kind]
    with pytest.raises(InvalidInput) as caught:
        model(**(sound | change))
    refused = caught.value
    assert refused.path == path
    assert value is None or refused.value == value
    assert allowed in refused.allowed
    if hint is not None:
        assert refused.hint is not None
        assert hint in refused.hint


def shaken(kind: str, **change: Any) -> Scene:
    """4 m of the soil under water, shaken by a pulse."""
    model, sound = SOUND[kind]
    ground = Region(
        "soil",
        box(x=(0, 0.5), y=(0, 4)),
        model(**(sound | change)),
        hydraulic_conductivity=1e-5,
        Gs=2.67,
        porosity=0.4,
        K0=0.5,
    )
    return scenes.column(regions=[ground])


@pytest.mark.parametrize("kind", SOUND)
def test_scene_says_the_same_in_toml_and_refuses_alike(kind: str) -> None:
    scene = shaken(kind)
    assert scene.regions[0].material.kind == kind
    for resolved in (False, True):
        assert Scene.from_toml(scene.to_toml(resolved=resolved)) == scene
    with pytest.raises(InvalidInput) as refused:
        Scene.from_toml(scene.to_toml().replace(f'kind = "{kind}"', f'kind = "{kind}"\nG0 = 1.0'))
    assert refused.value.path == "scene.regions[0].material.G0"


def test_a_refusal_of_the_core_names_the_region() -> None:
    text = shaken("drucker_prager").to_toml().replace("psi = 5.0", "psi = 40.0")
    with pytest.raises(
        InvalidInput, match=r"scene\.regions\[0\]\.material\.psi = 40\.0: must be in \[0, phi\]"
    ):
        Scene.from_toml(text)


@pytest.mark.parametrize("kind", SOUND)
def test_small_scene_runs_through_gravity_and_shaking(kind: str) -> None:
    simulation = Simulation(shaken(kind), threads=1)
    simulation.run_stage()
    at_rest = simulation.field("sigma_v_eff")
    simulation.run_stage()
    assert simulation.is_complete
    assert simulation.counters()["plastic_updates"] == simulation.steps * simulation.stress_nodes
    for name in ("displacement", "velocity", "sigma_v_eff", "excess_pore_pressure"):
        assert np.isfinite(simulation.field(name)).all()
    assert np.hypot(*simulation.field("displacement").T).max() < 0.1
    assert np.abs(simulation.field("sigma_v_eff") - at_rest).max() < at_rest.max()


COHESIVE: list[tuple[str, dict[str, Any], dict[str, Any]]] = [
    ("drucker_prager", {"c": 3.0, "phi": 0.0, "psi": 0.0}, {"c": 300.0, "phi": 0.0, "psi": 0.0}),
    ("mohr_coulomb", {"c": 3.0, "phi": 0.0, "psi": 0.0}, {"c": 300.0, "phi": 0.0, "psi": 0.0}),
    ("total_stress", {"Su": 3.0, "Sr": None, "softening_strain": None}, {"Su": 300.0}),
]


@pytest.mark.parametrize(("kind", "weak", "strong"), COHESIVE)
def test_weak_ground_shears_no_more_than_its_strength(
    kind: str, weak: dict[str, Any], strong: dict[str, Any]
) -> None:
    """Strength weaker than the pulse: tau stays below it, and the ground is strained more."""
    simulation = Simulation(shaken(kind, **weak), threads=1)
    simulation.run_stage()
    largest = 0.0
    while not simulation.is_complete:
        simulation.step(50)
        largest = max(largest, float(np.abs(simulation.field("tau_xy")).max()))
    assert 2.5 < largest < 3.0 * (1.0 + 1e-9)
    elastic = Simulation(shaken(kind, **strong), threads=1)
    elastic.run_stage()
    elastic.run_stage()
    assert simulation.field("gamma_max").max() > 3.0 * elastic.field("gamma_max").max()


def test_stiffness_follows_the_pressure_when_shaking_begins() -> None:
    """The impedance of the base is rho Cs of the ground above it, at its pressure."""

    def begun(exponent: float) -> Simulation:
        simulation = Simulation(shaken("pressure_elastic", exponent=exponent), threads=1)
        simulation.run_stage()
        simulation.step(1)
        return simulation

    soft, stiff = begun(1.0), begun(0.0)
    bottom = soft.field("sigma_v_eff").argmax()
    pressure = (soft.field("sigma_v_eff")[bottom] + 2.0 * soft.field("sigma_h_eff")[bottom]) / 3.0
    # The base lies half a spacing below the lowest nodes.
    ratio = np.divide(soft.base_impedance, stiff.base_impedance)
    assert ratio == pytest.approx(np.sqrt(pressure / 100.0), rel=0.06)
