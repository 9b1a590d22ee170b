"""Scenes as TOML: tables with the same names as in Python, where `kind` takes the place of the class."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._errors import InvalidInput
from ..files import toml

if TYPE_CHECKING:
    from .scene import Scene

# Places of motions in the tables of stages and of segments of a base.
_MOTIONS = ("motion", "vertical")


def text_of(scene: Scene, *, resolved: bool) -> str:
    """The scene as TOML text, with or without its defaults."""
    table: dict[str, Any] = scene.model_dump(exclude_none=True, exclude_unset=not resolved)
    return toml.text(table)


def write(text: str, path: str | Path) -> None:
    """Write the text of a scene; :class:`InvalidInput` if that is impossible."""
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InvalidInput(
            "path", str(path), f"must be writable: {error.strerror}", "check the folder and its permissions"
        ) from error


def table_of(path_or_text: str | Path) -> dict[str, Any]:
    """The arguments of a scene from a TOML file, or from TOML text (recognised by its line breaks).

    Files of motions are taken relative to the scene's file. Raises :class:`InvalidInput`.
    """
    if isinstance(path_or_text, str) and "\n" in path_or_text:
        table, folder = toml.parse(path_or_text, "scene", "text"), Path()
    else:
        path = Path(path_or_text)
        table, folder = toml.parse(toml.read(path, "scene"), "scene", str(path)), path.parent
    if "stages" in table:
        table["stages"] = _anchored(table["stages"], folder.absolute())
    return table


def _anchored(part: Any, folder: Path) -> Any:
    """A part of a table with the files of its motions found from `folder`."""
    if isinstance(part, list):
        return [_anchored(item, folder) for item in part]
    if not isinstance(part, dict):
        return part
    return {
        name: _from_folder(value, folder) if name in _MOTIONS else _anchored(value, folder)
        for name, value in part.items()
    }


def _from_folder(motion: Any, folder: Path) -> Any:
    """The table of a motion with its file found from `folder`."""
    if isinstance(motion, dict) and isinstance(motion.get("file"), str):
        return motion | {"file": str(folder / motion["file"])}
    return motion
