"""A catalogue of bad inputs by subject. Their messages are in `bad_inputs.txt`, which is written by

    python tests/bad_inputs.py > tests/bad_inputs.txt

Read the changes before you commit them.
"""

from __future__ import annotations

import contextlib
import copy
import io
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import sandboil as sb
import tomli_w
from sandboil import InvalidInput, cli, lab
from sandboil.core.simulation import Simulation
from sandboil.results.reference import Reference

Slip = Callable[[], object]
Change = Callable[[dict[str, Any]], object]

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
SEEPING: dict[str, Any] = {
    "spacing": 0.5,
    "water": {},
    "water_table": {"elevation": 4.0},
    "sides": {"kind": "roller"},
    "regions": [
        {
            "name": "soil",
            "shape": {"kind": "box", "x": [0.0, 10.0], "y": [0.0, 4.0]},
            "material": {"kind": "elastic", "E": 2.0e4, "nu": 0.3},
            "hydraulic_conductivity": 1.0e-5,
            "retention": {"kind": "van-genuchten", "alpha": 2.0, "n": 2.0},
            "Gs": 2.65,
            "porosity": 0.4,
        },
    ],
    "stages": [
        {
            "kind": "seepage",
            "conditions": [
                {"kind": "reservoir", "on": "left", "level": 4.0},
                {"kind": "head", "on": "right", "head": 2.0},
            ],
        }
    ],
}
# A slope between free-field sides, dry.
SLOPE: dict[str, Any] = {
    "spacing": 1.0,
    "sides": {"kind": "free-field"},
    "regions": [
        {
            "name": "fill",
            "shape": {"kind": "polygon", "points": [[0, 0], [30, 0], [30, 4], [20, 4], [12, 8], [0, 8]]},
            "material": {"kind": "mohr_coulomb", "c": 5.0, "phi": 30.0, "E": 2.0e4, "nu": 0.3},
            "dry_unit_weight": 18.0,
        }
    ],
    "stages": [{"kind": "gravity"}, {"kind": "shaking", "duration": 5.0}],
}

UPPER, LOWER = "regions.0", "regions.1"
SAND, ROCK = f"{UPPER}.material", f"{LOWER}.material"
SHAKING, MOTION = "stages.1", "stages.1.motion"
FIRST, SECOND, SOIL = "stages.0.conditions.0", "stages.0.conditions.1", "regions.0"


# Bad scenes in TOML


def to(path: str, value: object) -> Change:
    """A change that sets one value by its dotted path, indices as names."""

    def change(scene: dict[str, Any]) -> None:
        *parents, last = path.split(".")
        part: Any = scene
        for name in parents:
            part = part[int(name)] if isinstance(part, list) else part[name]
        part[int(last) if isinstance(part, list) else last] = value

    return change


def without(path: str) -> Change:
    """A change that removes one value."""

    def change(scene: dict[str, Any]) -> None:
        *parents, last = path.split(".")
        part: Any = scene
        for name in parents:
            part = part[int(name)] if isinstance(part, list) else part[name]
        del part[last]

    return change


def as_toml(scene: dict[str, Any], *changes: Change) -> str:
    """A scene after changes, in TOML."""
    changed = copy.deepcopy(scene)
    for change in changes:
        change(changed)
    return tomli_w.dumps(changed)


def level(*changes: Change) -> Slip:
    """The sound level ground after changes."""
    return lambda: sb.Scene.from_toml(as_toml(SOUND, *changes))


def slope(*changes: Change) -> Slip:
    """The sound slope after changes."""
    return lambda: sb.Scene.from_toml(as_toml(SLOPE, *changes))


def seeping(*changes: Change) -> Slip:
    """The sound seepage after changes."""
    return lambda: sb.Scene.from_toml(as_toml(SEEPING, *changes))


def lasting(*changes: Change) -> Slip:
    """The sound seepage after changes, in time."""
    return seeping(to("stages.0.duration", 10.0), *changes)


def adding(**condition: object) -> Change:
    """A third condition."""
    return lambda scene: scene["stages"][0]["conditions"].append(condition)


def under(*conditions: dict[str, Any]) -> Slip:
    """Other conditions, of soil without a retention curve."""
    return seeping(without(f"{SOIL}.retention"), to("stages.0.conditions", list(conditions)))


def material(**given: object) -> Slip:
    """Another soil in the lower region."""
    return level(to(ROCK, given))


def shaken(**given: object) -> Slip:
    """The slope shaken by a pulse, with further keys of the stage."""
    pulse = {"ricker": {"frequency": 2.0, "pga_g": 0.1}}
    return slope(to(SHAKING, {"kind": "shaking", "motion": pulse, "duration": 5.0} | given))


def moving(conditions: list[dict[str, Any]], *changes: Change) -> Slip:
    """Water under conditions while the ground shakes, after changes."""
    shaking = {"kind": "shaking", "duration": 5.0, "conditions": conditions}
    return seeping(to("stages", [{"kind": "gravity"}, shaking]), *changes)


def flowing(**given: object) -> Slip:
    """The slope in a run-out, with further keys of the stage."""
    return slope(to(SHAKING, RUN_OUT | given))


LEFT = {"kind": "head", "on": "left", "head": 4.0}
RUN_OUT: dict[str, Any] = {"kind": "run-out", "duration": 1.0}
WAVY = {"ratio": 0.005, "frequencies": [1.0, 10.0]}


# Slips in Python, in files and on the command line


def simulated(**motion: object) -> Slip:
    """The sound level ground under a motion that is only read when it is needed."""

    def slip() -> object:
        return Simulation(sb.Scene.from_toml(as_toml(SOUND, to(MOTION, motion))))

    return slip


def written(name: str, content: str | bytes, use: Callable[[Path], object]) -> Slip:
    """A file with a content, used."""

    def slip() -> object:
        path = Path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return use(path)

    return slip


def commanded(*arguments: object) -> Slip:
    """The command line, beside files of a sound scene, a soil and a record."""

    def slip() -> object:
        Path("scene.toml").write_text(as_toml(SOUND))
        Path("soil.toml").write_text("kind = 'pm4sand'\nDr = 0.5\nG0 = 600\nhpo = 0.4\n")
        Path("rock.toml").write_text("kind = 'elastic'\nE = 5e4\nnu = 0.3\n")
        Path("record.csv").write_text("time_s,acceleration_g\n0,0\n0.01,0.1\n0.02,0\n")
        Path("path.csv").write_text("eps_xx,eps_yy,gamma_xy\n0,0,1e-4\n")
        Path("file").write_text("no folder")
        Path("used").mkdir(exist_ok=True)
        Path("used/results.h5").write_text("a run")
        with contextlib.redirect_stdout(io.StringIO()):
            return cli.app([str(argument) for argument in arguments], standalone_mode=False)

    return slip


def ran(**options: Any) -> Slip:
    """A sound scene run with options."""
    return lambda: sb.run(sb.Scene(**SOUND), options.pop("out", "out"), **options)


PM4SAND = sb.PM4Sand(Dr=0.55, G0=677.0, hpo=0.40)
# A soil whose critical state at constant volume is weak: 0.3 kPa at D_r 0.13.
LOOSE = sb.PM4Sand(Dr=0.13, G0=300.0, hpo=0.5)
HOOKE = sb.Elastic(3.0e4, 9.0e4)
STRESS = (-50.0, -100.0, 0.0)


def tested(test: Callable[..., object], **arguments: Any) -> Slip:
    """A test of the laboratory, of sand unless a soil is given."""
    return lambda: test(arguments.get("soil", PM4SAND), **{k: v for k, v in arguments.items() if k != "soil"})


def cyclic(**arguments: Any) -> Slip:
    """Cyclic shear of sand."""
    return tested(lab.cyclic_dss, **({"csr": 0.1} | arguments))


def led(**arguments: Any) -> Slip:
    """A strain path of sand."""
    return tested(lab.strain_path, **({"stress0": STRESS, "strain": [(0.0, 0.0, 1e-3)]} | arguments))


def celled(**arguments: Any) -> Slip:
    """A cell of sand."""
    return tested(lab.shear_cell, **({"csr": 0.3, "spacing": 0.02} | arguments))


def results_of_another_format(path: Path) -> object:
    with h5py.File(path, "w") as file:
        file.attrs["format_version"] = 99
    return sb.load(path.parent)


def results_that_point_elsewhere(path: Path) -> object:
    with h5py.File(path, "w") as file:
        file.attrs["format_version"] = 1
        file["nodes"] = h5py.ExternalLink("/etc/hosts", "nodes")
    return sb.load(path.parent)


def results_without_end(path: Path) -> object:
    with h5py.File(path, "w") as file:
        file.create_dataset("nodes/position", shape=(10**12, 2), chunks=(256, 2), dtype=np.float64)
    return sb.load(path.parent)


CATALOGUE: dict[str, dict[str, Slip]] = {
    "the file of a scene": {
        "does not exist": lambda: sb.Scene.from_toml("absent.toml"),
        "is a folder": lambda: (Path("folder.toml").mkdir(), sb.Scene.from_toml("folder.toml")),
        "is not text": written("scene.toml", b"\xff\xfe\x00", sb.Scene.from_toml),
        "is not TOML": written("scene.toml", "spacing = \n", sb.Scene.from_toml),
        "is nested too deeply": written("scene.toml", "a = " + "[" * 5000, sb.Scene.from_toml),
        "has a key of too many parts": written(
            "scene.toml", "[b]\n" + "a." * 5000 + "a = 1", sb.Scene.from_toml
        ),
        "has a number of too many digits": written(
            "scene.toml", "spacing = " + "9" * 5000, sb.Scene.from_toml
        ),
        "has a key twice": written("scene.toml", "spacing = 1\nspacing = 2\n", sb.Scene.from_toml),
        "is empty": written("scene.toml", "", sb.Scene.from_toml),
        "cannot be written": lambda: sb.Scene(**SOUND).to_toml("no/such/folder.toml"),
    },
    "keys": {
        "of the scene, misspelt": level(to("spacng", 1.0)),
        "of water, misspelt": level(to("water.unit_wieght", 1.0)),
        "of the water table, misspelt": level(to("water_table.elevatoin", 1.0)),
        "of a region, misspelt": level(to(f"{UPPER}.porosty", 1.0)),
        "of a region, nearly": level(to(f"{UPPER}.hydraulic_conductivty", 1.0)),
        "of a shape, unknown": level(to(f"{UPPER}.shape.z", 1.0)),
        "of a sand, misspelt": level(to(f"{SAND}.phi_c", 1.0)),
        "of an elastic soil, in lower case": level(to(f"{ROCK}.g", 1.0)),
        "of output, in mixed case": level(to("output.field_dT", 1.0)),
        "of numerics, unknown": level(to("numerics", {"cfl": 0.5})),
        "of a condition, misspelt": seeping(to(f"{FIRST}.levl", 4.0)),
        "required and misspelt": level(to(f"{SAND}.Go", 677.0), without(f"{SAND}.G0")),
        "required and left out": level(without(f"{SAND}.hpo")),
        "given by both names": level(to(f"{SAND}.relative_density", 0.5)),
    },
    "shapes": {
        "that overlap": level(to(f"{LOWER}.shape.y", [0.0, 4.5])),
        "with a gap": level(to(f"{LOWER}.shape.y", [0.0, 3.5])),
        "around a hole": slope(
            to(f"{UPPER}.shape", {"kind": "box", "x": [0, 30], "y": [0, 4]}),
            lambda scene: scene["regions"].extend(
                scene["regions"][0] | {"name": name, "shape": {"kind": "box", "x": x, "y": y}}
                for name, x, y in (
                    ("left", [0, 10], [4, 8]),
                    ("right", [20, 30], [4, 8]),
                    ("top", [0, 30], [8, 12]),
                )
            ),
        ),
        "without height": level(to(f"{UPPER}.shape.y", [10.0, 10.0])),
        "with its ends exchanged": level(to(f"{UPPER}.shape.y", [10.0, 4.0])),
        "of three numbers": level(to(f"{UPPER}.shape.y", [0.0, 4.0, 10.0])),
        "of two corners": level(to(f"{UPPER}.shape", {"kind": "polygon", "points": [[0, 4], [1, 4]]})),
        "without area": level(
            to(f"{UPPER}.shape", {"kind": "polygon", "points": [[0, 4], [1, 4], [0.5, 4]]})
        ),
        "that crosses itself": level(
            to(f"{UPPER}.shape", {"kind": "polygon", "points": [[0, 4], [1, 10], [1, 4], [0, 10]]})
        ),
        "of an unknown kind": level(to(f"{UPPER}.shape.kind", "circle")),
        "without a kind": level(without(f"{UPPER}.shape.kind")),
        "none": level(to("regions", [])),
        "too many": level(lambda scene: scene.update(regions=scene["regions"] * 300)),
        "by a name, in Python": lambda: sb.Region("a", "box", PM4SAND),
        "with an argument out of place, in Python": lambda: sb.Region(
            "a", sb.box(x=(0, 1), y=(0, 1)), PM4SAND, 1e-3
        ),
        "named twice": level(to(f"{LOWER}.name", "upper")),
        "without a name": level(to(f"{LOWER}.name", "")),
    },
    "spacing and gravity": {
        "spacing of zero": level(to("spacing", 0.0)),
        "spacing larger than a layer": level(to("spacing", 1.5)),
        "spacing in millimetres": level(to("spacing", 1.0e-4)),
        "spacing left out": level(without("spacing")),
        "spacing as text": level(to("spacing", "0.5")),
        "spacing as a bool": level(to("spacing", True)),
        "coordinates beyond any section": level(to(f"{LOWER}.shape.x", [0.0, 1.0e300])),
        "infinite gravity": level(to("gravity", math.inf)),
        "gravity upwards": level(to("gravity", -9.81)),
    },
    "densities": {
        "porosity below zero": level(to(f"{LOWER}.porosity", -0.1)),
        "porosity against Dr": level(to(f"{UPPER}.porosity", 0.5)),
        "void ratio against Dr": level(to(f"{UPPER}.void_ratio", 0.7)),
        "void ratio of zero": level(to(f"{LOWER}.void_ratio", 0.0)),
        "unit weights that disagree": level(to(f"{UPPER}.saturated_unit_weight", 19.0)),
        "unit weight of zero": level(to(f"{LOWER}.dry_unit_weight", 0.0)),
        "bulk unit weight below zero": level(to(f"{LOWER}.bulk_unit_weight", -18.0)),
        "too few": level(without(f"{LOWER}.porosity")),
        "beyond the solids": level(
            without(f"{LOWER}.porosity"), to(f"{LOWER}.Gs", 2.4), to(f"{LOWER}.saturated_unit_weight", 30.0)
        ),
        "solids lighter than water": level(to(f"{UPPER}.Gs", 0.9)),
    },
    "soil at rest": {
        "K0 of one": level(to(f"{UPPER}.K0", 1.0)),
        "conductivity below zero": level(to(f"{UPPER}.hydraulic_conductivity", -1e-5)),
        "conductivity as text": level(to(f"{UPPER}.hydraulic_conductivity", "fast")),
        "no conductivity across layers": seeping(
            to(f"{SOIL}.hydraulic_conductivity", {"horizontal": 1e-5, "vertical": 0.0})
        ),
        "conductivity along layers below zero": seeping(
            to(f"{SOIL}.hydraulic_conductivity", {"horizontal": -1e-5, "vertical": 1e-6})
        ),
        "layers steeper than vertical": seeping(
            to(f"{SOIL}.hydraulic_conductivity", {"horizontal": 1e-5, "vertical": 1e-6, "angle_deg": 120.0})
        ),
        "infinite capillary rise": seeping(to(f"{SOIL}.retention.alpha", 0.0)),
        "alpha below zero": seeping(to(f"{SOIL}.retention.alpha", -2.0)),
        "steepness of one": seeping(to(f"{SOIL}.retention.n", 1.0)),
        "residual saturation equal to the full one": seeping(
            to(f"{SOIL}.retention.residual_saturation", 0.5), to(f"{SOIL}.retention.full_saturation", 0.5)
        ),
        "residual of one": seeping(to(f"{SOIL}.retention.residual_saturation", 1.0)),
        "saturation above one": seeping(to(f"{SOIL}.retention.full_saturation", 1.2)),
        "retention of an unknown kind": seeping(to(f"{SOIL}.retention.kind", "gardner")),
    },
    "sand": {
        "Dr of zero": level(to(f"{SAND}.Dr", 0.0)),
        "Dr in per cent": level(to(f"{SAND}.Dr", 55.0)),
        "Dr above one by its long name": level(without(f"{SAND}.Dr"), to(f"{SAND}.relative_density", 1.1)),
        "Dr above one, in Python": lambda: sb.PM4Sand(Dr=1.2, G0=677.0, hpo=0.4),
        "Dr twice, in Python": lambda: sb.PM4Sand(0.5, 600.0, 0.4, Dr=0.6),
        "G0 as text": level(to(f"{SAND}.G0", "677")),
        "G0 of zero": level(to(f"{SAND}.G0", 0.0)),
        "hpo below zero": level(to(f"{SAND}.hpo", -0.4)),
        "nu of a half": level(to(f"{SAND}.nu", 0.5)),
        "void ratio limits swapped": level(to(f"{SAND}.e_max", 0.5), to(f"{SAND}.e_min", 0.8)),
        "void ratio beyond any soil": level(to(f"{SAND}.e_max", 1.0e9)),
        "smallest void ratio of zero": level(to(f"{SAND}.e_min", 0.0)),
        "yield surface beyond the core's range": level(to(f"{SAND}.m", 5.0)),
        "friction angle beyond any sand": level(to(f"{SAND}.phi_cv", 60.0)),
        "atmosphere of zero": level(to(f"{SAND}.p_atm", 0.0)),
        "ho of zero": level(to(f"{SAND}.ho", 0.0)),
        "nb below zero": level(to(f"{SAND}.nb", -0.5)),
        "nd below zero": level(to(f"{SAND}.nd", -0.1)),
        "Ado of zero": level(to(f"{SAND}.Ado", 0.0)),
        "z_max below zero": level(to(f"{SAND}.z_max", -1.0)),
        "cz below zero": level(to(f"{SAND}.cz", -250.0)),
        "ce below zero": level(to(f"{SAND}.ce", -1.0)),
        "C_GD below one": level(to(f"{SAND}.C_GD", 0.5)),
        "C_DR below zero": level(to(f"{SAND}.C_DR", -1.0)),
        "C_kaf below zero": level(to(f"{SAND}.C_kaf", -1.0)),
        "Q of zero": level(to(f"{SAND}.Q", 0.0)),
        "R of zero": level(to(f"{SAND}.R", 0.0)),
        "F_sed_min above one": level(to(f"{SAND}.F_sed_min", 1.5)),
        "p_sed_o of zero": level(to(f"{SAND}.p_sed_o", 0.0)),
        "negative blow count": lambda: sb.PM4Sand.from_spt(N160cs=-5.0),
        "cone resistance of zero": lambda: sb.PM4Sand.from_cpt(qc1Ncs=0.0),
        "of a density in per cent": lambda: sb.PM4Sand.from_density(Dr=55.0),
    },
    "other soils": {
        "misspelt": level(to(f"{SAND}.kind", "pm4snd")),
        "without a kind": material(E=1.0, nu=0.3),
        "as text": level(to(ROCK, "elastic")),
        "elastic, two pairs mixed": material(kind="elastic", G=1e4, nu=0.3),
        "elastic, without moduli": material(kind="elastic"),
        "elastic, G of zero": material(kind="elastic", G=0.0, K=1e4),
        "elastic, K below zero": material(kind="elastic", G=1e4, K=-1e4),
        "elastic, E of zero": material(kind="elastic", E=0.0, nu=0.3),
        "elastic, nu of a half": material(kind="elastic", E=5e4, nu=0.5),
        "elastic by pressure, exponent above one": material(
            kind="pressure_elastic", E=5e4, nu=0.3, exponent=2.0
        ),
        "elastic by pressure, pressure of zero": material(kind="pressure_elastic", E=5e4, nu=0.3, p_ref=0.0),
        "friction angle above 90 degrees": material(kind="mohr_coulomb", c=0.0, phi=95.0, E=5e4, nu=0.3),
        "friction below zero": material(kind="mohr_coulomb", c=0.0, phi=-5.0, E=5e4, nu=0.3),
        "neither cohesion nor friction": material(kind="mohr_coulomb", c=0.0, phi=0.0, E=5e4, nu=0.3),
        "cohesion below zero": material(kind="mohr_coulomb", c=-5.0, phi=30.0, E=5e4, nu=0.3),
        "dilation above friction": material(kind="mohr_coulomb", c=0.0, phi=30.0, psi=35.0, E=5e4, nu=0.3),
        "tension below zero": material(
            kind="mohr_coulomb", c=1.0, phi=30.0, tension_cutoff=-1.0, E=5e4, nu=0.3
        ),
        "tension beyond the apex": material(
            kind="mohr_coulomb", c=1.0, phi=30.0, tension_cutoff=50.0, E=5e4, nu=0.3
        ),
        "residual without its strain": material(
            kind="drucker_prager", c=9.0, phi=30.0, c_residual=1.0, E=5e4, nu=0.3
        ),
        "strain without a residual": material(
            kind="drucker_prager", c=9.0, phi=30.0, softening_strain=0.05, E=5e4, nu=0.3
        ),
        "softening steeper than unloading": material(
            kind="drucker_prager", c=90.0, phi=30.0, c_residual=1.0, softening_strain=1e-6, E=5e4, nu=0.3
        ),
        "residual friction below zero": material(
            kind="drucker_prager", c=9.0, phi=30.0, phi_residual=-1.0, softening_strain=0.05, E=5e4, nu=0.3
        ),
        "residual dilation below zero": material(
            kind="drucker_prager", c=9.0, phi=30.0, psi_residual=-1.0, softening_strain=0.05, E=5e4, nu=0.3
        ),
        "residual cohesion above the peak": material(
            kind="drucker_prager", c=9.0, phi=30.0, c_residual=20.0, softening_strain=0.05, E=5e4, nu=0.3
        ),
        "matching misspelt": material(
            kind="drucker_prager", c=9.0, phi=30.0, matching="usuall", E=5e4, nu=0.3
        ),
        "undrained strength of zero": material(kind="total_stress", Su=0.0, E=5e4, nu=0.3),
        "residual strength above the peak": material(
            kind="total_stress", Su=30.0, Sr=40.0, softening_strain=0.1, E=5e4, nu=0.3
        ),
        "residual strength without its strain": material(
            kind="total_stress", Su=30.0, Sr=10.0, E=5e4, nu=0.3
        ),
        "residual strength of zero": material(
            kind="total_stress", Su=30.0, Sr=0.0, softening_strain=0.1, E=5e4, nu=0.3
        ),
        "softening misspelt": material(kind="total_stress", Su=30.0, softening="linnear", E=5e4, nu=0.3),
        "criterion misspelt": material(kind="total_stress", Su=30.0, criterion="mises", E=5e4, nu=0.3),
        "softening strain of zero": material(
            kind="total_stress", Su=30.0, Sr=10.0, softening_strain=0.0, E=5e4, nu=0.3
        ),
    },
    "still water": {
        "unit weight of zero": level(to("water.unit_weight", 0.0)),
        "bulk modulus below zero": level(to("water.bulk_modulus", -1e6)),
        "table in the ground": level(to("water_table", {"depth": 2.0})),
        "table twice": level(to("water_table", {"depth": 0.0, "elevation": 10.0})),
        "table without a level": level(to("water_table", {})),
        "table that turns back": seeping(to("water_table", {"points": [[5.0, 4.0], [5.0, 3.0]]})),
        "table of one point": seeping(to("water_table", {"points": [[5.0, 4.0]]})),
        "soil above it misspelt": level(to("water_table.above", "dri")),
        "without a table": level(without("water_table")),
        "table without water": level(without("water")),
        "elevation that is not a number": seeping(to("water_table.elevation", math.nan)),
    },
    "seepage": {
        "head below the base": seeping(to(f"{SECOND}.head", -1.0)),
        "head that is not a number": seeping(to(f"{SECOND}.head", math.nan)),
        "level below the base": seeping(to(f"{FIRST}.level", -1.0)),
        "level that falls below the base": lasting(to(f"{FIRST}.level", [[0.0, 4.0], [5.0, -0.5]])),
        "infinite level": seeping(to(f"{FIRST}.level", math.inf)),
        "level as text": seeping(to(f"{FIRST}.level", "high")),
        "level by numbers instead of pairs": seeping(to(f"{FIRST}.level", [0.0, 4.0])),
        "level by an empty list": lasting(to(f"{FIRST}.level", [])),
        "times that do not increase": lasting(to(f"{FIRST}.level", [[0.0, 4.0], [0.0, 3.0]])),
        "change on the way to a steady state": seeping(to(f"{FIRST}.level", [[0.0, 4.0], [1.0, 3.0]])),
        "reservoir on no edge": seeping(to(f"{FIRST}.on", "top")),
        "reservoir beside the section": seeping(
            adding(kind="reservoir", on="surface", x=[20.0, 30.0], level=4.0)
        ),
        "tolerance of one": seeping(to("stages.0.tolerance", 1.0)),
        "tolerance of a steady state": seeping(to("stages.0.tolerance", 0.01)),
        "x that falls": seeping(adding(kind="seepage-face", on="surface", x=[5.0, 3.0])),
        "x on a vertical edge": seeping(to(f"{FIRST}.x", [0.0, 3.0])),
        "point off the edge": seeping(to(f"{FIRST}.on", [[0.0, 0.0], [3.0, 2.0]])),
        "line across the section": seeping(to(f"{FIRST}.on", [[0.0, 2.0], [10.0, 2.0]])),
        "one point": seeping(to(f"{FIRST}.on", [[0.0, 0.0]])),
        "points that are not pairs": seeping(to(f"{FIRST}.on", [[0.0, 0.0, 0.0], [0.0, 4.0, 0.0]])),
        "line without length": seeping(to(f"{FIRST}.on", [[0.0, 1.0], [0.0, 1.0]])),
        "drain that leaves the section": seeping(adding(kind="drain", points=[[5.0, 2.0], [5.0, 9.0]])),
        "drain without length": seeping(adding(kind="drain", points=[[5.0, 2.0], [5.0, 2.0]])),
        "drain of one point": seeping(adding(kind="drain", points=[[5.0, 2.0]])),
        "edge with two conditions": seeping(adding(kind="seepage-face", on=[[10.0, 3.0], [10.0, 4.0]])),
        "head below soil without a retention curve": seeping(without(f"{SOIL}.retention")),
        "seepage face beside soil without a retention curve": under(
            LEFT, {"kind": "seepage-face", "on": "right"}
        ),
        "drain in soil without a retention curve": under(
            LEFT, {"kind": "drain", "points": [[5.0, 1.0], [6.0, 1.0]]}
        ),
        "pressure beside soil without a retention curve": under(
            LEFT, {"kind": "pressure", "on": "right", "pressure": 10.0}
        ),
        "pressure as text": seeping(to(SECOND, {"kind": "pressure", "on": "right", "pressure": "low"})),
        "drain under a pond that does not reach all of the ground": under(
            {"kind": "reservoir", "on": "surface", "x": [0.0, 5.0], "level": 5.0},
            {"kind": "drain", "points": [[5.0, 1.0], [6.0, 1.0]]},
        ),
        "steady state of fluxes alone": seeping(
            to("stages.0.conditions", [{"kind": "flux", "on": "left", "inflow": 1e-6}])
        ),
        "flux left out": seeping(to(SECOND, {"kind": "flux", "on": "right"})),
        "no condition": seeping(to("stages.0.conditions", [])),
        "unknown condition": seeping(to(f"{FIRST}.kind", "river")),
        "negative rain": seeping(adding(kind="rain", on="surface", rate=-1e-6)),
        "rain on a wall": seeping(adding(kind="rain", on="left", rate=1e-6)),
        "no time": seeping(to("stages.0.duration", 0.0)),
        "after gravity": seeping(lambda scene: scene["stages"].insert(0, {"kind": "gravity"})),
        "without water": seeping(without("water"), without("water_table")),
        "in impermeable ground": seeping(without(f"{SOIL}.hydraulic_conductivity")),
        "condition on a periodic side": seeping(without("sides")),
        "points on a periodic side": seeping(without("sides"), to(f"{FIRST}.on", [[0.0, 0.0], [0.0, 4.0]])),
    },
    "water while the ground moves": {
        "in dry ground": shaken(conditions=[LEFT]),
        "in impermeable ground": moving([LEFT], without(f"{SOIL}.hydraulic_conductivity")),
        "into soil that is dry above the water": moving(
            [{"kind": "rain", "on": "surface", "rate": 1e-6}],
            to("water_table", {"elevation": 2.0, "above": "dry"}),
        ),
        "on a free-field side": moving([LEFT], to("sides", {"kind": "free-field"})),
        "that changes beside free-field sides": moving(
            [{"kind": "head", "on": "surface", "head": [[0.0, 4.0], [1.0, 6.0]]}],
            to("sides", {"kind": "free-field"}),
        ),
        "on no edge": moving([LEFT | {"on": "top"}]),
    },
    "run-out": {
        "for a duration of zero": flowing(duration=0.0),
        "for a duration as text": flowing(duration="long"),
        "without a duration": slope(to(SHAKING, {"kind": "run-out"})),
        "with a negative viscosity": flowing(viscosity=-0.1),
        "with a viscosity that is not a number": flowing(viscosity=float("nan")),
        "in water whose surface turns back": flowing(still_water=[[0.0, 4.0], [2.0, 4.0], [1.0, 3.0]]),
        "in water by numbers instead of pairs": flowing(still_water=[4.0, 5.0]),
        "in water with dry ground": flowing(still_water=[[0.0, 4.0]]),
        "with an open side of an unknown name": flowing(open_sides=["top"]),
        "with an open periodic side": level(
            to(SHAKING, {"kind": "run-out", "duration": 1.0, "open_sides": ["right"]})
        ),
        "before shaking": slope(
            to("stages", [{"kind": "gravity"}, RUN_OUT, {"kind": "shaking", "duration": 5.0}])
        ),
        "twice": slope(to("stages", [{"kind": "gravity"}, RUN_OUT, RUN_OUT])),
        "without gravity": slope(to("stages", [RUN_OUT])),
        "with printed operators": slope(to(SHAKING, RUN_OUT), to("numerics", {"operators": "printed"})),
        "with corrected inertia": slope(
            to(SHAKING, RUN_OUT), to("numerics", {"dispersion_correction": True}), to("sides.kind", "roller")
        ),
    },
    "base and sides": {
        "sides of an unknown kind": level(to("sides", {"kind": "periodc"})),
        "only one side": slope(to("sides", {"kind": "sides", "left": {"kind": "roller"}})),
        "one periodic side": slope(
            to("sides", {"kind": "sides", "left": {"kind": "roller"}, "right": {"kind": "periodic"}})
        ),
        "periodic sides of different heights": level(
            to(f"{UPPER}.shape", {"kind": "polygon", "points": [[0, 4], [1, 4], [1, 9], [0, 10]]})
        ),
        "side that is not vertical": level(
            to(f"{UPPER}.shape", {"kind": "polygon", "points": [[0, 4], [1, 4], [0.5, 10], [0, 10]]})
        ),
        "side too low": slope(
            to(f"{UPPER}.shape.points", [[0, 0], [30, 0], [30, 1], [20, 4], [12, 8], [0, 8]])
        ),
        "side that is left and met again": slope(
            to(f"{UPPER}.shape.points", [[0, 0], [30, 0], [30, 4], [20, 4], [30, 8], [0, 8]])
        ),
        "base not level between periodic sides": level(
            to(f"{LOWER}.shape", {"kind": "polygon", "points": [[0, 0], [0.5, 1], [1, 0], [1, 4], [0, 4]]})
        ),
        "half a base": level(to(f"{SHAKING}.base", {"kind": "compliant", "Vs": 300.0})),
        "Vs of zero": level(to(f"{SHAKING}.base", {"Vs": 0.0, "density": 2.0})),
        "density in kg/m3": level(to(f"{SHAKING}.base", {"Vs": 300.0, "density": -2000.0})),
        "Vp alone": level(to(f"{SHAKING}.base", {"Vp": 900.0})),
        "Vp too slow": level(to(f"{SHAKING}.base", {"Vs": 300.0, "density": 2.0, "Vp": 300.0})),
        "absorbing without Vp": level(
            to(f"{SHAKING}.base", {"Vs": 300.0, "density": 2.0, "vertical": "absorbing"})
        ),
        "vertical misspelt": level(to(f"{SHAKING}.base", {"vertical": "rollers"})),
        "apparent velocity of zero": shaken(base={"apparent_velocity": 0.0}),
        "apparent velocity beside segments": shaken(
            base={"apparent_velocity": 500.0, "segments": [{"x": [0, 30]}]}
        ),
        "apparent velocity between periodic sides": level(
            to(f"{SHAKING}.base", {"apparent_velocity": 500.0})
        ),
        "wave that arrives too late": shaken(base={"apparent_velocity": 5.0}),
        "segments that leave a gap": shaken(base={"segments": [{"x": [0, 10]}, {"x": [20, 30]}]}),
        "segments that overlap": shaken(base={"segments": [{"x": [0, 20]}, {"x": [10, 30]}]}),
        "segment without length": shaken(base={"segments": [{"x": [10, 10]}]}),
        "segment with a negative delay": shaken(base={"segments": [{"x": [0, 30], "delay": -1.0}]}),
        "segment too late": shaken(base={"segments": [{"x": [0, 30], "delay": 9.0}]}),
        "Vs alone under a base that is not level": slope(
            to(f"{UPPER}.shape.points", [[0, 0], [30, 1], [30, 4], [20, 4], [12, 8], [0, 8]]),
            to(f"{SHAKING}.base", {"Vs": 300.0, "density": 2.0}),
        ),
    },
    "stages": {
        "none": level(to("stages", [])),
        "of an unknown kind": level(to("stages", [{"kind": "gravty"}])),
        "shaking first": level(to("stages", [{"kind": "shaking", "duration": 1.0}])),
        "gravity again": level(to("stages", [{"kind": "gravity"}, {"kind": "gravity"}])),
        "no end to standing still": level(to("stages", [{"kind": "gravity"}, {"kind": "shaking"}])),
        "duration below zero": level(to(f"{SHAKING}.duration", -1.0)),
        "tolerance of one": level(to("stages.0.tolerance", 1.0)),
        "steps not whole": level(to("stages.0.max_steps", 10.5)),
        "no steps": level(to("stages.0.max_steps", 0)),
        "initial Poisson's ratio of a half": level(to("stages.0.initial_poisson_ratio", 0.5)),
        "base in statics misspelt": level(to("stages.0.base", "noslip")),
        "damping in per cent": level(to(f"{SHAKING}.rayleigh", {**WAVY, "ratio": 0.5})),
        "no damping": level(to(f"{SHAKING}.rayleigh", {**WAVY, "ratio": 0.0})),
        "damping without its frequencies": level(to(f"{SHAKING}.rayleigh", {"ratio": 0.005})),
        "frequencies that fall": level(to(f"{SHAKING}.rayleigh", {**WAVY, "frequencies": [10.0, 1.0]})),
        "one frequency twice": level(to(f"{SHAKING}.rayleigh", {**WAVY, "frequencies": [2.0, 2.0]})),
        "a frequency of zero": level(to(f"{SHAKING}.rayleigh", {**WAVY, "frequencies": [0.0, 10.0]})),
        "damping of the printed operators": level(
            to("numerics", {"operators": "printed"}), to(f"{SHAKING}.rayleigh", WAVY)
        ),
        "bases that differ": level(
            to(
                "stages",
                [
                    {"kind": "gravity"},
                    {"kind": "shaking", "duration": 1.0},
                    {"kind": "shaking", "duration": 1.0, "base": {"vertical": "absorbing"}},
                ],
            )
        ),
        "a number for a motion, in Python": lambda: sb.Shaking(3.0),
        "a motion for a scene that has none": lambda: sb.Scene(**SOUND).with_motion(
            sb.Motion.ricker(2.0, 0.1)
        ),
    },
    "motions": {
        "without a source": level(to(MOTION, {"scale": 0.5})),
        "from two sources": level(to(MOTION, {"file": "a.AT2", "dt": 0.1, "velocity": [0.0, 1.0]})),
        "samples without their dt": level(to(MOTION, {"acceleration_g": [0.0, 1.0]})),
        "dt beside a file": level(to(MOTION, {"file": "a.AT2", "dt": 0.01})),
        "dt of zero": level(to(MOTION, {"dt": 0.0, "velocity": [0.0, 1.0]})),
        "samples as text": level(to(MOTION, {"dt": 0.01, "velocity": ["up", "down"]})),
        "samples that are not finite": level(to(MOTION, {"dt": 0.01, "velocity": [0.0, math.nan]})),
        "of an unknown kind": level(to(MOTION, {"kind": "outcropp", "dt": 0.01, "velocity": [0.0, 0.1]})),
        "misspelt argument of a generator": level(to(MOTION, {"synthetic": {"pga": 0.3}})),
        "missing argument of a generator": level(to(MOTION, {"ricker": {"frequency": 2.0}})),
        "infinite scale": level(to(MOTION, {"synthetic": {}, "scale": math.inf})),
        "vertical on a roller": shaken(
            vertical={"ricker": {"frequency": 2.0, "pga_g": 0.1}}, base={"vertical": "roller"}
        ),
        "vertical of another kind": shaken(
            vertical={"kind": "upgoing", "ricker": {"frequency": 2.0, "pga_g": 0.1}}
        ),
        "vertical beside a segment's own": shaken(
            vertical={"ricker": {"frequency": 2.0, "pga_g": 0.1}},
            base={"segments": [{"x": [0, 30], "motion": {"ricker": {"frequency": 2.0, "pga_g": 0.1}}}]},
        ),
        "within the ground": simulated(kind="within", dt=0.01, velocity=[0.0, 0.1, 0.0]),
        "whose file does not exist": simulated(file="none.AT2"),
        "whose file has a very long line": written("m.csv", "1" * 200_000, sb.Motion.from_csv),
        "of one sample": simulated(dt=0.01, velocity=[0.0]),
        "with an impossible acceleration": simulated(dt=0.01, acceleration_g=[0.0, 980.0, 0.0]),
        "with dt in milliseconds": simulated(dt=5.0, acceleration_g=[0.0, 0.1, 0.0]),
        "synthetic motion with a peak of zero": simulated(synthetic={"pga_g": 0.0}),
        "synthetic motion with a duration of zero": simulated(synthetic={"duration": -1.0}),
        "Ricker pulse with a frequency of zero": simulated(ricker={"frequency": 0.0, "pga_g": 0.1}),
        "two quantities, in Python": lambda: sb.Motion(dt=0.1, acceleration_g=[0, 0.1], velocity=[0, 0.1]),
    },
    "output": {
        "depth outside": level(to("output.depths", [4.0, 11.0])),
        "depth as an elevation": level(to("output.depths", [-4.0])),
        "depth named twice": level(to("output.depths", [4.0, 4.0])),
        "point outside": level(to("output.points", [[0.5, 3.0], [2.0, 3.0]])),
        "point of one number": level(to("output.points", [[0.5]])),
        "no time between histories": level(to("output.history_dt", 0.0)),
        "no time between fields": level(to("output.field_dt", -0.25)),
        "a frame every nanosecond": level(to("output.field_dt", 1.0e-9)),
        "envelope misspelt": level(to("output.envelopes", ["r_u", "gama_max"])),
        "stress paths by a number": level(to("output.stress_paths", 1)),
    },
    "numerics": {
        "operators misspelt": level(to("numerics", {"operators": "conservativ"})),
        "smoothing below one": level(to("numerics", {"smoothing_ratio": 0.5})),
        "filter above one": level(to("numerics", {"velocity_filter": 1.5})),
        "damping of one": level(to("numerics", {"local_damping": 1.0})),
        "time step factor of zero": level(to("numerics", {"time_step_factor": 0.0})),
        "misspelt integrator": level(to("numerics", {"integrator": "rk44"})),
        "tolerance too large": level(to("numerics", {"integrator_tolerance": 0.1})),
        "tolerance for another integrator": level(
            to("numerics", {"integrator": "rk4", "integrator_tolerance": 1e-5})
        ),
        "diffusion misspelt": level(to("numerics", {"diffusion": "implict"})),
        "acceleration term misspelt": level(to("numerics", {"acceleration_term": "yes"})),
        "acceleration term that implicit diffusion drops": level(
            to("numerics", {"diffusion": "implicit", "acceleration_term": "on"})
        ),
        "filter with the printed operators": level(
            to("numerics", {"operators": "printed", "velocity_filter": 0.1})
        ),
        "corrected inertia with the printed operators": level(
            to("numerics", {"operators": "printed", "dispersion_correction": True})
        ),
        "corrected inertia beside free-field sides": slope(to("numerics", {"dispersion_correction": True})),
        "corrected inertia by a number": level(to("numerics", {"dispersion_correction": 1})),
        "printed operators in wet ground beside free-field sides": seeping(
            to("sides", {"kind": "free-field"}),
            to("stages", [{"kind": "gravity"}]),
            to("numerics", {"operators": "printed"}),
        ),
        "geometry renewed at no strain": level(to("numerics", {"geometry_strain_limit": 0.0})),
        "gap memory as text": level(to("numerics", {"gap_memory": "yes"})),
    },
    "runs": {
        "zero threads": ran(threads=0),
        "too many threads": ran(threads=257),
        "threads as a bool": ran(threads=True),
        "accuracy misspelt": ran(accuracy="standart"),
        "folder that holds a run": lambda: (Path("out").mkdir(), Path("out/results.h5").touch(), ran()()),
        "folder that is a file": lambda: (Path("file").touch(), ran(out="file")()),
        "folder below a file": lambda: (Path("file").touch(), ran(out="file/out")()),
        "resumed in an empty folder": ran(resume=True),
        "resumed and started at once": ran(resume=True, start=("other", "gravity")),
        "started from an empty folder": ran(start=("other", "gravity")),
        "columns from an empty folder": ran(columns="other"),
        "columns of periodic sides": ran(keep_columns=True),
        "checkpoint interval of zero": ran(checkpoint_seconds=0.0),
        "negative checkpoint interval": ran(checkpoint_time=-1.0),
    },
    "parts on their own, in Python": {
        "no conductivity across layers": lambda: sb.Conductivity(1e-5, 0.0),
        "retention of no steepness": lambda: sb.VanGenuchten(alpha=2.0, n=1.0),
        "head at decreasing times": lambda: sb.Head("left", head=[(1.0, 0.0), (0.0, 0.0)]),
        "negative rain": lambda: sb.Rain("surface", rate=-1e-6),
        "drain of one point": lambda: sb.Drain([(0.0, 0.0)]),
        "seepage of nothing": lambda: sb.Seepage([]),
    },
    "results": {
        "missing": lambda: sb.load("nowhere"),
        "of another format": written("run/results.h5", "", results_of_another_format),
        "that point elsewhere": written("run/results.h5", "", results_that_point_elsewhere),
        "without end": written("run/results.h5", "", results_without_end),
        "of another code, missing": lambda: Reference.read("nowhere"),
        "of another code, without rows": written(
            "other/histories.csv", "time_s,acc_surface_g\n", lambda path: Reference.read(path.parent)
        ),
    },
    "cyclic shear": {
        "csr of zero": cyclic(csr=0.0),
        "csr below zero": cyclic(csr=-0.1),
        "csr that is not a number": cyclic(csr=math.nan),
        "csr as text": cyclic(csr="0.1"),
        "csr as an array": cyclic(csr=np.array([0.1])),
        "csr beyond the strength, drained": cyclic(csr=2.0, drained=True),
        "csr beyond the strength": cyclic(csr=30.0),
        "csr beyond the strength of loose sand": cyclic(csr=0.9, soil=LOOSE),
        "misspelt csr": cyclic(cccsr=0.1),
        "misspelt stress": cyclic(sigma_v=100.0),
        "misspelt gamma_stop": cyclic(gamma_stopp=0.1),
        "stress in tension": cyclic(sigma_v0=-100.0),
        "stress below the smallest that sand carries": cyclic(sigma_v0=0.2),
        "K0 of zero": cyclic(K0=0.0),
        "K0 too small for the strength": cyclic(K0=0.1),
        "K0 too large for the strength": cyclic(K0=9.0),
        "static shear beyond the strength": cyclic(static_shear_ratio=0.8),
        "negative static shear beyond the strength": cyclic(static_shear_ratio=-0.8),
        "void ratio above the largest": cyclic(void_ratio=0.9),
        "void ratio below the smallest": cyclic(void_ratio=0.45),
        "void ratio of zero": cyclic(void_ratio=0.0),
        "void ratio for a soil without void ratio": cyclic(void_ratio=0.6, soil=HOOKE),
        "gamma_stop of zero": cyclic(gamma_stop=0.0),
        "gamma_stop in per cent": cyclic(gamma_stop=5.0),
        "max_cycles of zero": cyclic(max_cycles=0),
        "fractional max_cycles": cyclic(max_cycles=2.5),
        "max_cycles as a bool": cyclic(max_cycles=True),
        "max_cycles too large": cyclic(max_cycles=10**20),
        "drained as text": cyclic(drained="no"),
        "misspelt integrator": cyclic(integrator="rk44"),
        "integrator for a soil in closed form": cyclic(integrator="rk4", soil=HOOKE),
        "tolerance too large": cyclic(tolerance=0.1),
        "tolerance for another integrator": cyclic(tolerance=1e-5, integrator="rk4"),
        "tolerance for a soil in closed form": cyclic(tolerance=1e-5, soil=HOOKE),
        "no loading": cyclic(csr=None),
        "two loadings": cyclic(reversals=[0.1]),
        "empty reversals": cyclic(csr=None, reversals=[]),
        "reversals as a table": cyclic(csr=None, reversals=[[0.1, -0.1]]),
        "infinite reversal": cyclic(csr=None, reversals=[0.1, math.inf]),
        "reversals as text": cyclic(csr=None, reversals=["up", "down"]),
        "reversal beyond the strength": cyclic(csr=None, reversals=[0.1, -30.0]),
        "reversal in the same direction": cyclic(csr=None, reversals=[0.1, 0.2]),
        "repeated reversal": cyclic(csr=None, reversals=[0.1, -0.1, -0.1]),
        "first reversal at the initial stress": cyclic(csr=None, reversals=[0.1], static_shear_ratio=0.1),
        "strain reversal beyond gamma_stop": cyclic(csr=None, gamma_reversals=[0.01, -0.2]),
        "first strain reversal at zero": cyclic(csr=None, gamma_reversals=[0.0, 0.01]),
        "soil as text": cyclic(soil="sand"),
        "soil as a class": cyclic(soil=sb.PM4Sand),
        "soil of None": cyclic(soil=None),
    },
    "other tests": {
        "monotonic shear to zero strain": tested(lab.monotonic_dss, gamma_max=-0.1),
        "monotonic shear with a misspelt gamma_max": tested(lab.monotonic_dss, gamma_mx=0.1),
        "shear with a K0 beyond the strength": tested(lab.monotonic_dss, K0=0.05),
        "missing strain path": tested(lab.strain_path, stress0=STRESS),
        "empty strain path": led(strain=[]),
        "strain path with two components": led(strain=[(0.0, 0.1)]),
        "strain path in per cent": led(strain=[(0.0, 0.0, 5.0)]),
        "strain path that is not finite": led(strain=[(0.0, 0.0, math.nan)]),
        "initial stress with two components": led(stress0=(1.0, 2.0)),
        "initial stress in tension": led(stress0=(50, 100, 0)),
        "initial stress beyond the strength": led(stress0=(-9, -100, 0)),
        "initial stress in Pa": led(stress0=(-1e9, -1.0, 0.0)),
        "stress path with one dimension": tested(lab.stress_path, stress0=STRESS, stress=[1.0, 2.0, 3.0]),
        "stress path in Pa": tested(lab.stress_path, stress0=STRESS, stress=[(0.0, 0.0, 1e9)]),
        "compression to zero strain": tested(lab.plane_strain_compression, axial_strain_max=1.0),
        "compression with a K0 beyond the strength": tested(lab.plane_strain_compression, K0=30.0),
        "amplitude of zero": tested(lab.modulus_reduction, strains=[0.0, 1e-3]),
        "misspelt amplitudes": tested(lab.modulus_reduction, strain=[1e-3]),
        "zero cycles of strain": tested(lab.modulus_reduction, cycles=0),
        "reconsolidation of None": lambda: lab.reconsolidation(None),
        "cell size not a multiple of the spacing": celled(spacing=0.025),
        "cell too small around its centre": celled(size=0.16),
        "cell with too small a centre": celled(free_size=0.02),
        "cell with gamma_stop too large": celled(gamma_stop=0.5),
        "cell with a density of zero": celled(density=0.0),
        "cell with a negative density": celled(density=-2000.0),
        "cell with inertia too large": celled(inertia=2.0),
        "cell with strain_step too large": celled(strain_step=0.1),
        "cell with local damping of 1": celled(local_damping=1.0),
        "cell with a negative velocity filter": celled(velocity_filter=-1.0),
        "cell with zero threads": celled(threads=0),
        "cell with soil as text": celled(soil="sand"),
    },
    "resistance": {
        "in zero cycles": tested(lab.crr, cycles=0.5),
        "to zero strain": tested(lab.crr, gamma_sa=0.0),
        "to two criteria": tested(lab.crr, gamma_sa=0.03, r_u=0.98),
        "to r_u above 1": tested(lab.crr, r_u=1.5),
        "with a K0 beyond the strength": tested(lab.crr, K0=0.05),
        "curve with a K0 beyond the strength": tested(lab.crr_curve, K0=0.05),
        "curve at a negative ratio": tested(lab.crr_curve, csr=[0.1, -0.1]),
        "curve at a ratio beyond the strength": tested(lab.crr_curve, csr=[0.1, 30.0]),
        "curve with max_cycles of zero": tested(lab.crr_curve, max_cycles=0),
        "overburden in tension": tested(lab.k_sigma, sigma_v0=[100.0, -100.0]),
        "overburden factor for a soil other than PM4Sand": tested(lab.k_sigma, soil=HOOKE),
        "static shear ratio beyond the range of the factor": tested(
            lab.k_alpha, static_shear_ratio=[0.0, 0.9]
        ),
        "calibrated to a crr of zero": lambda: lab.calibrate_hpo(Dr=0.55, G0=677.0, crr=0.0),
        "calibrated at a density in per cent": lambda: lab.calibrate_hpo(Dr=55.0, G0=677.0, crr=0.1),
        "calibrated with a given hpo": lambda: lab.calibrate_hpo(Dr=0.55, G0=677.0, crr=0.1, hpo=0.4),
        "calibrated with misspelt cycles": lambda: lab.calibrate_hpo(Dr=0.55, G0=677.0, crr=0.1, cycle=15),
        "calibrated with a K0 beyond the strength": lambda: lab.calibrate_hpo(
            Dr=0.55, G0=677.0, crr=0.1, K0=0.05
        ),
        "calibrated with a nu of a half": lambda: lab.calibrate_hpo(Dr=0.55, G0=677.0, crr=0.1, nu=0.5),
    },
    "the command line": {
        "scene that does not exist": commanded("plan", "none.toml"),
        "motion file that does not exist": commanded(
            "run", "scene.toml", "--out", "out", "--motion", "none.AT2"
        ),
        "unit without a motion": commanded("run", "scene.toml", "--out", "out", "--unit", "g"),
        "unknown unit": commanded("motion", "info", "record.csv", "--unit", "km"),
        "unit for an .AT2 file": commanded("motion", "info", "record.AT2", "--unit", "g"),
        "unknown column": commanded("motion", "info", "record.csv", "--column", "velocity"),
        "motion for a scene that has none": commanded("plan", "scene.toml", "--motion", "record.csv"),
        "folder that holds a run": commanded("run", "scene.toml", "--out", "used"),
        "folder that is a file": commanded("run", "scene.toml", "--out", "file"),
        "threads below one": commanded("run", "scene.toml", "--out", "out", "--threads", 0),
        "plan with zero threads": commanded("plan", "scene.toml", "--threads", 0),
        "checkpoint interval of zero": commanded(
            "run", "scene.toml", "--out", "out", "--checkpoint-seconds", 0
        ),
        "resumed in an empty folder": commanded("run", "scene.toml", "--out", "out", "--resume"),
        "pictures of an empty folder": commanded("plot", "out"),
        "spectrum with damping above 1": commanded("motion", "spectrum", "record.csv", "--damping", 2),
        "record converted to nothing": commanded("motion", "convert", "record.csv", "--out", "x.txt"),
        "record converted into a missing folder": commanded(
            "motion", "convert", "record.csv", "--out", "none/x.csv"
        ),
        "record scaled to zero": commanded("motion", "convert", "record.csv", "--out", "x.csv", "--pga", 0),
        "record filtered above the Nyquist frequency": commanded(
            "motion", "convert", "record.csv", "--out", "x.csv", "--high", 500
        ),
        "record outside the section": commanded(
            "motion", "deconvolve", "record.csv", "--scene", "scene.toml", "--out", "x.csv", "--x", 50
        ),
        "base motion written into a missing folder": commanded(
            "motion", "deconvolve", "record.csv", "--scene", "scene.toml", "--out", "none/x.csv"
        ),
        "sand without its contraction rate": commanded("lab", "dss", "--Dr", 0.5, "--G0", 600, "--csr", 0.1),
        "soil given by a file and by options": commanded(
            "lab", "dss", "--soil", "soil.toml", "--Dr", 0.5, "--csr", 0.1
        ),
        "soil file that does not exist": commanded("lab", "dss", "--soil", "none.toml", "--csr", 0.1),
        "shear neither cyclic nor monotonic": commanded("lab", "dss", "--soil", "soil.toml"),
        "shear both cyclic and monotonic": commanded(
            "lab", "dss", "--soil", "soil.toml", "--csr", 0.1, "--monotonic"
        ),
        "shear with a K0 beyond the strength": commanded(
            "lab", "dss", "--soil", "soil.toml", "--csr", 0.1, "--K0", 0.01
        ),
        "record of shear written into a missing folder": commanded(
            "lab", "dss", "--soil", "soil.toml", "--csr", 0.1, "--out", "none/x.csv"
        ),
        "record of shear written over a folder": commanded(
            "lab", "dss", "--soil", "soil.toml", "--csr", 0.1, "--out", "used"
        ),
        "picture of shear in an unknown format": commanded(
            "lab", "dss", "--soil", "soil.toml", "--csr", 0.1, "--plot", "x.gif7"
        ),
        "picture of shear drawn into a missing folder": commanded(
            "lab", "dss", "--soil", "soil.toml", "--csr", 0.1, "--plot", "none/x.png"
        ),
        "cell drawn into a missing folder": commanded(
            "lab", "cell", "--soil", "soil.toml", "--csr", 0.3, "--plot", "none/x.png"
        ),
        "curve written into a missing folder": commanded(
            "lab", "crr", "--soil", "soil.toml", "--out", "none/x.csv"
        ),
        "curve at a negative ratio": commanded("lab", "crr", "--soil", "soil.toml", "--csr", -0.1),
        "calibration written into a missing folder": commanded(
            "lab", "calibrate", "--spt", 6, "--out", "none/x.toml"
        ),
        "calibration without a target": commanded("lab", "calibrate", "--Dr", 0.5, "--G0", 600),
        "calibration to two field tests": commanded("lab", "calibrate", "--spt", 6, "--cpt", 90),
        "strain path that does not exist": commanded(
            "lab", "strain-path", "none.csv", "--stress0", -50, -100, 0, "--soil", "soil.toml"
        ),
        "strain path without a column": commanded(
            "lab", "strain-path", "record.csv", "--stress0", -50, -100, 0, "--soil", "soil.toml"
        ),
        "strain path written into a missing folder": commanded(
            "lab",
            "strain-path",
            "path.csv",
            "--stress0",
            -50,
            -100,
            0,
            "--soil",
            "soil.toml",
            "--out",
            "none/x.csv",
        ),
        "integrator for a soil in closed form": commanded(
            "lab", "dss", "--soil", "rock.toml", "--csr", 0.1, "--integrator", "rk4"
        ),
    },
}


@contextlib.contextmanager
def empty_folder() -> Iterator[Path]:
    """Work in a new folder, so that every message names the same files."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield Path(folder).resolve()
        finally:
            os.chdir(before)


def entry(slip: Slip) -> str:
    """A refusal as in the file: place, value, what is allowed, remedy."""
    with empty_folder() as folder:
        try:
            slip()
        except InvalidInput as error:
            refused = error
        else:
            return "    not refused\n"
    shown = str(refused).removeprefix(f"{refused.path} = ").partition(f": {refused.allowed}")[0]
    rows = {"at": refused.path, "value": shown, "allowed": refused.allowed, "remedy": refused.hint or "none"}
    return "".join(f"    {name:<8} {row}\n" for name, row in rows.items()).replace(str(folder), "FOLDER")


def text() -> str:
    """The whole file."""
    parts = []
    for subject, slips in CATALOGUE.items():
        parts += [f"## {subject}\n"]
        parts += [f"{name}\n{entry(slip)}" for name, slip in slips.items()]
    return "\n".join(parts)


if __name__ == "__main__":
    print(text(), end="")
