"""Files that the commands `sandboil lab ...` read."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from .._errors import InvalidInput
from .._types import Floats
from ..files import toml
from ..files.input_file import read_text
from ..scene.soils import Material, PM4Sand, material


def soil_of(file: Path | None, **sand: float | None) -> Material:
    """The soil of a TOML file, or PM4Sand by its three parameters."""
    given = {name: value for name, value in sand.items() if value is not None}
    if file is None:
        return PM4Sand(**given)
    if given:
        raise InvalidInput("--soil", str(file), f"excludes --{', --'.join(given)}", "put them into the file")
    return material(toml.parse(toml.read(file, "--soil"), "--soil", str(file)))


def strains_of(path: Path) -> Floats:
    """Strains (n, 3) of a CSV file with columns for xx, yy and the engineering shear strain."""
    names = ("eps_xx", "eps_yy", "gamma_xy")
    text = read_text(path, "PATH", "CSV file")
    try:
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
        return np.array([[float(row[name]) for name in names] for row in rows])
    except KeyError as error:
        allowed, header = f"must have a column {error.args[0]}", text.partition("\n")[0]
        raise InvalidInput("PATH", str(path), allowed, f"its header is {header!r}") from error
    except (csv.Error, ValueError, TypeError) as error:
        raise InvalidInput(
            "PATH",
            str(path),
            f"must be a CSV of numbers below a header: {error}",
            f"columns {', '.join(names)}",
        ) from error
