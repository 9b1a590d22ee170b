"""Base, sides and incoming waves: in a scene, and in its description for the core."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sandboil import (
    BaseSegment,
    CompliantBase,
    Elastic,
    Fixed,
    FreeField,
    Gravity,
    InvalidInput,
    Motion,
    Output,
    Periodic,
    Region,
    Roller,
    SandboilWarning,
    Scene,
    Shaking,
    Sides,
    Simulation,
    Water,
    WaterTable,
    _core,
    box,
    discretise,
    polygon,
)
from sandboil.core.description import (
    base_description,
    outline_description,
    section_description,
    stage_description,
)
from sandboil.core.doubts import doubts
from sandboil.core.motions import loaded_motions
from sandboil.core.probes import probes_of
from sandboil.run import plan

ROCK = Elastic(E=2.0e5, nu=0.3)
PULSE = Motion.ricker(frequency=4.0, pga_g=0.2)
# 1:2 between level benches.
BENCHES = [(0.0, 0.0), (40.0, 0.0), (40.0, 6.0), (26.0, 6.0), (14.0, 12.0), (0.0, 12.0)]


def slope(points: Any = BENCHES, **changes: Any) -> Scene:
    settings: dict[str, Any] = {
        "spacing": 1.0,
        "regions": [Region("ground", polygon(points), ROCK, dry_unit_weight=18.0)],
        "sides": FreeField(),
        "stages": [Gravity(), Shaking(PULSE, duration=1.0)],
    }
    return Scene(**(settings | changes))


def shaken(*args: Any, **kwargs: Any) -> list[Gravity | Shaking]:
    return [Gravity(), Shaking(*args, **kwargs)]


def base_of(scene: Scene) -> _core.Base:
    """The base of the shaking stage as the core takes it."""
    stage, motions = scene.stages[1], loaded_motions(scene)[1]
    assert isinstance(stage, Shaking)
    assert motions is not None
    return base_description(scene, stage, motions)


def segment(left: float, right: float, wave: int | None, delay: float = 0.0) -> _core.BaseSegment:
    return _core.BaseSegment(extent=(left, right), wave=wave, delay=delay, slowness=0.0)


def wave(horizontal: Motion | None, vertical: Motion | None = None) -> _core.Wave:
    """Half of motions at an outcrop, as they arrive at a base."""
    halves = []
    for motion in (horizontal, vertical):
        if motion is None:
            halves.append(None)
            continue
        interval, half = motion.upgoing_velocity()
        assert interval == motion.dt
        np.testing.assert_allclose(half, 0.5 * motion.velocity)
        halves.append(np.ascontiguousarray(half))
    first, second = halves
    return _core.Wave(interval=interval, horizontal=np.zeros(1) if first is None else first, vertical=second)


# Outline


def test_edges_of_a_slope_between_benches() -> None:
    outline = slope().outline
    np.testing.assert_array_equal(outline.base, [(0, 0), (40, 0)])
    assert (outline.left, outline.right) == ((0.0, 12.0), (0.0, 6.0))
    np.testing.assert_array_equal(outline.surface, [(0, 12), (14, 12), (26, 6), (40, 6)])
    assert outline.base_is_level
    assert not outline.is_level


def test_a_contact_of_regions_is_not_a_corner_of_the_base() -> None:
    parts = [Region(f"{x}", box(x=(x, x + 2), y=(0, 4)), ROCK, dry_unit_weight=18.0) for x in (0, 2, 4)]
    outline = slope(regions=parts).outline
    np.testing.assert_array_equal(outline.base, [(0, 0), (6, 0)])
    assert outline.is_level


@given(
    start=st.integers(0, 5),
    backwards=st.booleans(),
    angle=st.sampled_from([0.0, 5.0, 15.0, -5.0]),
)
def test_the_outline_does_not_depend_on_how_the_polygon_is_written(
    start: int, backwards: bool, angle: float
) -> None:
    rise = 40.0 * np.tan(np.radians(angle))
    points = [(x, y + rise * x / 40.0) for x, y in BENCHES]
    order = np.roll(np.arange(6), start)[:: -1 if backwards else 1]
    outline = slope([points[k] for k in order]).outline
    np.testing.assert_allclose(outline.base, [(0.0, 0.0), (40.0, rise)])
    np.testing.assert_allclose(outline.surface, points[:1:-1])
    np.testing.assert_allclose(outline.right, (rise, 6.0 + rise))
    assert outline.base_elevation(10.0) == pytest.approx(rise / 4.0)


def test_a_curved_base_is_a_line_of_many_corners() -> None:
    x = np.linspace(0.0, 40.0, 41)
    bowl = np.column_stack([x, 3.0 * ((x - 20.0) / 20.0) ** 2])
    outline = slope([*bowl.tolist(), (40.0, 12.0), (0.0, 12.0)]).outline
    np.testing.assert_allclose(outline.base, bowl)
    assert outline.left == (3.0, 12.0)


OVERHANGING = [(0, 0), (20, 0), (20, 2), (10, 2), (10, 4), (40, 4), (40, 12), (0, 12)]
STEPPED = [(0, 0), (20, 0), (20, 2), (40, 2), (40, 12), (0, 12)]
TOE = [(0, 0), (40, 0), (0, 12)]
PRONGS = [(0, 0), (40, 0), (40, 12), (0, 12), (0, 9), (10, 9), (10, 5), (0, 5)]


@pytest.mark.parametrize(
    ("points", "path", "allowed"),
    [
        (OVERHANGING, "scene.regions", "upright from (20, 0) to (20, 2)"),
        (STEPPED, "scene.regions", "upright from (20, 0) to (20, 2)"),
        ([(0, 0), (20, 0), (10, 4), (40, 4), (40, 12), (0, 12)], "scene.regions", "turns back from (20, 0)"),
        (TOE, "scene.sides", "on the right, which has 0 m"),
        ([*BENCHES[:2], (40, 1.5), *BENCHES[3:]], "scene.sides", "at least 2 spacings, 2 m"),
        (PRONGS, "scene.sides", "reaches x = 0 m again above 5 m"),
    ],
)
@pytest.mark.parametrize("sides", [FreeField(), Fixed()])
def test_outlines_that_cannot_be_computed_are_refused(
    points: Any, path: str, allowed: str, sides: Any
) -> None:
    with pytest.raises(InvalidInput) as refused:
        slope(points, sides=sides)
    assert refused.value.path == path
    assert allowed in refused.value.allowed
    assert refused.value.hint is not None


def test_periodic_sides_need_a_level_base() -> None:
    with pytest.raises(InvalidInput, match="level base between periodic sides") as refused:
        slope([(0, 0), (20, 1), (40, 0), (40, 12), (0, 12)], sides=Periodic())
    assert refused.value.hint == "sides = FreeField() takes any base"


# Discretisation of slopes


def inclined(angle: float) -> list[tuple[float, float]]:
    """Ground 12 m high on a base inclined like its surface."""
    rise = 40.0 * float(np.tan(np.radians(angle)))
    return [(0.0, 0.0), (40.0, rise), (40.0, 12.0 + rise), (0.0, 12.0)]


@pytest.mark.parametrize("points", [BENCHES, inclined(5.0), inclined(15.0), inclined(-15.0)])
def test_slopes_are_filled_and_carry_their_own_overburden(points: Any) -> None:
    scene = slope(points, spacing=0.5)
    particles, outline = discretise(scene), scene.outline
    assert particles.volume.sum() == pytest.approx(scene.section.area, rel=0.02)
    x, y = particles.position.T
    surface = np.interp(x, *outline.surface.T)
    np.testing.assert_allclose(particles.surface_elevation, surface, atol=1e-4)
    np.testing.assert_allclose(particles.sigma_v_eff0, 18.0 * (surface - y), atol=2e-3)
    # The three lowest particles of a column stand in the middle of equal cells that reach down to the base.
    base = np.interp(x, *outline.base.T)
    height = particles.volume / particles.spacing[0]
    order = np.lexsort((y, x))
    row = np.empty(len(x), dtype=int)
    row[order] = np.arange(len(x)) - np.searchsorted(x[order], x[order])
    stretched = row < 3
    np.testing.assert_allclose((y - base)[stretched], ((row + 0.5) * height)[stretched], atol=1e-9)
    assert (np.abs(height / particles.spacing[1] - 1.0) <= 1.0 / 6.0 + 1e-6).all()
    np.testing.assert_allclose(particles.volume[~stretched], np.prod(particles.spacing))


@pytest.mark.parametrize("angle", [5.0, -15.0])
def test_ground_on_an_inclined_base_comes_to_rest_and_stays_there(angle: float) -> None:
    scene = slope(inclined(angle), stages=[Gravity(max_steps=5000), Shaking(duration=0.2)])
    simulation = Simulation(scene, threads=1)
    simulation.run_stage()
    at_rest = simulation.field("displacement")
    simulation.run_stage()
    np.testing.assert_allclose(simulation.field("displacement"), at_rest, atol=1e-6)


@pytest.mark.parametrize("pond", [0.0, 3.0])
def test_a_submerged_slope_carries_its_buoyant_weight(pond: float) -> None:
    ground = Region("ground", polygon(BENCHES), ROCK, saturated_unit_weight=20.0, porosity=0.4)
    scene = slope(regions=[ground], water=Water(), water_table=WaterTable(elevation=12.0 + pond))
    particles = discretise(scene)
    depth = particles.surface_elevation - particles.position[:, 1]
    np.testing.assert_allclose(particles.sigma_v_eff0, 10.0 * depth, atol=1e-6)
    np.testing.assert_allclose(particles.pore_pressure0, 10.0 * (12.0 + pond - particles.position[:, 1]))


def test_points_beyond_a_side_that_does_not_repeat_are_those_at_the_side() -> None:
    particles = discretise(slope())
    effective, _ = particles.stress_at(np.array([[-3.0, 2.0], [43.0, 2.0]]))
    np.testing.assert_allclose(effective, [180.0, 72.0])


def test_histories_and_profiles_follow_the_base_of_their_column() -> None:
    scene = slope(inclined(5.0), output=Output(depths=[12.0]))
    surface, base, deepest = probes_of(scene, discretise(scene))
    rise = 20.0 * np.tan(np.radians(5.0))
    assert base.y == pytest.approx(rise)
    assert surface.y == pytest.approx(12.0 + rise)
    assert deepest.y == pytest.approx(rise)
    with pytest.raises(InvalidInput, match=r"mid column, \[0, 12\] m"):
        slope(inclined(5.0), output=Output(depths=[12.5]))
    for x in (1.0, 20.0, 39.0):
        assert sum(layer.thickness for layer in scene.profile(x).layers) == pytest.approx(12.0, abs=1.0)
    thin, thick = (sum(layer.thickness for layer in slope().profile(x).layers) for x in (39.0, 1.0))
    assert (thin, thick) == (pytest.approx(6.0), pytest.approx(12.0))


# What the core is given


def columns_of(scene: Scene) -> tuple[bytes | None, bytes | None]:
    """What identifies the columns of the left and the right side in the shaking stage."""
    particles, (gravity, shaking) = discretise(scene), scene.stages
    probes, motions = probes_of(scene, particles), loaded_motions(scene)
    described = [
        stage_description(scene, stage, scene.duration(stage), loaded, probes)
        for stage, loaded in zip((gravity, shaking), motions, strict=True)
    ]
    rest, moving = described
    assert isinstance(rest, _core.Gravity)
    assert isinstance(moving, _core.Shaking)
    return _core.column_identities(section_description(scene, particles), rest, moving)


def test_the_core_is_given_base_and_sides() -> None:
    scene = slope(
        sides=Sides(FreeField(), Fixed()), stages=[Gravity(base="free-slip"), Shaking(duration=1.0)]
    )
    assert outline_description(scene) == _core.Outline(
        base=np.array([(0.0, 0.0), (40.0, 0.0)]),
        base_support="free-slip",
        left=_core.Side(x=0.0, bottom=0.0, top=12.0, support="free-slip"),
        right=_core.Side(x=40.0, bottom=0.0, top=6.0, support="no-slip"),
    )
    assert section_description(scene, discretise(scene)).period is None
    assert base_of(scene) == _core.Base(
        vertical="roller", half_space=None, waves=[], segments=[segment(0.0, 40.0, None)]
    )
    # Only the left side has a column.
    left, right = columns_of(scene)
    assert left is not None
    assert right is None


def test_level_ground_is_given_as_a_period() -> None:
    scene = slope([(0, 0), (4, 0), (4, 6), (0, 6)], sides=Periodic())
    assert outline_description(scene) == _core.Outline(
        base=np.array([(0.0, 0.0), (4.0, 0.0)]), base_support="no-slip", left=None, right=None
    )
    assert section_description(scene, discretise(scene)).period == 4.0
    assert base_of(scene) == _core.Base(
        vertical="roller", half_space=None, waves=[wave(PULSE)], segments=[segment(0.0, 4.0, 0)]
    )


def test_a_vertical_motion_makes_the_base_absorb() -> None:
    rock = CompliantBase(Vs=400.0, density=2.1, Vp=900.0)
    half = PULSE.scaled(factor=0.5)
    both = slope(stages=shaken(PULSE, vertical=half, base=rock))
    assert base_of(both) == _core.Base(
        vertical="absorbing",
        half_space=_core.HalfSpace(shear_speed=400.0, compression_speed=900.0, density=2.1),
        waves=[wave(PULSE, half)],
        segments=[segment(0.0, 40.0, 0)],
    )
    assert base_of(slope(stages=shaken(vertical=PULSE))) == _core.Base(
        vertical="absorbing",
        half_space=None,
        waves=[wave(None, PULSE)],
        segments=[segment(0.0, 40.0, 0)],
    )


@given(velocity=st.floats(200.0, 5000.0), x=st.floats(0.0, 40.0))
def test_a_wave_reaches_a_place_after_its_way_along_the_base(velocity: float, x: float) -> None:
    for apparent, distance in ((velocity, x), (-velocity, 40.0 - x)):
        (arrival,) = CompliantBase(apparent_velocity=apparent).arrivals(0.0, 40.0)
        time = arrival.delay + arrival.slowness * (x - arrival.x[0])
        assert time == pytest.approx(distance / velocity, abs=1e-12)
        assert arrival.latest == pytest.approx(40.0 / velocity)


def test_segments_have_their_delays_and_motions() -> None:
    own = Motion.ricker(frequency=2.0, pga_g=0.1)
    base = CompliantBase(segments=[BaseSegment((20, 40), delay=0.1, motion=own), BaseSegment((0, 20))])
    scene = slope(stages=shaken(PULSE, base=base))
    assert base_of(scene) == _core.Base(
        vertical="roller",
        half_space=None,
        waves=[wave(PULSE), wave(own)],
        segments=[segment(0.0, 20.0, 0), segment(20.0, 40.0, 1, delay=0.1)],
    )
    # The stage lasts until the later one has passed.
    assert scene.duration(scene.stages[1]) == pytest.approx(0.1 + own.duration)


# Files


half_spaces = st.sampled_from([{}, {"Vs": 400.0, "density": 2.1, "Vp": 900.0}])
arrivals = st.sampled_from(
    [
        {},
        {"apparent_velocity": -1500.0},
        {"segments": [BaseSegment((0, 10)), BaseSegment((10, 40), delay=0.2)]},
    ]
)
walls = st.sampled_from([FreeField(), Roller(), Fixed()])


@given(
    sides=walls | st.tuples(walls, walls).map(lambda both: Sides(*both)),
    half_space=half_spaces,
    arrival=arrivals,
    vertical=st.none() | st.just(PULSE),
    support=st.sampled_from(["no-slip", "free-slip"]),
    resolved=st.booleans(),
)
def test_every_boundary_can_be_written_in_toml(
    sides: Any, half_space: Any, arrival: Any, vertical: Any, support: Any, resolved: bool
) -> None:
    base = CompliantBase(**half_space, **arrival)
    scene = slope(
        sides=sides,
        stages=[Gravity(base=support), Shaking(PULSE, vertical=vertical, base=base, duration=2.0)],
    )
    text = scene.to_toml(resolved=resolved)
    again = Scene.from_toml(text)
    assert again == scene
    assert again.to_toml(resolved=resolved) == text


def test_files_of_every_motion_are_found_from_the_scene_file(tmp_path: Any) -> None:
    (tmp_path / "record.csv").write_text("time,a_g\n0.0,0.0\n0.01,0.1\n0.02,-0.1\n")
    record = {"file": "record.csv", "unit": "g"}
    base = CompliantBase(segments=[BaseSegment((0, 40), motion=record)])
    for stage in (Shaking(record, vertical=record), Shaking(record, base=base)):
        (tmp_path / "scene.toml").write_text(slope(stages=[Gravity(), stage]).to_toml())
        read = Scene.from_toml(tmp_path / "scene.toml").stages[1]
        assert isinstance(read, Shaking)
        files = [spec.file for _, spec in read.motions if spec is not None]
        assert files == 2 * [str(tmp_path / "record.csv")]


# Refusals

QUIET = Motion(dt=0.01, velocity=[0.0, 0.0])
LATE = [BaseSegment((0, 20)), BaseSegment((20, 40), delay=1.5)]


@pytest.mark.parametrize(
    ("make", "path", "allowed"),
    [
        (lambda: CompliantBase(Vp=900.0), "base.Vp", "needs Vs and density"),
        (lambda: CompliantBase(Vs=400.0, density=2.1, Vp=500.0), "base.Vp", "at least 565.7 m/s"),
        (lambda: CompliantBase(apparent_velocity=0.0), "base.apparent_velocity", "must not be zero"),
        (
            lambda: CompliantBase(apparent_velocity=900.0, segments=LATE),
            "base.apparent_velocity",
            "left out beside segments",
        ),
        (lambda: BaseSegment((20, 20)), "segment.x", "the segment is empty"),
        (
            lambda: Shaking(PULSE, base=CompliantBase(Vs=400.0, density=2.1, vertical="absorbing")),
            "stage.base.Vp",
            "is required beside Vs",
        ),
        (
            lambda: Shaking(PULSE, vertical=PULSE, base=CompliantBase(vertical="roller")),
            "stage.base.vertical",
            "must be 'absorbing' under a vertical motion",
        ),
        (
            lambda: Shaking(PULSE, vertical=Motion.ricker(4.0, 0.1, kind="upgoing")),
            "stage.vertical.kind",
            "that of the horizontal motion, 'outcrop'",
        ),
        (
            lambda: Shaking(
                PULSE, vertical=PULSE, base=CompliantBase(segments=[BaseSegment((0, 40), motion=PULSE)])
            ),
            "stage.base.segments[0].motion",
            "left out beside a vertical motion",
        ),
        (
            lambda: slope(stages=shaken(PULSE, base=CompliantBase(segments=[BaseSegment((0, 39))]))),
            "scene.stages[1].base.segments",
            "leave a gap from 39 to 40",
        ),
        (
            lambda: slope(
                stages=shaken(
                    PULSE, base=CompliantBase(segments=[BaseSegment((0, 25)), BaseSegment((20, 40))])
                )
            ),
            "scene.stages[1].base.segments",
            "overlap from 20 to 25",
        ),
        (
            lambda: slope(stages=shaken(PULSE, base=CompliantBase(segments=LATE[::-1]), duration=1.0)),
            "scene.stages[1].base.segments[0].delay",
            "arrives at 1.5 s",
        ),
        (
            lambda: slope(stages=shaken(PULSE, base=CompliantBase(apparent_velocity=-20.0), duration=1.0)),
            "scene.stages[1].base.apparent_velocity",
            "arrives at 2 s",
        ),
        (
            lambda: slope(
                [(0, 0), (4, 0), (4, 6), (0, 6)],
                sides=Periodic(),
                stages=shaken(PULSE, base=CompliantBase(apparent_velocity=900.0)),
            ),
            "scene.stages[1].base.apparent_velocity",
            "left out between periodic sides",
        ),
        (
            lambda: slope(inclined(5.0), stages=shaken(PULSE, base=CompliantBase(Vs=400.0, density=2.1))),
            "scene.stages[1].base.Vp",
            "under a base that is not level",
        ),
        (
            lambda: slope(stages=[*shaken(PULSE, vertical=PULSE), Shaking(duration=1.0)]),
            "scene.stages[2].base.vertical",
            "as in the first shaking stage, 'absorbing'",
        ),
        (
            lambda: loaded_motions(slope(stages=shaken(PULSE, vertical=QUIET))),
            "scene.stages[1].vertical.dt",
            "that of the horizontal motion",
        ),
        (
            lambda: slope(stages=shaken(PULSE, vertical=PULSE)).with_motion(PULSE),
            "scene.stages[1].vertical",
            "component of the motion that another would replace",
        ),
        (lambda: slope(sides={"kind": "free_field"}), "scene.sides.kind", "must be one of"),
        (
            lambda: slope(numerics={"dispersion_correction": True}),
            "scene.numerics.dispersion_correction",
            "left out beside free-field sides",
        ),
        (
            lambda: slope(
                numerics={"operators": "printed"},
                regions=[Region("ground", polygon(BENCHES), ROCK, Gs=2.65, porosity=0.4)],
                water={},
                water_table={"elevation": 20.0},
            ),
            "scene.numerics.operators",
            "must be 'conservative' in saturated ground",
        ),
    ],
)
def test_boundaries_that_contradict_are_refused(make: Any, path: str, allowed: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        make()
    assert refused.value.path == path
    assert allowed in refused.value.allowed


# Warnings


def test_a_motion_that_does_not_end_at_rest_gives_a_warning() -> None:
    drift = np.linspace(0.0, 0.2, len(PULSE.velocity))
    drifting = Motion(dt=PULSE.dt, velocity=PULSE.velocity + drift)
    scene = slope(stages=shaken(drifting))
    (warning,) = doubts(scene, loaded_motions(scene))
    assert warning.startswith("scene.stages[1].motion ends with a velocity of 0.2 m/s")
    assert f"a drift of {drifting.displacement[-1]:.3g} m" in warning
    assert "baseline_corrected()" in warning
    with pytest.warns(SandboilWarning, match="ends with a velocity"):
        Simulation(scene, threads=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        page = str(plan.plan(scene))
    assert f"warning: {warning}" in page
    mended = slope(stages=shaken(drifting.baseline_corrected()))
    assert not doubts(mended, loaded_motions(mended))


def test_a_smooth_base_that_is_not_level_gives_a_warning() -> None:
    smooth = [Gravity(base="free-slip"), Shaking(duration=1.0)]
    scene = slope(inclined(5.0), stages=smooth)
    (warning,) = doubts(scene, loaded_motions(scene))
    assert warning.startswith("scene.stages[0].base = 'free-slip' above a base that is not level")
    for sound in (slope(inclined(5.0)), slope(stages=smooth)):
        assert not doubts(sound, loaded_motions(sound))


def test_a_stage_that_ends_before_a_delayed_motion_gives_a_warning() -> None:
    base = CompliantBase(segments=[BaseSegment((0, 20)), BaseSegment((20, 40), delay=0.4)])
    scene = slope(stages=shaken(PULSE, base=base, duration=1.0))
    (warning,) = doubts(scene, loaded_motions(scene))
    assert "ends before the motion has passed the base from x = 20 to 40 m, which takes 1.15 s" in warning
    open_ended = slope(stages=shaken(PULSE, base=base))
    assert not doubts(open_ended, loaded_motions(open_ended))


# Physics that is on


def test_the_plan_lists_columns_waves_and_passage() -> None:
    def rows(scene: Scene) -> dict[str, tuple[bool, str]]:
        return {name: (on, reason) for name, on, reason in scene.active_physics()}

    facts = rows(slope())
    assert facts["free-field columns"] == (True, "on the left and right: 2 columns of 18 particles in all")
    assert facts["vertical waves"] == (False, "the base is a roller vertically")
    level = [(0, 0), (20, 0), (20, 6), (0, 6)]
    assert rows(slope(level))["free-field columns"][1] == "on the left and right: 1 column of 6 particles"
    passing = rows(slope(level, stages=shaken(PULSE, base=CompliantBase(apparent_velocity=900.0))))
    assert passing["free-field columns"][1].endswith("2 columns of 12 particles in all")
    assert passing["wave passage"] == (True, "at an apparent 900 m/s")
    walled = rows(slope(sides=Sides(Roller(), Fixed())))
    assert walled["free-field columns"] == (False, "the sides are roller and fixed")
    assert rows(slope(stages=shaken(PULSE, vertical=PULSE)))["vertical waves"][0]
