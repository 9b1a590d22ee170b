"""Free-field columns kept by one run and read by another, instead of being computed again.

Two scenes share a column if the ground at the side, the motion that reaches it and the numerics are the
same. What stands between the sides may differ: a dam with and without its berm.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._errors import InvalidInput
from ..files.committed_file import sync_folder
from ..files.fingerprint import fingerprint
from ..files.hdf5 import LAYOUT, opened, refuse_foreign, text, text_of

Floats = NDArray[np.float64]

# Where a run keeps its columns, beside its results.
FILE_NAME = "free_field.h5"

# Time between the frames kept, s: straight lines between them lose 0.1 % of a pulse of 5 Hz
# (validation/README.md).
INTERVAL = 0.0025

HANDS = ("left", "right")


@dataclass(frozen=True)
class ColumnRecord:
    """What a column did in a stage.

    Attributes
    ----------
    interval : time between frames, s
    impedance : (rows, 3) density (Mg/m3), shear and compression wave speed (m/s) of every row from below
    wet : whether pore pressure is among the values
    values : (frames, width) increments of nominal stress and pore pressure (kPa), velocities (m/s) and the
        base's traction (kPa)
    """

    interval: float
    impedance: Floats
    wet: bool
    values: Floats

    def core(self) -> dict[str, Any]:
        """As the numerical core takes it."""
        return {
            "interval": self.interval,
            "impedance": np.ascontiguousarray(self.impedance),
            "wet": self.wet,
            "values": np.ascontiguousarray(self.values).reshape(-1),
        }

    @classmethod
    def of_core(cls, found: dict[str, Any]) -> ColumnRecord:
        """From what the numerical core gives."""
        width = int(found["width"])
        return cls(found["interval"], found["impedance"], found["wet"], found["values"].reshape(-1, width))


def key(section: dict[str, Any], stage: dict[str, Any], hand: str, tolerance: float) -> str:
    """Fingerprint of a column: of everything on which its motion in a stage depends.

    `section` and `stage` are the descriptions that the numerical core is given, `tolerance` is that of the
    gravity stage.
    """
    side, base = section[hand], stage["base"]
    position: Floats = section["position"]
    x = position[:, 0].min() if hand == "left" else position[:, 0].max()
    # The outermost nodes of the lattice: centres of one column of equal cells.
    inside = np.abs(position[:, 0] - x) < 0.5 * section["spacing"][0]
    inside &= (position[:, 1] >= side["bottom"]) & (position[:, 1] <= side["top"])
    rows = np.flatnonzero(inside)
    rows = rows[np.argsort(position[rows, 1])]
    stress = section["vertical_effective_stress"].reshape(-1, 2)[rows]
    wet = section["water"] is not None
    start, _, wave, delay, slowness = next(
        (segment for segment in base["segments"] if side["x"] <= segment[1]), base["segments"][-1]
    )
    lowest = float(section["base"][:, 1].min())
    described = {
        "version": _core.__version__,
        "tolerance": tolerance,
        "y": position[rows, 1],
        "volume": section["volume"][rows],
        "soils": [section["regions"][region] for region in section["region"][rows]],
        "surface": section["surface_elevation"][rows],
        "stress": stress,
        "pressure": section["pore_pressure"][rows] if wet else [],
        "spacing": section["spacing"],
        "water": section["water"],
        "gravity": section["gravity"],
        "base": [float(np.interp(x, *section["base"].T)), lowest, section["base_support"]],
        "numerics": section["numerics"],
        "wave": None if wave is None else stage["waves"][wave],
        "arrival": delay + (slowness * (side["x"] - start) if slowness else 0.0),
        **{name: base[name] for name in ("vertical", "half_space")},
        **{name: stage[name] for name in ("duration", "local_damping", "rayleigh", "time_step_factor")},
    }
    return fingerprint(described)


def prepare(
    section: dict[str, Any],
    stages: dict[str, dict[str, Any] | None],
    tolerance: float,
    read: str | os.PathLike[str] | None,
    keep: bool,
) -> list[tuple[str, str, str]]:
    """Add to the descriptions of stages the columns that are read, and whether they are recorded.

    `stages` are by name, None where the ground does not move; the others are as for :func:`key`. Returns
    stage, side and fingerprint of every column. Raises :class:`InvalidInput` if there is none, or if those
    to read are not in the folder.
    """
    moving = {name: stage for name, stage in stages.items() if stage is not None}
    keys = [
        (name, hand, key(section, stage, hand, tolerance))
        for name, stage in moving.items()
        for hand, side in zip(HANDS, stage["sides"], strict=True)
        if side == "free-field"
    ]
    if not keys:
        name, value = ("columns", str(read)) if read is not None else ("keep_columns", keep)
        raise InvalidInput(
            name, value, "needs a shaking stage beside free-field sides; this scene has none", "leave it out"
        )
    records = {} if read is None else load(read, keys)
    for name, stage in moving.items():
        of_stage = [records.get((name, hand)) for hand in HANDS]
        stage["column_records"] = tuple(None if one is None else one.core() for one in of_stage)
        stage["record_columns"] = INTERVAL if keep else None
    return keys


def _place(stage: str, hand: str) -> str:
    """The group of a column in the file."""
    return f"{stage}/{hand}"


def save(folder: Path, stage: str, hand: str, fingerprint: str, record: ColumnRecord) -> None:
    """Put a stage's column into the file of a folder, in place of one that is there.

    The file is renewed as a whole: a run that is killed leaves the one before. Raises :class:`OSError`.
    """
    path = folder / FILE_NAME
    part = path.with_suffix(".part")
    if path.exists():
        shutil.copyfile(path, part)
    with h5py.File(part, "a" if path.exists() else "w", libver=LAYOUT) as file:
        place = _place(stage, hand)
        if place in file:
            del file[place]
        group = file.create_group(place)
        group.attrs["key"] = text(fingerprint)
        group.attrs["interval_s"] = record.interval
        group.attrs["wet"] = record.wet
        group.create_dataset("impedance", data=record.impedance, fletcher32=True)
        group.create_dataset("values", data=record.values, compression="gzip", shuffle=True, fletcher32=True)
    part.replace(path)
    sync_folder(folder)


def load(
    folder: str | os.PathLike[str], fingerprints: Sequence[tuple[str, str, str]]
) -> dict[tuple[str, str], ColumnRecord]:
    """The columns of (stage, hand, fingerprint) kept in a folder, by stage and hand.

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
        for stage, hand, fingerprint in fingerprints:
            group = file.get(_place(stage, hand))
            if group is None or text_of(group.attrs["key"]) != fingerprint:
                found = "no column" if group is None else "a column of other ground, motion or numerics"
                raise InvalidInput(
                    "columns",
                    os.fspath(folder),
                    f"must hold the scene's own columns, but has {found} on the {hand} in {stage!r}",
                    "leave columns out: they are then computed, which takes a few per cent of a run",
                )
            records[stage, hand] = ColumnRecord(
                float(group.attrs["interval_s"]),
                np.asarray(group["impedance"][()], dtype=np.float64),
                bool(group.attrs["wet"]),
                np.asarray(group["values"][()], dtype=np.float64),
            )
    return records
