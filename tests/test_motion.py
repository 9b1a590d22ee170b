"""Ground motions: files, integration, baseline, filter, measures, spectra, generators, errors."""

from __future__ import annotations

import math
import os
import pickle
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sandboil._errors import InvalidInput
from sandboil.motion import Motion, response_spectrum

G = 9.81
RECORD = Path(os.environ.get("SANDBOIL_RECORDS", "")) / "RSN765_LOMAP_G01090.AT2"

needs_record = pytest.mark.skipif(
    not RECORD.exists(), reason=f"needs {RECORD.name}, which may not be distributed, in SANDBOIL_RECORDS"
)

VALUES = [0.01, -0.02, 0.03, 0.0, -0.01, 0.005, 0.25]
TITLE = "PEER NGA STRONG MOTION DATABASE RECORD\nSomewhere, 1/1/2000, Rock, 90\n"
UNITS_OF_G = "ACCELERATION TIME SERIES IN UNITS OF G\n"


def at2(folder: Path, text: str, name: str = "record.AT2") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def sine(frequency: float = 2.0, dt: float = 0.001, duration: float = 4.0, amplitude: float = 0.3) -> Motion:
    t = np.arange(round(duration / dt) + 1) * dt
    return Motion(dt=dt, acceleration_g=amplitude * np.cos(2 * np.pi * frequency * t))


# Files


@pytest.mark.parametrize(
    "counts",
    [
        "NPTS=      7, DT=  0.0050 SEC",
        "NPTS=7,DT=.005",
        "NPTS=      7  DT=  0.0050 SEC,",
        "npts=      7, dt=  0.0050sec",
        "NPTS:      7, DT: 5.0E-03 SEC",
        "7    0.0050    NPTS, DT",
        "      7   .0050   npts dt",
        "7, 0.0050, NPTS, DT",
    ],
)
def test_at2_header_variants_give_the_same_record(tmp_path: Path, counts: str) -> None:
    motion = Motion.from_at2(
        at2(tmp_path, f"{TITLE}{UNITS_OF_G}{counts}\n 0.01 -0.02 0.03\n0.0 -.01 5e-3 .25\n")
    )
    assert motion.dt == 0.005
    assert motion.acceleration_g.tolist() == VALUES
    assert motion.duration == pytest.approx(0.030, rel=1e-12)


@pytest.mark.parametrize(
    "rows",
    [
        "  1.0000000E-02 -2.0000000E-02  3.0000000E-02  0.0000000E+00 -1.0000000E-02\n  5.E-03 2.5e-1\n",
        "\n".join(str(value) for value in VALUES),
        "0.01 -0.02 0.03 0.0 -0.01 0.005 0.25",
        " .100000E-01-.200000E-01 .300000E-01 .000000E+00-.100000E-01\n\n .500000E-02 .250000E+00\n",
        "0.01D0, -0.02D0, 0.03D0, 0.0D0\n-1.0D-02, 5.0d-3, 0.25\n",
    ],
)
def test_at2_columns_of_any_width(tmp_path: Path, rows: str) -> None:
    text = f"{TITLE}{UNITS_OF_G}NPTS= 7, DT= 0.005 SEC\n{rows}"
    assert Motion.from_at2(at2(tmp_path, text)).acceleration_g.tolist() == VALUES


@pytest.mark.parametrize("before", ["", "one more line\nand another, 5 Hz\n"])
@pytest.mark.parametrize("after", ["", "COMMENT: first value at the trigger\n"])
def test_at2_header_of_more_lines(tmp_path: Path, before: str, after: str) -> None:
    text = f"{TITLE}{before}{UNITS_OF_G}NPTS= 2, DT= 0.01 SEC\n{after}0.1 0.2\n"
    assert Motion.from_at2(at2(tmp_path, text)).acceleration_g.tolist() == [0.1, 0.2]


@pytest.mark.parametrize(
    ("unit", "in_g"),
    [
        ("G", 1.0),
        ("G. FILTER: 0.1 Hz", 1.0),
        ("g", 1.0),
        ("M/S2", 1 / G),
        ("m/s/s", 1 / G),
        ("CM/SEC**2", 0.01 / G),
        ("cm/s^2", 0.01 / G),
        ("CM/SEC/SEC", 0.01 / G),
        ("Gal", 0.01 / G),
    ],
)
def test_at2_units(tmp_path: Path, unit: str, in_g: float) -> None:
    text = f"{TITLE}ACCELERATION TIME HISTORY IN UNITS OF {unit}\nNPTS= 2, DT= 0.01 SEC\n0.5 -0.25\n"
    motion = Motion.from_at2(at2(tmp_path, text))
    np.testing.assert_allclose(motion.acceleration_g, [0.5 * in_g, -0.25 * in_g], rtol=1e-15)


def test_at2_title_may_be_latin_1_and_lines_end_in_cr(tmp_path: Path) -> None:
    path = tmp_path / "record.at2"
    text = f"PEER\nViña del Mar\n{UNITS_OF_G}NPTS= 2, DT= 0.01 SEC\n0.1 0.2\n".replace("\n", "\r\n")
    path.write_bytes(text.encode("latin-1"))
    assert Motion.from_file(path).acceleration_g.tolist() == [0.1, 0.2]


samples = st.lists(st.floats(-19.0, 19.0, allow_subnormal=False), min_size=2, max_size=40)


@given(values=samples, dt=st.floats(1e-4, 0.5))
@settings(max_examples=60, deadline=None)
def test_at2_round_trip(tmp_path_factory: pytest.TempPathFactory, values: list[float], dt: float) -> None:
    path = tmp_path_factory.mktemp("at2") / "m.AT2"
    motion = Motion(dt=dt, acceleration_g=values)
    motion.write_at2(path)
    again = Motion.from_at2(path)
    assert again.dt == dt
    np.testing.assert_allclose(again.acceleration_g, values, rtol=5.1e-8, atol=0.0)


@given(values=samples, dt=st.floats(1e-4, 0.01))
@settings(max_examples=60, deadline=None)
def test_csv_round_trip(tmp_path_factory: pytest.TempPathFactory, values: list[float], dt: float) -> None:
    path = tmp_path_factory.mktemp("csv") / "m.csv"
    motion = Motion(dt=dt, acceleration_g=values)
    motion.write_csv(path)
    again = Motion.from_csv(path, unit="g")
    assert again.dt == pytest.approx(dt, rel=1e-11)
    np.testing.assert_array_equal(again.acceleration_g, motion.acceleration_g)
    np.testing.assert_array_equal(Motion.from_csv(path, unit="m/s", kind="upgoing").velocity, motion.velocity)


def test_csv_columns_are_selected_by_name_number_and_unit(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_text(
        "# a comment\nstation;Time (s);vel_m_s;acc_g\n1;5.00;0.1;0.5\n\n1;5.01;0.2;0.6\n1;5.02;0.3;0.7\n"
    )
    assert Motion.from_csv(path, unit="g").acceleration_g.tolist() == [0.5, 0.6, 0.7]
    assert Motion.from_csv(path, unit="m/s").velocity.tolist() == [0.1, 0.2, 0.3]
    assert Motion.from_csv(path).quantity == "acceleration_g"
    assert Motion.from_csv(path, column="VEL_M_S").velocity.tolist() == [0.1, 0.2, 0.3]
    chosen = Motion.from_file(path, column=2)
    assert chosen.velocity.tolist() == [0.1, 0.2, 0.3]
    assert chosen.dt == 0.01
    assert chosen.source == {"file": str(path), "unit": "m/s", "column": 2, "kind": "outcrop"}


@pytest.mark.parametrize(("unit", "in_g"), [("g", 1.0), ("m/s2", 1 / G), ("cm/s2", 0.01 / G)])
def test_csv_with_unknown_column_names_uses_the_second_column(tmp_path: Path, unit: str, in_g: float) -> None:
    path = tmp_path / "m.csv"
    path.write_text("instant,x,y\n0,0.5,3\n0.02,-1,3\n")
    np.testing.assert_allclose(
        Motion.from_csv(path, unit=unit).acceleration_g, [0.5 * in_g, -in_g], rtol=1e-15
    )


def test_csv_time_may_be_rounded(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_text("t,acc\n" + "".join(f"{k / 128:.3f},0.1\n" for k in range(1281)))
    assert Motion.from_csv(path, unit="g").dt == pytest.approx(1 / 128, rel=1e-12)


# Errors: each gives file, place, value and remedy


def bad_at2(body: str) -> Callable[[Path], Motion]:
    return lambda folder: Motion.from_at2(at2(folder, body))


def bad_csv(body: str, **options: Any) -> Callable[[Path], Motion]:
    return lambda folder: Motion.from_csv(at2(folder, body, "m.csv"), **options)


HEAD = f"{TITLE}{UNITS_OF_G}"
NPTS4 = f"{HEAD}NPTS= 4, DT= 0.01 SEC\n"

BAD_FILES: dict[str, tuple[Callable[[Path], Motion], list[str]]] = {
    "fewer than NPTS": (
        bad_at2(f"{NPTS4}0.1 0.2\n0.3\n"),
        ["record.AT2, NPTS = 4", "in the file, 3", "incomplete"],
    ),
    "more than NPTS": (
        bad_at2(f"{NPTS4}0.1 0.2\n0.3 0.4 0.5\n"),
        ["record.AT2, NPTS = 4", "in the file, 5", "more values than"],
    ),
    "nan": (bad_at2(f"{NPTS4}0.1 0.2\n0.3 NaN\n"), ["record.AT2, line 6 = nan", "finite", "1 of 4"]),
    "inf": (bad_at2(f"{NPTS4}0.1 -inf\n0.3 0.4\n"), ["record.AT2, line 5 = -inf", "finite"]),
    "overflow": (bad_at2(f"{NPTS4}0.1 1e999\n0.3 0.4\n"), ["record.AT2, line 5 = inf", "finite"]),
    "stars": (bad_at2(f"{NPTS4}0.1 0.2\n**** 0.4\n"), ["record.AT2, line 6 = '****'", "must be a number"]),
    "text between numbers": (
        bad_at2(f"{NPTS4}0.1 0.2\nEND OF RECORD\n"),
        ["line 6 = 'END'", "must be a number"],
    ),
    "underscore": (bad_at2(f"{NPTS4}0.1 1_0\n0.3 0.4\n"), ["line 5 = '1_0'"]),
    "zero points": (bad_at2(f"{HEAD}NPTS= 0, DT= 0.01 SEC\n"), ["line 4, NPTS = 0", "between 2 and"]),
    "points not whole": (
        bad_at2(f"{HEAD}NPTS= many, DT= 0.01 SEC\n"),
        ["line 4, NPTS = 'many'", "whole number"],
    ),
    "too many points": (
        bad_at2(f"{HEAD}NPTS= 99999999999, DT= 0.01\n"),
        ["NPTS = 99999999999", "2000000"],
    ),
    "dt zero": (
        bad_at2(f"{HEAD}NPTS= 2, DT= 0.0 SEC\n0.1 0.2\n"),
        ["line 4, DT = '0.0'", "above 0", "0.005"],
    ),
    "dt negative": (bad_at2(f"{HEAD}NPTS= 2, DT= -0.01 SEC\n0.1 0.2\n"), ["line 4, DT = '-0.01'", "above 0"]),
    "dt nan": (bad_at2(f"{HEAD}NPTS= 2, DT= NaN SEC\n0.1 0.2\n"), ["line 4, DT = 'NaN'", "finite"]),
    "dt in ms": (bad_at2(f"{HEAD}NPTS= 2, DT= 5.0\n0.1 0.2\n"), ["line 4, DT = '5.0'", "milliseconds"]),
    "wrong unit": (bad_at2(f"{NPTS4}0.1 0.2\n-98.1 0.4\n"), ["line 6 = -98.1", "20 g", "cm/s2"]),
    "unit missing": (
        bad_at2(f"{TITLE}NPTS= 2, DT= 0.01\n0.1 0.2\n"),
        ["record.AT2, unit = None", "UNITS OF G"],
    ),
    "velocity file": (
        bad_at2(f"{TITLE}VELOCITY TIME SERIES IN UNITS OF CM/S\nNPTS= 2, DT= 0.01\n0.1 0.2\n"),
        ["line 3, unit = 'CM/S'", "CSV"],
    ),
    "no header": (bad_at2("0.1 0.2\n0.3 0.4\n"), ["record.AT2 = ''", "NPTS=   7990, DT="]),
    "empty": (bad_at2(""), ["record.AT2 = ''", "NPTS"]),
    "no file": (
        lambda folder: Motion.from_at2(folder / "none.AT2"),
        ["none.AT2", "No such file", "check the path"],
    ),
    "folder": (lambda folder: Motion.from_csv(folder, unit="g"), ["Is a directory"]),
    "binary": (bad_at2("\0\1\2"), ["motion file", "binary", "CSV"]),
    "AT2 with unit": (lambda folder: Motion.from_file(folder / "x.AT2", unit="g"), ["unit = 'g'", "CSV"]),
    "csv no header": (bad_csv("0,0.1\n0.01,0.2\n", unit="g"), ["m.csv, line 1 = '0,0.1'", "header row"]),
    "csv one column": (bad_csv("acc_g\n0.1\n0.2\n"), ["m.csv, line 1 = 'acc_g'", "time column"]),
    "csv empty": (bad_csv("", unit="g"), ["m.csv, line 1 = ''", "header row"]),
    "csv zero points": (bad_csv("t,a\n", unit="g"), ["m.csv, number of points = 0", "at least 2"]),
    "csv unit missing": (bad_csv("t,a\n0,0.1\n0.01,0.1\n"), ["m.csv, unit = None", 'unit="g"', '"a_g"']),
    "csv unit unknown": (bad_csv("t,a\n", unit="cm/s3"), ["unit = 'cm/s3'", 'did you mean "cm/s2"?']),
    "csv unit contradicts": (bad_csv("t,acc_g\n0,0\n", unit="m/s2"), ["m.csv, unit = 'm/s2'", "acc_g"]),
    "csv velocity in cm": (bad_csv("t,vel_cm_s\n0,0\n", unit="m/s"), ["m.csv, unit = 'cm_s'", "convert"]),
    "csv column unknown": (
        bad_csv("t,acc_ns,acc_ew\n0,0,0\n", unit="g", column="acc_nw"),
        ["m.csv, column = 'acc_nw'", "did you mean"],
    ),
    "csv column out of range": (bad_csv("t,acc\n0,0\n", unit="g", column=2), ["m.csv, column = 2"]),
    "csv column is time": (
        bad_csv("t,acc\n0,0\n", unit="g", column=0),
        ["m.csv, column = 0", "other than time"],
    ),
    "csv gap in time": (
        bad_csv("t,a\n0.00,0\n0.01,0\n0.02,0\n0.04,0\n0.05,0\n", unit="g"),
        ["m.csv, line 5, time = 0.04", "one time step of 0.01 s after 0.02 s", "gap"],
    ),
    "csv time repeats": (
        bad_csv("t,a\n0,0\n.01,0\n.01,0\n.02,0\n.03,0\n", unit="g"),
        ["line 4, time = 0.01"],
    ),
    "csv time decreases": (
        bad_csv("t,a\n0,0\n.01,0\n.02,0\n.01,0\n.02,0\n", unit="g"),
        ["line 5, time = 0.01"],
    ),
    "csv step changes a little": (
        bad_csv(
            "t,a\n" + "".join(f"{0.01 * k + 0.001 * max(0, k - 50):.4f},0\n" for k in range(100)), unit="g"
        ),
        ["m.csv, line", "change of time step"],
    ),
    "csv time constant": (bad_csv("t,a\n1,0\n1,0\n1,0\n", unit="g"), ["m.csv, time step = 0.0", "above 0"]),
    "csv time nan": (bad_csv("t,a\n0,0\nnan,0\n0.02,0\n", unit="g"), ["m.csv, line 3, time = nan", "finite"]),
    "csv time in ms": (bad_csv("t,a\n0,0\n5,0\n10,0\n", unit="g"), ["time step = 5.0", "milliseconds"]),
    "csv gap in values": (bad_csv("t,a\n0,0\n0.01,\n", unit="g"), ["m.csv, line 3, column a = ''", "gap"]),
    "csv nan": (bad_csv("t,a\n0,0\n0.01,nan\n", unit="g"), ["m.csv, line 3", "nan", "finite"]),
    "csv ragged": (bad_csv("t,a\n0,0\n0.01,0,1\n", unit="g"), ["m.csv, line 3 = '0.01,0,1'", "2 columns"]),
    "csv wrong unit": (bad_csv("t,a\n0,0\n0.01,400\n", unit="g"), ["m.csv, line 3", "400.0", "20 g", "m/s2"]),
    "csv velocity in cm as m": (
        bad_csv("t,v\n0,0\n0.01,34\n", unit="m/s"),
        ["m.csv, line 3", "34.0", "cm/s"],
    ),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_file_is_refused_with_place_value_and_remedy(case: str, tmp_path: Path) -> None:
    make, parts = BAD_FILES[case]
    with pytest.raises(InvalidInput) as refused:
        make(tmp_path)
    message = str(refused.value)
    for part in parts:
        assert part in message


def test_the_size_of_files_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = at2(tmp_path, "t,a\n0,0\n0.01,0\n0.02,0\n", "m.csv")
    monkeypatch.setattr("sandboil.motion._files.MAX_SAMPLES", 2)
    with pytest.raises(InvalidInput, match=r"m\.csv, line 4 = 3: must have at most 2 points"):
        Motion.from_csv(path, unit="g")
    monkeypatch.setattr("sandboil.files.input_file.MAX_FILE_BYTES", 10)
    with pytest.raises(InvalidInput, match="must not exceed 10 bytes"):
        Motion.from_csv(path, unit="g")


def test_unwritable_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="cannot be written"):
        sine().write_csv(tmp_path / "absent" / "m.csv")


QUIET = [0.0, 0.0, 0.0]
BAD_ARGUMENTS: dict[str, tuple[Callable[[], object], list[str]]] = {
    "dt zero": (lambda: Motion(dt=0.0, acceleration_g=QUIET), ["motion.dt = 0.0", "above 0"]),
    "dt nan": (lambda: Motion(dt=math.nan, acceleration_g=QUIET), ["motion.dt = nan"]),
    "dt text": (lambda: Motion(dt="fast", acceleration_g=QUIET), ["motion.dt = 'fast'"]),  # type: ignore[arg-type]
    "no points": (
        lambda: Motion(dt=0.01, acceleration_g=[]),
        ["motion.acceleration_g.size = 0", "between 2"],
    ),
    "nan": (lambda: Motion(dt=0.01, acceleration_g=[0.0, math.nan]), ["motion.acceleration_g[1] = nan"]),
    "table": (lambda: Motion(dt=0.01, acceleration_g=[[0.0], [1.0]]), ["one-dimensional"]),
    "words": (lambda: Motion(dt=0.01, acceleration_g=["a", "b"]), ["array of numbers"]),
    "over 20 g": (lambda: Motion(dt=0.01, acceleration_g=[0.0, -21.0]), ["[1] = -21.0", "20 g", "unit"]),
    "over 20 m/s": (lambda: Motion(dt=0.5, velocity=[0.0, 21.0]), ["motion.velocity[1] = 21.0", "cm/s"]),
    "steep velocity": (
        lambda: Motion(dt=0.001, velocity=[0.0, 0.0, 1.0]),
        ["motion.velocity[2]", "differentiated"],
    ),
    "neither": (lambda: Motion(dt=0.01), ["motion = 'neither'"]),
    "both": (lambda: Motion(dt=0.01, acceleration_g=QUIET, velocity=QUIET), ["motion = 'both'"]),
    "kind": (
        lambda: Motion(dt=0.01, acceleration_g=QUIET, kind="outcrp"),  # type: ignore[arg-type]
        ["motion.kind = 'outcrp'", 'did you mean "outcrop"?'],
    ),
    "within": (
        lambda: Motion(dt=0.01, acceleration_g=QUIET, kind="within").upgoing_velocity(),
        ["motion.kind = 'within'", "downgoing", "outcrop motion of the same rock"],
    ),
    "scaled without value": (lambda: sine().scaled(), ["exactly one"]),
    "scaled by both": (lambda: sine().scaled(pga_g=1.0, factor=1.0), ["exactly one"]),
    "scaled to zero": (lambda: sine().scaled(pga_g=0.0), ["above 0", "flipped()"]),
    "quiet scaled": (
        lambda: Motion(dt=0.01, velocity=QUIET).scaled(pga_g=0.1),
        ["all values of the motion are 0"],
    ),
    "factor nan": (lambda: sine().scaled(factor=math.nan), ["scaled(factor) = nan"]),
    "scaled over 20 g": (lambda: sine().scaled(pga_g=25.0), ["20 g"]),
    "no corner": (lambda: sine().filtered(), ["at least one corner"]),
    "corner zero": (lambda: sine().filtered(low=0.0), ["filtered(low) = 0.0"]),
    "over Nyquist": (lambda: sine().filtered(high=500.0), ["Nyquist", "500 Hz"]),
    "corners exchanged": (lambda: sine().filtered(low=25.0, high=0.1), ["must have low below high"]),
    "damping": (lambda: sine().response_spectrum(damping=5), ["damping = 5", "0.05"]),
    "periods": (lambda: sine().response_spectrum(periods=[-1.0]), ["periods = [-1.0]", "0 or above"]),
    "spectrum nan": (lambda: response_spectrum([0.0, math.inf], 0.01), ["acceleration_g[1] = inf"]),
    "ricker frequency": (lambda: Motion.ricker(0.0, 0.1), ["ricker.frequency = 0.0"]),
    "ricker pga": (lambda: Motion.ricker(2.0, -0.1), ["ricker.pga_g = -0.1", "flipped()"]),
    "ricker dt": (lambda: Motion.ricker(10.0, 0.1, dt=0.02), ["ricker.dt = 0.02", "0.01 s"]),
    "ricker short": (lambda: Motion.ricker(1.0, 0.1, duration=1.0), ["ricker.duration = 1.0", "3 s"]),
    "ricker long": (lambda: Motion.ricker(1.0, 0.1, duration=1e9), ["ricker.duration", "samples"]),
    "synthetic pga": (lambda: Motion.synthetic(pga_g=0.0), ["synthetic.pga_g = 0.0"]),
    "synthetic seed": (lambda: Motion.synthetic(seed=-1), ["synthetic.seed = -1"]),
    "synthetic dt": (lambda: Motion.synthetic(dt=0.05), ["synthetic.dt = 0.05", "0.02 s"]),
    "synthetic pgv": (lambda: Motion.synthetic(pgv=30.0), ["synthetic.pgv = 30.0", "must lie between"]),
    "synthetic two spectra": (
        lambda: Motion.synthetic(pgv=0.3, ground_frequency=2.0),
        ["leave one of them out"],
    ),
    "synthetic d5_95": (lambda: Motion.synthetic(d5_95=11.0), ["synthetic.d5_95 = 11.0", "7.2 s"]),
}


@pytest.mark.parametrize("case", BAD_ARGUMENTS)
def test_bad_argument_is_refused(case: str) -> None:
    make, parts = BAD_ARGUMENTS[case]
    with pytest.raises(InvalidInput) as refused:
        make()
    for part in parts:
        assert part in str(refused.value)


# Integration, baseline, filter


def test_velocity_is_exact_for_an_acceleration_linear_between_samples() -> None:
    motion = Motion(dt=0.5, acceleration_g=[0.0, 1.0, 1.0, -1.0])
    np.testing.assert_allclose(motion.velocity, G * np.array([0.0, 0.25, 0.75, 0.75]), rtol=1e-15)
    np.testing.assert_allclose(motion.displacement, G * np.array([0.0, 0.0625, 0.3125, 0.6875]), rtol=1e-15)


def test_the_integral_of_a_sine_is_its_closed_form() -> None:
    omega = 4 * np.pi
    motion = sine()
    velocity = 0.3 * G * np.sin(omega * motion.time) / omega
    displacement = 0.3 * G * (1 - np.cos(omega * motion.time)) / omega**2
    # The trapezoidal rule reduces a sine by (omega dt)^2/12 = 1.3e-5, and the displacement by twice as much.
    np.testing.assert_allclose(motion.velocity, velocity, atol=1.4e-5 * velocity.max())
    np.testing.assert_allclose(motion.displacement, displacement, atol=2.8e-5 * displacement.max())


def test_given_velocity_is_kept_and_differentiated() -> None:
    t = np.arange(2001) * 0.001
    velocity = 0.2 * np.sin(4 * np.pi * t) + 0.01
    motion = Motion(dt=0.001, velocity=velocity)
    np.testing.assert_array_equal(motion.velocity, velocity)
    expected = 0.2 * 4 * np.pi * np.cos(4 * np.pi * t) / G
    np.testing.assert_allclose(motion.acceleration_g[1:-1], expected[1:-1], atol=3e-5 * expected.max())


def test_velocity_at_is_linear_between_samples_and_zero_outside() -> None:
    motion = Motion(dt=0.1, velocity=[0.1, 0.3, 0.2])
    times = np.array([[-0.01, 0.0, 0.05], [0.1, 0.175, 0.21]])
    np.testing.assert_allclose(motion.velocity_at(times), [[0.0, 0.1, 0.2], [0.3, 0.225, 0.0]], rtol=1e-14)


@pytest.mark.parametrize("quantity", ["acceleration_g", "velocity"])
def test_baseline_correction_gives_zero_final_velocity_and_displacement(quantity: str) -> None:
    drifting = sine().acceleration_g + 0.002 + 0.001 * np.linspace(0, 1, 4001) ** 2
    motion = Motion(dt=0.001, acceleration_g=drifting)
    if quantity == "velocity":
        motion = Motion(dt=0.001, velocity=motion.velocity + 0.05)
    corrected = motion.baseline_corrected()
    assert corrected.quantity == quantity
    assert abs(motion.displacement[-1]) > 0.1
    assert corrected.velocity[0] == pytest.approx(0.0, abs=1e-14)
    assert corrected.velocity[-1] == pytest.approx(0.0, abs=1e-12)
    assert corrected.displacement[-1] == pytest.approx(0.0, abs=1e-12)
    # Eight whole cycles and a slow drift: the sine remains, except its small part in the polynomial.
    rest = corrected.velocity - sine().velocity
    assert np.sqrt(np.mean(rest**2)) < 0.12 * sine().pgv


def test_baseline_of_a_polynomial_drift_is_the_drift() -> None:
    t = np.linspace(0, 1, 501)
    motion = Motion(dt=0.01, acceleration_g=0.01 - 0.02 * t + 0.03 * t**2 - 0.01 * t**3)
    np.testing.assert_allclose(motion.baseline_corrected().acceleration_g, 0.0, atol=1e-11)


def test_filter_has_no_delay_and_the_squared_gain_of_one_pass() -> None:
    for frequency, low, high, gain in ((2.0, 0.2, 20.0, 1.0), (2.0, None, 2.0, 0.5), (2.0, 2.0, None, 0.5)):
        motion = sine(frequency, dt=0.005, duration=20.0)
        middle = slice(1500, 2500)
        filtered = motion.filtered(low, high).acceleration_g[middle]
        np.testing.assert_allclose(filtered, gain * motion.acceleration_g[middle], atol=2e-3 * 0.3)
    assert np.max(np.abs(sine(20.0, 0.005, 20.0).filtered(high=2.0).acceleration_g[1500:2500])) < 1e-6
    assert np.max(np.abs(sine(0.5, 0.01, 40.0).filtered(low=5.0).acceleration_g[1500:2500])) < 1e-6


def test_filter_assumes_rest_before_and_after_the_record() -> None:
    pulse = np.concatenate([np.full(20, 0.1), np.zeros(180)])
    inside = np.concatenate([np.zeros(5000), pulse, np.zeros(5000)])
    near = Motion(dt=0.01, acceleration_g=pulse).filtered(0.2, 10.0).acceleration_g
    far = Motion(dt=0.01, acceleration_g=inside).filtered(0.2, 10.0).acceleration_g[5000:5200]
    np.testing.assert_allclose(near, far, atol=1e-8)


# Kinds, transformations, measures


def test_upgoing_wave_is_half_an_outcrop_motion() -> None:
    t: dict[str, Any] = {"acceleration_g": sine().acceleration_g, "dt": 0.001}
    dt, half = Motion(**t).upgoing_velocity()
    assert dt == 0.001
    np.testing.assert_array_equal(half, 0.5 * sine().velocity)
    np.testing.assert_array_equal(Motion(**t, kind="upgoing").upgoing_velocity()[1], sine().velocity)


def test_transformations_scale_keep_kind_and_clear_the_source() -> None:
    motion = Motion.ricker(2.0, 0.1, kind="upgoing")
    assert motion.source == {"ricker": {"frequency": 2.0, "pga_g": 0.1}, "kind": "upgoing"}
    for changed, factor in (
        (motion.scaled(factor=3), 3),
        (motion.scaled(pga_g=0.05), 0.5),
        (motion.flipped(), -1),
    ):
        assert changed.source is None
        assert changed.kind == "upgoing"
        np.testing.assert_allclose(changed.velocity, factor * motion.velocity, rtol=1e-12, atol=1e-15)
    assert motion.scaled(pga_g=0.8).pga_g == pytest.approx(0.8, rel=1e-15)


def test_motion_is_immutable_comparable_and_picklable() -> None:
    motion, numbers = sine(), np.array([0.0, 0.1])
    kept = Motion(dt=0.01, acceleration_g=numbers)
    numbers[1] = 0.5
    assert kept.pga_g == 0.1
    with pytest.raises(AttributeError, match="immutable"):
        motion.dt = 1.0
    for series in (motion.acceleration_g, motion.velocity, motion.displacement, motion.time):
        with pytest.raises(ValueError, match="read-only"):
            series[0] = 1.0
    assert motion == sine() == pickle.loads(pickle.dumps(motion))
    assert hash(motion) == hash(sine())
    assert motion != motion.flipped()
    assert motion != Motion(dt=0.001, acceleration_g=motion.acceleration_g, kind="within")


def test_measures_of_a_sine() -> None:
    motion = sine()
    assert motion.pga_g == 0.3
    assert motion.pgv == pytest.approx(0.3 * G / (4 * np.pi), rel=2e-5)
    assert motion.arias == pytest.approx(np.pi / (2 * G) * (0.3 * G) ** 2 * 4.0 / 2, rel=1e-6)
    assert motion.cav == pytest.approx(0.3 * G * 4.0 * 2 / np.pi, rel=2e-5)
    assert Motion(dt=0.001, acceleration_g=np.full(4001, 0.1)).d5_95 == pytest.approx(3.6, rel=1e-12)
    assert Motion(dt=0.01, velocity=QUIET).d5_95 == 0.0


# Response spectrum


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.3])
def test_spectrum_of_a_harmonic_base_is_the_closed_form(damping: float) -> None:
    """Transient and steady response of an oscillator, initially at rest, to a cos(w t) from t = 0."""
    dt, w, amplitude = 0.001, 2 * np.pi * 1.5, 0.2
    t = np.arange(8001) * dt
    periods = np.array([0.2, 0.5, 0.61, 1.0, 3.0])
    exact = []
    for omega in 2 * np.pi / periods:
        steady = -amplitude / complex(omega**2 - w**2, 2 * damping * omega * w)
        damped = omega * math.sqrt(1 - damping**2)
        cosine = -steady.real
        sine_part = (damping * omega * cosine + w * steady.imag) / damped
        free = np.exp(-damping * omega * t) * (cosine * np.cos(damped * t) + sine_part * np.sin(damped * t))
        u = (steady * np.exp(1j * w * t)).real + free
        exact.append(omega**2 * np.max(np.abs(u)))
    got = response_spectrum(amplitude * np.cos(w * t), dt, periods, damping)
    assert got.damping == damping
    # Linear interpolation of the cosine: error (w dt)^2/12 = 7e-6, which accumulates undamped over 12 cycles.
    np.testing.assert_allclose(got.psa_g, exact, rtol=5e-5)


def test_spectrum_is_exact_for_coarse_linear_segments() -> None:
    """A ramp over one step, then a constant: exact response of the oscillator, evaluated on a fine grid."""
    period, ramp, level = 1.0, 0.25, 0.1
    omega = 2 * np.pi / period
    t = np.linspace(0, 5, 500_001)
    rising = level / ramp * (t - np.sin(omega * t) / omega)
    late = np.clip(t - ramp, 0, None)
    after = level / ramp * (late - np.sin(omega * late) / omega)
    exact = np.max(np.abs(rising - after))
    got = response_spectrum([0.0] + [level] * 20, ramp, [period], 0.0).psa_g[0]
    # Twenty values per period underestimate the oscillation about the level by at most 1 - cos(pi/20).
    assert exact * (1 - 0.0062) <= got <= exact * (1 + 1e-12)


def test_spectrum_includes_the_free_vibration_after_the_record() -> None:
    """Impulse of velocity V: a slow undamped oscillator reaches omega V after a quarter of its period."""
    pulse = np.concatenate([[0.0], np.full(9, 0.1), [0.0]])
    period = 10.0
    expected = 2 * np.pi / period * pulse.sum() * 0.001
    assert response_spectrum(pulse, 0.001, [period], 0.0).psa_g[0] == pytest.approx(expected, rel=1e-5)
    # With damping, the peak is reduced by exp(-damping/damped (pi/2 - asin(damping))) and slightly earlier.
    lower = math.exp(-0.2 / math.sqrt(0.96) * math.acos(0.2))
    damped = response_spectrum(pulse, 0.001, [period], 0.2).psa_g[0]
    assert damped == pytest.approx(lower * expected, rel=2e-3)


def test_spectrum_tends_to_the_peak_acceleration_at_short_periods() -> None:
    motion = Motion.synthetic()
    spectrum = motion.response_spectrum(periods=[0.0, 1e-6, 1e-4, 0.002, 0.005])
    assert spectrum.psa_g[0] == motion.pga_g
    np.testing.assert_allclose(spectrum.psa_g[1:4], motion.pga_g, rtol=0.01)
    # At long periods it tends to the displacement: the ground moves and the mass does not.
    long = motion.response_spectrum(periods=[200.0]).psa_g[0] * G / (2 * np.pi / 200) ** 2
    assert long == pytest.approx(np.max(np.abs(motion.displacement)), rel=0.05)


def test_spectrum_of_200_periods_and_8000_samples_takes_less_than_a_second() -> None:
    acceleration = Motion.synthetic(duration=40.0).acceleration_g
    assert acceleration.size == 8001
    begin = time.process_time()
    spectrum = response_spectrum(acceleration, 0.005)
    assert time.process_time() - begin < 1.0
    assert spectrum.periods.size == spectrum.psa_g.size == 200


# Generators


@pytest.mark.parametrize("frequency", [0.5, 2.0, 5.0, 50.0])
def test_ricker_has_its_peak_frequency_and_comes_to_rest(frequency: float) -> None:
    motion = Motion.ricker(frequency=frequency, pga_g=0.1)
    assert motion.pga_g == 0.1
    assert motion.acceleration_g[motion.acceleration_g.size // 2] == 0.1
    assert abs(motion.velocity[-1]) < 1e-7 * motion.pgv
    assert abs(motion.displacement[-1]) < 1e-6 * np.max(np.abs(motion.displacement))
    padded = np.fft.rfft(motion.acceleration_g, 2**16)
    peak = np.fft.rfftfreq(2**16, motion.dt)[np.argmax(np.abs(padded))]
    assert peak == pytest.approx(frequency, rel=0.02)
    # Largest velocity pga/(sqrt(2 e) pi f).
    assert motion.pgv == pytest.approx(0.1 * G / (math.sqrt(2 * math.e) * math.pi * frequency), rel=2e-3)


def test_ricker_of_a_given_duration() -> None:
    motion = Motion.ricker(2.0, 0.1, dt=0.01, duration=5.0)
    assert (motion.dt, motion.duration) == (0.01, 5.0)
    assert motion.time[np.argmax(motion.acceleration_g)] == pytest.approx(0.75)


def test_synthetic_is_like_the_record() -> None:
    """PGA 0.473 g, PGV 0.339 m/s and D5-95 3.68 s are the values of RSN765, component 090."""
    motion = Motion.synthetic(pga_g=0.47, duration=12.0, seed=1)
    assert motion.pga_g == pytest.approx(0.47, rel=1e-12)
    assert motion.pgv == pytest.approx(0.3387 * 0.47 / 0.4731, rel=1e-3)
    assert motion.d5_95 == pytest.approx(3.68, rel=0.03)
    assert motion.duration == pytest.approx(12.0, rel=1e-12)
    assert abs(motion.velocity[-1]) < 1e-10
    assert abs(motion.displacement[-1]) < 1e-10


def test_synthetic_has_the_frequency_band_of_an_earthquake() -> None:
    motion = Motion.synthetic()
    power = np.abs(np.fft.rfft(motion.acceleration_g)) ** 2
    frequency = np.fft.rfftfreq(motion.acceleration_g.size, motion.dt)
    assert power[frequency > 50.0].sum() < 1e-4 * power.sum()
    assert power[frequency < 0.25].sum() < 1e-3 * power.sum()
    assert power[(frequency > 0.5) & (frequency < 12.0)].sum() / power.sum() > 0.8


def test_synthetic_depends_only_on_its_seed() -> None:
    motion = Motion.synthetic(seed=3)
    assert motion == Motion.synthetic(seed=3)
    made = (
        Motion.synthetic(**motion.source["synthetic"], kind=motion.source["kind"]) if motion.source else None
    )
    assert made == motion
    assert motion.source == {
        "synthetic": {"pga_g": 0.47, "duration": 12.0, "seed": 3, "dt": 0.005},
        "kind": "outcrop",
    }
    assert np.max(np.abs(motion.acceleration_g - Motion.synthetic(seed=4).acceleration_g)) > 0.1


@given(
    seed=st.integers(0, 2**32),
    pga_g=st.floats(0.001, 3.0),
    ratio=st.floats(0.05, 0.12),
    duration=st.floats(8.0, 40.0),
)
@settings(max_examples=20, deadline=None)
def test_synthetic_meets_its_targets(seed: int, pga_g: float, ratio: float, duration: float) -> None:
    """A PGV is met exactly, or refused with the range that is possible for this seed."""
    try:
        motion = Motion.synthetic(pga_g, duration, seed, pgv=ratio * pga_g * G)
    except InvalidInput as refused:
        least, most = (float(word) for word in refused.allowed.split() if word.replace(".", "").isdigit())
        assert not least < ratio * pga_g * G < most
        return
    assert motion.pga_g == pytest.approx(pga_g, rel=1e-12)
    assert motion.pgv == pytest.approx(ratio * pga_g * G, rel=1e-3)
    assert motion.d5_95 == pytest.approx(3.68 / 12.0 * duration, rel=0.4)


def test_synthetic_uses_the_given_ground_frequency_and_duration() -> None:
    soft, stiff = (Motion.synthetic(ground_frequency=f) for f in (1.0, 8.0))
    assert soft.pgv > 2 * stiff.pgv
    short, long = (np.mean([Motion.synthetic(seed=s, d5_95=d).d5_95 for s in range(6)]) for d in (2.0, 6.0))
    assert short == pytest.approx(2.0, rel=0.2)
    assert long == pytest.approx(6.0, rel=0.2)


# The record of the paper


@needs_record
def test_record_reads_and_integrates_to_the_velocity_distributed_with_it() -> None:
    motion = Motion.from_at2(RECORD)
    other = Motion.from_csv(RECORD.parent / "loma_prieta_gilroy1.csv", unit="m/s")
    assert (motion.acceleration_g.size, motion.dt) == (7990, 0.005)
    assert motion.source == {"file": str(RECORD), "kind": "outcrop"}
    assert np.sqrt(np.mean((motion.velocity - other.velocity) ** 2)) < 1e-9
    # Values in the header of the record, to the printed digits.
    assert motion.pga_g == pytest.approx(0.4731, abs=6e-5)
    assert motion.pgv == pytest.approx(0.3387, abs=6e-5)
    assert motion.arias == pytest.approx(1.68, abs=6e-3)
    assert motion.d5_95 == pytest.approx(3.68, abs=6e-3)


@needs_record
def test_record_with_the_older_header_format() -> None:
    motion = Motion.from_at2(RECORD.parent / "pacoima_dam_1971_pul164.AT2")
    other = Motion.from_csv(RECORD.parent / "pacoima_dam_1971_pul164.csv")
    assert (motion.acceleration_g.size, motion.dt) == (4164, 0.01)
    assert motion.pga_g == pytest.approx(1.22591)
    np.testing.assert_allclose(motion.acceleration_g, other.acceleration_g, atol=1e-7)


@needs_record
def test_spectrum_of_the_record_is_the_reference_one() -> None:
    path = Path(__file__).parents[1] / "validation" / "level_ground" / "reference" / "spectrum.csv"
    reference = np.loadtxt(path, delimiter=",", skiprows=1)
    spectrum = Motion.from_at2(RECORD).response_spectrum(periods=reference[:, 0])
    np.testing.assert_allclose(spectrum.psa_g, reference[:, 2], rtol=3e-6)
