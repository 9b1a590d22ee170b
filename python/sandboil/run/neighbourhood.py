"""The nodes around the place where a run diverged, as a table and as a picture."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .._errors import SimulationDiverged
from .._types import Floats
from ..core.quantities import FIELDS, VECTOR_FIELDS
from ..core.simulation import Simulation
from ..results.plots import neighbourhood as draw

FILE_NAME = "neighbourhood.csv"
PICTURE_NAME = "neighbourhood.png"

# Radius around the offending node, in spacings: beyond its neighbours' neighbours.
_REACH = 6.0

# Fields of every node in the table, besides its place and region.
_FIELDS = (
    "displacement",
    "velocity",
    "acceleration",
    "sigma_v_eff",
    "sigma_h_eff",
    "tau_xy",
    "gamma_xy",
    "excess_pore_pressure",
)


def _centre(simulation: Simulation, error: SimulationDiverged) -> int:
    """The offending node; of a free-field column, whose nodes are others, the section's nearest to it."""
    rest = simulation.particles.position
    if error.node < len(rest):
        present = rest[error.node] + simulation.field("displacement")[error.node]
        if np.allclose(present, error.position, equal_nan=True):
            return error.node
    distance = np.linalg.norm(rest - np.nan_to_num(error.position), axis=1)
    return int(np.argmin(distance))


def write(folder: Path, simulation: Simulation, error: SimulationDiverged) -> list[Path]:
    """Write the neighbourhood of the node that an error is about, and return the paths.

    `neighbourhood.csv` has a row for each node, the offending one first, then by distance: index, place
    at rest (m), region, and fields with their units, signs as in `FIELDS`. `neighbourhood.png` shows speed
    and stress. Raises :class:`OSError`.
    """
    centre = _centre(simulation, error)
    rest, spacing = simulation.particles.position, max(simulation.particles.spacing)
    distance = np.linalg.norm(rest - rest[centre], axis=1)
    order = np.argsort(distance, kind="stable")
    nodes = order[distance[order] <= _REACH * spacing]
    fields = simulation.fields([name for name in _FIELDS if name in simulation.field_names])
    columns: dict[str, npt.NDArray[np.generic] | list[str]] = {
        "node": nodes,
        "x (m)": rest[nodes, 0],
        "y (m)": rest[nodes, 1],
        "region": [simulation.scene.regions[k].name for k in simulation.particles.region[nodes]],
    }
    for name, values in fields.items():
        unit = FIELDS[name].unit
        if name in VECTOR_FIELDS:
            columns |= {f"{name}_{axis} ({unit})": values[nodes, k] for k, axis in enumerate("xy")}
        else:
            columns[f"{name} ({unit})"] = values[nodes]
    paths = [folder / FILE_NAME, folder / PICTURE_NAME]
    with paths[0].open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(np.asarray(values).tolist() for values in columns.values()), strict=True))
    speed: Floats = np.linalg.norm(fields["velocity"][nodes], axis=1)
    draw(rest[nodes], speed, fields["sigma_v_eff"][nodes], str(error), paths[1])
    return paths
