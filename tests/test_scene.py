"""A scene is the same in Python and TOML; values that follow from those given."""

from __future__ import annotations

import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from sandboil import (
    CompliantBase,
    Gravity,
    MotionSpec,
    Numerics,
    Output,
    Rayleigh,
    Region,
    RunOut,
    Scene,
    Shaking,
    Water,
    WaterTable,
    _core,
    box,
    discretise,
    polygon,
)
from sandboil._errors import InvalidInput
from sandboil.core.description import section_description
from sandboil.motion import Motion
from sandboil.scene.phases import REFERENCE_WATER_DENSITY
from sandboil.scene.rules import MESSAGES
from sandboil.scene.soils import Elastic, PM4Sand

LEVEL_GROUND = Path(__file__).parents[1] / "examples" / "level_ground"
SAND = PM4Sand(Dr=0.55, G0=677.0, hpo=0.40)


def column(**changes: Any) -> Scene:
    """One layer of saturated sand, 1 m wide and 10 m high, with changes."""
    settings: dict[str, Any] = {
        "spacing": 0.5,
        "water": Water(),
        "water_table": WaterTable(depth=0.0),
        "regions": [Region("sand", box(x=(0, 1), y=(0, 10)), SAND, hydraulic_conductivity=1e-3, Gs=2.67)],
        "stages": [Gravity(), Shaking(duration=1.0)],
    }
    return Scene(**(settings | changes))


def dry_column(**densities: float) -> Scene:
    region = Region("rock", box(x=(0, 1), y=(0, 10)), Elastic(G=1.0e4, K=2.0e4), **densities)
    return column(water=None, water_table=None, regions=[region])


# The example


def test_example_is_the_same_in_python_and_toml() -> None:
    from_toml = Scene.from_toml(LEVEL_GROUND / "scene.toml")
    from_python = runpy.run_path(str(LEVEL_GROUND / "scene.py"))["scene"]
    assert from_toml == from_python


def test_example_is_the_site_of_the_paper() -> None:
    scene = Scene.from_toml(LEVEL_GROUND / "scene.toml")
    parts = [
        (r.shape.geometry.bounds, r.material.Dr, r.material.G0, r.material.hpo)
        for r in scene.regions
        if isinstance(r.material, PM4Sand)
    ]
    assert parts == [
        ((0.0, 12.0, 1.0, 20.0), 0.35, 476.0, 0.53),
        ((0.0, 6.0, 1.0, 12.0), 0.55, 677.0, 0.40),
        ((0.0, 0.0, 1.0, 6.0), 0.75, 890.0, 0.63),
    ]
    assert all((r.Gs, r.K0, r.hydraulic_conductivity) == (2.67, 0.5, 1.0e-3) for r in scene.regions)
    assert scene.water == Water(unit_weight=10.0, bulk_modulus=1.0e6)
    assert scene.water_level_at(np.array([0.5])) == 20.0
    # The reference's base: saturated density 2.100 Mg/m3 under nu 1/3 statics.
    assert scene.regions[2].resolved(scene).saturated_density == pytest.approx(2.100, abs=5e-4)
    assert scene.regions[2].initial_poisson_ratio == pytest.approx(1.0 / 3.0)
    gravity, shaking = scene.stages
    assert gravity == Gravity()
    assert isinstance(shaking, Shaking)
    assert (shaking.duration, shaking.base) == (40.0, CompliantBase())
    assert shaking.motion is not None
    assert shaking.motion.load() == Motion.synthetic(pga_g=0.47)


# Round trip

positive = st.floats(1.0e-3, 1.0e6)
sands = st.builds(
    PM4Sand,
    Dr=st.floats(0.05, 1.0),
    G0=st.floats(100.0, 2000.0),
    hpo=st.floats(0.01, 10.0),
    nu=st.none() | st.floats(0.0, 0.49),
    z_max=st.none() | positive,
    phi_cv=st.none() | st.floats(20.0, 40.0),
)
rocks = st.builds(Elastic, G=positive, K=positive) | st.builds(Elastic, E=positive, nu=st.floats(0.0, 0.49))
motions = st.one_of(
    st.none(),
    st.builds(Motion.ricker, frequency=st.floats(0.5, 5.0), pga_g=st.floats(0.01, 1.0)),
    st.builds(
        Motion,
        dt=st.floats(0.001, 0.02),
        acceleration_g=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=20),
        kind=st.sampled_from(["outcrop", "upgoing"]),
    ),
    st.builds(Motion, dt=st.just(0.01), velocity=st.lists(st.floats(-0.1, 0.1), min_size=2, max_size=20)),
)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    levels = [0.0]
    for thickness in draw(st.lists(st.floats(0.5, 5.0), min_size=1, max_size=4)):
        levels.append(levels[-1] + thickness)
    wet = draw(st.booleans())
    regions = []
    for i in range(len(levels) - 1):
        material = draw(sands | rocks)
        bottom, top = levels[i], levels[i + 1]
        corners = [(0.0, bottom), (1.0, bottom), (1.0, top), (0.0, top)]
        regions.append(
            Region(
                f"layer {i}",
                draw(st.sampled_from([box(x=(0.0, 1.0), y=(bottom, top)), polygon(corners)])),
                material,
                hydraulic_conductivity=draw(st.none() | st.floats(0.0, 1.0)),
                Gs=draw(st.floats(2.0, 3.0)),
                porosity=draw(st.floats(0.2, 0.6)) if isinstance(material, Elastic) else None,
                K0=draw(st.floats(0.1, 0.9)),
            )
        )
    rayleigh = draw(
        st.none()
        | st.builds(
            Rayleigh,
            ratio=st.floats(0.001, 0.3),
            frequencies=st.tuples(st.floats(0.01, 2.0), st.floats(3.0, 1000.0)),
        )
    )
    printed = Numerics(operators="printed", local_damping=0.05)
    shaking = Shaking(
        draw(motions),
        base=draw(st.sampled_from([CompliantBase(), CompliantBase(Vs=300.0, density=2.1)])),
        duration=draw(st.floats(0.1, 100.0)),
        rayleigh=rayleigh,
    )
    return Scene(
        spacing=draw(st.floats(0.05, 0.5)),
        gravity=draw(st.floats(1.0, 20.0)),
        water=Water(bulk_modulus=draw(positive)) if wet else None,
        water_table=WaterTable(elevation=levels[-1] + draw(st.floats(0.0, 10.0))) if wet else None,
        regions=regions,
        stages=[Gravity(tolerance=draw(st.floats(1e-8, 1e-2))), *draw(st.sampled_from([[], [shaking]]))],
        output=draw(st.sampled_from([Output(), Output(depths=[0.1, 0.25], points=[(0.5, 0.25)])])),
        numerics=draw(st.sampled_from([Numerics()] if rayleigh else [Numerics(), printed])),
    )


@given(scenes(), st.booleans())
def test_toml_gives_the_equal_scene_back(scene: Scene, resolved: bool) -> None:
    text = scene.to_toml(resolved=resolved)
    again = Scene.from_toml(text)
    assert again == scene
    assert again.to_toml(resolved=resolved) == text


@given(motions.filter(lambda motion: motion is not None))
def test_motion_comes_back_bit_for_bit(motion: Motion) -> None:
    stage = Scene.from_toml(column(stages=[Gravity(), Shaking(motion)]).to_toml()).stages[1]
    assert isinstance(stage, Shaking)
    assert stage.motion is not None
    assert stage.motion.load() == motion


def test_toml_holds_given_values_and_every_default_on_request() -> None:
    scene = column(numerics=Numerics(velocity_filter=0.2))
    text = scene.to_toml()
    assert "velocity_filter = 0.2" in text
    assert "smoothing_ratio" not in text
    assert "smoothing_ratio = 1.4" in scene.to_toml(resolved=True)
    dual = column(numerics=Numerics(operators="dual")).to_toml(resolved=True)
    assert "smoothing_ratio = 1.2" in dual


def test_file_is_written_and_read(tmp_path: Path) -> None:
    scene = column()
    text = scene.to_toml(tmp_path / "scene.toml")
    assert (tmp_path / "scene.toml").read_text() == text
    assert Scene.from_toml(tmp_path / "scene.toml") == scene == Scene.from_toml(str(tmp_path / "scene.toml"))


def test_scenes_cannot_be_changed() -> None:
    scene = column()
    with pytest.raises(ValidationError, match="frozen"):
        scene.spacing = 1.0  # type: ignore[misc]
    assert isinstance(scene.regions, tuple)


def test_arrays_are_accepted_for_lists() -> None:
    output = Output(depths=np.array([1.0, 2.0]), points=np.array([[0.5, 3.0]]))
    assert output == Output(depths=[1, 2], points=[(0.5, 3.0)])
    assert column(spacing=np.float32(0.5)).spacing == 0.5


# Motions


def record(folder: Path, name: str = "record.csv") -> Path:
    path = folder / name
    path.write_text("time,a_g\n0.0,0.0\n0.01,0.1\n0.02,-0.1\n")
    return path


def test_motion_file_is_found_from_the_scene_file(tmp_path: Path) -> None:
    record(tmp_path)
    text = column(stages=[Gravity(), Shaking(MotionSpec(file="record.csv", unit="g", scale=2.0))]).to_toml()
    assert 'file = "record.csv"' in text
    (tmp_path / "scene.toml").write_text(text)
    stage = Scene.from_toml(tmp_path / "scene.toml").stages[1]
    assert isinstance(stage, Shaking)
    assert stage.motion is not None
    np.testing.assert_allclose(stage.motion.load().acceleration_g, [0.0, 0.2, -0.2])


def test_motion_read_from_a_file_is_named_wherever_the_scene_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(tmp_path)
    monkeypatch.chdir(tmp_path)
    motion = Motion.from_csv("record.csv", unit="g", kind="upgoing")
    scene = column(stages=[Gravity(), Shaking(motion)])
    (tmp_path / "elsewhere").mkdir()
    scene.to_toml(tmp_path / "elsewhere" / "scene.toml")
    monkeypatch.chdir("/")
    again = Scene.from_toml(tmp_path / "elsewhere" / "scene.toml")
    assert again == scene
    stage = again.stages[1]
    assert isinstance(stage, Shaking)
    assert stage.motion is not None
    assert stage.motion.load() == motion


def test_transformed_motion_is_written_by_its_samples() -> None:
    motion = Motion.ricker(frequency=2.0, pga_g=0.1).scaled(factor=0.5)
    spec = MotionSpec.of(motion)
    assert spec.ricker is None
    assert spec.load() == motion


def test_generator_defaults_are_written_out() -> None:
    spec = MotionSpec(synthetic={"pga_g": 0.3})
    assert spec == MotionSpec.of(Motion.synthetic(pga_g=0.3))
    assert spec.synthetic is not None
    assert {"pga_g", "duration", "seed"} <= set(spec.synthetic)


def test_motion_is_replaced_where_there_is_one() -> None:
    first, other = Motion.ricker(frequency=2.0, pga_g=0.1), Motion.ricker(frequency=1.0, pga_g=0.2)
    base = CompliantBase(Vs=300.0, density=2.1)
    scene = column(stages=[Gravity(), Shaking(first, base=base, duration=9.0), Shaking(duration=5.0)])
    changed = scene.with_motion(other)
    assert changed.stages == (
        Gravity(),
        Shaking(other, base=base, duration=9.0),
        Shaking(duration=5.0),
    )
    assert Scene.from_toml(changed.to_toml()) == changed
    with pytest.raises(InvalidInput, match="must hold a shaking stage with a motion"):
        column().with_motion(other)


# Densities: e = 0.635 (Dr 0.55), Gs 2.67, rho_w 10/9.81

RHO_W = 10.0 / 9.81
N = 0.635 / 1.635
DRY = (1.0 - N) * 2.67 * RHO_W
SATURATED = DRY + N * RHO_W


@pytest.mark.parametrize(
    "densities",
    [
        {"Gs": 2.67, "porosity": N},
        {"Gs": 2.67, "void_ratio": 0.635},
        {"Gs": 2.67, "dry_unit_weight": DRY * 9.81},
        {"Gs": 2.67, "saturated_unit_weight": SATURATED * 9.81},
        {"Gs": 2.67, "bulk_unit_weight": SATURATED * 9.81},
        {"porosity": N, "dry_unit_weight": DRY * 9.81},
        {"porosity": N, "saturated_unit_weight": SATURATED * 9.81},
        {"dry_unit_weight": DRY * 9.81, "saturated_unit_weight": SATURATED * 9.81},
        {"dry_unit_weight": DRY * 9.81, "bulk_unit_weight": SATURATED * 9.81},
        {"Gs": 2.67, "porosity": N, "saturated_unit_weight": round(SATURATED * 9.81, 2)},
    ],
)
def test_any_sufficient_set_of_densities_gives_the_same_soil(densities: dict[str, float]) -> None:
    region = Region("rock", box(x=(0, 1), y=(0, 10)), Elastic(G=1.0e4, K=2.0e4), **densities)
    soil = region.resolved(column(regions=[region]))
    assert soil.porosity == pytest.approx(N)
    assert soil.void_ratio == pytest.approx(0.635)
    assert soil.Gs == pytest.approx(2.67)
    assert soil.solid_density == pytest.approx(2.67 * RHO_W)
    assert soil.dry_density == pytest.approx(DRY)
    assert soil.saturated_density == pytest.approx(SATURATED)


def test_relative_density_gives_the_void_ratio() -> None:
    scene = column()
    assert scene.regions[0].resolved(scene).porosity == pytest.approx(N)
    sand = PM4Sand(Dr=0.5, G0=600.0, hpo=0.4, e_max=1.0, e_min=0.6)
    region = Region("sand", box(x=(0, 1), y=(0, 10)), sand, saturated_unit_weight=19.5, porosity=0.8 / 1.8)
    assert region.resolved(column(regions=[region])).void_ratio == pytest.approx(0.8)


def test_dry_densities() -> None:
    alone = dry_column(dry_unit_weight=18.0)
    soil = alone.regions[0].resolved(alone)
    assert (soil.dry_density, soil.porosity) == (pytest.approx(18.0 / 9.81), 0.0)
    assert soil.solid_density == soil.dry_density
    bulk = dry_column(bulk_unit_weight=18.0)
    assert bulk.regions[0].resolved(bulk) == soil
    grains = dry_column(Gs=2.65, porosity=0.4)
    assert grains.regions[0].resolved(grains).dry_density == pytest.approx(
        0.6 * 2.65 * REFERENCE_WATER_DENSITY
    )


# What follows from a scene


def test_elastic_pairs_are_equivalent() -> None:
    by_nu = Elastic(E=2.6e4, nu=0.3).core()
    at_rest = (-50.0, -100.0, 0.0, -50.0)
    assert _core.small_strain_moduli(by_nu, at_rest) == pytest.approx((1.0e4, 2.6e4 / 1.2))
    assert Elastic(G=1.0e4, K=2.0e4).core() == _core.Soil.elastic(G=1.0e4, K=2.0e4)


def test_sand_gives_its_parameters_to_the_core() -> None:
    sand = PM4Sand(relative_density=0.5, shear_modulus_coefficient=600, contraction_rate=0.4, z_max=2)
    assert sand.core() == _core.Soil.pm4sand(Dr=0.5, G0=600.0, hpo=0.4, z_max=2.0, nu=None)
    assert sand.core() != _core.Soil.pm4sand(Dr=0.5, G0=600.0, hpo=0.4)


def test_memory_of_gaps_is_an_option_of_the_sand() -> None:
    def sent(numerics: Numerics) -> dict[str, bytes]:
        scene = column(numerics=numerics)
        return section_description(scene, discretise(scene)).parts()

    without, with_memory = sent(Numerics()), sent(Numerics(gap_memory=True))
    assert {name for name, part in without.items() if part != with_memory[name]} == {"regions"}


@pytest.mark.parametrize(
    "make",
    [
        lambda: _core.Water(unit_weight=10.0, bulk_modulus=1e6, bulk_moduls=1e6),  # type: ignore[call-arg]
        lambda: _core.Soil.elastic(G=1e4, K=2e4, nu=0.3),  # type: ignore[call-arg]
        lambda: _core.Gravity(tolerance=1e-4),  # type: ignore[call-arg]
        lambda: _core.Choices(printed_operator=True),  # type: ignore[call-arg]
    ],
)
def test_the_core_refuses_unknown_and_missing_names(make: Callable[[], object]) -> None:
    with pytest.raises(TypeError, match="argument"):
        make()


def test_every_rule_of_the_core_has_its_message() -> None:
    assert list(MESSAGES) == _core.RULES
    for message in MESSAGES.values():
        parts = {"numerics": [Numerics], "stage": [Shaking, RunOut]}[message.part]
        assert any(message.field in part.model_fields for part in parts)


def test_descriptions_do_not_change() -> None:
    layers = _core.Conductivity(major=1e-4, minor=1e-5, direction=(1.0, 0.0))
    with pytest.raises(AttributeError):
        layers.major = 1.0  # type: ignore[misc]
    with pytest.raises(AttributeError):
        layers.mayor = 1.0  # type: ignore[attr-defined]


def test_water_level_and_stage_names() -> None:
    scene = column(
        water_table=WaterTable(depth=-3.0),
        stages=[Gravity(), Shaking(duration=1.0), Shaking(duration=2.0)],
    )
    assert scene.water_level_at(np.array([0.5])) == 13.0
    assert scene.bounds == (0.0, 0.0, 1.0, 10.0)
    assert scene.stage_names == ["gravity", "shaking", "shaking_2"]
    assert dry_column(dry_unit_weight=18.0).water_level_at(np.array([0.5])) == -np.inf


def test_only_what_the_scene_requires_is_active() -> None:
    def active(scene: Scene) -> set[str]:
        assert all(reason for _, _, reason in scene.active_physics())
        return {name for name, on, _ in scene.active_physics() if on}

    always = {"velocity filter"}
    assert active(column()) == always | {
        "pore water",
        "water diffusion",
        "water acceleration",
        "soil state",
        "base dashpots",
    }
    dry = dry_column(dry_unit_weight=18.0)
    assert active(dry) == always | {"base dashpots"}
    assert active(dry.changed(stages=[Gravity()])) == always
    at_rest = column(stages=[Gravity()])
    assert active(at_rest) == always | {"pore water"}
    assert ("water diffusion", False, "no shaking stage") in at_rest.active_physics()
    undrained = column(regions=[Region("sand", box(x=(0, 1), y=(0, 10)), SAND, Gs=2.67)])
    assert active(undrained) == always | {"pore water", "soil state", "base dashpots"}
    damped = column(numerics=Numerics(local_damping=0.05, velocity_filter=0.0))
    assert "local damping" in active(damped)
    assert "velocity filter" not in active(damped)
    rayleigh = Rayleigh(ratio=0.005, frequencies=(1.0, 10.0))
    viscous = column(stages=[Gravity(), Shaking(duration=1.0, rayleigh=rayleigh)])
    assert ("Rayleigh damping", True, "0.5 % at 1 and 10 Hz") in viscous.active_physics()
    assert ("Rayleigh damping", False, "no shaking stage has it") in column().active_physics()


@pytest.mark.parametrize(
    ("conductivity", "choice", "used"),
    [
        (1e-3, "auto", True),
        (1e-2, "auto", False),
        (1e-2, "on", True),
        (1e-3, "off", False),
        (None, "on", False),
    ],
)
def test_acceleration_term_follows_conductivity_and_choice(
    conductivity: float | None, choice: Any, used: bool
) -> None:
    region = Region("s", box(x=(0, 1), y=(0, 10)), SAND, hydraulic_conductivity=conductivity, Gs=2.67)
    scene = column(regions=[region], numerics=Numerics(acceleration_term=choice))
    assert scene.uses_acceleration_term is used


def test_regions_may_differ_in_name_only_on_opposite_sides() -> None:
    sides = [
        Region(name, box(x=x, y=(0, 10)), SAND, Gs=2.67)
        for name, x in (("left", (0.0, 1.0)), ("right", (2.0, 3.0)))
    ]
    middle = Region("middle", box(x=(1.0, 2.0), y=(0, 10)), PM4Sand(0.8, 890.0, 0.63), Gs=2.67)
    assert len(column(regions=[*sides, middle]).regions) == 3
