"""Fuzz test of all readers: every damaged file must be read or refused, within limits of time and memory.

    python tests/fuzz/fuzz_readers.py --reader toml --inputs 1000000

An input is a valid file in which some bytes, numbers, words or lines are changed, duplicated, moved or
removed. It can be reproduced from its number and the seed. Readers run in a separate process, so that a crash
is counted as a fault. Inputs with faults are written to `--keep` and printed; the exit code is then 1.
"""

from __future__ import annotations

import argparse
import copy
import datetime
import json
import mmap
import os
import random
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import tomllib
import traceback
import warnings
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FrameType, SimpleNamespace
from typing import Any

import h5py
import numpy as np
import sandboil as sb
import tomli_w
from sandboil import _core
from sandboil._errors import DamagedState, InvalidInput
from sandboil.cli.inputs import strains_of
from sandboil.core.simulation import Simulation
from sandboil.files import toml
from sandboil.files.hdf5 import LAYOUT
from sandboil.results import reader as results
from sandboil.results import reference
from sandboil.run import checkpoint, columns
from sandboil.scene.soils import material

# Largest processor time for one input, s, and elapsed time after which a process without progress is killed,
# s.
LIMIT = 10.0
PATIENCE = 60.0
# Largest memory for reading, bytes, in addition to that of the process at its start.
MEMORY = 1_000_000_000
# Largest length of an error message, characters.
LONGEST_MESSAGE = 5000
# Largest number of changes of one input.
CHANGES = 4

Read = Callable[[Path], object]


@dataclass(frozen=True)
class Reader:
    """A reader and the inputs for it.

    Attributes
    ----------
    seeds : valid files
    read : the reader
    suffix : file name under which an input is read
    is_text : change text rather than bytes
    seal : function that completes a changed input, for example with a checksum
    is_toml : change half of the inputs as tables rather than as text
    """

    seeds: list[bytes]
    read: Read
    suffix: str
    is_text: bool = True
    seal: Callable[[random.Random, bytes], bytes] = lambda rng, content: content
    is_toml: bool = False


# Changes

NUMBERS = [
    "0",
    "-1",
    "1",
    "0.0",
    "-0.0",
    "1e999",
    "-1e999",
    "nan",
    "inf",
    "1e308",
    "5e-324",
    "1_0",
    "0x7f",
    "9" * 40,
]
NUMBERS += [
    "9" * 5000,
    "1e-320",
    "0.1",
    "1e6",
    "2147483648",
    "9223372036854775808",
    "true",
    '"x"',
    "[]",
    "{}",
    "1.5.2",
]
WORDS = [
    "[",
    "]",
    "{",
    "}",
    '"',
    "'",
    '"""',
    "=",
    ".",
    ",",
    "\n",
    "#",
    "\\",
    "\t",
    "[[",
    "]]",
    "a.",
    "kind",
    "\ufeff",
]
WORDS += [
    "[" * 2000,
    "{a=" * 300,
    "a." * 40,
    "a." * 40 + "a = 1\n",
    "NPTS",
    "DT=",
    "\r",
    "\x00",
    "\x85",
    "\u2028",
    "é",
]
WORDS += [
    " " * 3000,
    "1-" * 500,
    "1" * 3000,
    ";",
    "1979-05-27",
    "../../etc/passwd",
    "-",
    "E",
    "e5",
    "[stages]\n",
]


def changed_text(rng: random.Random, text: str, other: str) -> str:
    """A text after one change."""
    if not text:
        return other
    at = rng.randrange(len(text))
    match rng.randrange(7):
        case 0:
            return text[:at] + rng.choice(WORDS) + text[at:]
        case 1:
            return text[:at] + text[at + rng.randint(1, 20) :]
        case 2:
            return changed_number(rng, text)
        case 3:
            lines = text.split("\n")
            place = rng.randrange(len(lines))
            replacements = [[], [lines[place]] * 2, [lines[rng.randrange(len(lines))], lines[place]]]
            lines[place : place + 1] = rng.choice(replacements)
            return "\n".join(lines)
        case 4:
            begin = rng.randrange(len(other) or 1)
            return text[:at] + other[begin : begin + rng.randint(1, 200)] + text[at:]
        case 5:
            return text[:at] + chr(rng.choice((rng.randrange(128), rng.randrange(0xD000)))) + text[at + 1 :]
        case _:
            return text[:at]


def changed_number(rng: random.Random, text: str) -> str:
    """A text with one of its words, most of which are numbers, replaced."""
    words = text.split(" ")
    words[rng.randrange(len(words))] = rng.choice(NUMBERS)
    return " ".join(words)


def changed_bytes(rng: random.Random, content: bytes, other: bytes) -> bytes:
    """Bytes after one change."""
    if not content:
        return other
    at = rng.randrange(len(content))
    width = rng.choice((1, 2, 4, 8))
    match rng.randrange(6):
        case 0:
            return content[:at] + bytes([content[at] ^ (1 << rng.randrange(8))]) + content[at + 1 :]
        case 1:
            value = rng.choice((0, 1, -1, 1 << (8 * width - 1), rng.getrandbits(8 * width)))
            changed = (value & ((1 << (8 * width)) - 1)).to_bytes(width, "little")
            return content[:at] + changed + content[at + width :]
        case 2:
            return content[:at]
        case 3:
            return content[:at] + content[at + rng.randint(1, 64) :]
        case 4:
            begin = rng.randrange(len(content))
            piece = content[begin : begin + rng.randint(1, 64)]
            return content[:at] + piece + content[at + len(piece) :]
        case _:
            begin = rng.randrange(len(other) or 1)
            return content[:at] + other[begin : begin + rng.randint(1, 64)] + content[at:]


VALUES: list[Any] = [0, -1, 1, 2**63 - 1, -(2**63), 0.0, -0.0, 0.5, 1e-300, 1e300, float("nan"), float("inf")]
VALUES += [True, "", "x", "0.5", "x" * 5000, [], [[]], [0.0] * 500, [[0.0, 1.0]] * 300, {}, {"kind": "box"}]
VALUES += [
    [0, 1],
    [1, 0],
    [[0, 0], [1, 0], [0, 1]],
    {"a": {"b": {"c": []}}},
    1e-9,
    1e9,
    -1e-9,
    datetime.time(1),
]


def changed_tables(rng: random.Random, tables: dict[str, Any], other: dict[str, Any]) -> None:
    """Replace, remove, duplicate or misspell one value in `tables`, or insert one of those of `other`."""
    part: Any = tables
    while True:
        key = rng.choice(list(part) if isinstance(part, dict) else range(len(part)))
        value = part[key]
        if not isinstance(value, (dict, list)) or not value or rng.random() < 0.3:
            break
        part = value
    match rng.randrange(6):
        case 0:
            del part[key]
        case 1 if isinstance(part, list):
            part.insert(key, copy.deepcopy(value))
        case 1:
            part[f"{key}s"] = value
        case 2:
            part[key] = copy.deepcopy(rng.choice(list(other.values())))
        case 3 if isinstance(value, (int, float)):
            part[key] = value * rng.choice((-1, 0.5, 2, 1e3, 1e-3, 1e6, 1e-6))
        case _:
            part[key] = copy.deepcopy(rng.choice(VALUES))


def damaged_toml(rng: random.Random, content: bytes, other: bytes) -> bytes:
    """A TOML file with changes in its tables."""
    tables, others = (tomllib.loads(text.decode()) for text in (content, other))
    for _ in range(rng.randint(1, CHANGES)):
        if tables:
            changed_tables(rng, tables, others)
    return tomli_w.dumps(tables).encode()


def damaged(reader: Reader, seed: int, number: int) -> bytes:
    """Input `number` of a reader."""
    rng = random.Random(seed * 1_000_003 + number)
    content, other = rng.choice(reader.seeds), rng.choice(reader.seeds)
    if reader.is_toml and rng.random() < 0.5:
        return damaged_toml(rng, content, other)
    for _ in range(rng.randint(1, CHANGES)):
        if reader.is_text and rng.random() < 0.9:
            text = content.decode("utf-8", "replace"), other.decode("utf-8", "replace")
            content = changed_text(rng, *text).encode("utf-8", "replace")
        else:
            content = changed_bytes(rng, content, other)
    return reader.seal(rng, content)


# Readers


def _scenes() -> list[bytes]:
    sand = sb.PM4Sand(Dr=0.55, G0=677.0, hpo=0.4)
    ground = sb.Region("sand", sb.box(x=(0, 1), y=(0, 4)), sand, hydraulic_conductivity=1e-4, Gs=2.67)
    motion = sb.Motion(dt=0.1, acceleration_g=[0.0, 0.1, -0.1, 0.0])
    wet = {"water": sb.Water(), "water_table": sb.WaterTable(depth=0)}
    level = sb.Scene(
        spacing=1.0,
        regions=[ground],
        stages=[sb.Gravity(), sb.Shaking(motion)],
        output=sb.Output(depths=[1.0]),
        **wet,
    )
    slope = sb.Region(
        "clay",
        sb.polygon([(0, 0), (8, 0), (8, 2), (4, 2), (2, 4), (0, 4)]),
        sb.MohrCoulomb(c=5.0, phi=25.0, E=2e4, nu=0.3),
        hydraulic_conductivity=sb.Conductivity(1e-5, 1e-6, angle_deg=5),
        retention=sb.VanGenuchten(alpha=2.0, n=2.0),
        Gs=2.7,
        porosity=0.4,
    )
    conditions = [
        sb.Reservoir("left", level=[(0, 3), (9, 2)]),
        sb.SeepageFace([(8, 0), (8, 2)]),
        sb.Drain([(3, 1), (5, 1)]),
    ]
    seeping = sb.Scene(
        spacing=1.0,
        water=sb.Water(),
        water_table=sb.WaterTable(points=[(0, 3), (8, 2)]),
        regions=[slope],
        sides=sb.Sides(sb.FreeField(), sb.Roller()),
        stages=[
            sb.Seepage(conditions, duration=10.0),
            sb.Gravity(),
            sb.Shaking(
                sb.Motion.ricker(2.0, 0.1),
                base=sb.CompliantBase(300.0, 2.0, Vp=600.0, apparent_velocity=1000.0),
                rayleigh=sb.Rayleigh(ratio=0.01, frequencies=(1.0, 5.0)),
            ),
        ],
    )
    return [scene.to_toml(resolved=full).encode() for scene in (level, seeping) for full in (False, True)]


AT2 = b"""PEER NGA STRONG MOTION DATABASE RECORD
LOMA PRIETA 10/18/89, GILROY ARRAY 1, 090
ACCELERATION TIME SERIES IN UNITS OF G
NPTS=     10, DT=  0.0050 SEC
  0.1000000E-02 -0.2000000E-02  0.3000000E-02  0.0000000E+00  0.1000000E-02
  0.1000000E-02-0.2000000E-02-0.3000000E-02 0.0 .1D-2
"""
OLDER = b"title\n\nACCELERATION TIME HISTORY IN UNITS OF CM/S2\n   4   .0200   NPTS, DT\n 1.0 2.0 -3.0 .0\n"
CSV = b"# a record\ntime_s,acceleration_g,velocity_m/s\n0,0,0\n0.01,0.1,0.002\n0.02,-0.1,0.001\n0.03,0,0\n"
SEMICOLONS = b"t;acc (cm/s2)\n0.0;1e1\n0.005;-2.0\n0.010;3\n"
STRAINS = b"eps_xx,eps_yy,gamma_xy\n0,0,0.001\n0,-1e-4,0.002\n"
TABLE = b"time_s,acc_surface_g,ru_4m\n0,0,0\n0.01,0.1,0.5\n"
SOIL = b'kind = "pm4sand"\nDr = 0.5\nG0 = 600.0\nhpo = 0.4\ne_max = 0.8\n'


def _tiny() -> sb.Scene:
    """A scene with few nodes under water and very short shaking."""
    sand = sb.PM4Sand(Dr=0.55, G0=677.0, hpo=0.4)
    ground = sb.Region("sand", sb.box(x=(0, 1), y=(0, 3)), sand, hydraulic_conductivity=1e-4, Gs=2.67)
    pulse = sb.Motion.ricker(5.0, 0.05)
    return sb.Scene(
        spacing=1.0,
        water=sb.Water(),
        water_table=sb.WaterTable(depth=0),
        regions=[ground],
        stages=[sb.Gravity(), sb.Shaking(pulse, duration=0.02)],
        output=sb.Output(field_dt=0.01),
    )


@cache
def _run() -> sb.Run:
    with tempfile.TemporaryDirectory() as folder:
        return sb.run(_tiny(), Path(folder) / "run", threads=1, progress=False)


def _results(folder: Path) -> bytes:
    """A results file with little more than the data that its reader uses, so that changes affect them."""
    with tempfile.TemporaryDirectory() as made:
        sb.run(_tiny(), Path(made) / "run", threads=1, progress=False)
        path = folder / "few.h5"
        with (
            h5py.File(Path(made) / "run" / results.FILE_NAME) as whole,
            h5py.File(path, "w", libver=LAYOUT) as few,
        ):
            few.attrs.update(whole.attrs)
            names = [
                "scene",
                "probes",
                "frames/stage",
                "frames/time",
                "frames/time_step",
                "frames/time_step_limit",
            ]
            names += [
                "nodes/position",
                "nodes/surface_elevation",
                "stages",
                "motions",
                "envelopes/shaking/r_u",
            ]
            names += [
                "histories/shaking/time",
                "histories/shaking/acceleration_x",
                "VTKHDF/PointData/displacement",
            ]
            for name in names:
                whole.copy(name, few.require_group(str(Path(name).parent)))
            few["nodes"].attrs.update(whole["nodes"].attrs)
        return path.read_bytes()


def _read_results(path: Path) -> None:
    run = results.load(path.parent)
    run.history("acceleration_x")
    run.motion()
    run.envelope("r_u")
    run.settlement()
    run.accounts()
    run.time_steps()


COLUMNS = [columns.Column("shaking", hand, "0123456789abcdef") for hand in columns.HANDS]
# Values of a frame of three wet rows.
WIDTH = 44


def _columns(folder: Path) -> bytes:
    rng = np.random.default_rng(1)
    for column in COLUMNS:
        record = _core.ColumnRecord(
            interval=0.0025, impedance=np.ones((3, 3)), wet=True, values=rng.random((8, WIDTH))
        )
        columns.save(folder, column, record)
    return (folder / columns.FILE_NAME).read_bytes()


def _state(simulation: Simulation, folder: Path) -> bytes:
    keeper = checkpoint.Keeper(folder, simulation, None, None)
    marked = {"frames": 1, "clock": 0.0, "names": ["scene"], "rows": {"frames/time": 1}}
    keeper.store(marked, float("inf"), 1.0)
    (path,) = (folder / checkpoint.FOLDER_NAME).iterdir()
    return path.read_bytes()


def _sealed(rng: random.Random, content: bytes) -> bytes:
    """A state, in most cases with a valid checksum, so that the test reaches the code after the checksum."""
    body = content[:-4]
    return body + struct.pack("<I", zlib.crc32(body)) if rng.random() < 0.9 else content


def readers(folder: Path) -> dict[str, Callable[[], Reader]]:
    """Every reader by name; its valid files are made in a folder."""

    def state() -> Reader:
        simulation = Simulation(_tiny(), threads=1)
        simulation.run_stage()
        simulation.step(5)
        stored = _state(simulation, folder)

        def read(path: Path) -> None:
            checkpoint._note(path)
            _core.Simulation.restore(simulation._section, path, 1)

        return Reader([stored], read, "state.state", is_text=False, seal=_sealed)

    def results_file() -> Reader:
        # The scene in the file is tested by another reader, and would take most of the time.
        results.Scene = SimpleNamespace(from_toml=cache(sb.Scene.from_toml))  # type: ignore[misc, assignment]
        return Reader([_results(folder)], _read_results, results.FILE_NAME, is_text=False)

    def columns_file() -> Reader:
        return Reader(
            [_columns(folder)],
            lambda path: columns.load(path.parent, COLUMNS),
            columns.FILE_NAME,
            is_text=False,
        )

    return {
        "toml": lambda: Reader(_scenes(), sb.Scene.from_toml, "scene.toml", is_toml=True),
        "soil": lambda: Reader(
            [SOIL],
            lambda path: material(toml.parse(toml.read(path, "soil"), "soil", "")),
            "soil.toml",
            is_toml=True,
        ),
        "at2": lambda: Reader([AT2, OLDER], sb.Motion.from_file, "m.AT2"),
        "csv": lambda: Reader([CSV, SEMICOLONS], sb.Motion.from_file, "m.csv"),
        "strain-path": lambda: Reader([STRAINS], strains_of, "path.csv"),
        "reference": lambda: Reader([TABLE], reference._table, "histories.csv"),
        "results": results_file,
        "columns": columns_file,
        "state": state,
    }


# Runs


class Hang(BaseException):
    """Reading exceeded the time limit."""


def _hang(number: int, frame: FrameType | None) -> None:
    raise Hang


def outcome(reader: Reader, content: bytes, path: Path) -> str:
    """Result of reading an input: "read", "refused", or a description of the fault."""
    path.write_bytes(content)
    try:
        reader.read(path)
    except (InvalidInput, DamagedState) as error:
        length = len(str(error))
        return "refused" if length < LONGEST_MESSAGE else f"the error message has {length} characters"
    except Hang:
        return f"still reading after {LIMIT:g} s"
    except BaseException:
        return traceback.format_exc()
    return "read"


def _limit_memory() -> None:
    """Limit the memory of this process from now on, on systems that report the present memory."""
    statm = Path("/proc/self/statm")
    if statm.exists():
        limit = int(statm.read_text().split()[0]) * mmap.PAGESIZE + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


# Indices in the memory that the reading process shares with the waiting process.
NUMBER, READ, FAULTS = range(3)


def _work(reader: Reader, seed: int, inputs: range, shared: Any, keep: Path, path: Path) -> None:
    """Read inputs in order; write the number of each, and the counts of results, to the shared memory."""
    signal.signal(signal.SIGPROF, _hang)
    warnings.simplefilter("ignore")
    _limit_memory()
    for number in inputs:
        shared[NUMBER] = number
        content = damaged(reader, seed, number)
        signal.setitimer(signal.ITIMER_PROF, LIMIT)
        result = outcome(reader, content, path)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        if result == "read":
            shared[READ] += 1
        elif result != "refused":
            shared[FAULTS] += 1
            _report(keep, number, content, result)


def _report(keep: Path, number: int, content: bytes, fault: str) -> None:
    keep.mkdir(parents=True, exist_ok=True)
    (keep / f"{number}.input").write_bytes(content)
    (keep / f"{number}.txt").write_text(fault)
    print(f"input {number}: {fault.strip().splitlines()[-1]}", flush=True)


def fuzz(name: str, inputs: int, seed: int, keep: Path) -> dict[str, float]:
    """Test a reader; returns numbers of inputs, of files read and of faults, seconds and largest memory."""
    folder = Path(tempfile.mkdtemp(dir="/dev/shm" if Path("/dev/shm").exists() else None))
    start = time.monotonic()
    try:
        reader = readers(folder)[name]()
        shared = memoryview(mmap.mmap(-1, 8 * 3)).cast("q")
        first = 0
        while first < inputs:
            child = os.fork()
            if child == 0:
                _work(reader, seed, range(first, inputs), shared, keep, folder / reader.suffix)
                os._exit(0)
            code = _ended(child, shared)
            if code == 0:
                break
            number = shared[NUMBER]
            shared[FAULTS] += 1
            _report(keep, number, damaged(reader, seed, number), f"the process ended with {code}")
            first = number + 1
        memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0
    finally:
        shutil.rmtree(folder)
    return {
        "inputs": inputs,
        "read": shared[READ],
        "faults": shared[FAULTS],
        "seconds": round(time.monotonic() - start, 1),
        "memory, MB": round(memory),
    }


def _ended(child: int, shared: Any) -> int:
    """Exit code of a process, or minus the signal that ended it; a process without progress is killed."""
    before, since = shared[NUMBER], time.monotonic()
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        if shared[NUMBER] != before:
            before, since = shared[NUMBER], time.monotonic()
        elif time.monotonic() - since > PATIENCE:
            os.kill(child, signal.SIGKILL)
        time.sleep(0.01)


def main() -> None:
    """Parse the arguments, test the readers and print the results."""
    names = list(readers(Path()))
    parser = argparse.ArgumentParser(description="Test the readers with damaged files.")
    parser.add_argument(
        "--reader", choices=names, action="append", help="a reader; may be repeated; default all"
    )
    parser.add_argument("--inputs", type=int, default=10_000, help="number of inputs for each reader")
    parser.add_argument("--seed", type=int, default=1, help="seed of the random changes")
    parser.add_argument(
        "--keep", type=Path, default=Path("fuzz_findings"), help="folder for inputs with faults"
    )
    arguments = parser.parse_args()
    faults = 0.0
    for name in arguments.reader or names:
        result = fuzz(name, arguments.inputs, arguments.seed, arguments.keep / name)
        print(json.dumps({"reader": name, **result}), flush=True)
        faults += result["faults"]
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
