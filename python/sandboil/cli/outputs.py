"""Files that commands are to write: found unwritable before any work is done for them."""

from __future__ import annotations

import os
from pathlib import Path

import typer

from .._errors import InvalidInput

# Forms of a motion's file, and of a picture, known by their endings.
MOTIONS = (".at2", ".csv")
PICTURES = (".png", ".pdf", ".svg")


def to_write(parameter: typer.CallbackParam, path: Path | None) -> Path | None:
    """Refuse a file that cannot be written; for an option's callback."""
    if path is not None:
        told = _obstacle(path)
        if told is not None:
            raise InvalidInput(
                parameter.opts[0], str(path), f"must be writable, but {told}", "name another file"
            )
    return path


def picture_to_write(parameter: typer.CallbackParam, path: Path | None) -> Path | None:
    """Refuse a picture that cannot be written, or of an unknown form."""
    return to_write(parameter, _of_form(parameter, path, PICTURES))


def motion_to_write(parameter: typer.CallbackParam, path: Path) -> Path:
    """Refuse a motion's file that cannot be written, or of an unknown form."""
    to_write(parameter, _of_form(parameter, path, MOTIONS))
    return path


def _of_form(parameter: typer.CallbackParam, path: Path | None, endings: tuple[str, ...]) -> Path | None:
    if path is not None and path.suffix.lower() not in endings:
        raise InvalidInput(
            parameter.opts[0],
            str(path),
            f"must end in {', '.join(endings)}: the ending chooses the form",
            f"for example {path.stem}{endings[0]}",
        )
    return path


def _obstacle(path: Path) -> str | None:
    """Why a file could not be written."""
    folder = path.absolute().parent
    if path.is_dir():
        return "it is a folder"
    if not folder.is_dir():
        return f"there is no folder {folder}"
    target = path if path.exists() else folder
    return None if os.access(target, os.W_OK) else f"{target} is not"
