"""Ground motion files: PEER .AT2 and CSV. Errors give the file and the line."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from .._errors import InvalidInput, nearest_name
from ..files.input_file import read_bytes
from ._series import (
    MAX_DT,
    MAX_SAMPLES,
    STANDARD_GRAVITY,
    Array,
    Quantity,
    finite_series,
    ground_motion,
    positive,
)

# Longest accepted line, characters: several thousand columns. The cells of a line need many times its memory.
MAX_LINE = 100_000
# The number of points of an .AT2 must be within this many lines (in PEER files it is in line four).
MAX_HEADER_LINES = 50
# Largest relative difference of a step of the time column from the usual one. Rounded decimals differ less,
# and a missing sample gives a difference of 1.
STEP_TOLERANCE = 0.25
# Significant digits of a spacing from a time column; further digits are round-off of its decimals.
DT_DIGITS = 12
# Numbers per line of an .AT2, as in PEER files (5E15.7), and their digits after the decimal point.
AT2_COLUMNS = 5
AT2_DIGITS = 7

# Accepted units: the quantity of each, and the factor to g or m/s.
UNITS: dict[str, tuple[Quantity, float]] = {
    "g": ("acceleration_g", 1.0),
    "m/s2": ("acceleration_g", 1.0 / STANDARD_GRAVITY),
    "cm/s2": ("acceleration_g", 0.01 / STANDARD_GRAVITY),
    "m/s": ("velocity", 1.0),
}

_UNSIGNED = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[EeDd][-+]?\d+)?"
_NUMBER = rf"[-+]?{_UNSIGNED}"
# Numbers without separator, from Fortran columns of full width: each further number begins with its sign.
_TOUCHING = re.compile(rf"{_NUMBER}(?:[-+]{_UNSIGNED})+")
_EACH = re.compile(_NUMBER)
_NOT_FINITE = re.compile(r"[-+]?(nan|inf|infinity)", re.IGNORECASE)
_NPTS = re.compile(r"\bNPTS\s*[=:]\s*([^\s,=]+)", re.IGNORECASE)
_DT = re.compile(r"\bDT\s*[=:]\s*([^\s,=]+)", re.IGNORECASE)
_NPTS_DT_LAST = re.compile(r"^\s*([^\s,=]+)[\s,]+([^\s,=]+)[\s,]+NPTS[\s,]*DT\b", re.IGNORECASE)
_SECONDS = re.compile(r"s(ec(onds?)?)?\.?$", re.IGNORECASE)
_AT2_UNIT = re.compile(r"\bUNITS\b\s*(?:OF|IN|ARE)?\s*[:=(]?\s*([A-Za-z][\w/*^]*)", re.IGNORECASE)
_COLUMN_UNIT = re.compile(
    r"(?:^|[\s_(\[,])(g|c?m[/_]s(?:ec)?(?:[/_]s(?:ec)?|\^?2)?|gal)[)\]]*$", re.IGNORECASE
)
_ACCELERATION_COLUMN = re.compile(r"a(?:cc\w*)?(?![a-z])", re.IGNORECASE)
_VELOCITY_COLUMN = re.compile(r"v(?:el\w*)?(?![a-z])", re.IGNORECASE)
_TIME_COLUMN = re.compile(r"t(?:ime)?(?![a-z])", re.IGNORECASE)


@dataclass(frozen=True)
class Record:
    """Contents of a file: spacing in s, quantity, (n,) samples in g or m/s, and the unit in the file."""

    dt: float
    quantity: Quantity
    samples: Array
    unit: str


def read_at2(path: str | os.PathLike[str]) -> Record:
    """Read a PEER .AT2 acceleration; see :meth:`Motion.from_at2`."""
    name = os.fspath(path)
    lines = _lines(name)
    header, points, dt = _at2_header(name, lines)
    unit = _at2_unit(name, header)

    values: list[float] = []
    line_of: list[int] = []
    for number, line in lines:
        row = _at2_row(name, number, line, started=bool(values))
        values.extend(row)
        line_of.extend([number] * len(row))
        if len(values) > MAX_SAMPLES:
            raise InvalidInput(
                f"{name}, line {number}",
                len(values),
                f"must have at most {MAX_SAMPLES} points",
                "shorten the record or increase its time step",
            )
    if len(values) != points:
        raise InvalidInput(
            f"{name}, NPTS",
            points,
            f"must be the number of values in the file, {len(values)}",
            "the file is incomplete or was edited: use a complete copy"
            if len(values) < points
            else "the file has more values than its header says: use an unedited copy",
        )
    quantity, factor = UNITS[unit]
    samples = ground_motion(np.array(values) * factor, quantity, dt, lambda at: f"{name}, line {line_of[at]}")
    return Record(dt, quantity, samples, unit)


def _at2_header(name: str, lines: Iterator[tuple[int, str]]) -> tuple[list[str], int, float]:
    """Header lines, number of points and spacing, s. The header ends with the line of NPTS and DT."""
    header: list[str] = []
    for number, line in islice(lines, MAX_HEADER_LINES):
        # Reduce all space to single blanks, so that the patterns take linear time.
        header.append(" ".join(line.split()))
        last = _NPTS_DT_LAST.search(header[-1])
        if last:
            points_text, dt_text = last.groups()
        else:
            points_found, dt_found = _NPTS.search(header[-1]), _DT.search(header[-1])
            if not (points_found and dt_found):
                continue
            points_text, dt_text = points_found[1], dt_found[1]
        place = f"{name}, line {number}"
        try:
            points = int(points_text)
        except ValueError:
            raise InvalidInput(f"{place}, NPTS", points_text, "must be a whole number") from None
        if not 2 <= points <= MAX_SAMPLES:
            raise InvalidInput(
                f"{place}, NPTS",
                points,
                f"must lie between 2 and {MAX_SAMPLES}",
                "use a complete copy of the record",
            )
        return header, points, _record_dt(f"{place}, DT", _SECONDS.sub("", dt_text))
    raise InvalidInput(
        name,
        header[3] if len(header) > 3 else "",
        f'must have a line like "NPTS=   7990, DT=  0.0050 SEC" among its first {MAX_HEADER_LINES}',
        "if it is not a PEER .AT2 file, save it as CSV with a header row",
    )


def _record_dt(place: str, value: object) -> float:
    hint = f"the spacing in seconds, at most {MAX_DT:g}, for example 0.005"
    # Fortran may write the exponent with a D.
    number = re.sub("[dD]", "e", value) if isinstance(value, str) else value
    dt = positive(place, number, "seconds", hint)
    if dt > MAX_DT:
        raise InvalidInput(place, value, f"must be at most {MAX_DT:g} s", "it is probably in milliseconds")
    return dt


def _at2_unit(name: str, header: list[str]) -> str:
    for number, line in enumerate(header, start=1):
        found = _AT2_UNIT.search(line)
        if found:
            unit = _plain_unit(found[1])
            if unit is None or UNITS[unit][0] != "acceleration_g":
                raise InvalidInput(
                    f"{name}, line {number}, unit",
                    found[1],
                    "must be one of G, CM/S2, M/S2",
                    "an .AT2 file must contain an acceleration; use CSV for other quantities",
                )
            return unit
    raise InvalidInput(
        f"{name}, unit",
        None,
        'must be given in a header line, as "ACCELERATION TIME SERIES IN UNITS OF G"',
        "add the unit to the third line",
    )


def _number(text: str) -> float:
    """A number, also with a Fortran exponent D. nan and inf are accepted here and refused later."""
    if _EACH.fullmatch(text):
        return float(text.upper().replace("D", "E"))
    if _NOT_FINITE.fullmatch(text):
        return float(text)
    raise ValueError(text)


def _plain_unit(text: str) -> str | None:
    """The key of UNITS for a spelling such as CM/SEC**2, cm/s/s, gal, m_s2 or G; None if unknown."""
    spelled = text.lower().replace("sec", "s").replace("**", "").replace("^", "").replace("_", "/")
    spelled = re.sub(r"/s/s$", "/s2", spelled)
    spelled = "cm/s2" if spelled in ("gal", "cm/s2") else spelled
    return spelled if spelled in UNITS else None


def _at2_row(name: str, number: int, line: str, started: bool) -> list[float]:
    row: list[float] = []
    for token in line.replace(",", " ").split():
        parts = _EACH.findall(token) if _TOUCHING.fullmatch(token) else [token]
        for part in parts:
            try:
                row.append(_number(part))
            except ValueError:
                if not started and not row:
                    # Text after the NPTS line and before the first number still belongs to the header.
                    return []
                raise InvalidInput(
                    f"{name}, line {number}",
                    token,
                    "must be a number",
                    "correct the line or use another copy",
                ) from None
    return row


def read_csv(path: str | os.PathLike[str], unit: str | None, column: str | int | None) -> Record:
    """Read one column of a CSV; see :meth:`Motion.from_csv`."""
    name = os.fspath(path)
    rows = _csv_rows(name)
    header_line, header = next(rows, (1, []))
    if len(header) < 2 or any(_EACH.fullmatch(cell) for cell in header):
        raise InvalidInput(
            f"{name}, line {header_line}",
            ",".join(header),
            "must be a header row with a time column and at least one more column",
            'for example "time_s,acceleration_g"',
        )
    unit = unit if unit is None else _plain_unit(unit) or unit
    if unit is not None and unit not in UNITS:
        hint = _did_you_mean(unit, UNITS) or "convert the record to one of them"
        raise InvalidInput("unit", unit, f"must be one of {', '.join(UNITS)}", hint)
    time_at = next((i for i, cell in enumerate(header) if _TIME_COLUMN.match(cell)), 0)
    value_at = _value_column(name, header, time_at, unit, column)
    unit = _csv_unit(name, header[value_at], unit)

    times: list[float] = []
    values: list[float] = []
    line_of: list[int] = []
    for number, cells in rows:
        if len(cells) != len(header):
            raise InvalidInput(
                f"{name}, line {number}",
                ",".join(cells),
                f"must have {len(header)} columns, as the header",
                "correct the line or use another copy",
            )
        for target, at in ((times, time_at), (values, value_at)):
            try:
                target.append(_number(cells[at]))
            except ValueError:
                raise InvalidInput(
                    f"{name}, line {number}, column {header[at]}",
                    cells[at],
                    "must be a number",
                    "gaps are not filled automatically: correct the record or use another copy",
                ) from None
        line_of.append(number)
        if len(values) > MAX_SAMPLES:
            raise InvalidInput(
                f"{name}, line {number}",
                len(values),
                f"must have at most {MAX_SAMPLES} points",
                "shorten the record or increase its time step",
            )
    if len(values) < 2:
        raise InvalidInput(
            f"{name}, number of points",
            len(values),
            "must be at least 2",
            "use a complete copy of the record",
        )
    dt = _uniform_step(name, np.array(times), line_of)
    quantity, factor = UNITS[unit]
    samples = ground_motion(
        np.array(values) * factor,
        quantity,
        dt,
        lambda at: (
            f"{name}, line {line_of[at]}, column {header[value_at]} ({quantity.replace('_g', ' in g')})"
        ),
    )
    return Record(dt, quantity, samples, unit)


def _csv_rows(name: str) -> Iterator[tuple[int, list[str]]]:
    """Line numbers and stripped cells; comment lines (#) and blank lines are skipped."""
    delimiter = None
    for number, line in _lines(name):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if delimiter is None:
            delimiter = next((mark for mark in (",", ";", "\t") if mark in line), ",")
        yield number, [cell.strip().strip('"') for cell in line.split(delimiter)]


def _value_column(
    name: str, header: list[str], time_at: int, unit: str | None, column: str | int | None
) -> int:
    if isinstance(column, int):
        if not 0 <= column < len(header) or column == time_at:
            raise InvalidInput(
                f"{name}, column",
                column,
                f"must be the number (from 0) of a column of {header} other than time",
                "or give the name of the column",
            )
        return column
    if column is not None:
        lowered = [cell.lower() for cell in header]
        if column.lower() not in lowered:
            raise InvalidInput(
                f"{name}, column",
                column,
                f"must be one of {', '.join(header)}",
                _did_you_mean(column, header) or "the names are those of the header of the file",
            )
        return lowered.index(column.lower())
    wanted = _VELOCITY_COLUMN if unit is not None and UNITS[unit][0] == "velocity" else _ACCELERATION_COLUMN
    others = [i for i in range(len(header)) if i != time_at]
    return next((i for i in others if wanted.match(header[i])), others[0])


def _csv_unit(name: str, column: str, unit: str | None) -> str:
    """The given unit, or the unit in the name of the column; a contradiction is refused."""
    in_name = _COLUMN_UNIT.search(column)
    stated = _plain_unit(in_name[1]) if in_name else None
    if in_name and stated is None:
        raise InvalidInput(
            f"{name}, unit",
            in_name[1],
            f"must be one of {', '.join(UNITS)}",
            "convert the column and rename it",
        )
    if unit is None:
        if stated is None:
            raise InvalidInput(
                f"{name}, unit",
                None,
                f"must be given, one of {', '.join(UNITS)}",
                f'give unit="g", or name the column "{column}_g"',
            )
        return stated
    if stated is not None and stated != unit:
        raise InvalidInput(
            f"{name}, unit",
            unit,
            f'contradicts the name of the column "{column}", which has the unit {stated}',
            "correct one of them",
        )
    return unit


def _uniform_step(name: str, times: Array, line_of: list[int]) -> float:
    """Spacing of a time column, s; a non-uniform column is refused with the line of the first uneven step."""
    times = finite_series(times, f"{name}, time", lambda at: f"{name}, line {line_of[at]}, time")
    steps = np.diff(times)
    usual = _record_dt(f"{name}, time step", float(np.median(steps)))
    uneven = np.flatnonzero(~(np.abs(steps - usual) <= STEP_TOLERANCE * usual))
    dt = float(f"{(times[-1] - times[0]) / (times.size - 1):.{DT_DIGITS}g}")
    if not uneven.size:
        drift = np.abs(times - times[0] - dt * np.arange(times.size))
        uneven = np.flatnonzero(drift > usual) - 1
    if uneven.size:
        at = int(uneven[0])
        raise InvalidInput(
            f"{name}, line {line_of[at + 1]}, time",
            float(times[at + 1]),
            f"must be one time step of {usual:.6g} s after {times[at]:.9g} s",
            "the record has a gap or a change of time step: resample it with a constant step",
        )
    return dt


def _did_you_mean(name: str, candidates: dict[str, tuple[Quantity, float]] | list[str]) -> str | None:
    nearest = nearest_name(name, candidates)
    return f'did you mean "{nearest}"?' if nearest else None


def _lines(name: str) -> Iterator[tuple[int, str]]:
    """The lines of a file, numbered from 1."""
    content = read_bytes(name, "motion file", "record, .AT2 or CSV")
    if b"\0" in content:
        raise InvalidInput("motion file", name, "must be text", "this is a binary file: export it as CSV")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Old headers have station names in Latin-1, which can decode any byte.
        text = content.decode("latin-1")
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        if len(line) > MAX_LINE:
            raise InvalidInput(
                f"{name}, line {number}",
                f"{len(line)} characters",
                f"must not exceed {MAX_LINE} characters",
                "it is not a record, or its line breaks are missing: export it again",
            )
        yield number, line


def write_at2(path: str | os.PathLike[str], dt: float, acceleration_g: Array, title: str) -> None:
    """Write an .AT2 file as PEER does: four header lines, then accelerations in g in the format 5E15.7."""
    numbers = [f"{value:{AT2_DIGITS + 8}.{AT2_DIGITS}E}" for value in acceleration_g]
    rows = ("".join(numbers[i : i + AT2_COLUMNS]) for i in range(0, len(numbers), AT2_COLUMNS))
    header = (
        "STRONG MOTION RECORD IN THE FORMAT OF THE PEER NGA DATABASE",
        title,
        "ACCELERATION TIME SERIES IN UNITS OF G",
        f"NPTS= {len(numbers):6d}, DT= {dt!r} SEC",
    )
    _write(path, [*header, *rows])


def write_csv(path: str | os.PathLike[str], dt: float, acceleration_g: Array, velocity: Array) -> None:
    """Write time (s), acceleration (g) and velocity (m/s) with all digits."""
    rows = (
        f"{index * dt!r},{float(a)!r},{float(v)!r}"
        for index, (a, v) in enumerate(zip(acceleration_g, velocity, strict=True))
    )
    _write(path, ["time_s,acceleration_g,velocity_m/s", *rows])


def _write(path: str | os.PathLike[str], lines: list[str]) -> None:
    try:
        Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise InvalidInput(
            "motion file",
            os.fspath(path),
            f"cannot be written: {error.strerror}",
            "check the folder and its permissions",
        ) from error
