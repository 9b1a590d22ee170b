"""The functions on which bits depend besides ours: those of the machine's mathematical library and of NumPy.

They pick other instructions on other processors, and round differently there.
"""

from __future__ import annotations

import importlib.metadata
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .quantities import digest

COUNT = 2001

# Python calls the mathematical library that the core calls. (math.hypot is excluded: it is part of Python.)
ONE_ARGUMENT: list[tuple[Callable[[float], float], float, float]] = [
    (math.exp, -30.0, 30.0),
    (math.expm1, -2.0, 2.0),
    (math.log, 1.0e-6, 1.0e4),
    (math.log1p, -0.9, 10.0),
    (math.log10, 1.0e-6, 1.0e4),
    (math.cbrt, -100.0, 100.0),
    (math.sin, -50.0, 50.0),
    (math.cos, -50.0, 50.0),
    (math.tan, -1.5, 1.5),
    (math.asin, -1.0, 1.0),
    (math.acos, -1.0, 1.0),
    (math.atan, -20.0, 20.0),
    (math.sinh, -10.0, 10.0),
    (math.cosh, -10.0, 10.0),
    (math.tanh, -5.0, 5.0),
]


def _between(low: float, high: float) -> list[float]:
    return [low + (high - low) * k / (COUNT - 1) for k in range(COUNT)]


def _library() -> str:
    """Digest of a table of the mathematical library's functions."""
    table = [[function(x) for x in _between(low, high)] for function, low, high in ONE_ARGUMENT]
    powers = [math.pow(x, y) for x, y in zip(_between(1.0e-3, 50.0), _between(-4.0, 6.0), strict=True)]
    angles = [math.atan2(y, x) for x, y in zip(_between(-3.0, 5.0), _between(4.0, -2.0), strict=True)]
    return digest([*table, powers, angles])


def _numpy() -> str:
    """Digest of a table of NumPy's functions that prepare a scene and its motions."""
    x, positive = np.array(_between(-20.0, 20.0)), np.array(_between(1.0e-3, 50.0))
    wave = np.fft.rfft(np.sin(x) * np.exp(-(x**2)))
    table: list[Any] = [
        *(function(x) for function in (np.exp, np.sin, np.cos, np.tanh)),
        *(function(positive) for function in (np.log, np.sqrt)),
        positive ** (x / 10.0),
        np.hypot(x, positive),
        np.arctan2(x, positive),
        np.cumsum(np.sin(x)),
        np.abs(wave),
        np.angle(wave),
        [np.sum(np.sin(x)), np.mean(np.cos(x)), np.dot(np.sin(x), np.cos(positive)), np.std(x)],
    ]
    return digest(np.concatenate([np.ravel(part) for part in table]))


def fingerprint() -> dict[str, str]:
    """Digests of tables of the functions, by whose they are."""
    return {"mathematical library": _library(), "NumPy": _numpy()}


def libraries() -> dict[str, str]:
    """Versions of the libraries that prepare a scene. Others may well give the same bits."""
    return {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "shapely")}
