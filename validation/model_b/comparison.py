"""Model B of the level ground site (Mhaski and Ramana 2025, section 6.2), between free-field sides.

Compared with the column of model A and with OpenSees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sandboil as sb
from scipy.signal import butter, sosfiltfilt

from validation.level_ground import site
from validation.level_ground.site import CORNER, DEPTHS, Floats

# Width of the paper's main domain, m.
WIDTH = 5.0


@dataclass(frozen=True)
class Difference:
    """Model B less model A. Tuples go over 4, 11 and 17 m."""

    pga_10hz: float
    r_u_largest: tuple[float, ...]
    r_u_rms: tuple[float, ...]
    side_r_u_largest: tuple[float, ...]


def scenes(motion: sb.Motion, spacing: float) -> tuple[sb.Scene, sb.Scene]:
    """Models A, one particle wide, and B, which also keeps histories beside its left side."""
    model_a = site.scene(motion, spacing=spacing)
    model_b = site.scene(motion, spacing=spacing, width=WIDTH, sides=sb.FreeField())
    beside = [(0.5 * spacing, model_b.bounds[3] - depth) for depth in DEPTHS]
    return model_a, model_b.changed(**{"output.points": beside})


def surface_acceleration(run: sb.Run) -> tuple[Floats, Floats]:
    """Time (s) and horizontal acceleration at the surface below 10 Hz (g)."""
    surface = run.history("acceleration_x", unit="g")
    rate = 1.0 / (surface.time[1] - surface.time[0])
    return surface.time, sosfiltfilt(butter(4, CORNER, fs=rate, output="sos"), surface.values)


def difference(run_a: sb.Run, run_b: sb.Run) -> Difference:
    """Compare two runs."""
    peaks = [float(np.abs(surface_acceleration(run)[1]).max()) for run in (run_a, run_b)]
    largest, rms, beside = [], [], []
    for depth in DEPTHS:
        column = run_a.history("r_u", depth=depth)
        centre = run_b.history("r_u", depth=depth)
        side = run_b.history("r_u", at=(0.5 * run_b.scene.spacing, run_b.scene.bounds[3] - depth))
        apart = np.interp(column.time, centre.time, centre.values) - column.values
        largest.append(float(np.abs(apart).max()))
        rms.append(float(np.sqrt(np.mean(apart**2))))
        apart = np.interp(column.time, side.time, side.values) - column.values
        beside.append(float(np.abs(apart).max()))
    return Difference(peaks[1] / peaks[0] - 1.0, tuple(largest), tuple(rms), tuple(beside))
