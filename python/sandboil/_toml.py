"""TOML from and to a user: what is read is refused as any other input is."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from ._errors import InvalidInput


def read(path: Path, label: str) -> str:
    """The text of a file; :class:`InvalidInput` under `label` if there is none."""
    try:
        # A byte order mark, as some editors write it, is no part of the text.
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InvalidInput(label, str(path), f"must be a readable TOML file: {reason}") from error


def parse(text: str, label: str, origin: str) -> dict[str, Any]:
    """The table that a text from `origin` holds; :class:`InvalidInput` under `label` if it is no TOML."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidInput(label, origin, f"must be TOML: {error}") from error


def text(table: dict[str, Any]) -> str:
    """A table as TOML."""
    return tomli_w.dumps(table)
