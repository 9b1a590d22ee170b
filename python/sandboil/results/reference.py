"""Results of another code, for comparison."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._errors import InvalidInput
from .._types import Floats
from ..files.input_file import read_text


@dataclass(frozen=True)
class Reference:
    """Results of another code, drawn over those of a run, from a folder of CSV files with a header each.

    ``histories.csv``: time_s, acc_surface_g, and ru_<depth>m for any depths (4 m: ru_4m).
    ``spectrum.csv``: period_s and psa_surface_g_5pct.
    ``stress_strain.csv``: time_s, and tau_kPa_<depth>m, sv_eff_kPa_<depth>m, gamma_<depth>m.
    Compression positive, time 0 at the start of the record. Other columns are ignored.
    """

    histories: dict[str, Floats]
    spectrum: dict[str, Floats]
    stress_strain: dict[str, Floats]

    @classmethod
    def read(cls, folder: str | os.PathLike[str]) -> Reference:
        """The files of a folder; :class:`InvalidInput` names the one that is missing or no such table."""
        return cls(
            **{
                name: _table(Path(folder) / f"{name}.csv")
                for name in ("histories", "spectrum", "stress_strain")
            }
        )


def _table(path: Path) -> dict[str, Floats]:
    header, _, rows = read_text(path, "reference", "CSV file").partition("\n")
    names = header.strip().split(",")
    try:
        values = np.loadtxt(io.StringIO(rows), delimiter=",", ndmin=2) if rows.strip() else np.empty((0, 0))
    except ValueError as error:
        raise InvalidInput(
            "reference",
            str(path),
            f"must be a CSV of numbers below a header: {error}",
            "see sandboil.results.reference.Reference",
        ) from error
    if values.shape[1] != len(names):
        raise InvalidInput(
            "reference",
            str(path),
            f"must have {len(names)} columns as its header, not {values.shape[1]}",
            "see sandboil.results.reference.Reference",
        )
    return dict(zip(names, values.T, strict=True))


def column_of(table: dict[str, Floats], name: str) -> Floats:
    """A column of one of the tables; :class:`InvalidInput` if it is missing."""
    if name not in table:
        raise InvalidInput("reference", ", ".join(table), f"must have a column {name}")
    return table[name]
