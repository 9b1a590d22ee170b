"""TOML files of a user, read and written."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from .._errors import InvalidInput
from .input_file import read_text

# Most parts of a dotted key: a scene's have six at most, and the parser's memory grows with their square.
MAX_KEY_PARTS = 16
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
_DEEP_KEY = re.compile(rf"(?<![\w-])(?:{_PART}[ \t]*+\.[ \t]*+){{{MAX_KEY_PARTS}}}")


def read(path: Path, label: str) -> str:
    """The text of a file; :class:`InvalidInput` under `label` if there is none."""
    return read_text(path, label, "TOML file")


def parse(text: str, label: str, origin: str) -> dict[str, Any]:
    """The table that a text from `origin` holds; :class:`InvalidInput` under `label` if it is no TOML."""
    if found := _DEEP_KEY.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise InvalidInput(
            label,
            origin,
            f"must have keys of at most {MAX_KEY_PARTS} parts (at line {line})",
            "write tables instead",
        )
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise InvalidInput(
            label, origin, "must not nest lists and tables so deeply", "close the brackets"
        ) from error
    except ValueError as error:
        # A TOMLDecodeError, or an integer of more digits than Python takes.
        raise InvalidInput(
            label, origin, f"must be TOML: {error}", "for example spacing = 0.5, or [water] above its keys"
        ) from error


def text(table: dict[str, Any]) -> str:
    """A table as TOML."""
    return tomli_w.dumps(table)
