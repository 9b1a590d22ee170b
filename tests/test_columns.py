"""Free-field columns kept by one run and read by another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import sandboil as sb
from sandboil import InvalidInput
from sandboil.run.columns import FILE_NAME

MOTION = sb.Motion.ricker(frequency=4.0, pga_g=0.2)
SAND = sb.PM4Sand(Dr=0.55, G0=677.0, hpo=0.40)


def ground(
    width: float = 4.0,
    sides: Any = None,
    motion: sb.Motion = MOTION,
    tolerance: float = 1.0e-4,
    **changes: Any,
) -> sb.Scene:
    """Six metres of sand under water between free-field sides, shaken for a second."""
    return sb.Scene(
        spacing=0.5,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0),
        regions=[
            sb.Region("sand", sb.box(x=(0, width), y=(0, 6)), SAND, hydraulic_conductivity=1e-4, Gs=2.67)
        ],
        sides=sides or sb.FreeField(),
        stages=[sb.Gravity(tolerance=tolerance), sb.Shaking(motion, duration=1.0)],
        output=sb.Output(depths=[2.0], field_dt=0.5),
        **changes,
    )


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> sb.Run:
    return sb.run(ground(), tmp_path_factory.mktemp("columns") / "kept", threads=1, keep_columns=True)


def test_a_run_on_kept_columns_is_the_run_that_kept_them(kept: sb.Run, tmp_path: Path) -> None:
    again = sb.run(ground(), tmp_path / "again", threads=1, columns=kept.path.parent)
    for name, at in (("velocity_x", "surface"), ("r_u", 2.0)):
        then, now = (
            run.history(name) if at == "surface" else run.history(name, depth=at) for run in (kept, again)
        )
        assert np.abs(now.values - then.values).max() < 0.005 * np.abs(then.values).max()


def test_what_was_kept_is_what_is_read(kept: sb.Run, tmp_path: Path) -> None:
    """Columns with half the motion move the section less, so they are read, not solved."""
    (tmp_path / FILE_NAME).write_bytes((kept.path.parent / FILE_NAME).read_bytes())
    with h5py.File(tmp_path / FILE_NAME, "a") as file:
        for hand in ("left", "right"):
            file[f"shaking/{hand}/values"][...] *= 0.5
    still = sb.run(ground(), tmp_path / "still", threads=1, columns=tmp_path)
    then, now = (np.abs(run.history("velocity_x").values).max() for run in (kept, still))
    assert now < 0.9 * then


def test_every_stage_reads_its_own_columns(tmp_path: Path) -> None:
    scene = ground()
    twice = scene.changed(stages=[*scene.stages, sb.Shaking(MOTION.flipped(), duration=1.0)])
    first = sb.run(twice, tmp_path / "first", threads=1, keep_columns=True)
    again = sb.run(twice, tmp_path / "again", threads=1, columns=tmp_path / "first")
    for stage in ("shaking", "shaking_2"):
        then, now = (run.history("velocity_x", stage=stage).values for run in (first, again))
        assert np.abs(now - then).max() < 0.01 * np.abs(then).max()


def test_another_section_beside_the_same_ground_may_read_them(kept: sb.Run, tmp_path: Path) -> None:
    wider = sb.run(ground(width=8.0), tmp_path / "wider", threads=1, columns=kept.path.parent)
    assert wider.summary()


def test_a_run_keeps_nothing_unless_it_is_asked(tmp_path: Path) -> None:
    sb.run(ground(), tmp_path / "plain", threads=1)
    assert not (tmp_path / "plain" / FILE_NAME).exists()


@pytest.mark.parametrize(
    ("scene", "allowed"),
    [
        (ground(motion=MOTION.scaled(factor=1.01)), "other ground, motion or numerics"),
        (ground(numerics=sb.Numerics(velocity_filter=0.3)), "other ground, motion or numerics"),
        (ground(gravity=9.8), "other ground, motion or numerics"),
        (ground(tolerance=1.0e-5), "other ground, motion or numerics"),
        (ground(sides=sb.Roller()), "needs a shaking stage beside free-field sides"),
        (ground(sides=sb.Sides(sb.FreeField(), sb.Roller()), motion=MOTION.flipped()), "on the left"),
    ],
)
def test_columns_of_another_scene_are_refused(
    kept: sb.Run, tmp_path: Path, scene: sb.Scene, allowed: str
) -> None:
    with pytest.raises(InvalidInput) as refused:
        sb.run(scene, tmp_path / "out", columns=kept.path.parent)
    assert refused.value.path == "columns"
    assert allowed in refused.value.allowed
    assert not (tmp_path / "out").exists()


def keys(base: sb.CompliantBase | None = None, **stiffness: float) -> dict[str, str]:
    """Fingerprint of each column beside three regions, some of which have another stiffness."""
    places = {"left": (0, 4), "middle": (4, 8), "right": (8, 12)}
    regions = [
        sb.Region(
            name,
            sb.box(x=place, y=(0, 4)),
            sb.Elastic(G=stiffness.get(name, 2.0e4), K=4.0e4),
            dry_unit_weight=18.0,
        )
        for name, place in places.items()
    ]
    scene = sb.Scene(
        spacing=1.0,
        regions=regions,
        sides=sb.FreeField(),
        stages=[sb.Gravity(), sb.Shaking(MOTION, base=base or sb.CompliantBase(), duration=2.0)],
    )
    columns = sb.Simulation(scene, threads=1, keep_columns=True)._columns
    return {column.hand: column.fingerprint for column in columns}


@pytest.mark.parametrize(
    ("changed", "hands"),
    [
        ({"middle": 3.0e4}, set()),
        ({"left": 3.0e4}, {"left"}),
        ({"right": 3.0e4}, {"right"}),
        (
            {"base": sb.CompliantBase(segments=[sb.BaseSegment((0, 6)), sb.BaseSegment((6, 12), delay=0.1)])},
            {"right"},
        ),
        (
            {
                "base": sb.CompliantBase(
                    segments=[sb.BaseSegment((0, 6), motion=MOTION.flipped()), sb.BaseSegment((6, 12))]
                )
            },
            {"left"},
        ),
        ({"base": sb.CompliantBase(Vs=400.0, density=2.1)}, {"left", "right"}),
    ],
)
def test_a_column_is_identified_by_its_own_ground_and_wave(changed: dict[str, Any], hands: set[str]) -> None:
    before, after = keys(), keys(**changed)
    assert {hand for hand, key in before.items() if after[hand] != key} == hands


def test_a_folder_without_sound_columns_is_refused(kept: sb.Run, tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"has no free_field\.h5"):
        sb.run(ground(), tmp_path / "out", columns=tmp_path)
    (tmp_path / FILE_NAME).write_bytes(b"no HDF5")
    with pytest.raises(InvalidInput, match="must be a sound file"):
        sb.run(ground(), tmp_path / "out", columns=tmp_path)
    (tmp_path / FILE_NAME).write_bytes((kept.path.parent / FILE_NAME).read_bytes())
    with h5py.File(tmp_path / FILE_NAME, "a") as file:
        del file["shaking/left/values"]
    with pytest.raises(InvalidInput, match="must be a sound file"):
        sb.run(ground(), tmp_path / "out", columns=tmp_path)


def test_keeping_columns_needs_some(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="keep_columns"):
        sb.run(ground(sides=sb.Roller()), tmp_path / "out", keep_columns=True)


def test_columns_are_read_again_before_a_run_out(tmp_path: Path) -> None:
    """A run-out has no columns: its sides are walls."""
    before = ground()
    scene = before.changed(stages=[*before.stages, sb.RunOut(0.02)])
    sb.run(scene, tmp_path / "first", threads=1, keep_columns=True)
    with h5py.File(tmp_path / "first" / FILE_NAME) as file:
        assert set(file) == {"shaking"}
    again = sb.run(scene, tmp_path / "again", threads=1, columns=tmp_path / "first")
    assert again.status == "complete"


def test_a_run_out_alone_has_no_columns_to_keep(tmp_path: Path) -> None:
    before = ground()
    scene = before.changed(stages=[before.stages[0], sb.RunOut(0.02)])
    with pytest.raises(InvalidInput, match="keep_columns"):
        sb.run(scene, tmp_path / "out", keep_columns=True)
