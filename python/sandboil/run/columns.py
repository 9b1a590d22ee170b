"""Free-field columns kept by one run and read by another, instead of being computed again.

Two scenes share a column if the ground at the side, the motion that reaches it and the numerics are the
same. What stands between the sides may differ: a dam with and without its berm.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from .. import _core
from .._errors import InvalidInput
from ..files.committed_file import sync_folder
from ..files.fingerprint import fingerprint
from ..files.hdf5 import LAYOUT, opened, refuse_foreign, text, text_of

# Where a run keeps its columns, beside its results.
FILE_NAME = "free_field.h5"

# Time between the frames kept, s: straight lines between them lose 0.1 % of a pulse of 5 Hz
# (validation/README.md).
INTERVAL = 0.0025

HANDS = ("left", "right")

# Stages of grains by name; None for others.
Stages = Mapping[str, _core.Gravity | _core.Shaking | _core.RunOut | None]


class Column(NamedTuple):
    """A free-field column in a stage: name of the stage, side, and fingerprint of all that moves it."""

    stage: str
    hand: str
    fingerprint: str


def columns_of(
    section: _core.Section, stages: Stages, read: str | os.PathLike[str] | None, keep: bool
) -> list[Column]:
    """Every column of the stages, which are to be read from a folder or kept.

    Raises :class:`InvalidInput` if there is none.
    """
    gravity = next((stage for stage in stages.values() if isinstance(stage, _core.Gravity)), None)
    shakings = {name: stage for name, stage in stages.items() if isinstance(stage, _core.Shaking)}
    found = [
        Column(name, hand, fingerprint(_core.__version__.encode() + identity))
        for name, stage in shakings.items()
        for hand, identity in zip(HANDS, _core.column_identities(section, gravity, stage), strict=True)
        if identity is not None
    ]
    if not found:
        name, value = ("columns", str(read)) if read is not None else ("keep_columns", keep)
        raise InvalidInput(
            name, value, "needs a shaking stage beside free-field sides; this scene has none", "leave it out"
        )
    return found


def with_columns(
    stages: Stages, columns: Sequence[Column], read: str | os.PathLike[str] | None, keep: bool
) -> list[_core.Gravity | _core.Shaking | _core.RunOut | None]:
    """The stages, which read their columns from a folder if one is given, and record them if they are kept.

    Raises :class:`InvalidInput` if the folder does not hold the columns.
    """
    records = {} if read is None else load(read, columns)

    def of(name: str, stage: _core.Shaking) -> _core.Shaking:
        left, right = (records.get((name, hand)) for hand in HANDS)
        return stage.with_columns(records=(left, right), record_interval=INTERVAL if keep else None)

    return [of(name, stage) if isinstance(stage, _core.Shaking) else stage for name, stage in stages.items()]


def _place(stage: str, hand: str) -> str:
    """The group of a column in the file."""
    return f"{stage}/{hand}"


def save(folder: Path, column: Column, record: _core.ColumnRecord) -> None:
    """Put a column into the file of a folder, in place of one that is there.

    The file is renewed as a whole: a run that is killed leaves the one before. Raises :class:`OSError`.
    """
    path = folder / FILE_NAME
    part = path.with_suffix(".part")
    if path.exists():
        shutil.copyfile(path, part)
    with h5py.File(part, "a" if path.exists() else "w", libver=LAYOUT) as file:
        place = _place(column.stage, column.hand)
        if place in file:
            del file[place]
        group = file.create_group(place)
        group.attrs["key"] = text(column.fingerprint)
        group.attrs["interval_s"] = record.interval
        group.attrs["wet"] = record.wet
        group.create_dataset("impedance", data=record.impedance, fletcher32=True)
        group.create_dataset("values", data=record.values, compression="gzip", shuffle=True, fletcher32=True)
    part.replace(path)
    sync_folder(folder)


def load(
    folder: str | os.PathLike[str], columns: Sequence[Column]
) -> dict[tuple[str, str], _core.ColumnRecord]:
    """The records of columns that are kept in a folder, by stage and hand.

    Raises :class:`InvalidInput` if the folder holds none, or those of other ground, motion or numerics.
    """
    path = Path(folder) / FILE_NAME
    if not path.is_file():
        raise InvalidInput(
            "columns",
            os.fspath(folder),
            f"must be the folder of a run that kept its columns, but has no {FILE_NAME}",
            "run that scene with keep_columns=True",
        )
    records = {}
    with opened(path, "columns") as file:
        refuse_foreign(file, "columns")
        for stage, hand, identity in columns:
            group = file.get(_place(stage, hand))
            if group is None or text_of(group.attrs["key"]) != identity:
                found = "no column" if group is None else "a column of other ground, motion or numerics"
                raise InvalidInput(
                    "columns",
                    os.fspath(folder),
                    f"must hold the scene's own columns, but has {found} on the {hand} in {stage!r}",
                    "leave columns out: they are then computed, which takes a few per cent of a run",
                )
            records[stage, hand] = _core.ColumnRecord(
                interval=float(group.attrs["interval_s"]),
                impedance=np.asarray(group["impedance"][()], dtype=np.float64),
                wet=bool(group.attrs["wet"]),
                values=np.asarray(group["values"][()], dtype=np.float64),
            )
    return records
