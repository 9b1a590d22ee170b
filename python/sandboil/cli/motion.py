"""The commands `sandboil motion ...`: ground motions, shown and converted."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..motion import Kind, Motion
from ..scene.scene import Scene
from ..site import CurveChoice, Place, deconvolution
from .outputs import motion_to_write

app = typer.Typer(help="Measure, convert and deconvolve ground motions.", no_args_is_help=True)

UnitOption = Annotated[
    str | None,
    typer.Option(help="Unit of a CSV's values: g, m/s2, cm/s2 or m/s; default as in its header."),
]
ColumnOption = Annotated[str | None, typer.Option(help="Column of a CSV, by its name.")]
MotionFile = Annotated[Path, typer.Argument(help="Record: PEER .AT2, or CSV with a header.", metavar="FILE")]
MotionOut = Annotated[Path, typer.Option(help="File to write, .AT2 or .csv.", callback=motion_to_write)]
KindOption = Annotated[Kind, typer.Option(help="Place for which the motion is given.")]


@app.command()
def info(
    file: MotionFile, unit: UnitOption = None, column: ColumnOption = None, kind: KindOption = "outcrop"
) -> None:
    """Print peak values, duration and other measures of a motion."""
    motion = Motion.from_file(file, unit=unit, column=column, kind=kind)
    for name, value, symbol in (
        ("kind", motion.kind, ""),
        ("points", len(motion.time), ""),
        ("time step", motion.dt, " s"),
        ("duration", motion.duration, " s"),
        ("peak acceleration", motion.pga_g, " g"),
        ("peak velocity", motion.pgv, " m/s"),
        ("peak displacement", float(abs(motion.displacement).max()), " m"),
        ("Arias intensity", motion.arias, " m/s"),
        ("CAV", motion.cav, " m/s"),
        ("significant duration 5-95 %", motion.d5_95, " s"),
    ):
        typer.echo(f"{name:<28}{value:.4g}{symbol}" if isinstance(value, float) else f"{name:<28}{value}")


@app.command()
def spectrum(
    file: MotionFile,
    unit: UnitOption = None,
    column: ColumnOption = None,
    kind: KindOption = "outcrop",
    damping: Annotated[float, typer.Option(help="Damping ratio, fraction of critical.")] = 0.05,
) -> None:
    """Print the pseudo-acceleration response spectrum as CSV."""
    response = Motion.from_file(file, unit=unit, column=column, kind=kind).response_spectrum(damping)
    typer.echo("period_s,psa_g")
    for period, psa in zip(response.periods, response.psa_g, strict=True):
        typer.echo(f"{period:.6g},{psa:.6g}")


@app.command()
def convert(
    file: MotionFile,
    out: MotionOut,
    unit: UnitOption = None,
    column: ColumnOption = None,
    pga: Annotated[float | None, typer.Option(help="Scale to this peak acceleration, g.")] = None,
    low: Annotated[float | None, typer.Option(help="Remove frequencies below this, Hz.")] = None,
    high: Annotated[float | None, typer.Option(help="Remove frequencies above this, Hz.")] = None,
) -> None:
    """Write a motion in another form, filtered and scaled if asked."""
    motion = Motion.from_file(file, unit=unit, column=column)
    if low is not None or high is not None:
        motion = motion.filtered(low=low, high=high)
    if pga is not None:
        motion = motion.scaled(pga_g=pga)
    _write(motion, out)


@app.command()
def deconvolve(
    file: MotionFile,
    scene: Annotated[Path, typer.Option(help="Scene of the ground at the recording station.")],
    out: MotionOut,
    unit: UnitOption = None,
    column: ColumnOption = None,
    kind: KindOption = "outcrop",
    x: Annotated[
        float | None, typer.Option(help="Place of the station, m; default the middle of the section.")
    ] = None,
    at: Annotated[Place, typer.Option(help="Depth of the station.")] = "surface",
    curves: Annotated[
        CurveChoice, typer.Option(help="Curves of stiffness and damping against strain.")
    ] = "darendeli",
    linear: Annotated[bool, typer.Option("--linear", help="Keep the small-strain stiffness.")] = False,
    max_frequency: Annotated[float | None, typer.Option(help="Remove frequencies above this, Hz.")] = None,
) -> None:
    """Find the outcrop motion at the base of a scene from a record at its surface; print strains."""
    motion = Motion.from_file(file, unit=unit, column=column, kind=kind)
    ground = Scene.from_toml(scene).profile(x, curves=curves)
    found = deconvolution(motion, ground, at=at, linear=linear, max_frequency=max_frequency)
    _write(found.motion, out)
    typer.echo(str(found))


def _write(motion: Motion, out: Path) -> None:
    """Write a motion in the form given by the ending of the file."""
    write = motion.write_at2 if out.suffix.lower() == ".at2" else motion.write_csv
    write(out)
