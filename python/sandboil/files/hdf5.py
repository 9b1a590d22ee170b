"""HDF5 files of sandboil read from a user's disk: every fault of a file is reported as bad input."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .._errors import InvalidInput, SandboilError

# Most values per byte of file: deflate makes 1032 bytes of one at most, and we use no other filter that does.
_MAX_EXPANSION = 1032

# Most groups and arrays of a file: a run of many stages has hundreds, and a group may hold itself.
_MAX_PLACES = 10_000

# Layout of what we write, of HDF5 1.10. Its metadata have checksums, so that damage is found before it is
# used; in older layouts damage can hang or crash the library.
LAYOUT = ("v110", "v110")


def text(value: str) -> NDArray[np.bytes_]:
    """A text as an attribute of fixed length: HDF5 follows those of variable length without any checksum."""
    content = value.encode()
    return np.array(content, dtype=h5py.string_dtype("utf-8", max(len(content), 1)))


def text_of(value: Any) -> str:
    """The text of an attribute."""
    content = value.decode() if isinstance(value, bytes) else value
    if not isinstance(content, str):
        raise ValueError(f"an attribute is {type(value).__name__} and no text")
    return content


@contextmanager
def opened(path: Path, label: str) -> Iterator[h5py.File]:
    """A file to read; :class:`InvalidInput` under `label` if h5py or the reader cannot make sense of it."""
    try:
        with h5py.File(path, "r") as file:
            yield file
    except SandboilError:
        raise
    except (OSError, KeyError, ValueError, TypeError, AttributeError, IndexError, RuntimeError) as error:
        # What h5py raises for a damaged file, and what follows from a value of another type.
        raise InvalidInput(
            label,
            str(path),
            f"must be a sound file of sandboil: {error}",
            "take a copy, or run the scene again",
        ) from error


def refuse_foreign(file: h5py.File, label: str) -> None:
    """Refuse a file that refers to others, or whose arrays are larger than what it holds can be unpacked to.

    Other files would be read and, when a run is resumed, written; larger arrays fill the memory.
    """
    room = _MAX_EXPANSION * Path(file.filename).stat().st_size
    groups, count = [file], 0
    while groups:
        group = groups.pop()
        for name in group:
            count += 1
            fault = (
                _foreign(group, name, room) if count <= _MAX_PLACES else f"it has over {_MAX_PLACES} places"
            )
            if fault is not None:
                raise InvalidInput(
                    label,
                    file.filename,
                    f"must hold its own arrays alone, but {fault}",
                    "take a copy of the run",
                )
            if group.get(name, getclass=True) is h5py.Group:
                groups.append(group[name])


def _foreign(group: h5py.Group, name: str, room: int) -> str | None:
    """What is wrong at a place of a file; None if it holds an array or a group of its own."""
    place = f"{group.name.rstrip('/')}/{name}"
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        return f"{place} is a link to elsewhere"
    item = group[name]
    if isinstance(item, h5py.Group):
        return None
    if not isinstance(item, h5py.Dataset):
        return f"{place} is no array"
    if item.external or item.is_virtual:
        return f"{place} lies in another file"
    return f"{place} declares {item.nbytes} bytes" if item.nbytes > room else None
