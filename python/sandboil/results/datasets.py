"""Datasets of a results file: created, extended and replaced, each with its unit."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from ..files.hdf5 import text
from .layout import UNITS, Dataset

# Rows per chunk of datasets that grow by single rows, and of histories: a few pages of disk each.
ROWS_PER_CHUNK = 256
# Fastest deflate level: it halves the file; higher ones cost time and gain little on noisy floats.
_DEFLATE = 1


def create(file: h5py.File, place: Dataset, values: npt.ArrayLike) -> h5py.Dataset:
    """A dataset that does not grow."""
    # HDF5 makes no checksum of an empty dataset.
    dataset = file.create_dataset(place.path, data=values, fletcher32=np.size(values) > 0)
    dataset.attrs[UNITS] = text(place.unit)
    return dataset


def create_texts(file: h5py.File, place: Dataset, texts: list[str]) -> None:
    """A dataset of texts of the same type."""
    dataset = file.create_dataset(place.path, data=np.stack([text(line) for line in texts]), fletcher32=True)
    dataset.attrs[UNITS] = text(place.unit)


def create_growing(
    file: h5py.File,
    place: Dataset,
    chunk: tuple[int, ...] = (ROWS_PER_CHUNK,),
    dtype: Any = np.float64,
) -> h5py.Dataset:
    """An empty dataset that grows along its first axis by whole chunks on disk."""
    dataset = file.create_dataset(
        place.path,
        shape=(0, *chunk[1:]),
        maxshape=(None, *chunk[1:]),
        chunks=chunk,
        dtype=dtype,
        shuffle=True,
        compression="gzip",
        compression_opts=_DEFLATE,
        fletcher32=True,
    )
    dataset.attrs[UNITS] = text(place.unit)
    return dataset


def append(file: h5py.File, place: Dataset, rows: npt.ArrayLike) -> None:
    """More rows at the end of a dataset."""
    dataset, count = file[place.path], len(np.asarray(rows))
    dataset.resize(len(dataset) + count, axis=0)
    if count:
        dataset[-count:] = rows


def replace(file: h5py.File, place: Dataset, values: npt.ArrayLike) -> None:
    """New values of the same shape; the dataset is created if it is missing."""
    if place.path in file:
        file[place.path][...] = values
    else:
        create(file, place, values)
