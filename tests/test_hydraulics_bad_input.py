"""Each slip that water, its conditions and its soils can hold is refused as those of a scene are."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import Any

import pytest
import tomli_w
from sandboil import Conductivity, Drain, Head, InvalidInput, Rain, Scene, Seepage, VanGenuchten
from test_bad_input import setting

RETENTION = {"kind": "van-genuchten", "alpha": 2.0, "n": 2.0}
SOUND: dict[str, Any] = {
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
            "retention": RETENTION,
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
STAGE = "stages.0"
FIRST, SECOND = f"{STAGE}.conditions.0", f"{STAGE}.conditions.1"
SOIL = "regions.0"
PATH, SOIL_PATH = "scene.stages[0].conditions", "scene.regions[0]"

Change = Callable[[dict[str, Any]], object]


def adding(**condition: object) -> Change:
    """A third condition."""
    return lambda scene: scene["stages"][0]["conditions"].append(condition)


def under(*conditions: dict[str, Any]) -> Change:
    """Other conditions, of soil without a retention curve."""

    def change(scene: dict[str, Any]) -> None:
        del scene["regions"][0]["retention"]
        scene["stages"][0]["conditions"] = list(conditions)

    return change


def lasting(*changes: Change) -> Change:
    """Changes of a scene whose seepage lasts for a while."""

    def change(scene: dict[str, Any]) -> None:
        scene["stages"][0]["duration"] = 10.0
        for one in changes:
            one(scene)

    return change


def without(*names: str) -> Change:
    return lambda scene: [scene.pop(name) for name in names]


LEFT = {"kind": "head", "on": "left", "head": 4.0}
CURVE = "VanGenuchten"

# What is changed, the path told, the value told, and parts of what is allowed and of the remedy.
CASES: dict[str, tuple[Change, str, object, str, str | None]] = {
    "head below the base": (
        setting(f"{SECOND}.head", -1.0),
        f"{PATH}[1].head",
        -1.0,
        "must not lie below the base, elevation 0 m",
        "elevations in the section's own coordinates",
    ),
    "level below the base": (
        setting(f"{FIRST}.level", -1.0),
        f"{PATH}[0].level",
        -1.0,
        "must not lie below the base",
        "elevations",
    ),
    "level that falls below the base": (
        lasting(setting(f"{FIRST}.level", [[0.0, 4.0], [5.0, -0.5]])),
        f"{PATH}[0].level[1]",
        -0.5,
        "must not lie below the base",
        "elevations",
    ),
    "reservoir on no edge": (
        setting(f"{FIRST}.on", "top"),
        f"{PATH}[0].on",
        "top",
        "must be one of 'surface', 'base', 'left', 'right', or points (x, y)",
        None,
    ),
    "reservoir beside the section": (
        adding(kind="reservoir", on="surface", x=[20.0, 30.0], level=4.0),
        f"{PATH}[2].x",
        (20.0, 30.0),
        "must cover a stretch of the section's edge",
        "from x = 0 to 10 m",
    ),
    "x that falls": (
        adding(kind="seepage-face", on="surface", x=[5.0, 3.0]),
        f"{PATH}[2].x",
        (5.0, 3.0),
        "must rise",
        "left end, right end",
    ),
    "x of an upright edge": (
        setting(f"{FIRST}.x", [0.0, 3.0]),
        f"{PATH}[0].x",
        (0.0, 3.0),
        "cuts the 'surface' or the 'base'",
        "given by points",
    ),
    "point off the edge": (
        setting(f"{FIRST}.on", [[0.0, 0.0], [3.0, 2.0]]),
        f"{PATH}[0].on[1]",
        (3.0, 2.0),
        "must lie on the edge of the section, it is 2 m away",
        "Drain",
    ),
    "line across the section": (
        setting(f"{FIRST}.on", [[0.0, 2.0], [10.0, 2.0]]),
        f"{PATH}[0].on",
        ((0.0, 2.0), (10.0, 2.0)),
        "must follow the edge of the section, it leaves it by 2 m",
        "Drain",
    ),
    "one point": (
        setting(f"{FIRST}.on", [[0.0, 0.0]]),
        f"{PATH}[0].on",
        [[0.0, 0.0]],
        "at least two points (x, y)",
        None,
    ),
    "line without length": (
        setting(f"{FIRST}.on", [[0.0, 1.0], [0.0, 1.0]]),
        f"{PATH}[0].on",
        ((0.0, 1.0), (0.0, 1.0)),
        "must cover a stretch of the section's edge",
        "from x = 0 to 10 m",
    ),
    "drain that leaves the section": (
        adding(kind="drain", points=[[5.0, 2.0], [5.0, 9.0]]),
        f"{PATH}[2].points",
        ((5.0, 2.0), (5.0, 9.0)),
        "must lie in the section",
        "the other conditions",
    ),
    "drain without length": (
        adding(kind="drain", points=[[5.0, 2.0], [5.0, 2.0]]),
        f"{PATH}[2].points[1]",
        (5.0, 2.0),
        "must lie apart from the point before it",
        None,
    ),
    "edge with two conditions": (
        adding(kind="seepage-face", on=[[10.0, 3.0], [10.0, 4.0]]),
        f"{PATH}[2].on",
        ((10.0, 3.0), (10.0, 4.0)),
        "must leave out the edge of conditions[1]",
        "cut it",
    ),
    "head above which soil says nothing": (
        lambda scene: scene["regions"][0].pop("retention"),
        f"{SOIL_PATH}.retention",
        None,
        "region 'soil' reaches 4 m, above the head of 2 m",
        CURVE,
    ),
    "seepage face beside soil that says nothing": (
        under(LEFT, {"kind": "seepage-face", "on": "right"}),
        f"{SOIL_PATH}.retention",
        None,
        "above the head of 0 m",
        CURVE,
    ),
    "drain in soil that says nothing": (
        under(LEFT, {"kind": "drain", "points": [[5.0, 1.0], [6.0, 1.0]]}),
        f"{SOIL_PATH}.retention",
        None,
        "above the head of 1 m",
        CURVE,
    ),
    "pressure beside soil that says nothing": (
        under(LEFT, {"kind": "pressure", "on": "right", "pressure": 10.0}),
        f"{SOIL_PATH}.retention",
        None,
        "above the head of 1 m",
        CURVE,
    ),
    "capillary rise without end": (
        setting(f"{SOIL}.retention.alpha", 0.0),
        f"{SOIL_PATH}.retention.alpha",
        0.0,
        "must lie in (0, 1000]",
        "1/kPa",
    ),
    "negative alpha": (
        setting(f"{SOIL}.retention.alpha", -2.0),
        f"{SOIL_PATH}.retention.alpha",
        -2.0,
        "must lie in (0, 1000]",
        "1/cm",
    ),
    "steepness of one": (
        setting(f"{SOIL}.retention.n", 1.0),
        f"{SOIL_PATH}.retention.n",
        1.0,
        "must lie in (1, 20]",
        None,
    ),
    "residual as much as full": (
        setting(f"{SOIL}.retention", {**RETENTION, "residual_saturation": 0.5, "full_saturation": 0.5}),
        f"{SOIL_PATH}.retention.residual_saturation",
        0.5,
        "must be below full_saturation, 0.5",
        None,
    ),
    "more than full": (
        setting(f"{SOIL}.retention.full_saturation", 1.2),
        f"{SOIL_PATH}.retention.full_saturation",
        1.2,
        "must lie in (0, 1]",
        None,
    ),
    "steady state of fluxes alone": (
        setting(f"{STAGE}.conditions", [{"kind": "flux", "on": "left", "inflow": 1.0e-6}]),
        PATH,
        ["flux"],
        "must tell the pressure somewhere",
        "a duration",
    ),
    "no condition": (setting(f"{STAGE}.conditions", []), PATH, [], "at least 1", None),
    "times that stand still": (
        lasting(setting(f"{FIRST}.level", [[0.0, 4.0], [0.0, 3.0]])),
        f"{PATH}[0].level",
        [[0.0, 4.0], [0.0, 3.0]],
        "must have rising times",
        None,
    ),
    "series without pairs": (
        lasting(setting(f"{FIRST}.level", [])),
        f"{PATH}[0].level",
        [],
        "at least one pair",
        None,
    ),
    "text for a level": (
        setting(f"{FIRST}.level", "high"),
        f"{PATH}[0].level",
        "high",
        "must be a number",
        None,
    ),
    "numbers that are no pairs": (
        setting(f"{FIRST}.level", [0.0, 4.0]),
        f"{PATH}[0].level",
        [0.0, 4.0],
        "pairs of time (s) and value",
        None,
    ),
    "change on the way to a steady state": (
        setting(f"{FIRST}.level", [[0.0, 4.0], [1.0, 3.0]]),
        f"{PATH}[0].level",
        ((0.0, 4.0), (1.0, 3.0)),
        "must not change with time on the way to a steady state",
        "duration",
    ),
    "rain that rises": (
        adding(kind="rain", on="surface", rate=-1.0e-6),
        f"{PATH}[2].rate[0]",
        -1.0e-6,
        "must not be negative",
        "Flux",
    ),
    "rain on a wall": (
        adding(kind="rain", on="left", rate=1.0e-6),
        f"{PATH}[2].on",
        "left",
        "must be the 'surface'",
        "Flux",
    ),
    "no time": (setting(f"{STAGE}.duration", 0.0), "scene.stages[0].duration", 0.0, "greater than 0", None),
    "seepage after gravity": (
        lambda scene: scene["stages"].insert(0, {"kind": "gravity"}),
        "scene.stages[1].kind",
        "seepage",
        "must be the first stage",
        "by the other stages",
    ),
    "seepage without water": (
        without("water", "water_table"),
        "scene.water",
        None,
        "is required by a seepage stage",
        "water = Water()",
    ),
    "ground that lets nothing through": (
        lambda scene: scene["regions"][0].pop("hydraulic_conductivity"),
        "scene.regions",
        ["soil"],
        "must hold one that water flows through",
        "hydraulic_conductivity",
    ),
    "no conductivity across layers": (
        setting(f"{SOIL}.hydraulic_conductivity", {"horizontal": 1.0e-5, "vertical": 0.0}),
        f"{SOIL_PATH}.hydraulic_conductivity.vertical",
        0.0,
        "must be greater than 0",
        None,
    ),
    "negative conductivity along layers": (
        setting(f"{SOIL}.hydraulic_conductivity", {"horizontal": -1.0e-5, "vertical": 1.0e-6}),
        f"{SOIL_PATH}.hydraulic_conductivity.horizontal",
        -1.0e-5,
        "must be greater than 0",
        None,
    ),
    "negative conductivity": (
        setting(f"{SOIL}.hydraulic_conductivity", -1.0e-5),
        f"{SOIL_PATH}.hydraulic_conductivity",
        -1.0e-5,
        "must be at least 0",
        None,
    ),
    "condition on a periodic side": (
        without("sides"),
        f"{PATH}[0].on",
        "left",
        "does not go with periodic sides",
        "Roller()",
    ),
    "points on a periodic side": (
        lambda scene: (
            scene.pop("sides"),
            setting(f"{FIRST}.on", [[0.0, 0.0], [0.0, 4.0]])(scene),
        ),
        f"{PATH}[0].on",
        ((0.0, 0.0), (0.0, 4.0)),
        "does not go with periodic sides",
        "Roller()",
    ),
    "level twice": (
        setting("water_table.points", [[0.0, 4.0], [10.0, 3.0]]),
        "scene.water_table",
        {"elevation": 4.0, "depth": None, "points": ((0.0, 4.0), (10.0, 3.0))},
        "exactly one of elevation, depth and points",
        None,
    ),
    "water table that turns back": (
        setting("water_table", {"points": [[5.0, 4.0], [5.0, 3.0]]}),
        "scene.water_table.points[1]",
        (5.0, 3.0),
        "to the right of the point before it",
        None,
    ),
    "unknown condition": (
        setting(f"{FIRST}.kind", "river"),
        f"{PATH}[0].kind",
        "river",
        "must be one of 'head'",
        None,
    ),
    "misspelt level": (
        setting(f"{FIRST}.levl", 4.0),
        f"{PATH}[0].levl",
        4.0,
        "unknown key",
        "did you mean 'level'?",
    ),
}


def said(change: Change) -> str:
    """The sound scene after a change, in TOML."""
    scene = copy.deepcopy(SOUND)
    change(scene)
    return tomli_w.dumps(scene)


def test_the_scene_that_the_cases_spoil_is_sound() -> None:
    assert Scene.from_toml(said(lambda scene: None)).seepage is not None


@pytest.mark.parametrize("case", CASES)
def test_slip_is_refused_with_path_value_allowed_and_remedy(case: str) -> None:
    change, path, value, allowed, hint = CASES[case]
    with pytest.raises(InvalidInput) as caught:
        Scene.from_toml(said(change))
    refused = caught.value
    assert refused.path == path
    assert refused.value == value
    assert allowed in refused.allowed
    if hint is not None:
        assert refused.hint is not None
        assert hint in refused.hint


@pytest.mark.parametrize(
    ("place", "path"),
    [
        (f"{FIRST}.level", f"{PATH}[0].level[0][1]"),
        (f"{SECOND}.head", f"{PATH}[1].head[0][1]"),
        (f"{SOIL}.retention.alpha", f"{SOIL_PATH}.retention.alpha"),
        (f"{SOIL}.retention.n", f"{SOIL_PATH}.retention.n"),
        (f"{SOIL}.hydraulic_conductivity", f"{SOIL_PATH}.hydraulic_conductivity"),
        ("water_table.elevation", "scene.water_table.elevation"),
    ],
)
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_no_number_is_refused(place: str, path: str, value: float) -> None:
    with pytest.raises(InvalidInput) as caught:
        Scene.from_toml(said(setting(place, value)))
    assert caught.value.path == path
    assert "must be finite" in caught.value.allowed


def test_water_above_which_fluxes_may_run_for_a_while_is_sound() -> None:
    flux = {"kind": "flux", "on": "left", "inflow": 1.0e-6}
    assert Scene.from_toml(said(lasting(setting(f"{STAGE}.conditions", [flux])))).stages


@pytest.mark.parametrize(
    ("make", "path"),
    [
        (lambda: Conductivity(1e-5, 0.0), "hydraulic_conductivity.vertical"),
        (lambda: VanGenuchten(alpha=2.0, n=1.0), "retention.n"),
        (lambda: Head("left", head=[(1.0, 0.0), (0.0, 0.0)]), "condition.head"),
        (lambda: Rain("surface", rate=-1e-6), "condition.rate[0]"),
        (lambda: Drain([(0.0, 0.0)]), "condition.points"),
        (lambda: Seepage([]), "stage.conditions"),
    ],
)
def test_parts_refuse_on_their_own(make: Callable[[], object], path: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        make()
    assert caught.value.path == path
