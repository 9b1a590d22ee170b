"""The level ground site of Mhaski and Ramana (2025), section 6.2, model A, beside OpenSees.

The scene and the figures that are compared. The record RSN765_LOMAP_G01090.AT2 may not be distributed here.
"""

from __future__ import annotations

import csv
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import sandboil as sb
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

RECORD = "RSN765_LOMAP_G01090.AT2"
DATA = Path(__file__).parent / "reference"
DEPTHS = (4, 11, 17)
DURATION = 40.0
# Corner of the low-pass under which surface peaks of different codes agree, Hz.
CORNER = 10.0
# Periods over which spectra are compared, s.
PERIODS = (0.05, 5.0)

# name, bottom and top (m), PM4Sand: Table 1 of the paper.
LAYERS = (
    ("layer 1", (12, 20), sb.PM4Sand(Dr=0.35, G0=476, hpo=0.53)),
    ("layer 2", (6, 12), sb.PM4Sand(Dr=0.55, G0=677, hpo=0.40)),
    ("layer 3", (0, 6), sb.PM4Sand(Dr=0.75, G0=890, hpo=0.63)),
)

Floats = NDArray[np.float64]


def records() -> Path | None:
    """Folder of records named by the environment variable SANDBOIL_RECORDS, if it has the record."""
    folder = Path(os.environ.get("SANDBOIL_RECORDS", ""))
    return folder if (folder / RECORD).is_file() else None


def scene(
    motion: sb.Motion | None,
    *,
    spacing: float = 0.2,
    width: float | None = None,
    rayleigh: sb.Rayleigh | None = None,
    sides: sb.Periodic | sb.FreeField | None = None,
    **numerics: Any,
) -> sb.Scene:
    """The site `width` wide, one particle by default, between periodic sides by default, shaken for 40 s."""
    return sb.Scene(
        spacing=spacing,
        water=sb.Water(unit_weight=10.0, bulk_modulus=1.0e6),
        water_table=sb.WaterTable(depth=0),
        regions=[
            sb.Region(
                name, sb.box(x=(0, width or spacing), y=y), sand, hydraulic_conductivity=1e-3, Gs=2.67, K0=0.5
            )
            for name, y, sand in LAYERS
        ],
        sides=sides or sb.Periodic(),
        stages=[sb.Gravity(), sb.Shaking(motion, duration=DURATION, rayleigh=rayleigh)],
        output=sb.Output(depths=DEPTHS, history_dt=0.005, field_dt=1.0),
        numerics=sb.Numerics(**numerics),
    )


@dataclass(frozen=True)
class Table:
    """A CSV of numbers by column name."""

    columns: dict[str, Floats]

    @classmethod
    def read(cls, path: Path) -> Table:
        with path.open(encoding="utf-8") as file:
            names = next(csv.reader(file))
            values = np.loadtxt(file, delimiter=",")
        return cls(dict(zip(names, values.T, strict=True)))

    def __getitem__(self, name: str) -> Floats:
        return self.columns[name]


@dataclass(frozen=True)
class Figures:
    """What is compared; differences are ours less the reference's. Tuples go over 4, 11 and 17 m."""

    pga_raw_g: float
    pga_10hz_g: float
    r_u_max: tuple[float, ...]
    r_u_rms: tuple[float, ...]
    r_u_20s: tuple[float, ...]
    r_u_40s: tuple[float, ...]
    first_090_s: float
    first_090_difference_s: float
    spectrum_difference: float
    settlement_m: float


def figures(run: sb.Run) -> Figures:
    """Compare a run with the reference."""
    reference, spectrum = Table.read(DATA / "histories.csv"), Table.read(DATA / "spectrum.csv")
    surface = run.history("acceleration_x", unit="g")
    rate = 1.0 / (surface.time[1] - surface.time[0])
    smooth = sosfiltfilt(butter(4, CORNER, fs=rate, output="sos"), surface.values)

    until = reference["time_s"] <= DURATION
    instants = reference["time_s"][until]
    largest, rms, at_20, at_40 = [], [], [], []
    for depth in DEPTHS:
        r_u = run.history("r_u", depth=depth)
        difference = np.interp(instants, r_u.time, r_u.values) - reference[f"ru_{depth}m"][until]
        largest.append(float(r_u.values.max()))
        rms.append(float(np.sqrt(np.mean(difference**2))))
        at_20.append(float(np.interp(20.0, instants, difference)))
        at_40.append(float(difference[-1]))

    shallow = run.history("r_u", depth=DEPTHS[0])
    first = _first(shallow.time, shallow.values)
    psa = sb.response_spectrum(surface.values, 1.0 / rate, spectrum["period_s"]).psa_g
    compared = (spectrum["period_s"] >= PERIODS[0]) & (spectrum["period_s"] <= PERIODS[1])
    return Figures(
        pga_raw_g=float(np.abs(surface.values).max()),
        pga_10hz_g=float(np.abs(smooth).max()),
        r_u_max=tuple(largest),
        r_u_rms=tuple(rms),
        r_u_20s=tuple(at_20),
        r_u_40s=tuple(at_40),
        first_090_s=first,
        first_090_difference_s=first - _first(reference["time_s"], reference["ru_4m"]),
        spectrum_difference=float(
            np.mean(np.abs(psa / spectrum["psa_surface_g_5pct"] - 1.0)[compared]),
        ),
        settlement_m=float(run.settlement().values[-1]),
    )


def _first(times: Floats, values: Floats) -> float:
    above = values >= 0.9
    return float(times[np.argmax(above)]) if above.any() else float("nan")
