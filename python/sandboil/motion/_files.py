"""Ground motion files: PEER .AT2 and CSV, read with every defect told by file and line."""

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
from .._input_file import read_bytes
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

# Longest line taken, characters: some thousand columns; what a line is split into takes many times its text.
MAX_LINE = 100_000
# An .AT2 says its number of points within this many lines (four, in PEER's own).
MAX_HEADER_LINES = 50
# A step of the time column may differ from the others by this fraction of it: rounded decimals differ
# less, a missing sample by one whole step.
STEP_TOLERANCE = 0.25
# Digits kept of a spacing taken from a time column: those beyond are rounding of its decimals.
DT_DIGITS = 12
# Numbers in a line of an .AT2, as PEER writes them (5E15.7), and their digits after the point.
AT2_COLUMNS = 5
AT2_DIGITS = 7

# Accepted units: the quantity they tell and what their values are multiplied by to give g or m/s.
UNITS: dict[str, tuple[Quantity, float]] = {
    "g": ("acceleration_g", 1.0),
    "m/s2": ("acceleration_g", 1.0 / STANDARD_GRAVITY),
    "cm/s2": ("acceleration_g", 0.01 / STANDARD_GRAVITY),
    "m/s": ("velocity", 1.0),
}

_UNSIGNED = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[EeDd][-+]?\d+)?"
_NUMBER = rf"[-+]?{_UNSIGNED}"
# Fortran columns filled to their width: each further number shows by its sign.
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
    """What a file holds: spacing in s, quantity, its (n,) samples in g or m/s, and the file's own unit."""

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
                f"at most {MAX_SAMPLES} points are taken",
                "cut or thin the record",
            )
    if len(values) != points:
        raise InvalidInput(
            f"{name}, NPTS",
            points,
            f"must be the number of values in the file, which holds {len(values)}",
            "the file is cut short or was edited: take a whole copy"
            if len(values) < points
            else "the file holds more than its header says: take an unedited copy",
        )
    quantity, factor = UNITS[unit]
    samples = ground_motion(np.array(values) * factor, quantity, dt, lambda at: f"{name}, line {line_of[at]}")
    return Record(dt, quantity, samples, unit)


def _at2_header(name: str, lines: Iterator[tuple[int, str]]) -> tuple[list[str], int, float]:
    """Header, number of points and spacing: the header ends with the line that holds NPTS and DT."""
    header: list[str] = []
    for number, line in islice(lines, MAX_HEADER_LINES):
        # Single blanks: the patterns allow for any number in several places.
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
                "take a whole copy of the record",
            )
        return header, points, _record_dt(f"{place}, DT", _SECONDS.sub("", dt_text))
    raise InvalidInput(
        name,
        header[3] if len(header) > 3 else "",
        f'must hold a line like "NPTS=   7990, DT=  0.0050 SEC" among its first {MAX_HEADER_LINES}',
        "if it is no PEER .AT2 file, write it as CSV with a header row",
    )


def _record_dt(place: str, value: object) -> float:
    hint = f"the spacing in seconds, at most {MAX_DT:g}, for example 0.005"
    # Fortran writes exponents with a D.
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
                    "an .AT2 file holds an acceleration; other quantities can be given as CSV",
                )
            return unit
    raise InvalidInput(
        f"{name}, unit",
        None,
        'must be stated in a header line, as "ACCELERATION TIME SERIES IN UNITS OF G"',
        "add the unit to the third line",
    )


def _number(text: str) -> float:
    """A number with a point, Fortran's D exponent included; nan and inf pass, to be refused as such."""
    if _EACH.fullmatch(text):
        return float(text.upper().replace("D", "E"))
    if _NOT_FINITE.fullmatch(text):
        return float(text)
    raise ValueError(text)


def _plain_unit(text: str) -> str | None:
    """The key of UNITS that a spelling means: CM/SEC**2, cm/s/s, gal, m_s2, G."""
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
                    # Text below the NPTS line still belongs to the header.
                    return []
                raise InvalidInput(
                    f"{name}, line {number}",
                    token,
                    "must be a number",
                    "repair the line or take another copy",
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
            "must be a header row that names a time column and at least one more",
            'for example "time_s,acceleration_g"',
        )
    unit = unit if unit is None else _plain_unit(unit) or unit
    if unit is not None and unit not in UNITS:
        told = _did_you_mean(unit, UNITS) or "convert the record to one of them"
        raise InvalidInput("unit", unit, f"must be one of {', '.join(UNITS)}", told)
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
                f"must have {len(header)} columns as the header has",
                "repair the line or take another copy",
            )
        for target, at in ((times, time_at), (values, value_at)):
            try:
                target.append(_number(cells[at]))
            except ValueError:
                raise InvalidInput(
                    f"{name}, line {number}, column {header[at]}",
                    cells[at],
                    "must be a number",
                    "a gap in the record is not filled: repair it or take another copy",
                ) from None
        line_of.append(number)
        if len(values) > MAX_SAMPLES:
            raise InvalidInput(
                f"{name}, line {number}",
                len(values),
                f"at most {MAX_SAMPLES} points are taken",
                "cut or thin the record",
            )
    if len(values) < 2:
        raise InvalidInput(
            f"{name}, number of points", len(values), "must be at least 2", "take a whole copy of the record"
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
    """Line numbers and stripped cells; comment lines (#) and blank ones are passed over."""
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
                f"must be the number (from 0) of a column of {header} that is not time",
                "or name the column",
            )
        return column
    if column is not None:
        lowered = [cell.lower() for cell in header]
        if column.lower() not in lowered:
            raise InvalidInput(
                f"{name}, column",
                column,
                f"must be one of {', '.join(header)}",
                _did_you_mean(column, header) or "columns are named by the file's header",
            )
        return lowered.index(column.lower())
    wanted = _VELOCITY_COLUMN if unit is not None and UNITS[unit][0] == "velocity" else _ACCELERATION_COLUMN
    others = [i for i in range(len(header)) if i != time_at]
    return next((i for i in others if wanted.match(header[i])), others[0])


def _csv_unit(name: str, column: str, unit: str | None) -> str:
    """The unit given, or else the one in the column's name; a contradiction is refused."""
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
                f"must be stated, one of {', '.join(UNITS)}",
                f'give unit="g", or name the column "{column}_g"',
            )
        return stated
    if stated is not None and stated != unit:
        raise InvalidInput(
            f"{name}, unit",
            unit,
            f'contradicts the column "{column}", whose name says {stated}',
            "correct either",
        )
    return unit


def _uniform_step(name: str, times: Array, line_of: list[int]) -> float:
    """Spacing of a time column, refused with the place where it is not uniform."""
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
            f"must follow {times[at]:.9g} s by the record's step of {usual:.6g} s",
            "there is a gap or a change of step: fill it or resample the record evenly",
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
        # Old headers name their stations in Latin-1, in which every byte is a letter.
        text = content.decode("latin-1")
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        if len(line) > MAX_LINE:
            raise InvalidInput(
                f"{name}, line {number}",
                f"{len(line)} characters",
                f"must not exceed {MAX_LINE} characters",
                "this is no record, or its line breaks are lost: export it anew",
            )
        yield number, line


def write_at2(path: str | os.PathLike[str], dt: float, acceleration_g: Array, title: str) -> None:
    """Write PEER's form: four header lines, then 5E15.7 in g."""
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
    """Write time, acceleration and velocity with every digit."""
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
            "motion file", os.fspath(path), f"cannot be written: {error.strerror}", "check folder and rights"
        ) from error
