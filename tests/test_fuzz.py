"""A small part of the inputs of `fuzz/fuzz_readers.py`, and any value in a scene."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import sandboil as sb
from bad_inputs import SEEPING, SLOPE, SOUND, as_toml, to
from hypothesis import given, settings
from hypothesis import strategies as st

SCRIPT = Path(__file__).parent / "fuzz" / "fuzz_readers.py"
# A part of a second for each reader.
INPUTS = 400


def test_spoilt_files_are_read_or_refused(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, SCRIPT, "--inputs", str(INPUTS), "--seed", "2", "--keep", tmp_path],
        capture_output=True,
        text=True,
        check=False,
        timeout=250,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(rows) == 9
    for row in rows:
        # Inputs that are all refused at their first byte would try nothing.
        assert 0.01 * INPUTS < row["read"] < INPUTS, row


def places(part: Any, path: str = "") -> list[str]:
    """Paths of all values in tables and lists, also of those that hold others."""
    items = part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ()
    inner = [place for key, value in items for place in places(value, f"{path}.{key}")]
    return [path.removeprefix("."), *inner] if path else inner


CASES = [(scene, place) for scene in (SOUND, SEEPING, SLOPE) for place in places(scene)]
NUMBERS = st.one_of(st.integers(-(2**63), 2**63 - 1), st.floats(), st.sampled_from([0.0, 1.0, -1.0, 0.5]))
PLAIN = st.one_of(NUMBERS, st.booleans(), st.text(max_size=8))
VALUES = st.recursive(
    PLAIN,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(min_size=1, max_size=6), inner, max_size=3)
    ),
    max_leaves=8,
)


@settings(max_examples=400, deadline=None)
@given(st.sampled_from(CASES), VALUES)
@pytest.mark.filterwarnings("ignore::RuntimeWarning:shapely")
def test_any_value_in_a_scene_is_accepted_or_refused(case: tuple[dict[str, Any], str], value: object) -> None:
    scene, place = case
    try:
        made = sb.Scene.from_toml(as_toml(scene, to(place, value)))
    except sb.InvalidInput:
        return
    assert sb.Scene.from_toml(made.to_toml(resolved=True)) == made
