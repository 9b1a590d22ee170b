"""Cyclic resistance and calibration of the sands of Table 1 of Mhaski and Ramana (2025).

Measures the tables of README.md and draws resistance.png:

    python -m validation.resistance
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import sandboil as sb
from sandboil import lab

from validation.page import write_tables

FOLDER = Path(__file__).parent

_T = TypeVar("_T")


@dataclass(frozen=True)
class Published:
    """One row of Table 1, and the void ratio that OpenSees has after consolidation from zero stress."""

    name: str
    Dr: float
    G0: float
    crr: float
    hpo: float
    void_ratio: float

    @property
    def sand(self) -> sb.PM4Sand:
        return sb.PM4Sand(Dr=self.Dr, G0=self.G0, hpo=self.hpo)


TABLE_1 = (
    Published("D_r 0.35", 0.35, 476.0, 0.090, 0.53, 0.694110),
    Published("D_r 0.55", 0.55, 677.0, 0.147, 0.40, 0.634396),
    Published("D_r 0.75", 0.75, 890.0, 0.312, 0.63, 0.574558),
)
# Overburden of the K_sigma table, atmospheres, and static shear ratios of the K_alpha curves.
OVERBURDEN, SUSTAINED = (0.5, 1.0, 2.0, 4.0), (0.0, 0.05, 0.1, 0.2, 0.3)


def timed(work: Callable[[], _T]) -> tuple[_T, float]:
    """A result and the seconds it took."""
    begin = time.perf_counter()
    result = work()
    return result, time.perf_counter() - begin


def calibrated(row: Published) -> str:
    """Calibration with the sand's own void ratio, with OpenSees' one, and back again."""
    own, seconds = timed(lambda: lab.calibrate_hpo(row.Dr, row.G0, row.crr))
    consolidated = lab.calibrate_hpo(row.Dr, row.G0, row.crr, void_ratio=row.void_ratio)
    resistance = lab.crr(row.sand)
    back = lab.calibrate_hpo(row.Dr, row.G0, resistance)

    def against(sand: sb.PM4Sand) -> str:
        return f"{sand.hpo:.3f} ({100.0 * (sand.hpo / row.hpo - 1.0):+.1f} %)"

    cells = [row.name, f"{row.hpo:.2f}", against(consolidated), against(own), f"{seconds:.2f}"]
    cells += [f"{resistance:.4f}", f"{100.0 * (back.hpo / row.hpo - 1.0):+.2f} %"]
    return f"| {' | '.join(cells)} |"


def curves(row: Published) -> tuple[lab.ResistanceCurve, str]:
    """CSR-N curve of eight points and three criteria, and its cost."""
    csr = [factor * row.crr for factor in (0.75, 0.82, 0.9, 1.0, 1.1, 1.25, 1.45, 1.7)]
    curve, seconds = timed(lambda: lab.crr_curve(row.sand, csr=csr))
    at = [f"{curve.csr_at(cycles):.3f}" for cycles in (5.0, 15.0, 30.0)]
    return curve, f"| {' | '.join([row.name, *at, f'{seconds:.2f}'])} |"


def factors(row: Published) -> tuple[lab.FactorCurve, lab.FactorCurve, str]:
    """K_sigma and K_alpha of the model beside the published ones."""
    sigma = lab.k_sigma(row.sand, [101.3 * atmospheres for atmospheres in OVERBURDEN])
    alpha = lab.k_alpha(row.sand, SUSTAINED)
    cells = [f"{ours:.2f} ({theirs:.2f})" for ours, theirs in zip(sigma.factor, sigma.published, strict=True)]
    cells += [
        f"{ours:.2f} ({theirs:.2f})" for ours, theirs in zip(alpha.factor, alpha.published, strict=True)
    ]
    return sigma, alpha, f"| {' | '.join([row.name, *cells])} |"


def _draw(
    found: list[lab.ResistanceCurve], sigma: list[lab.FactorCurve], alpha: list[lab.FactorCurve]
) -> None:
    import matplotlib.pyplot as plt
    from matplotlib.ticker import LogLocator, NullFormatter

    colours = ("#0072B2", "#009E73", "#D55E00")
    figure, axes = plt.subplots(1, 3, figsize=(13.0, 4.0), layout="constrained")
    for row, colour, curve, by_sigma, by_alpha in zip(TABLE_1, colours, found, sigma, alpha, strict=True):
        for (name, cycles), line in zip(curve.cycles.items(), ("-", ":", "--"), strict=True):
            axes[0].semilogx(cycles, curve.csr, line, color=colour, label=f"{row.name}, {name}")
        axes[0].plot(15.0, row.crr, "*", ms=12.0, color=colour, mec="black", mew=0.5)
        for axis, by in ((axes[1], by_sigma), (axes[2], by_alpha)):
            axis.plot(by.x, by.factor, "o-", color=colour, label=row.name)
            axis.plot(by.x, by.published, "--", color=colour, lw=0.9)
    axes[0].xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes[0].xaxis.set_major_formatter("{x:g}")
    axes[0].xaxis.set_minor_formatter(NullFormatter())
    axes[0].set(xlabel="uniform cycles", ylabel="cyclic stress ratio", ylim=(0.0, None))
    axes[0].set_title("resistance; stars: Table 1 at 15 cycles", loc="left", fontsize=9)
    axes[0].legend(frameon=False, fontsize=6.5)
    axes[1].set(xlabel="vertical effective stress, kPa", ylabel="$K_\\sigma$", ylim=(0.0, None))
    axes[1].set_title("dashed: Boulanger and Idriss (2004)", loc="left", fontsize=9)
    axes[2].set(xlabel="static shear ratio", ylabel="$K_\\alpha$", ylim=(0.0, None))
    axes[2].set_title("dashed: Idriss and Boulanger (2003)", loc="left", fontsize=9)
    axes[2].legend(frameon=False, fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.3)
    figure.savefig(FOLDER / "resistance.png", dpi=110)
    plt.close(figure)


def main() -> None:
    """Measure the tables, write them to README.md, and draw the picture."""
    calibrations = [
        "| sand | published h_po | h_po, void ratio of OpenSees | h_po, own void ratio | s "
        "| CRR of the published sand | h_po from that CRR |",
        "|---|---|---|---|---|---|---|",
        *map(calibrated, TABLE_1),
    ]
    found = [curves(row) for row in TABLE_1]
    resistances = [
        "| sand | CSR at 5 cycles | 15 | 30 | curve of 8 points and 3 criteria, s |",
        "|---|---|---|---|---|",
        *(line for _, line in found),
    ]
    by = [factors(row) for row in TABLE_1]
    heads = [f"K_sigma {atmospheres:g} atm" for atmospheres in OVERBURDEN]
    heads += [f"K_alpha {ratio:g}" for ratio in SUSTAINED]
    effects = [f"| sand | {' | '.join(heads)} |", "|---" * (1 + len(heads)) + "|"]
    effects += [line for _, _, line in by]
    tables = [calibrations, resistances, effects]
    print("\n\n".join("\n".join(lines) for lines in tables))
    write_tables(FOLDER / "README.md", tables)
    _draw([curve for curve, _ in found], [sigma for sigma, _, _ in by], [alpha for _, alpha, _ in by])


if __name__ == "__main__":
    main()
