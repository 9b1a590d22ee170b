"""The part of a results file that VTK reads: temporal PolyData with one vertex per node."""

from __future__ import annotations

import h5py
import numpy as np
import numpy.typing as npt

from .._types import Floats
from ..core.quantities import FIELDS, VECTOR_FIELDS
from ..files.hdf5 import text
from .datasets import ROWS_PER_CHUNK, append, create, create_growing
from .layout import DESCRIPTION, Nodes, Vtk


def begin(file: h5py.File, nodes: int, fields: list[str]) -> None:
    """Create all datasets for so many nodes and the fields by their names."""
    group = file.create_group(Vtk.GROUP)
    group.attrs[Vtk.VERSION] = np.array(Vtk.LAYOUT_VERSION, dtype=np.int64)
    # VTK reads the type as a fixed-length string only.
    group.attrs[Vtk.TYPE] = np.bytes_(Vtk.POLY_DATA)
    create(file, Vtk.NUMBER_OF_POINTS, np.array([nodes]))
    create_growing(file, Vtk.POINTS, (nodes, 3))
    for kind in Vtk.CELL_KINDS:
        _create_cells(file, kind, nodes if kind == Vtk.VERTICES else 0)
    steps = file.create_group(Vtk.STEPS)
    steps.attrs[Vtk.NUMBER_OF_STEPS] = 0
    create_growing(file, Vtk.TIMES)
    for place in (Vtk.PART_OFFSETS, Vtk.NUMBER_OF_PARTS, Vtk.POINT_OFFSETS):
        create_growing(file, place, dtype=np.int64)
    for place in (Vtk.CELL_OFFSETS, Vtk.CONNECTIVITY_OFFSETS):
        create_growing(file, place, (ROWS_PER_CHUNK, len(Vtk.CELL_KINDS)), np.int64)
    # Written once and read by every frame: its offset stays zero.
    file[Vtk.data(Vtk.REGION).path] = file[Nodes.REGION.path]
    create_growing(file, Vtk.data_offsets(Vtk.REGION), dtype=np.int64)
    for name in fields:
        shape = (nodes, 3) if name in VECTOR_FIELDS else (nodes,)
        dataset = create_growing(file, Vtk.data(name, FIELDS[name].unit), shape)
        dataset.attrs[DESCRIPTION] = text(FIELDS[name].description)
        create_growing(file, Vtk.data_offsets(name), dtype=np.int64)


def _create_cells(file: h5py.File, kind: str, count: int) -> None:
    for name, values in (
        (Vtk.NUMBER_OF_CELLS, np.array([count])),
        (Vtk.NUMBER_OF_CONNECTIVITY_IDS, np.array([count])),
        (Vtk.CONNECTIVITY, np.arange(count)),
        (Vtk.OFFSETS, np.arange(count + 1)),
    ):
        create(file, Vtk.cells(kind, name), values)


def append_frame(
    file: h5py.File, frame: int, time: float, position: Floats, fields: dict[str, Floats]
) -> None:
    """The frame of that number at a time (s): places (n, 2), m, and fields by name, (n,) or (n, 2)."""
    first = frame * len(position)
    append(file, Vtk.POINTS, _with_z(position))
    for name, values in fields.items():
        append(file, Vtk.data(name), _with_z(values) if values.ndim == 2 else values)
        append(file, Vtk.data_offsets(name), [first])
    append(file, Vtk.data_offsets(Vtk.REGION), [0])
    append(file, Vtk.POINT_OFFSETS, [first])
    append(file, Vtk.PART_OFFSETS, [0])
    append(file, Vtk.NUMBER_OF_PARTS, [1])
    for place in (Vtk.CELL_OFFSETS, Vtk.CONNECTIVITY_OFFSETS):
        append(file, place, np.zeros((1, len(Vtk.CELL_KINDS)), dtype=np.int64))
    append(file, Vtk.TIMES, [time])
    set_frames(file, frame + 1)


def set_frames(file: h5py.File, count: int) -> None:
    """Set the number of frames that VTK sees."""
    file[Vtk.STEPS].attrs[Vtk.NUMBER_OF_STEPS] = count


def _with_z(vectors: Floats) -> npt.NDArray[np.float64]:
    """(n, 2) vectors with a third component 0."""
    return np.column_stack([vectors, np.zeros(len(vectors))])
