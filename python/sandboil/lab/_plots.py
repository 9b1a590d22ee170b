"""Plots of the tests."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .._errors import InvalidInput
from .._style import OURS, REFERENCE, new_figure, styled
from .._types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ._results import (
        CompressionTest,
        CyclicTest,
        ModulusReduction,
        PathTest,
        Reconsolidation,
        Record,
        ShearTest,
    )

# Length of an axis over its largest value.
_MARGIN = 1.05
# Label of each quantity, and the factor from the record to the plot.
_QUANTITIES = {
    "gamma": ("shear strain, %", 100.0),
    "tau": ("shear stress, kPa", 1.0),
    "sigma_v_eff": ("vertical effective stress, kPa", 1.0),
    "r_u": ("excess pore pressure ratio, 1", 1.0),
    "eps_v": ("contraction, %", 100.0),
    "cycle": ("cycles, 1", 1.0),
    "G_ratio": ("$G/G_{max}$, 1", 1.0),
    "damping": ("damping ratio, %", 100.0),
    "axial_strain": ("vertical strain, %", 100.0),
    "p": ("mean effective stress in the plane, kPa", 1.0),
    "q": ("vertical minus horizontal stress, kPa", 1.0),
    "excess_pore_pressure": ("excess pore pressure, kPa", 1.0),
    "gamma_xy": ("shear strain xy, %", 100.0),
    "tau_xy": ("shear stress xy, kPa", 1.0),
    "mean": ("mean stress in the plane, tension positive, kPa", 1.0),
    "volume": ("expansion, %", 100.0),
}


def cyclic(test: CyclicTest, reference: object | None) -> Figure:
    """Stress path, stress-strain loops, and pore pressure (drained: contraction) and strain over cycles."""
    panels = [
        ("sigma_v_eff", "tau"),
        ("gamma", "tau"),
        ("cycle", "eps_v" if test.drained else "r_u"),
        ("cycle", "gamma"),
    ]
    return _drawn(test, reference, panels, (2, 2))


def monotonic(test: ShearTest, reference: object | None) -> Figure:
    """Stress-strain curve, stress path, and pore pressure (drained: contraction) against strain."""
    panels = [
        ("gamma", "tau"),
        ("sigma_v_eff", "tau"),
        ("gamma", "eps_v" if test.drained else "r_u"),
    ]
    return _drawn(test, reference, panels, (1, 3))


def modulus(test: ModulusReduction, reference: object | None) -> Figure:
    """Modulus ratio and damping ratio against strain."""
    figure = _drawn(test, reference, [("gamma", "G_ratio"), ("gamma", "damping")], (1, 2))
    for axes in figure.axes:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.set_ylim(bottom=0.0)
    return figure


def compression(test: CompressionTest, reference: object | None) -> Figure:
    """Stress-strain curve, stress path, and pore pressure (drained: contraction) against strain."""
    panels = [
        ("axial_strain", "q"),
        ("p", "q"),
        ("axial_strain", "eps_v" if test.eps_v.any() else "excess_pore_pressure"),
    ]
    return _drawn(test, reference, panels, (1, 3))


def reconsolidation(test: Reconsolidation, reference: object | None) -> Figure:
    """Vertical effective stress against contraction, and shear stress against vertical effective stress."""
    return _drawn(test, reference, [("eps_v", "sigma_v_eff"), ("sigma_v_eff", "tau")], (1, 2))


def path(test: PathTest, reference: object | None) -> Figure:
    """Shear stress against shear strain and against mean stress, and mean stress against volume."""
    panels = [("gamma_xy", "tau_xy"), ("mean", "tau_xy"), ("volume", "mean")]
    return _drawn(test, reference, panels, (1, 3))


def _drawn(
    test: Record, reference: object | None, panels: list[tuple[str, str]], shape: tuple[int, int]
) -> Figure:
    rows, columns = shape
    with styled():
        figure = new_figure(1.0 + 3.8 * columns, 0.6 + 2.9 * rows)
        for axes, names in zip(figure.subplots(rows, columns).flat, panels, strict=True):
            _draw(axes, test, names, {"color": OURS, "label": "sandboil"})
            if reference is not None:
                _draw(axes, reference, names, {"color": REFERENCE, "ls": "--", "label": "reference"})
            (x, y) = names
            axes.set(xlabel=_QUANTITIES[x][0], ylabel=_QUANTITIES[y][0])
            if x in ("sigma_v_eff", "cycle", "p"):
                axes.set_xlim(0.0, _MARGIN * axes.dataLim.x1)
        if reference is not None:
            figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


def _draw(axes: Axes, source: object, names: tuple[str, str], style: dict[str, Any]) -> None:
    x, y = (_QUANTITIES[name][1] * _values(source, name) for name in names)
    axes.plot(x, y, **style)


def _values(source: object, name: str) -> Floats:
    """The array `name` of a test, or of any object that has it as an attribute or key."""
    try:
        value = source[name] if isinstance(source, Mapping) else getattr(source, name)
    except (AttributeError, KeyError):
        raise InvalidInput("reference", source, f"must have the array {name} as attribute or key") from None
    return np.asarray(value, dtype=np.float64)
