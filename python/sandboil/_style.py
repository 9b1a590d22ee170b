"""How every picture looks."""

from __future__ import annotations

from typing import Any

# Colours that the colour-blind tell apart (Okabe and Ito 2008): ours, the input's, and the reference's.
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
