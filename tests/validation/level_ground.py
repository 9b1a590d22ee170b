"""The level ground site of Mhaski and Ramana (2025), section 6.2, model A, beside OpenSees.

One place for the scene and the figures that are compared. As a script it measures the rows of
docs/validation.md anew:

    python tests/validation/level_ground.py --records FOLDER [ROW ...]

where FOLDER holds RSN765_LOMAP_G01090.AT2, which may not be distributed here.
"""

from __future__ import annotations

import argparse
import csv
import os
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import sandboil as sb
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

RECORD = "RSN765_LOMAP_G01090.AT2"
DATA = Path(__file__).parent / "data" / "level_ground"
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
    """Folder of records named by the environment variable SANDBOIL_RECORDS, if it has ours."""
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
    """The site `width` wide (one particle if not given), periodic unless told, shaken for 40 s."""
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


# Rows of docs/validation.md: name and how it differs from the default, one-particle-wide column.
ROWS: dict[str, dict[str, Any]] = {
    "default": {},
    "1 m wide": {"width": 1.0},
    "dx 0.4 m": {"spacing": 0.4},
    "dx 0.1 m": {"spacing": 0.1},
    "h 1.2 dx": {"smoothing_ratio": 1.2},
    "h 1.3 dx": {"smoothing_ratio": 1.3},
    "filter 0.05": {"velocity_filter": 0.05},
    "filter 0.1": {"velocity_filter": 0.1},
    "filter 0.15": {"velocity_filter": 0.15},
    "filter 0.3": {"velocity_filter": 0.3},
    "filter 0.4": {"velocity_filter": 0.4},
    "filter 0.1, local damping 0.05": {"velocity_filter": 0.1, "local_damping": 0.05},
    "local damping 0.05": {"local_damping": 0.05},
    "Rayleigh 0.5 % at 1 and 10 Hz": {"rayleigh": sb.Rayleigh(ratio=0.005, frequencies=(1.0, 10.0))},
    "explicit, with acceleration": {"diffusion": "explicit", "acceleration_term": "on"},
    "explicit, without": {"diffusion": "explicit", "acceleration_term": "off"},
    "dt factor 0.3": {"time_step_factor": 0.3},
    "dt factor 0.9": {"time_step_factor": 0.9},
    "draft": {"time_step_factor": 0.9, "integrator_tolerance": 1.0e-4},
    "tolerance 1e-4": {"integrator_tolerance": 1.0e-4},
    "tolerance 1e-6": {"integrator_tolerance": 1.0e-6},
    "Runge-Kutta": {"integrator": "rk4"},
    "reference integrator": {"integrator": "reference"},
    "printed": {"operators": "printed"},
    "printed, local damping 0.05": {"operators": "printed", "local_damping": 0.05},
}


DOCS = Path(__file__).parents[2] / "docs"
# Where the measured rows are kept, the page that shows them between its two marks, and the picture of them.
ROWS_FILE, PAGE, PICTURE = DOCS / "level_ground.csv", DOCS / "validation.md", DOCS / "figures" / "trade.png"
BEGIN, END = "<!-- rows of tests/validation/level_ground.py -->", "<!-- end of rows -->"
# Written as they are measured; per-depth figures as 4, 11 and 17 m.
HEADER = (
    "| row | wall, s | dt, 1e-4 s | PGA below 10 Hz (raw), g | r_u max 4, 11, 17 m | rms | "
    "r_u(4 m) >= 0.9 at, s | at 20 s | at 40 s | spectrum, % |",
    "|---|---|---|---|---|---|---|---|---|---|",
)

Row = dict[str, str]


def _measured(name: str, motion: sb.Motion) -> Row:
    """Run a row and compare it; every figure as text with all that is worth telling of it."""
    with tempfile.TemporaryDirectory() as folder:
        run = sb.run(scene(motion, **ROWS[name]), Path(folder) / "run", threads=2, progress=False)
        accounts = run.accounts("shaking")
        found = asdict(figures(run))
    plain = {
        "wall_s": float(accounts["wall_time_s"]),
        "steps": int(accounts["steps"]),
        "evaluations_per_update": accounts["count_evaluations"] / accounts["count_plastic_updates"],
    }
    for key, value in found.items():
        if isinstance(value, tuple):
            plain |= {f"{key}_{depth}m": one for depth, one in zip(DEPTHS, value, strict=True)}
        else:
            plain[key] = value
    return {"row": name} | {key: f"{value:.6g}" for key, value in plain.items()}


def _line(row: Row) -> str:
    def number(key: str, digits: int, factor: float = 1.0) -> str:
        return f"{factor * float(row[key]):.{digits}f}"

    def three(key: str) -> str:
        return " ".join(number(f"{key}_{depth}m", 3) for depth in DEPTHS)

    step = 1.0e4 * DURATION / float(row["steps"])
    peaks = f"{number('pga_10hz_g', 3)} ({number('pga_raw_g', 2)})"
    cells = [row["row"], number("wall_s", 0), f"{step:.2f}", peaks, three("r_u_max"), three("r_u_rms")]
    cells += [number("first_090_s", 2), three("r_u_20s"), three("r_u_40s")]
    cells += [number("spectrum_difference", 1, 100.0)]
    return f"| {' | '.join(cells)} |"


def _write_rows(rows: list[Row]) -> None:
    with ROWS_FILE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _write_page(rows: list[Row]) -> None:
    """Replace the table between the page's marks."""
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    table = "\n".join([BEGIN, *HEADER, *map(_line, rows), END])
    PAGE.write_text(before + table + after, encoding="utf-8")


def _draw(rows: list[Row]) -> None:
    """Error against cost for spacing, and error against strength for the velocity filter."""
    import matplotlib.pyplot as plt

    by_name = {row["row"]: row for row in rows}
    spacings = {0.4: "dx 0.4 m", 0.2: "default", 0.1: "dx 0.1 m"}
    filters = {0.05: "filter 0.05", 0.1: "filter 0.1", 0.15: "filter 0.15", 0.2: "default"}
    filters |= {0.3: "filter 0.3", 0.4: "filter 0.4"}

    def errors(name: str) -> tuple[float, float]:
        row = by_name[name]
        r_u = np.mean([float(row[f"r_u_rms_{depth}m"]) for depth in DEPTHS])
        return float(r_u), float(row["spectrum_difference"])

    figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
    wall = [float(by_name[name]["wall_s"]) for name in spacings.values()]
    for axis, x, names in (
        (axes[0], wall, list(spacings.values())),
        (axes[1], list(filters), list(filters.values())),
    ):
        r_u, spectrum = np.array([errors(name) for name in names]).T
        axis.plot(x, r_u, "o-", color="#0072B2", label="r_u, rms of the history, mean of 4, 11, 17 m")
        axis.plot(x, spectrum, "s-", color="#D55E00", label="surface spectrum, 5 %, 0.05 to 5 s, mean")
        axis.set_ylim(0.0, 0.17)
        axis.grid(alpha=0.3)
    for x, y, spacing in zip(wall, (errors(name)[1] for name in spacings.values()), spacings, strict=True):
        axes[0].annotate(f"{spacing:g} m", (x, y), textcoords="offset points", xytext=(4, 6))
    axes[0].margins(x=0.12)
    axes[0].set_xlabel("wall time of 40 s of shaking, s (one particle wide)")
    axes[0].set_ylabel("difference from OpenSees, 1")
    axes[0].set_title("spacing", loc="left")
    axes[1].set_xlabel("strength of the velocity filter, 1")
    axes[1].set_title("velocity filter at 0.2 m", loc="left")
    axes[1].legend(frameon=False)
    PICTURE.parent.mkdir(exist_ok=True)
    figure.savefig(PICTURE, dpi=110)
    plt.close(figure)


def main() -> None:
    """Measure rows anew and show them in docs/validation.md."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--records", type=Path, help=f"folder that holds {RECORD}; without it only redraw")
    parser.add_argument("rows", nargs="*", help="default: all")
    asked = parser.parse_args()
    kept: dict[str, Row] = {}
    if ROWS_FILE.exists():
        with ROWS_FILE.open(newline="", encoding="utf-8") as file:
            kept = {row["row"]: row for row in csv.DictReader(file)}
    if asked.records:
        motion = sb.Motion.from_at2(asked.records / RECORD)
        for name in asked.rows or ROWS:
            kept[name] = _measured(name, motion)
            print(_line(kept[name]), flush=True)
            _write_rows([kept[name] for name in ROWS if name in kept])
    rows = [kept[name] for name in ROWS]
    _write_page(rows)
    _draw(rows)


if __name__ == "__main__":
    main()
