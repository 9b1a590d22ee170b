"""The command `sandboil`. Exit codes: 0 done, 2 bad input refused before any work, 3 the run stopped itself
and kept its results, 130 interrupted."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Annotated, TextIO

import typer

from .._errors import (
    InvalidInput,
    ResumeWarning,
    RunInterrupted,
    SandboilError,
    SandboilWarning,
    SuctionWarning,
)
from ..core.doubts import doubts
from ..core.motions import loaded_motions
from ..motion import Kind, Motion
from ..results.layout import FILE_NAME
from ..results.plots import Reference
from ..results.plots import plot as draw
from ..results.reader import load
from ..run import checkpoint
from ..run.accuracy import Accuracy
from ..run.plan import plan as plan_of
from ..run.run import run as run_scene
from ..scene.scene import Scene
from ..site import CurveChoice, Place, deconvolution
from . import lab
from .outputs import motion_to_write

EXIT_INVALID = 2
EXIT_STOPPED = 3
EXIT_INTERRUPTED = 130

app = typer.Typer(
    help="What an earthquake does to saturated ground.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
motion_app = typer.Typer(help="Look at ground motions and convert them.", no_args_is_help=True)
app.add_typer(motion_app, name="motion")
app.add_typer(lab.app, name="lab")

SceneFile = Annotated[Path, typer.Argument(help="Scene as a TOML file.", metavar="SCENE")]
MotionOption = Annotated[
    Path | None, typer.Option("--motion", help="Shake by this record (.AT2 or CSV) instead of the scene's.")
]
UnitOption = Annotated[
    str | None, typer.Option(help="Unit of a CSV's values: g, m/s2, cm/s2 or m/s, unless its header says it.")
]
RunKindOption = Annotated[
    Kind | None, typer.Option("--kind", help="Where the --motion is one of; default outcrop.")
]
ColumnOption = Annotated[str | None, typer.Option(help="Column of a CSV, by its name.")]
ThreadsOption = Annotated[int, typer.Option(help="Threads; the results do not depend on their number.")]
AccuracyOption = Annotated[Accuracy, typer.Option(help="Fills the numerics that the scene leaves open.")]
MotionFile = Annotated[Path, typer.Argument(help="Record: PEER .AT2, or CSV with a header.", metavar="FILE")]
MotionOut = Annotated[Path, typer.Option(help="File to write, .AT2 or .csv.", callback=motion_to_write)]
KindOption = Annotated[Kind, typer.Option(help="Where the motion is one of.")]


def _scene(path: Path, motion: Path | None, unit: str | None, column: str | None, kind: Kind | None) -> Scene:
    scene = Scene.from_toml(path)
    if motion is not None:
        return scene.with_motion(Motion.from_file(motion, unit=unit, column=column, kind=kind or "outcrop"))
    for name, value in (("--unit", unit), ("--column", column), ("--kind", kind)):
        if value is not None:
            raise InvalidInput(name, value, "belongs to a --motion", "name the record, or leave it out")
    return scene


@app.command()
def plan(
    scene: SceneFile,
    motion: MotionOption = None,
    unit: UnitOption = None,
    column: ColumnOption = None,
    kind: RunKindOption = None,
    accuracy: AccuracyOption = "standard",
    threads: ThreadsOption = 2,
) -> None:
    """Tell what a run would compute and cost, from a trial of some seconds. Writes nothing."""
    typer.echo(str(plan_of(_scene(scene, motion, unit, column, kind), threads, accuracy)))


@app.command()
def run(
    scene: SceneFile,
    out: Annotated[Path, typer.Option(help="Folder for the results; must not hold a run but to resume.")],
    motion: MotionOption = None,
    unit: UnitOption = None,
    column: ColumnOption = None,
    kind: RunKindOption = None,
    accuracy: AccuracyOption = "standard",
    threads: ThreadsOption = 2,
    columns: Annotated[
        Path | None, typer.Option(help="Folder of a run whose free-field columns are read again.")
    ] = None,
    keep_columns: Annotated[
        bool, typer.Option("--keep-columns", help="Keep the free-field columns for other runs.")
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the run in the folder from its last checkpoint.")
    ] = False,
    checkpoint_seconds: Annotated[
        float, typer.Option(help="Wall time between checkpoints, s.")
    ] = checkpoint.SECONDS,
    checkpoint_time: Annotated[
        float | None, typer.Option(help="Also so often in the time of shaking, s.")
    ] = None,
) -> None:
    """Compute a scene. Ctrl-C ends it with readable results, to be gone on with by --resume."""
    said = _scene(scene, motion, unit, column, kind)
    for doubt in doubts(said, loaded_motions(said)):
        _tell(doubt)
    try:
        with warnings.catch_warnings():
            # They are told above, before the run's long time.
            warnings.simplefilter("ignore", SandboilWarning)
            for told_later in (ResumeWarning, SuctionWarning):
                warnings.simplefilter("always", told_later)
            warnings.showwarning = _tell
            results = run_scene(
                said,
                out,
                threads=threads,
                accuracy=accuracy,
                columns=columns,
                keep_columns=keep_columns,
                resume=resume,
                checkpoint_seconds=checkpoint_seconds,
                checkpoint_time=checkpoint_time,
            )
    except InvalidInput:
        raise
    except SandboilError as error:
        error.add_note(f"results until then: {out / FILE_NAME}")
        raise
    typer.echo(str(results.summary()))


def _tell(
    message: Warning | str,
    category: type[Warning] = UserWarning,
    filename: str = "",
    lineno: int = 0,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning on stderr: its text and nothing of where in the code it came from."""
    typer.echo(f"warning: {message}", err=True)


@app.command()
def plot(
    folder: Annotated[Path, typer.Argument(help="Folder of a run.", metavar="DIR")],
    reference: Annotated[
        Path | None, typer.Option(help="Folder with another code's results in CSV, to lay over.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the pictures, default plots in DIR.")] = None,
    stage: Annotated[str | None, typer.Option(help="A shaking stage, default the last.")] = None,
) -> None:
    """Draw a run as PNG: seepage, the surface's motion, pore pressure, the column and stress paths."""
    laid_over = None if reference is None else Reference.read(reference)
    for path in draw(load(folder), out, reference=laid_over, stage=stage):
        typer.echo(str(path))


@motion_app.command()
def info(
    file: MotionFile, unit: UnitOption = None, column: ColumnOption = None, kind: KindOption = "outcrop"
) -> None:
    """Print the measures of a motion."""
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


@motion_app.command()
def spectrum(
    file: MotionFile,
    unit: UnitOption = None,
    column: ColumnOption = None,
    kind: KindOption = "outcrop",
    damping: Annotated[float, typer.Option(help="Fraction of critical.")] = 0.05,
) -> None:
    """Print the pseudo-acceleration response spectrum as CSV."""
    response = Motion.from_file(file, unit=unit, column=column, kind=kind).response_spectrum(damping)
    typer.echo("period_s,psa_g")
    for period, psa in zip(response.periods, response.psa_g, strict=True):
        typer.echo(f"{period:.6g},{psa:.6g}")


@motion_app.command()
def convert(
    file: MotionFile,
    out: MotionOut,
    unit: UnitOption = None,
    column: ColumnOption = None,
    pga: Annotated[float | None, typer.Option(help="Scale to this peak acceleration, g.")] = None,
    low: Annotated[float | None, typer.Option(help="Take frequencies below this away, Hz.")] = None,
    high: Annotated[float | None, typer.Option(help="Take frequencies above this away, Hz.")] = None,
) -> None:
    """Write a motion in another form, filtered and scaled if asked."""
    motion = Motion.from_file(file, unit=unit, column=column)
    if low is not None or high is not None:
        motion = motion.filtered(low=low, high=high)
    if pga is not None:
        motion = motion.scaled(pga_g=pga)
    _write(motion, out)


@motion_app.command()
def deconvolve(
    file: MotionFile,
    scene: Annotated[Path, typer.Option(help="Scene whose ground the record stood on.")],
    out: MotionOut,
    unit: UnitOption = None,
    column: ColumnOption = None,
    kind: KindOption = "outcrop",
    x: Annotated[float | None, typer.Option(help="Where it stood, m; default the middle.")] = None,
    at: Annotated[Place, typer.Option(help="At which end of the ground it stood.")] = "surface",
    curves: Annotated[CurveChoice, typer.Option(help="Stiffness and damping over strain.")] = "darendeli",
    linear: Annotated[bool, typer.Option("--linear", help="Keep the stiffness of small strain.")] = False,
    max_frequency: Annotated[float | None, typer.Option(help="Take faster waves away, Hz.")] = None,
) -> None:
    """Find the outcrop motion at the base of a scene from a record at its surface; print strains."""
    motion = Motion.from_file(file, unit=unit, column=column, kind=kind)
    ground = Scene.from_toml(scene).profile(x, curves=curves)
    found = deconvolution(motion, ground, at=at, linear=linear, max_frequency=max_frequency)
    _write(found.motion, out)
    typer.echo(str(found))


def _write(motion: Motion, out: Path) -> None:
    """Write a motion in the form that the file's ending tells."""
    write = motion.write_at2 if out.suffix.lower() == ".at2" else motion.write_csv
    write(out)


def main() -> None:
    """Run the command line and exit with its code."""
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
    except SandboilError as error:
        typer.echo(f"sandboil: {error}", err=True)
        for note in getattr(error, "__notes__", ()):
            typer.echo(note, err=True)
        if isinstance(error, InvalidInput):
            sys.exit(EXIT_INVALID)
        sys.exit(EXIT_INTERRUPTED if isinstance(error, RunInterrupted) else EXIT_STOPPED)
