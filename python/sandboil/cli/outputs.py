"""Files that commands write: refused before any work if they cannot be written."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from numpy.typing import NDArray

from .._errors import InvalidInput
from .._style import DPI

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Forms of a motion's file, and of a picture, known by their endings.
MOTIONS = (".at2", ".csv")
PICTURES = (".png", ".pdf", ".svg")


def to_write(parameter: typer.CallbackParam, path: Path | None) -> Path | None:
    """Refuse a file that cannot be written; for an option's callback."""
    if path is not None:
        obstacle = _obstacle(path)
        if obstacle is not None:
            raise InvalidInput(
                parameter.opts[0], str(path), f"must be writable, but {obstacle}", "name another file"
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


def csv_of(columns: dict[str, NDArray[Any]]) -> str:
    """Columns of numbers as CSV."""
    # Adding 0 takes the sign of a zero away.
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(f"{value + 0.0:.9g}" for value in row) for row in rows)]
    return "\n".join(lines) + "\n"


def write_csv(path: Path, columns: dict[str, NDArray[Any]]) -> None:
    """Write columns of numbers as CSV."""
    write_text(path, csv_of(columns))


def draw(path: Path, figure: Figure) -> None:
    """Write a picture."""
    try:
        figure.savefig(path, dpi=DPI)
    except (OSError, ValueError) as error:
        raise InvalidInput("--plot", str(path), f"must be writable: {error}", "name another file") from error


def write_text(path: Path, text: str) -> None:
    """Write a text."""
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InvalidInput(
            "--out", str(path), f"must be writable: {error.strerror}", "name another file"
        ) from error
