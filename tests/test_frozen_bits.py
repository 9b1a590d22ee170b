"""Small scenes give the bits that were frozen; `tests/freeze.py` describes how to freeze others."""

from __future__ import annotations

from pathlib import Path

import freeze
import pytest
from frozen import machine, options, scenes
from frozen.cases import CASES, computed

# Most entries named in a failure.
MOST_NAMED = 20


@pytest.fixture(scope="module")
def kept() -> freeze.Entries:
    """The frozen entries, where this machine can give their bits."""
    frozen_on, _, entries = freeze.read()
    other = [name for name, digest in machine.fingerprint().items() if digest != frozen_on.get(name)]
    if other:
        pytest.skip(
            f"the functions of {' and '.join(other)} round otherwise than where the bits were frozen: "
            "python tests/freeze.py --write with sources that you trust, then compare"
        )
    return entries


@pytest.mark.parametrize("case", CASES)
def test_frozen_bits(case: str, kept: freeze.Entries, tmp_path: Path) -> None:
    found = freeze.entries(case, computed(case, 1, tmp_path))
    changed = freeze.differences(freeze.of_case(kept, case), found)
    if changed:
        _, libraries, _ = freeze.read()
        named = [f"{name}: {difference}" for name, difference in changed.items()][:MOST_NAMED]
        count = f"{len(changed)} of {len(found)} entries differ"
        with_libraries = f"frozen with {libraries}, here {machine.libraries()}"
        pytest.fail("\n".join([f"{count}, {with_libraries}", *named]), pytrace=False)


# Options that every scene refuses: a motion within the ground, and rain that falls on no surface.
REFUSED = {"MotionSpec.kind = within", "Rain.on = base", "Rain.on = left", "Rain.on = right"}


def test_scenes_use_every_option(tmp_path: Path) -> None:
    used = options.used(build(tmp_path) for build in scenes.ALL.values())
    assert options.schema() - used == REFUSED
