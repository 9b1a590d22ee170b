"""Measures the rows of README.md, a quarter of an hour for all of them, and draws trade.png.

    python -m validation.level_ground --records FOLDER [ROW ...]

where FOLDER holds RSN765_LOMAP_G01090.AT2, which may not be distributed here. Without
it, the table is written and the picture drawn from rows.csv.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import sandboil as sb

from validation.level_ground.site import DEPTHS, DURATION, RECORD, figures, scene
from validation.page import write_tables

# Rows of the table in README.md: name, and changes to the default column, which is one particle wide.
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


FOLDER = Path(__file__).parent
ROWS_FILE = FOLDER / "rows.csv"
# Figures per depth are those of 4, 11 and 17 m.
HEADER = (
    "| row | wall, s | dt, 1e-4 s | PGA below 10 Hz (raw), g | r_u max 4, 11, 17 m | rms | "
    "r_u(4 m) >= 0.9 at, s | at 20 s | at 40 s | spectrum, % |",
    "|---|---|---|---|---|---|---|---|---|---|",
)

Row = dict[str, str]


def _measured(name: str, motion: sb.Motion) -> Row:
    """Run a row and compare it; every figure as text with six digits."""
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
    figure.savefig(FOLDER / "trade.png", dpi=110)
    plt.close(figure)


def main() -> None:
    """Measure rows and write them to README.md."""
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
    write_tables(FOLDER / "README.md", [[*HEADER, *map(_line, rows)]])
    _draw(rows)


if __name__ == "__main__":
    main()
