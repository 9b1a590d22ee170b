"""The commands `sandboil lab ...`: tests on one material point, and on a block of particles."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress

from .. import lab
from .._errors import InvalidInput, SandboilError
from ..files import toml as _toml
from ..lab._arguments import Integrator
from .inputs import soil_of, strains_of
from .outputs import csv_of, draw, picture_to_write, to_write, write_csv, write_text
from .pages import cyclic_lines, monotonic_lines, resistance_lines

if TYPE_CHECKING:
    pass

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
VoidRatioOption = Annotated[
    float | None, typer.Option(help="Void ratio at the start; default that of the soil.")
]
IntegratorOption = Annotated[Integrator, typer.Option(help="Integration method of rate equations.")]
PlotOption = Annotated[
    Path | None, typer.Option(help="File for the picture: PNG, PDF or SVG.", callback=picture_to_write)
]
StopOption = Annotated[float, typer.Option(help="Shear strain that ends a cyclic test.")]
MaxCyclesOption = Annotated[int, typer.Option(help="Cycles that end a cyclic test.")]
CyclesOption = Annotated[float, typer.Option(help="Uniform cycles, counted by halves.")]
OutOption = Annotated[Path | None, typer.Option(help="CSV file for the measurements.", callback=to_write)]


@app.command()
def dss(
    Dr: DrOption = None,
    G0: G0Option = None,
    hpo: HpoOption = None,
    soil: SoilOption = None,
    csr: Annotated[float | None, typer.Option(help="Cyclic shear stress over sigma_v0.")] = None,
    monotonic: Annotated[
        bool, typer.Option("--monotonic", help="Monotonic shear instead of cyclic.")
    ] = False,
    drained: Annotated[
        bool, typer.Option("--drained", help="Constant vertical stress instead of constant volume.")
    ] = False,
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
    """Direct simple shear, cyclic (--csr) or --monotonic; prints its usual results."""
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
        lines = monotonic_lines(test)
    else:
        test = lab.cyclic_dss(tested, csr=csr, gamma_stop=gamma_stop, max_cycles=max_cycles, **common)
        lines = cyclic_lines(test)
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
    spacing: Annotated[float, typer.Option(help="Particle spacing, m.")] = 0.01,
    inertia: Annotated[
        float, typer.Option(help="Inertial over confining stress; smaller is more accurate, slower.")
    ] = 0.002,
    integrator: IntegratorOption = "default",
    threads: Annotated[int, typer.Option(help="Threads; the results do not depend on their number.")] = 1,
    out: OutOption = None,
    plot: PlotOption = None,
) -> None:
    """Cyclic simple shear of a block of particles with a free centre, in minutes; prints as `lab dss`."""
    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal, transient=True) as bar:
        row = bar.add_task("cycles", total=max_cycles)

        def shown(cycle: float, gamma: float) -> None:
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
            progress=shown,
            threads=threads,
        )
    spread = f"{100.0 * test.report.gamma_spread:.2g} % strain, {test.report.tau_spread:.2g} kPa"
    _conclude(test, [*cyclic_lines(test), f"{'largest spread':<28}{spread}"], out, plot)


def _conclude(test: lab.ShearTest, lines: list[str], out: Path | None, plot: Path | None) -> None:
    typer.echo("\n".join([*lines, f"{'ended':<28}{test.ended}"]))
    if out is not None:
        write_csv(out, test.columns())
    if plot is not None:
        draw(plot, test.plot())
    _stop_if_incomplete(test)


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
    """Impose strains on a soil, tension positive; prints or writes the stresses as CSV."""
    test = lab.strain_path(
        soil_of(soil, Dr=Dr, G0=G0, hpo=hpo),
        stress0=stress0,
        strain=strains_of(file),
        void_ratio=void_ratio,
        integrator=integrator,
    )
    if out is None:
        typer.echo(csv_of(test.columns()), nl=False)
    else:
        write_csv(out, test.columns())
    _stop_if_incomplete(test)


@app.command()
def calibrate(
    Dr: DrOption = None,
    G0: G0Option = None,
    crr: Annotated[float | None, typer.Option(help="Cyclic resistance ratio to meet.")] = None,
    spt: Annotated[float | None, typer.Option(help="(N1)60cs, to estimate missing values.")] = None,
    cpt: Annotated[float | None, typer.Option(help="q_c1Ncs, to estimate missing values.")] = None,
    cycles: CyclesOption = 15.0,
    gamma_sa: Annotated[float, typer.Option(help="Single-amplitude shear strain to reach.")] = 0.03,
    sigma_v0: SigmaOption = 101.3,
    K0: K0Option = 0.5,
    static_shear_ratio: BiasOption = 0.0,
    void_ratio: VoidRatioOption = None,
    integrator: IntegratorOption = "default",
    out: Annotated[
        Path | None,
        typer.Option(help="TOML file for the material, which scenes and --soil read.", callback=to_write),
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
                "is required unless --spt or --cpt is given",
                f"add --{name}, or a field test",
            )
    with warnings.catch_warnings(record=True) as shown:
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
    for warning in shown:
        typer.echo(f"warning: {warning.message}", err=True)
    text = _toml.text(result.soil.model_dump(exclude_none=True))
    typer.echo(
        f"# CRR {result.achieved:.4g} in {cycles:g} cycles, {result.target:.4g} asked for\n{text}", nl=False
    )
    if out is not None:
        write_text(out, text)
    if plot is not None:
        draw(plot, result.plot())


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
    typer.echo("\n".join(resistance_lines(curve)))
    if out is not None:
        write_csv(out, curve.columns())
    if plot is not None:
        draw(plot, curve.plot())


def _stop_if_incomplete(test: lab.ShearTest | lab.PathTest) -> None:
    if not test.complete:
        raise SandboilError(f"the test stopped: {test.ended}")
