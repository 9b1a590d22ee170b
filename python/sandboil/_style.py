"""The look of every picture. Drawing is loaded by the first picture: that takes a second."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours for the colour-blind, too (Okabe and Ito 2008): ours, the input's, and the reference's.
OURS, INPUT, REFERENCE = "#0072B2", "#999999", "#D55E00"
DPI = 150
STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
}


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of a size in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


@contextmanager
def styled() -> Iterator[None]:
    """Draw in our style."""
    from matplotlib import rc_context

    with rc_context(STYLE):
        yield
