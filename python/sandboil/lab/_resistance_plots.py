"""Plots of cyclic resistance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._style import INPUT, OURS, REFERENCE, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ._resistance import FactorCurve, ResistanceCurve

_MARKERS = ("o", "s", "^")
# Colours of the criteria; the first criterion is the default of calibrations.
_COLOURS = (OURS, "#009E73", INPUT)


def resistance(curve: ResistanceCurve, target: tuple[float, float] | None = None) -> Figure:
    """CSR against cycles for each criterion; `target`: the point (cycles, CSR) of a calibration."""
    from matplotlib.ticker import LogLocator, NullFormatter

    with styled():
        figure = new_figure(5.6, 4.0)
        axes = figure.subplots()
        for (name, cycles), marker, colour in zip(curve.cycles.items(), _MARKERS, _COLOURS, strict=True):
            order = np.argsort(cycles)
            axes.plot(cycles[order], curve.csr[order], marker=marker, ms=4.0, color=colour, label=name)
        if target is not None:
            axes.plot(*target, marker="*", ms=13.0, ls="", color=REFERENCE, label="target", zorder=5)
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set(xlabel="uniform cycles", ylabel="cyclic stress ratio", ylim=(0.0, None))
        axes.grid(which="minor", alpha=0.15)
        axes.legend(loc="best")
    return figure


def factor(curve: FactorCurve) -> Figure:
    """A correction factor on cyclic resistance and the published factor."""
    with styled():
        figure = new_figure(5.0, 3.6)
        axes = figure.subplots()
        axes.plot(curve.x, curve.published, color=REFERENCE, ls="--", label=curve.source)
        axes.plot(curve.x, curve.factor, marker="o", ms=4.0, color=OURS, label="PM4Sand")
        letter = {"K_sigma": r"$K_\sigma$", "K_alpha": r"$K_\alpha$"}[curve.name]
        axes.set(xlabel=curve.argument, ylabel=letter, ylim=(0.0, None))
        axes.legend(loc="best")
    return figure
