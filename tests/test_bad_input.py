"""Every bad input of the catalogue is refused before any work, with its place, value, range and remedy."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any, NoReturn

import bad_inputs
import pytest
import sandboil as sb
from bad_inputs import CATALOGUE, SEEPING, SLOPE, SOUND, as_toml, lasting, seeping, to
from sandboil import _core
from sandboil._errors import InvalidInput, SandboilError, SimulationDiverged, nearest_name

KEPT = Path(bad_inputs.__file__).with_suffix(".txt")
NAMES = [(subject, name) for subject, slips in CATALOGUE.items() for name in slips]


@pytest.fixture(scope="module")
def kept() -> dict[tuple[str, str], str]:
    """The refusals in the file, by subject and name."""
    entries = {}
    for part in KEPT.read_text(encoding="utf-8").removeprefix("## ").split("\n## "):
        subject, *blocks = part.rstrip("\n").split("\n\n")
        for block in blocks:
            name, _, message = block.partition("\n")
            entries[subject, name] = message + "\n"
    return entries


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every computation fail the test: of a section, of seepage, and of a specimen."""

    def work(*args: Any, **kwargs: Any) -> NoReturn:
        pytest.fail("work began before the input was refused")

    class Untested:
        """A specimen that cannot be tested."""

        def __init__(self, *args: Any, **kwargs: Any) -> None:
            self._own = specimen(*args, **kwargs)

        def __getattr__(self, name: str) -> Any:
            return work if name in ("shear", "path", "copy") else getattr(self._own, name)

    specimen = _core.Specimen
    monkeypatch.setattr(_core, "Specimen", Untested)
    for name in ("Simulation", "Seepage", "ShearCell"):
        monkeypatch.setattr(_core, name, work)


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(("subject", "name"), NAMES, ids=lambda value: value)
def test_a_bad_input_is_refused_as_it_was_read(
    subject: str, name: str, kept: dict[tuple[str, str], str]
) -> None:
    assert bad_inputs.entry(CATALOGUE[subject][name]) == kept[subject, name]


def test_the_file_and_the_catalogue_have_the_same_entries(kept: dict[tuple[str, str], str]) -> None:
    assert list(kept) == NAMES
    assert len(NAMES) >= 60


def test_every_refusal_has_place_value_and_remedy(kept: dict[tuple[str, str], str]) -> None:
    lacking = []
    for name, message in kept.items():
        rows = dict(line.strip().split(None, 1) for line in message.splitlines() if " " in line.strip())
        if set(rows) != {"at", "value", "allowed", "remedy"} or rows["remedy"] == "none":
            lacking.append(name)
    assert not lacking


@pytest.mark.parametrize("scene", [SOUND, SEEPING, SLOPE], ids=["level", "seeping", "slope"])
def test_the_scenes_without_a_change_are_accepted(scene: dict[str, Any]) -> None:
    assert sb.Scene.from_toml(as_toml(scene)) == sb.Scene(**scene)


def test_fluxes_alone_are_allowed_for_a_given_duration() -> None:
    flux = {"kind": "flux", "on": "left", "inflow": 1.0e-6}
    assert lasting(to("stages.0.conditions", [flux]))()


def test_a_drain_below_a_pond_needs_no_retention_curve() -> None:
    drowned = {
        "conditions": [
            {"kind": "reservoir", "on": "surface", "level": 5.0},
            {"kind": "drain", "points": [[5.0, 1.0], [6.0, 1.0]]},
        ]
    }
    changes = (to("stages.0", {"kind": "seepage", **drowned}), to("water_table", {"elevation": 5.0}))
    scene = seeping(*changes, bad_inputs.without(f"{bad_inputs.SOIL}.retention"))()
    assert isinstance(scene, sb.Scene)
    simulation = sb.Simulation(scene, threads=1)
    simulation.run_stage()
    assert simulation.field("pore_pressure").min() > 0.0


def test_suction_in_soil_without_a_retention_curve_gives_a_warning() -> None:
    """More is drawn out on the right than the head on the left drives through the ground."""
    drawn = [{"kind": "head", "on": "left", "head": 6.0}, {"kind": "flux", "on": "right", "inflow": -1e-5}]
    full = bad_inputs.without(f"{bad_inputs.SOIL}.retention")
    scene = seeping(full, to("water_table.elevation", 6.0), to("stages.0.conditions", drawn))()
    assert isinstance(scene, sb.Scene)
    simulation = sb.Simulation(scene, threads=1)
    # Darcy: 10 m of ground take q L/k = 10 m of head; 4 m below the base at the top right are 80 kPa.
    with pytest.warns(
        sb.SuctionWarning, match=r"suction of 7\d.* kPa at \(9\.75, 3\.75\) m in region 'soil'"
    ):
        simulation.run_stage()
    assert len(simulation.doubts) == 1


def test_a_byte_order_mark_is_accepted(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(as_toml(SOUND), encoding="utf-8-sig")
    assert sb.Scene.from_toml(path) == sb.Scene(**SOUND)


def test_a_message_is_short_for_a_value_of_any_size() -> None:
    for value in ("x" * 10**6, list(range(10**6)), {str(k): [k] * 100 for k in range(1000)}):
        message = str(InvalidInput("a" * 10**5, value, "b" * 10**5, "c" * 10**5))
        assert 1000 < len(message) < 3000


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


def test_nearest_name_ignores_case_and_finds_none_for_unlike_names() -> None:
    names = ["porosity", "void_ratio", "G0"]
    assert nearest_name("Porosty", names) == "porosity"
    assert nearest_name("g0", names) == "G0"
    assert nearest_name("wxyz", names) is None
