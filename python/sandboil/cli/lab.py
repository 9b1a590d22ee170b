"""The commands `sandboil lab ...`: tests on one material point, and on a block of particles."""

from __future__ import annotations

import csv
import io
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress

from .. import lab
from .._errors import InvalidInput, SandboilError
from .._style import DPI
from .._types import Floats
from ..files import toml as _toml
from ..files.input_file import read_text
from ..lab._arguments import Integrator
from ..scene.soils import Material, PM4Sand, material
from .outputs import picture_to_write, to_write

if TYPE_CHECKING:
    from matplotlib.figure import Figure

app = typer.Typer(help="Test a soil at one point, or as a block of particles.", no_args_is_help=True)

DrOption = Annotated[float | None, typer.Option("--Dr", help="PM4Sand: relative density, fraction.")]
G0Option = Annotated[float | None, typer.Option("--G0", help="PM4Sand: shear modulus coefficient.")]
HpoOption = Annotated[float | None, typer.Option("--hpo", help="PM4Sand: contraction rate.")]
SoilOption = Annotated[
    Path | None, typer.Option("--soil", help="TOML with kind and parameters, as a scene's material.")
]
SigmaOption = Annotated[float, typer.Option("--sigma-v0", help="Vertical effective stress, kPa.")]
K0Option = Annotated[float, typer.Option("--K0", help="Horizontal over vertical effective stress.")]
BiasOption = Annotated[float, typer.Option(help="Static shear stress over sigma_v0.")]
VoidRatioOption = Annotated[float | None, typer.Option(help="At the start; default the soil's own.")]
IntegratorOption = Annotated[Integrator, typer.Option(help="Of rate-type models.")]
PlotOption = Annotated[Path | None, typer.Option(help="Picture, PNG, PDF or SVG.", callback=picture_to_write)]
StopOption = Annotated[float, typer.Option(help="Shear strain that ends a cyclic test.")]
MaxCyclesOption = Annotated[int, typer.Option(help="Cycles that end a cyclic test.")]
CyclesOption = Annotated[float, typer.Option(help="Uniform cycles, counted by halves.")]
OutOption = Annotated[Path | None, typer.Option(help="CSV for the record.", callback=to_write)]

# Levels that the summary of a cyclic test counts cycles to.
_LEVELS = (
    *(("r_u", level) for level in (0.90, 0.95, 0.98)),
    *((measure, level) for measure in ("gamma_sa", "gamma_da") for level in (0.01, 0.03, 0.05)),
)
# Shear strains at which the summary of a monotonic test reads stresses.
_STRAINS = (0.001, 0.005, 0.01, 0.02, 0.05, 0.1)


def soil_of(file: Path | None, **sand: float | None) -> Material:
    """The soil of a TOML file, or PM4Sand by its three parameters."""
    given = {name: value for name, value in sand.items() if value is not None}
    if file is None:
        return PM4Sand(**given)
    if given:
        raise InvalidInput("--soil", str(file), f"excludes --{', --'.join(given)}", "put them into the file")
    return material(_toml.parse(_toml.read(file, "--soil"), "--soil", str(file)))


@app.command()
def dss(
    Dr: DrOption = None,
    G0: G0Option = None,
    hpo: HpoOption = None,
    soil: SoilOption = None,
    csr: Annotated[float | None, typer.Option(help="Cyclic shear stress over sigma_v0.")] = None,
    monotonic: Annotated[bool, typer.Option("--monotonic", help="Shear one way instead.")] = False,
    drained: Annotated[bool, typer.Option("--drained", help="Hold the stress, not the volume.")] = False,
    sigma_v0: SigmaOption = 101.3,
    K0: K0Option = 0.5,
    static_shear_ratio: BiasOption = 0.0,
    void_ratio: VoidRatioOption = None,
    gamma_stop: StopOption = 0.05,
    max_cycles: MaxCyclesOption = 60,
    gamma_max: Annotated[float, typer.Option(help="Shear strain that ends a monotonic test.")] = 0.10,
    integrator: IntegratorOption = "default",
    out: OutOption = None,
    plot: PlotOption = None,
) -> None:
    """Direct simple shear, cyclic (--csr) or --monotonic; prints what one asks of such a test."""
    common: dict[str, Any] = {
        "sigma_v0": sigma_v0,
        "K0": K0,
        "static_shear_ratio": static_shear_ratio,
        "void_ratio": void_ratio,
        "drained": drained,
        "integrator": integrator,
    }
    tested = soil_of(soil, Dr=Dr, G0=G0, hpo=hpo)
    if monotonic == (csr is not None):
        raise InvalidInput(
            "--csr",
            csr,
            "must be given for a cyclic test, and not with --monotonic",
            "for example --csr 0.15, or --monotonic alone",
        )
    test: lab.ShearTest
    if csr is None:
        test = lab.monotonic_dss(tested, gamma_max=gamma_max, **common)
        lines = _monotonic_lines(test)
    else:
        test = lab.cyclic_dss(tested, csr=csr, gamma_stop=gamma_stop, max_cycles=max_cycles, **common)
        lines = _cyclic_lines(test)
    _conclude(test, lines, out, plot)


@app.command()
def cell(
    csr: Annotated[float, typer.Option(help="Cyclic shear stress over sigma_v0.")],
    Dr: DrOption = None,
    G0: G0Option = None,
    hpo: HpoOption = None,
    soil: SoilOption = None,
    sigma_v0: SigmaOption = 101.3,
    K0: K0Option = 0.5,
    void_ratio: VoidRatioOption = None,
    gamma_stop: StopOption = 0.05,
    max_cycles: MaxCyclesOption = 60,
    spacing: Annotated[float, typer.Option(help="Between particles, m.")] = 0.01,
    inertia: Annotated[float, typer.Option(help="Its share of the confining stress: accuracy.")] = 0.002,
    integrator: IntegratorOption = "default",
    threads: Annotated[int, typer.Option(help="Threads; the results do not depend on their number.")] = 1,
    out: OutOption = None,
    plot: PlotOption = None,
) -> None:
    """Cyclic simple shear of a block of particles with a free centre, in minutes; prints as dss does."""
    # It loads slowly, and no other test of the laboratory is long enough for it.

    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal, transient=True) as bar:
        row = bar.add_task("cycles", total=max_cycles)

        def told(cycle: float, gamma: float) -> None:
            bar.update(row, completed=cycle, description=f"{cycle:.2f} cycles, {100.0 * gamma:+.2f} %")

        test = lab.shear_cell(
            soil_of(soil, Dr=Dr, G0=G0, hpo=hpo),
            csr=csr,
            sigma_v0=sigma_v0,
            K0=K0,
            void_ratio=void_ratio,
            gamma_stop=gamma_stop,
            max_cycles=max_cycles,
            spacing=spacing,
            inertia=inertia,
            integrator=integrator,
            progress=told,
            threads=threads,
        )
    spread = f"{100.0 * test.report.gamma_spread:.2g} % strain, {test.report.tau_spread:.2g} kPa"
    _conclude(test, [*_cyclic_lines(test), f"{'largest spread':<28}{spread}"], out, plot)


def _conclude(test: lab.ShearTest, lines: list[str], out: Path | None, plot: Path | None) -> None:
    typer.echo("\n".join([*lines, f"{'ended':<28}{test.ended}"]))
    if out is not None:
        _write(out, test.columns())
    if plot is not None:
        _draw(plot, test.plot())
    _stop_if_incomplete(test)


def _cyclic_lines(test: lab.CyclicTest) -> list[str]:
    names = {"r_u": "r_u", "gamma_sa": "single amplitude", "gamma_da": "double amplitude"}
    lines = [f"{'criterion':<28}{'cycles':>8}"]
    for measure, level in _LEVELS:
        cycles = test.cycles_to(**{measure: level})
        shown = f"{level:.2f}" if measure == "r_u" else f"{100.0 * level:g} %"
        lines.append(f"{names[measure] + ' ' + shown:<28}{cycles:>8.2f}".replace("     nan", "   never"))
    lines.append(f"{'cycles made':<28}{test.cycle[-1]:>8.2f}")
    lines.append(f"{'largest r_u':<28}{test.r_u.max():>8.3f}")
    lines.append(f"{'largest shear strain, %':<28}{100.0 * test.gamma_sa.max():>8.2f}")
    return lines


def _monotonic_lines(test: lab.ShearTest) -> list[str]:
    lines = [f"{'shear strain, %':<18}{'shear stress, kPa':>20}{'vertical, kPa':>16}{'contraction, %':>16}"]
    # The last increment leaves round-off.
    reached = [strain for strain in _STRAINS if strain <= round(float(test.gamma[-1]), 9)]
    for strain in reached:
        tau, sigma, volume = (
            np.interp(strain, test.gamma, column) for column in (test.tau, test.sigma_v_eff, test.eps_v)
        )
        lines.append(f"{100.0 * strain:<18g}{tau:>20.2f}{sigma:>16.2f}{100.0 * volume:>16.3f}")
    lines.append(f"{'largest':<18}{test.tau.max():>20.2f}")
    return lines


@app.command("strain-path")
def strain_path(
    file: Annotated[
        Path, typer.Argument(help="CSV with the columns eps_xx, eps_yy and gamma_xy.", metavar="PATH")
    ],
    stress0: Annotated[
        tuple[float, float, float],
        typer.Option(help="First effective stress xx yy xy, kPa, tension positive.", metavar="XX YY XY"),
    ],
    Dr: DrOption = None,
    G0: G0Option = None,
    hpo: HpoOption = None,
    soil: SoilOption = None,
    void_ratio: VoidRatioOption = None,
    integrator: IntegratorOption = "default",
    out: OutOption = None,
) -> None:
    """Lead a soil through strains, tension positive; prints or writes the stresses as CSV."""
    test = lab.strain_path(
        soil_of(soil, Dr=Dr, G0=G0, hpo=hpo),
        stress0=stress0,
        strain=_strains(file),
        void_ratio=void_ratio,
        integrator=integrator,
    )
    if out is None:
        typer.echo(_csv(test.columns()), nl=False)
    else:
        _write(out, test.columns())
    _stop_if_incomplete(test)


@app.command()
def calibrate(
    Dr: DrOption = None,
    G0: G0Option = None,
    crr: Annotated[float | None, typer.Option(help="Cyclic resistance ratio to meet.")] = None,
    spt: Annotated[float | None, typer.Option(help="(N1)60cs, for what is not given.")] = None,
    cpt: Annotated[float | None, typer.Option(help="q_c1Ncs, for what is not given.")] = None,
    cycles: CyclesOption = 15.0,
    gamma_sa: Annotated[float, typer.Option(help="Single-amplitude shear strain to reach.")] = 0.03,
    sigma_v0: SigmaOption = 101.3,
    K0: K0Option = 0.5,
    static_shear_ratio: BiasOption = 0.0,
    void_ratio: VoidRatioOption = None,
    integrator: IntegratorOption = "default",
    out: Annotated[
        Path | None,
        typer.Option(help="TOML for the material, as a scene and --soil take it.", callback=to_write),
    ] = None,
    plot: PlotOption = None,
) -> None:
    """Find PM4Sand's contraction rate for a cyclic resistance; prints the material as TOML."""
    estimated: dict[str, float] = {}
    if spt is not None or cpt is not None:
        estimated = lab.correlations.estimates(N160cs=spt, qc1Ncs=cpt, sigma_v0=sigma_v0, crr=crr)
    given = {name: value for name, value in {"Dr": Dr, "G0": G0, "crr": crr}.items() if value is not None}
    asked: dict[str, Any] = estimated | given
    for name in ("Dr", "G0", "crr"):
        if name not in asked:
            raise InvalidInput(
                f"--{name}",
                None,
                "is required unless --spt or --cpt says it",
                f"add --{name}, or a field test",
            )
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", lab.CalibrationWarning)
        result = lab.calibration(
            **asked,
            cycles=cycles,
            gamma_sa=gamma_sa,
            sigma_v0=sigma_v0,
            K0=K0,
            static_shear_ratio=static_shear_ratio,
            void_ratio=void_ratio,
            integrator=integrator,
        )
    for warning in told:
        typer.echo(f"warning: {warning.message}", err=True)
    text = _toml.text(result.soil.model_dump(exclude_none=True))
    typer.echo(
        f"# CRR {result.achieved:.4g} in {cycles:g} cycles, {result.target:.4g} asked for\n{text}", nl=False
    )
    if out is not None:
        _write_text(out, text)
    if plot is not None:
        _draw(plot, result.plot())


@app.command()
def crr(
    Dr: DrOption = None,
    G0: G0Option = None,
    hpo: HpoOption = None,
    soil: SoilOption = None,
    csr: Annotated[list[float] | None, typer.Option(help="Stress ratio to test; may be repeated.")] = None,
    max_cycles: Annotated[int, typer.Option(help="Cycles that end a test.")] = 500,
    sigma_v0: SigmaOption = 101.3,
    K0: K0Option = 0.5,
    static_shear_ratio: BiasOption = 0.0,
    void_ratio: VoidRatioOption = None,
    integrator: IntegratorOption = "default",
    out: OutOption = None,
    plot: PlotOption = None,
) -> None:
    """CSR against cycles for the three usual criteria, by default at eight ratios around 15 cycles."""
    curve = lab.crr_curve(
        soil_of(soil, Dr=Dr, G0=G0, hpo=hpo),
        csr,
        max_cycles=max_cycles,
        sigma_v0=sigma_v0,
        K0=K0,
        static_shear_ratio=static_shear_ratio,
        void_ratio=void_ratio,
        integrator=integrator,
    )
    typer.echo(f"{'CSR':>8}" + "".join(f"{name:>24}" for name in curve.cycles))
    for row, ratio in enumerate(curve.csr):
        cells = (f"{cycles[row]:>24.2f}".replace("  nan", "never") for cycles in curve.cycles.values())
        typer.echo(f"{ratio:>8.4f}" + "".join(cells))
    if out is not None:
        _write(out, curve.columns())
    if plot is not None:
        _draw(plot, curve.plot())


def _strains(path: Path) -> Floats:
    names = ("eps_xx", "eps_yy", "gamma_xy")
    text = read_text(path, "PATH", "CSV file")
    try:
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
        return np.array([[float(row[name]) for name in names] for row in rows])
    except KeyError as error:
        told, found = f"must have a column {error.args[0]}", text.partition("\n")[0]
        raise InvalidInput("PATH", str(path), told, f"its header is {found!r}") from error
    except (csv.Error, ValueError, TypeError) as error:
        raise InvalidInput(
            "PATH",
            str(path),
            f"must be a CSV of numbers below a header: {error}",
            f"columns {', '.join(names)}",
        ) from error


def _csv(columns: dict[str, NDArray[Any]]) -> str:
    # Adding 0 takes the sign of a zero away.
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(f"{value + 0.0:.9g}" for value in row) for row in rows)]
    return "\n".join(lines) + "\n"


def _write(path: Path, columns: dict[str, NDArray[Any]]) -> None:
    _write_text(path, _csv(columns))


def _draw(path: Path, figure: Figure) -> None:
    try:
        figure.savefig(path, dpi=DPI)
    except (OSError, ValueError) as error:
        raise InvalidInput("--plot", str(path), f"must be writable: {error}", "name another file") from error


def _write_text(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InvalidInput(
            "--out", str(path), f"must be writable: {error.strerror}", "name another file"
        ) from error


def _stop_if_incomplete(test: lab.ShearTest | lab.PathTest) -> None:
    if not test.complete:
        raise SandboilError(f"the test stopped: {test.ended}")
