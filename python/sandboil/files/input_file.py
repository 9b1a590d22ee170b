"""Input files of a user, read whole up to a largest size."""

from __future__ import annotations

import os
from pathlib import Path

from .._errors import InvalidInput

# Largest input file, bytes: a motion of two million samples fits as rows of three full numbers and as
# numbers in a scene; read into memory it is far smaller than the memory of a usual computer.
MAX_FILE_BYTES = 100_000_000


def read_bytes(path: str | os.PathLike[str], label: str, form: str) -> bytes:
    """The content of a file of some form; :class:`InvalidInput` under `label` if it has none or too much."""
    name = os.fspath(path)
    try:
        with Path(path).open("rb") as file:
            # Some files, as devices, have no size and no end.
            content = file.read(MAX_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        # A name with a zero byte is a ValueError.
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InvalidInput(
            label, name, f"must be a readable {form}: {reason}", "check the path and its permissions"
        ) from error
    if len(content) > MAX_FILE_BYTES:
        raise InvalidInput(
            label, name, f"must not exceed {MAX_FILE_BYTES} bytes", f"it is probably no {form}"
        )
    return content


def read_text(path: str | os.PathLike[str], label: str, form: str) -> str:
    """The text of a file in UTF-8; :class:`InvalidInput` under `label` if it is none."""
    try:
        # A byte order mark, as some editors write it, is no part of the text.
        return read_bytes(path, label, form).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidInput(
            label,
            os.fspath(path),
            f"must be a readable {form}: it is not UTF-8 text",
            "save it as UTF-8",
        ) from error
