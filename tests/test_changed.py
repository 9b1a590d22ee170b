"""A changed copy is checked as a new scene is, and an unknown path is refused with the nearest name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import sandboil as sb
import scenes
from sandboil import InvalidInput, Scene

ROCK = sb.CompliantBase(400.0, 2.1)


def refused(change: Callable[[], object]) -> InvalidInput:
    with pytest.raises(InvalidInput) as caught:
        change()
    return caught.value


def test_nothing_changed_is_an_equal_scene() -> None:
    scene = scenes.column()
    assert scene.changed() == scene
    assert scene.changed().to_toml() == scene.to_toml()


@pytest.mark.parametrize(
    ("path", "value", "found"),
    [
        ("spacing", 0.5, lambda scene: scene.spacing),
        ("water", sb.Water(bulk_modulus=2.2e6), lambda scene: scene.water),
        ("water.bulk_modulus", 2.2e6, lambda scene: scene.water.bulk_modulus),
        ("numerics.velocity_filter", 0.3, lambda scene: scene.numerics.velocity_filter),
        ("output.depths", (2.0,), lambda scene: scene.output.depths),
        ("output.depths[1]", 2.0, lambda scene: scene.output.depths[1]),
        ("regions[0].material", scenes.DENSE, lambda scene: scene.regions[0].material),
        ("regions[-1].material.Dr", 0.7, lambda scene: scene.regions[1].material.Dr),
        ("regions['loose'].K0", 0.6, lambda scene: scene.regions[0].K0),
        ('regions["dense"].material.relative_density', 0.7, lambda scene: scene.regions[1].material.Dr),
        ("stages[1]", sb.Shaking(duration=1.0), lambda scene: scene.stages[1]),
        ("stages[1].base", ROCK, lambda scene: scene.stages[1].base),
        (
            "stages[1].motion.ricker",
            {"frequency": 2.0, "pga_g": 0.1},
            lambda scene: scene.stages[1].motion.ricker,
        ),
    ],
)
def test_a_change_is_made_at_its_path_alone(path: str, value: Any, found: Callable[[Any], Any]) -> None:
    scene = scenes.column()
    before = found(scene)
    changed = scene.changed(**{path: value})
    assert found(changed) == value
    assert before != value
    assert scene == scenes.column()
    assert changed.changed(**{path: before}) == scene


def test_changes_of_one_part_are_checked_together() -> None:
    scene = scenes.column(sides=sb.Roller())
    base = {"stages[1].base.Vs": 400.0, "stages[1].base.density": 2.1}
    assert scene.changed(**base).stages[1].base == ROCK
    assert refused(lambda: scene.changed(**{"stages[1].base.Vs": 400.0})).path == "scene.stages[1].base"


@pytest.mark.parametrize(
    ("path", "value", "argument"),
    [
        ("spacing", -1.0, {"spacing": -1.0}),
        ("spacing", "0.5", {"spacing": "0.5"}),
        ("spacng", 0.5, {"spacng": 0.5}),
        ("water.bulk_modulus", 0.0, {"water": {"bulk_modulus": 0.0}}),
        ("numerics.cfl", 0.5, {"numerics": {"cfl": 0.5}}),
        ("output.depths", [40.0], {"output": {"depths": [40.0]}}),
        ("water_table", None, {"water_table": None}),
    ],
)
def test_a_bad_value_is_refused_as_in_construction(path: str, value: Any, argument: dict[str, Any]) -> None:
    scene = scenes.column()
    changed = refused(lambda: scene.changed(**{path: value}))
    assert str(changed) == str(refused(lambda: scenes.column(**argument)))


@pytest.mark.parametrize(
    ("path", "place", "hint"),
    [
        ("watter.bulk_modulus", "scene.watter", "did you mean 'water'?"),
        ("regions[0].material.Drr", "scene.regions[0].material.Drr", "did you mean 'Dr'?"),
        ("regions[7].K0", "scene.regions[7]", "places count from 0"),
        ("regions['lose'].K0", "scene.regions['lose']", "did you mean \"'loose'\"?"),
        ("spacing.x", "scene.spacing", "give it as a whole"),
        ("regions.K0", "scene.regions.K0", "places count from 0"),
        ("stages[1", "scene.stages[1", "for example"),
        ("", "scene.", "for example"),
    ],
)
def test_a_path_that_leads_nowhere_is_refused(path: str, place: str, hint: str) -> None:
    error = refused(lambda: scenes.column().changed(**{path: 1.0}))
    assert error.path == place
    assert hint in (error.hint or "")


def test_a_copy_with_an_update_is_checked() -> None:
    scene = scenes.column()
    assert scene.model_copy(update={"spacing": 0.5}) == scene.changed(spacing=0.5)
    assert scene.model_copy() == scene
    assert scene.model_copy(deep=True) == scene
    error = refused(lambda: scene.model_copy(update={"spacing": -1.0}))
    assert str(error) == str(refused(lambda: scenes.column(spacing=-1.0)))
    with pytest.raises(InvalidInput, match="Dr"):
        scenes.LOOSE.model_copy(update={"Dr": 35.0})


def test_parts_change_as_scenes_do() -> None:
    shaking = sb.Shaking(scenes.PULSE, duration=0.8)
    assert shaking.changed(duration=1.0) == sb.Shaking(scenes.PULSE, duration=1.0)
    assert scenes.LOOSE.changed(Dr=0.4).Dr == 0.4
    assert isinstance(scenes.column().changed(spacing=0.5), Scene)
