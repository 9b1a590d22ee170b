"""Each slip a scene can hold is refused with its path, the value, what is allowed, and the remedy."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from sandboil._errors import InvalidInput, SandboilError, SimulationDiverged, nearest_name
from sandboil.materials import Elastic, PM4Sand
from sandboil.scene import Box, Gravity, Rayleigh, Region, Scene, Shaking, box, polygon
from sandboil.simulation import Simulation

SOUND: dict[str, Any] = {
    "spacing": 0.5,
    "water": {"unit_weight": 10.0, "bulk_modulus": 1.0e6},
    "water_table": {"depth": 0.0},
    "regions": [
        {
            "name": "upper",
            "shape": {"kind": "box", "x": [0.0, 1.0], "y": [4.0, 10.0]},
            "material": {"kind": "pm4sand", "Dr": 0.55, "G0": 677.0, "hpo": 0.4},
            "hydraulic_conductivity": 1.0e-3,
            "Gs": 2.67,
        },
        {
            "name": "lower",
            "shape": {"kind": "box", "x": [0.0, 1.0], "y": [0.0, 4.0]},
            "material": {"kind": "elastic", "E": 5.0e4, "nu": 0.3},
            "porosity": 0.4,
            "saturated_unit_weight": 20.0,
        },
    ],
    "stages": [{"kind": "gravity"}, {"kind": "shaking", "duration": 10.0}],
    "output": {"depths": [4.0]},
}

Change = Callable[[dict[str, Any]], object]


def setting(path: str, value: object) -> Change:
    """A change that sets one value by its dotted path, indices as names."""

    def change(scene: dict[str, Any]) -> None:
        *parents, last = path.split(".")
        part: Any = scene
        for name in parents:
            part = part[int(name)] if isinstance(part, list) else part[name]
        part[last] = value

    return change


def without(*names: str) -> Change:
    def change(scene: dict[str, Any]) -> None:
        for name in names:
            del scene[name]

    return change


def refusal(change: Change) -> InvalidInput:
    """The refusal of the sound scene after a change, said in TOML."""
    said = copy.deepcopy(SOUND)
    change(said)
    with pytest.raises(InvalidInput) as caught:
        Scene.from_toml(tomli_w.dumps(said))
    return caught.value


def test_the_scene_that_the_cases_spoil_is_sound() -> None:
    assert Scene.from_toml(tomli_w.dumps(SOUND)).regions[1].name == "lower"


UPPER, LOWER = "regions.0", "regions.1"
SAND, ROCK = f"{UPPER}.material", f"{LOWER}.material"

# change, path, value, part of what is allowed, part of the hint (None: no hint)
CASES: dict[str, tuple[Change, str, object, str, str | None]] = {
    "overlap": (
        setting(f"{LOWER}.shape.y", [0.0, 4.5]),
        "scene.regions[1].shape",
        Box(x=(0.0, 1.0), y=(0.0, 4.5)),
        "must not overlap region 'upper'",
        "y 4 to 4.5",
    ),
    "gap": (
        setting(f"{LOWER}.shape.y", [0.0, 3.5]),
        "scene.regions",
        ["upper", "lower"],
        "without gaps",
        "y 0 to 3.5",
    ),
    "empty box": (
        setting(f"{UPPER}.shape.y", [10.0, 10.0]),
        "scene.regions[0].shape.y",
        (10.0, 10.0),
        "the region is empty",
        "low end, high end",
    ),
    "box upside down": (
        setting(f"{UPPER}.shape.y", [10.0, 4.0]),
        "scene.regions[0].shape.y",
        (10.0, 4.0),
        "must rise",
        "low end, high end",
    ),
    "empty polygon": (
        setting(f"{UPPER}.shape", {"kind": "polygon", "points": [[0.0, 4.0], [1.0, 4.0], [0.5, 4.0]]}),
        "scene.regions[0].shape.points",
        ((0.0, 4.0), (1.0, 4.0), (0.5, 4.0)),
        "must",
        None,
    ),
    "crossed polygon": (
        setting(
            f"{UPPER}.shape",
            {"kind": "polygon", "points": [[0.0, 4.0], [1.0, 10.0], [1.0, 4.0], [0.0, 10.0]]},
        ),
        "scene.regions[0].shape.points",
        ((0.0, 4.0), (1.0, 10.0), (1.0, 4.0), (0.0, 10.0)),
        "must form a simple polygon",
        "in order around the region",
    ),
    "no regions": (setting("regions", []), "scene.regions", [], "at least 1", None),
    "name twice": (
        setting(f"{LOWER}.name", "upper"),
        "scene.regions[1].name",
        "upper",
        "is already the name of regions[0]",
        None,
    ),
    "negative porosity": (
        setting(f"{LOWER}.porosity", -0.1),
        "scene.regions[1].porosity",
        -0.1,
        "must lie in (0, 1)",
        None,
    ),
    "porosity against Dr": (
        setting(f"{UPPER}.porosity", 0.5),
        "scene.regions[0].porosity",
        0.5,
        "contradicts material.Dr = 0.55, which gives porosity = 0.38838",
        "give only one",
    ),
    "void ratio against Dr": (
        setting(f"{UPPER}.void_ratio", 0.7),
        "scene.regions[0].void_ratio",
        0.7,
        "which gives void_ratio = 0.635",
        "give only one",
    ),
    "unit weights that disagree": (
        setting(f"{UPPER}.saturated_unit_weight", 19.0),
        "scene.regions[0].saturated_unit_weight",
        19.0,
        "which make it 20.214 kN/m3",
        "only a sufficient set",
    ),
    "too few densities": (
        lambda scene: scene["regions"][1].pop("porosity"),
        "scene.regions[1]",
        {"saturated_unit_weight": 20.0},
        "needs enough densities",
        "Gs = 2.65",
    ),
    "density beyond that of the solids": (
        lambda scene: scene["regions"][1].update(
            Gs=scene["regions"][1].pop("porosity") + 2.0, saturated_unit_weight=30.0
        ),
        "scene.regions[1]",
        {"Gs": 2.4, "saturated_unit_weight": 30.0},
        "must lie in (0, 1)",
        "density of water",
    ),
    "Dr zero": (
        setting(f"{SAND}.Dr", 0.0),
        "scene.regions[0].material.Dr",
        0.0,
        "must lie in (0, 1]",
        "fraction",
    ),
    "Dr in percent": (
        setting(f"{SAND}.Dr", 55.0),
        "scene.regions[0].material.Dr",
        55.0,
        "must lie in (0, 1]",
        "55 % is written 0.55",
    ),
    "Dr above one by its long name": (
        lambda scene: scene["regions"][0].update(
            material={"kind": "pm4sand", "relative_density": 1.1, "G0": 677.0, "hpo": 0.4}
        ),
        "scene.regions[0].material.Dr",
        1.1,
        "must lie in (0, 1]",
        "fraction",
    ),
    "Dr by both names": (
        setting(f"{SAND}.relative_density", 0.5),
        "scene.regions[0].material.Dr",
        0.55,
        "was given twice",
        None,
    ),
    "nu of a half, elastic": (
        setting(f"{ROCK}.nu", 0.5),
        "scene.regions[1].material.nu",
        0.5,
        "must lie in [0, 0.5)",
        "keep the drained nu",
    ),
    "nu of a half, PM4Sand": (
        setting(f"{SAND}.nu", 0.5),
        "scene.regions[0].material.nu",
        0.5,
        "must lie in [0, 0.5)",
        "keep the drained nu",
    ),
    "K0 of one": (
        setting(f"{UPPER}.K0", 1.0),
        "scene.regions[0].K0",
        1.0,
        "must lie in (0, 1)",
        "nu = K0/(1 + K0)",
    ),
    "two elastic pairs mixed": (
        lambda scene: scene["regions"][1].update(material={"kind": "elastic", "G": 1.0e4, "nu": 0.3}),
        "scene.regions[1].material",
        {"G": 1.0e4, "nu": 0.3},
        "exactly one pair",
        None,
    ),
    "void ratio limits swapped": (
        lambda scene: scene["regions"][0]["material"].update(e_max=0.5, e_min=0.8),
        "scene.regions[0].material.e_max",
        0.5,
        "must be greater than e_min = 0.8",
        "swapped",
    ),
    "text for a number": (
        setting(f"{SAND}.G0", "677"),
        "scene.regions[0].material.G0",
        "677",
        "must be a number",
        None,
    ),
    "truth value for a number": (setting("spacing", True), "scene.spacing", True, "must be a number", None),
    "not finite": (setting("gravity", math.inf), "scene.gravity", math.inf, "must be finite", None),
    "spacing larger than a layer": (
        setting("spacing", 1.5),
        "scene.spacing",
        1.5,
        "must not exceed the least extent of any region, 1 m (upper)",
        None,
    ),
    "spacing zero": (setting("spacing", 0.0), "scene.spacing", 0.0, "must be greater than 0", None),
    "spacing in millimetres": (
        setting("spacing", 1.0e-4),
        "scene.spacing",
        1.0e-4,
        "at most 1e+07 cells",
        "increase it",
    ),
    "coordinates beyond any section": (
        setting("regions.1.shape.x", [0.0, 1.0e300]),
        "scene.spacing",
        0.5,
        "at most 1e+07 cells",
        "unit of the coordinates",
    ),
    "yield surface beyond the core's range": (
        setting("regions.0.material.m", 5.0),
        "scene.regions[0].material.m",
        5.0,
        "must be",
        None,
    ),
    "void ratio of no soil": (
        setting("regions.0.material.e_max", 1.0e9),
        "scene.regions[0].material.e_max",
        1.0e9,
        "must lie in (0, 10]",
        None,
    ),
    "depth named twice": (
        setting("output.depths", [4.0, 4.0]),
        "scene.output.depths[1]",
        4.0,
        "named twice",
        None,
    ),
    "a frame every nanosecond": (
        setting("output.field_dt", 1.0e-9),
        "scene.output.field_dt",
        1.0e-9,
        "at most 100000 frames",
        "0.0001 s",
    ),
    "tolerance without error control": (
        setting("numerics", {"integrator": "rk4", "integrator_tolerance": 1.0e-5}),
        "scene.numerics.integrator_tolerance",
        1.0e-5,
        "no effect",
        "default",
    ),
    "acceleration term that implicit diffusion drops": (
        setting("numerics", {"diffusion": "implicit", "acceleration_term": "on"}),
        "scene.numerics.acceleration_term",
        "on",
        "left out",
        "explicit",
    ),
    "filter that the printed operators have not": (
        setting("numerics", {"operators": "printed", "velocity_filter": 0.1}),
        "scene.numerics.velocity_filter",
        0.1,
        "no effect",
        "conservative",
    ),
    "inertia that does not suit the printed operators": (
        setting("numerics", {"operators": "printed", "dispersion_correction": True}),
        "scene.numerics.dispersion_correction",
        True,
        "not for the printed operators",
        "conservative",
    ),
    "misspelt material": (
        setting(f"{SAND}.kind", "pm4snd"),
        "scene.regions[0].material.kind",
        "pm4snd",
        "must be one of 'pm4sand', 'elastic'",
        "did you mean 'pm4sand'?",
    ),
    "material without a kind": (
        lambda scene: scene["regions"][1].update(material={"E": 1.0, "nu": 0.3}),
        "scene.regions[1].material",
        {"E": 1.0, "nu": 0.3},
        "needs kind = one of 'pm4sand', 'elastic'",
        None,
    ),
    "misspelt choice": (
        setting("numerics", {"operators": "conservativ"}),
        "scene.numerics.operators",
        "conservativ",
        "must be one of 'conservative', 'printed'",
        "did you mean 'conservative'?",
    ),
    "misspelt envelope": (
        setting("output.envelopes", ["r_u", "gama_max"]),
        "scene.output.envelopes[1]",
        "gama_max",
        "must be one of 'r_u', 'gamma_max'",
        "did you mean 'gamma_max'?",
    ),
    "water table in the ground": (
        setting("water_table", {"depth": 2.0}),
        "scene.regions[0].retention",
        None,
        "is required of soil above the water table",
        "above='dry'",
    ),
    "water table twice": (
        setting("water_table", {"depth": 0.0, "elevation": 10.0}),
        "scene.water_table",
        {"elevation": 10.0, "depth": 0.0, "points": None},
        "exactly one of elevation, depth and points",
        None,
    ),
    "water without a table": (
        without("water_table"),
        "scene.water_table",
        None,
        "is required when there is water",
        "WaterTable(depth=0)",
    ),
    "table without water": (
        without("water"),
        "scene.water",
        None,
        "is required when there is a water table",
        "Water()",
    ),
    "shaking first": (
        setting("stages", [{"kind": "shaking", "duration": 1.0}]),
        "scene.stages[0].kind",
        "shaking",
        "must be 'gravity'",
        None,
    ),
    "gravity again": (
        setting("stages", [{"kind": "gravity"}, {"kind": "gravity"}]),
        "scene.stages[1].kind",
        "gravity",
        "must come before all shaking, and only once",
        None,
    ),
    "no end to standing still": (
        setting("stages", [{"kind": "gravity"}, {"kind": "shaking"}]),
        "scene.stages[1].duration",
        None,
        "is required when there is no motion",
        "seconds",
    ),
    "half a base": (
        setting("stages.1.base", {"kind": "compliant", "Vs": 300.0}),
        "scene.stages[1].base",
        {"Vs": 300.0, "density": None},
        "both Vs and density",
        None,
    ),
    "steps not whole": (
        setting("stages", [{"kind": "gravity", "max_steps": 10.5}]),
        "scene.stages[0].max_steps",
        10.5,
        "integer",
        None,
    ),
    "depth outside": (
        setting("output.depths", [4.0, 11.0]),
        "scene.output.depths[1]",
        11.0,
        "[0, 10] m",
        "positive downwards",
    ),
    "depth as an elevation": (
        setting("output.depths", [-4.0]),
        "scene.output.depths[0]",
        -4.0,
        "[0, 10] m",
        "positive downwards",
    ),
    "point outside": (
        setting("output.points", [[0.5, 3.0], [2.0, 3.0]]),
        "scene.output.points[1]",
        (2.0, 3.0),
        "must lie in the section",
        None,
    ),
    "sides of unlike height": (
        setting(
            f"{UPPER}.shape",
            {"kind": "polygon", "points": [[0.0, 4.0], [1.0, 4.0], [1.0, 9.0], [0.0, 10.0]]},
        ),
        "scene.sides",
        "periodic",
        "straight vertical sides, the same soils at the same levels",
        "right: [('lower', 0.0, 4.0), ('upper', 4.0, 9.0)]",
    ),
    "side not vertical": (
        setting(
            f"{UPPER}.shape",
            {"kind": "polygon", "points": [[0.0, 4.0], [1.0, 4.0], [0.5, 10.0], [0.0, 10.0]]},
        ),
        "scene.sides",
        "periodic",
        "straight vertical sides",
        "right: [('lower', 0.0, 4.0)]",
    ),
    "base not level": (
        setting(
            f"{LOWER}.shape",
            {"kind": "polygon", "points": [[0.0, 0.0], [0.5, 1.0], [1.0, 0.0], [1.0, 4.0], [0.0, 4.0]]},
        ),
        "scene.regions",
        ["upper", "lower"],
        "must stand on a level base",
        None,
    ),
    "motion without a source": (
        setting("stages.1.motion", {"scale": 0.5}),
        "scene.stages[1].motion",
        [],
        "exactly one source",
        None,
    ),
    "motion from two sources": (
        setting("stages.1.motion", {"file": "a.AT2", "dt": 0.1, "velocity": [0.0, 1.0]}),
        "scene.stages[1].motion",
        ["file", "velocity"],
        "exactly one source",
        None,
    ),
    "samples without their dt": (
        setting("stages.1.motion", {"acceleration_g": [0.0, 1.0]}),
        "scene.stages[1].motion.dt",
        None,
        "goes with acceleration_g or velocity",
        None,
    ),
    "dt beside a file": (
        setting("stages.1.motion", {"file": "a.AT2", "dt": 0.01}),
        "scene.stages[1].motion.dt",
        0.01,
        "goes with acceleration_g or velocity",
        None,
    ),
    "damping in per cent": (
        setting("stages.1.rayleigh", {"ratio": 0.5, "frequencies": [1.0, 10.0]}),
        "scene.stages[1].rayleigh.ratio",
        0.5,
        "must lie in (0, 0.3]",
        "a fraction",
    ),
    "no damping": (
        setting("stages.1.rayleigh", {"ratio": 0.0, "frequencies": [1.0, 10.0]}),
        "scene.stages[1].rayleigh.ratio",
        0.0,
        "must lie in (0, 0.3]",
        None,
    ),
    "damping without its frequencies": (
        setting("stages.1.rayleigh", {"ratio": 0.005}),
        "scene.stages[1].rayleigh.frequencies",
        None,
        "is required",
        None,
    ),
    "descending frequencies of damping": (
        setting("stages.1.rayleigh", {"ratio": 0.005, "frequencies": [10.0, 1.0]}),
        "scene.stages[1].rayleigh.frequencies",
        (10.0, 1.0),
        "must ascend",
        "frequencies = [1, 10]",
    ),
    "one frequency of damping twice": (
        setting("stages.1.rayleigh", {"ratio": 0.005, "frequencies": [2.0, 2.0]}),
        "scene.stages[1].rayleigh.frequencies",
        (2.0, 2.0),
        "must ascend",
        "five times",
    ),
    "a frequency of damping that is none": (
        setting("stages.1.rayleigh", {"ratio": 0.005, "frequencies": [0.0, 10.0]}),
        "scene.stages[1].rayleigh.frequencies[0]",
        0.0,
        "must lie in [0.01, 1000]",
        None,
    ),
    "Rayleigh damping of the printed operators": (
        lambda scene: scene.update(
            numerics={"operators": "printed"},
            stages=[
                {"kind": "gravity"},
                {"kind": "shaking", "duration": 1.0, "rayleigh": {"ratio": 0.01, "frequencies": [1.0, 5.0]}},
            ],
        ),
        "scene.stages[1].rayleigh",
        Rayleigh(ratio=0.01, frequencies=(1.0, 5.0)),
        "left out with the printed operators",
        "numerics.local_damping",
    ),
    "misspelt argument of a generator": (
        setting("stages.1.motion", {"synthetic": {"pga": 0.3}}),
        "scene.stages[1].motion.synthetic.pga",
        0.3,
        "unknown key",
        "did you mean 'pga_g'?",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_slip_is_refused_with_path_value_allowed_and_remedy(case: str) -> None:
    change, path, value, allowed, hint = CASES[case]
    refused = refusal(change)
    assert refused.path == path
    assert refused.value == value
    assert allowed in refused.allowed
    if hint is not None:
        assert refused.hint is not None
        assert hint in refused.hint
    told = str(refused)
    assert told.startswith(f"{path} = {refused.value!r}: {refused.allowed}")
    assert refused.hint is None or told.endswith(refused.hint)


MISSPELT = [
    ("spacng", "scene.spacng", "spacing"),
    ("water.unit_wieght", "scene.water.unit_wieght", "unit_weight"),
    ("water_table.elevatoin", "scene.water_table.elevatoin", "elevation"),
    (f"{UPPER}.porosty", "scene.regions[0].porosty", "porosity"),
    (f"{UPPER}.hydraulic_conductivty", "scene.regions[0].hydraulic_conductivty", "hydraulic_conductivity"),
    (f"{UPPER}.shape.z", "scene.regions[0].shape.z", None),
    (f"{SAND}.phi_c", "scene.regions[0].material.phi_c", "phi_cv"),
    (f"{ROCK}.g", "scene.regions[1].material.g", "G"),
    ("output.field_dT", "scene.output.field_dT", "field_dt"),
]


@pytest.mark.parametrize(("key", "path", "meant"), MISSPELT)
def test_misspelt_key_is_told_with_the_nearest_name(key: str, path: str, meant: str | None) -> None:
    refused = refusal(setting(key, 1.0))
    assert (refused.path, refused.value) == (path, 1.0)
    assert refused.allowed.startswith("unknown key, known are ")
    assert refused.hint == (f"did you mean {meant!r}?" if meant else None)


def test_misspelling_a_required_key_is_told_before_the_missing_one() -> None:
    def change(scene: dict[str, Any]) -> None:
        sand = scene["regions"][0]["material"]
        sand["Go"] = sand.pop("G0")

    refused = refusal(change)
    assert refused.path == "scene.regions[0].material.Go"
    assert refused.hint == "did you mean 'G0'?"


def test_missing_key_is_told() -> None:
    refused = refusal(lambda scene: scene["regions"][0]["material"].pop("hpo"))
    assert refused.path == "scene.regions[0].material.hpo"
    assert refused.allowed.startswith("is required")


def test_hole_in_the_section_is_refused() -> None:
    def part(name: str, x: tuple[float, float], y: tuple[float, float]) -> Region:
        return Region(name, box(x=x, y=y), Elastic(1.0e4, 2.0e4), dry_unit_weight=18.0)

    with pytest.raises(InvalidInput, match="a hole lies in x 1 to 2, y 1 to 2"):
        Scene(
            spacing=0.5,
            regions=[
                part("base", (0, 3), (0, 1)),
                part("left", (0, 1), (1, 2)),
                part("right", (2, 3), (1, 2)),
                part("top", (0, 3), (2, 3)),
            ],
            stages=[Gravity()],
        )


def test_python_and_toml_refuse_alike() -> None:
    with pytest.raises(InvalidInput) as alone:
        PM4Sand(Dr=1.2, G0=677.0, hpo=0.4)
    inside = refusal(setting(f"{SAND}.Dr", 1.2))
    assert alone.value.path == "material.Dr"
    assert inside.path == "scene.regions[0].material.Dr"
    assert (alone.value.value, alone.value.allowed, alone.value.hint) == (
        inside.value,
        inside.allowed,
        inside.hint,
    )


def test_arguments_out_of_place_are_refused() -> None:
    sand = PM4Sand(0.5, 600.0, 0.4)
    with pytest.raises(InvalidInput, match="takes 3 positional arguments, 4 were given"):
        Region("a", box(x=(0, 1), y=(0, 1)), sand, 1e-3)  # type: ignore[misc]
    with pytest.raises(InvalidInput, match=r"material\.Dr = 0\.6: was given twice"):
        PM4Sand(0.5, 600.0, 0.4, Dr=0.6)  # type: ignore[misc]
    with pytest.raises(InvalidInput, match=r"region\.shape"):
        Region("a", "box", sand)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match=r"shape\.points"):
        polygon([(0.0, 0.0), (1.0, 0.0)])
    with pytest.raises(InvalidInput, match=r"stage\.motion"):
        Shaking(3.0)  # type: ignore[arg-type]


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="No such file"):
        Scene.from_toml(tmp_path / "absent.toml")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InvalidInput, match="not UTF-8"):
        Scene.from_toml(binary)
    broken = tmp_path / "broken.toml"
    broken.write_text("spacing = \n")
    with pytest.raises(InvalidInput, match=r"must be TOML: .*line 1"):
        Scene.from_toml(str(broken))
    scene = Scene.from_toml(tomli_w.dumps(SOUND))
    with pytest.raises(InvalidInput, match="must be writable"):
        scene.to_toml(tmp_path / "no" / "such" / "folder.toml")


def test_a_byte_order_mark_is_no_slip(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(tomli_w.dumps(SOUND), encoding="utf-8-sig")
    assert Scene.from_toml(path) == Scene(**SOUND)


def test_a_bad_motion_is_told_with_its_stage(tmp_path: Path) -> None:
    """A motion is read before anything is computed, and its own path follows that of its stage."""
    within = {"kind": "within", "dt": 0.01, "velocity": [0.0, 0.1, 0.0]}
    lost = {"file": str(tmp_path / "none.AT2")}
    for motion, path in ((within, "scene.stages[1].motion.kind"), (lost, "scene.stages[1].motion file")):
        scene = Scene(**(SOUND | {"stages": [{"kind": "gravity"}, {"kind": "shaking", "motion": motion}]}))
        with pytest.raises(InvalidInput) as refused:
            Simulation(scene, threads=1)
        assert refused.value.path.startswith(path)


def test_threads_are_bounded() -> None:
    for threads in (0, 257, True, 2.0):
        with pytest.raises(InvalidInput, match="whole number from 1 to 256"):
            Simulation(Scene(**SOUND), threads=threads)


def test_errors_survive_pickling_and_say_what_they_hold() -> None:
    refused = InvalidInput("scene.spacing", -1.0, "must be greater than 0", "in m")
    again = pickle.loads(pickle.dumps(refused))
    assert str(again) == "scene.spacing = -1.0: must be greater than 0; in m"
    assert isinstance(refused, ValueError)
    diverged = SimulationDiverged("velocity", 7, (0.5, 19.9), 1.5e3, 1.25, 4000)
    assert isinstance(diverged, SandboilError)
    assert str(pickle.loads(pickle.dumps(diverged))) == (
        "the run diverged: velocity of node 7 at (0.5, 19.9) m is 1.5e+03, time 1.25 s, step 4000"
    )


def test_nearest_name_ignores_case_and_gives_up_on_strangers() -> None:
    names = ["porosity", "void_ratio", "G0"]
    assert nearest_name("Porosty", names) == "porosity"
    assert nearest_name("g0", names) == "G0"
    assert nearest_name("wxyz", names) is None
