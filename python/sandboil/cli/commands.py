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
from ..results.plots import plot as draw
from ..results.reader import load
from ..results.reference import Reference
from ..run import checkpoint
from ..run.accuracy import Accuracy
from ..run.plan import plan as plan_of
from ..run.run import run as run_scene
from ..scene.scene import Scene
from . import lab
from . import motion as motions
from .motion import ColumnOption, UnitOption

EXIT_INVALID = 2
EXIT_STOPPED = 3
EXIT_INTERRUPTED = 130

app = typer.Typer(
    help="Simulation of saturated ground in earthquakes.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(motions.app, name="motion")
app.add_typer(lab.app, name="lab")

SceneFile = Annotated[Path, typer.Argument(help="Scene as a TOML file.", metavar="SCENE")]
MotionOption = Annotated[
    Path | None, typer.Option("--motion", help="Record (.AT2 or CSV) that replaces the motion of the scene.")
]
RunKindOption = Annotated[
    Kind | None, typer.Option("--kind", help="Place for which the --motion is given; default outcrop.")
]
ThreadsOption = Annotated[int, typer.Option(help="Threads; the results do not depend on their number.")]
AccuracyOption = Annotated[Accuracy, typer.Option(help="Preset for numerics that the scene does not set.")]


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
    """Show what a run would compute and cost, from a trial of some seconds. Writes nothing."""
    typer.echo(str(plan_of(_scene(scene, motion, unit, column, kind), threads, accuracy)))


@app.command()
def run(
    scene: SceneFile,
    out: Annotated[
        Path, typer.Option(help="Folder for the results; it may contain a run only with --resume.")
    ],
    motion: MotionOption = None,
    unit: UnitOption = None,
    column: ColumnOption = None,
    kind: RunKindOption = None,
    accuracy: AccuracyOption = "standard",
    threads: ThreadsOption = 2,
    columns: Annotated[
        Path | None, typer.Option(help="Folder of a run whose free-field columns are read, not computed.")
    ] = None,
    keep_columns: Annotated[
        bool, typer.Option("--keep-columns", help="Keep the free-field columns for other runs.")
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the run in the folder from its last checkpoint.")
    ] = False,
    checkpoint_seconds: Annotated[
        float, typer.Option(help="Wall time between checkpoints, s.")
    ] = checkpoint.SECONDS,
    checkpoint_time: Annotated[
        float | None, typer.Option(help="Simulated time between checkpoints, s.")
    ] = None,
) -> None:
    """Compute a scene. Ctrl-C ends it with readable results; --resume continues it."""
    wanted = _scene(scene, motion, unit, column, kind)
    for doubt in doubts(wanted, loaded_motions(wanted)):
        _warn(doubt)
    try:
        with warnings.catch_warnings():
            # They are printed above, before the long run.
            warnings.simplefilter("ignore", SandboilWarning)
            for shown in (ResumeWarning, SuctionWarning):
                warnings.simplefilter("always", shown)
            warnings.showwarning = _warn
            results = run_scene(
                wanted,
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


def _warn(
    message: Warning | str,
    category: type[Warning] = UserWarning,
    filename: str = "",
    lineno: int = 0,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning on stderr: its text without a place in the code."""
    typer.echo(f"warning: {message}", err=True)


@app.command()
def plot(
    folder: Annotated[Path, typer.Argument(help="Folder of a run.", metavar="DIR")],
    reference: Annotated[
        Path | None, typer.Option(help="Folder with CSV results of another code, drawn in the same plots.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the pictures, default plots in DIR.")] = None,
    stage: Annotated[str | None, typer.Option(help="A shaking stage, default the last.")] = None,
) -> None:
    """Draw a run as PNG: seepage, the surface's motion, pore pressure, the column and stress paths."""
    other = None if reference is None else Reference.read(reference)
    for path in draw(load(folder), out, reference=other, stage=stage):
        typer.echo(str(path))


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
