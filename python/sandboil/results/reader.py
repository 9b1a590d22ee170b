"""What a run leaves behind: one HDF5 file that ParaView opens as it stands, and the object that reads it.

Layout of `results.h5` (format version in the root attributes; every dataset has a `units` attribute):

    /VTKHDF           temporal PolyData, version 2: one vertex per node, the fields of every frame
    /frames           stage, stage time, step, time step and wall time of every frame
    /nodes            initial place, region and geostatic state of the nodes
    /probes           points of the histories
    /histories/STAGE  time (m,) and every channel (m, probes)
    /energy/STAGE     time (m,), energy and work by kind, and mass of each phase (m,)
    /envelopes/STAGE  largest values over all steps, (nodes,)
    /motions/STAGE    the motion that shook the stage
    /stages/STAGE     attributes: steps, wall time, counters
    /machine          attributes: what computed the run first
    /seepage          of a seepage stage: its last fields, discharge and inflow of every condition
    /scene            the scene as TOML with every default written out

While a run goes on, a second copy `.results.h5.twin` lies beside it: one is written while the other can be
read. The root attributes tell how the run ended and how often it was resumed.
"""

from __future__ import annotations

import csv
import importlib.metadata
import json
import os
import platform
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, cast

import h5py
import numpy as np
import numpy.typing as npt

from .. import _core
from .._errors import InvalidInput, ResumeWarning, SandboilError, unknown_name
from .._types import COORDINATE_TOLERANCE, Floats
from ..core.simulation import (
    ENERGY,
    FIELDS,
    HISTORIES,
    SEEPAGE_FIELDS,
    STRESS_HISTORIES,
    VECTOR_FIELDS,
    WATER_FIELDS,
    Probe,
    Simulation,
    pore_pressure_ratio,
    written_fields,
)
from ..files.committed_file import CommittedFile, twin_of
from ..files.hdf5 import LAYOUT, opened, refuse_foreign, said, text
from ..motion import Kind, Motion, ResponseSpectrum, response_spectrum
from ..motion._series import STANDARD_GRAVITY, butterworth
from ..run.plan import described_coefficient, pore_pressure_coefficients
from ..scene.scene import Scene

FILE_NAME = "results.h5"
# Raised when a reader of the old layout would misunderstand the new one.
FORMAT_VERSION = 1

# Version of the VTKHDF layout written, and the four kinds of cells a PolyData may have, in its own order.
VTKHDF_VERSION = (2, 0)
_CELL_KINDS = ("Vertices", "Lines", "Polygons", "Strips")

# Rows per chunk of what grows by single rows, and of histories: a few pages of disk each.
_ROWS_PER_CHUNK = 256
# Fastest deflate level: it halves the file; higher ones cost time and gain little on noisy floats.
_DEFLATE = 1

# Longest name of what limits a time step, bytes.
_LONGEST_LIMIT = 64

# Least wall time between commits of frames, s: each waits for the disk, some hundredths of a second.
_COMMIT_INTERVAL = 5.0

# Corner of the low-pass under which surface accelerations of different codes agree, Hz, and its order: peaks
# above it are single dilation spikes that depend on mesh and time step.
PGA_CORNER = 10.0
PGA_ORDER = 4

# Histories that follow from a stored one and the geostatic state.
_STORED_AS = {
    "r_u": "excess_pore_pressure",
    "pore_pressure": "excess_pore_pressure",
    "r_u_stress": "sigma_v_eff",
}

Status = Literal["running", "complete", "interrupted", "stopped"]
Time = float | Literal["last"]


class Writer:
    """Writes a run into a file as it goes. The file on disk is whole at every moment, also after a kill.

    Parameters
    ----------
    path : of the file
    simulation : that is run
    accuracy : the preset asked for, of a new file
    mark : what :meth:`mark` told when the state was stored that the run goes on from: all after it is taken
        away; None: a new file

    Raises :class:`OSError` whenever the file cannot be written.
    """

    def __init__(
        self, path: Path, simulation: Simulation, accuracy: str, mark: dict[str, Any] | None = None
    ) -> None:
        self.path = path
        self._simulation = simulation
        self._disk = CommittedFile(path, exists=mark is not None)
        self._file = h5py.File(self._disk, "w" if mark is None else "r+", libver=LAYOUT)
        self._frames = 0
        self._clock = 0.0
        if mark is None:
            self._write_head(accuracy)
            self._write_nodes()
            self._begin_vtk()
            self._begin_frames()
        else:
            self._return_to(mark)
        try:
            self.commit()
        except OSError:
            self.abandon()
            raise

    def commit(self) -> None:
        """Make the disk hold what has been written."""
        self._file.flush()
        self._disk.commit()
        self._committed_at = time.monotonic()

    def mark(self) -> dict[str, Any]:
        """Commit, and tell how far the file has come: to be stored beside the simulation's state."""
        self.commit()
        names: list[str] = []
        rows = {}

        def look(name: str, item: h5py.Group | h5py.Dataset) -> None:
            names.append(name)
            if isinstance(item, h5py.Dataset) and item.maxshape[:1] == (None,):
                rows[name] = len(item)

        self._file.visititems(look)
        return {"frames": self._frames, "clock": self._clock, "names": names, "rows": rows}

    def _return_to(self, mark: dict[str, Any]) -> None:
        present: list[str] = []
        self._file.visit(present.append)
        for name in sorted(set(present) - set(mark["names"])):
            # Gone already with the group that held it?
            if name in self._file:
                del self._file[name]
        for name, count in mark["rows"].items():
            self._file[name].resize(count, axis=0)
        self._frames, self._clock = mark["frames"], mark["clock"]
        root = self._file
        root["VTKHDF/Steps"].attrs["NSteps"] = self._frames
        root.attrs["status"] = text("running")
        root.attrs["message"] = text("")
        root.attrs["resumed"] = root.attrs["resumed"] + 1

    # What is written once

    def _write_head(self, accuracy: str) -> None:
        root, scene = self._file, self._simulation.scene
        root.attrs["format"] = text("sandboil results")
        root.attrs["format_version"] = FORMAT_VERSION
        root.attrs["sandboil_version"] = text(importlib.metadata.version("sandboil"))
        root.attrs["core_version"] = text(_core.__version__)
        root.attrs["revision"] = text(_core.__revision__)
        root.attrs["h5py_version"] = text(h5py.__version__)
        root.attrs["numpy_version"] = text(np.__version__)
        root.attrs["accuracy"] = text(accuracy)
        root.attrs["status"] = text("running")
        root.attrs["message"] = text("")
        root.attrs["resumed"] = 0
        machine = root.create_group("machine")
        machine.attrs["threads"] = self._simulation.threads
        for name, value in (
            ("system", platform.platform()),
            ("processor", _processor()),
            ("python_version", platform.python_version()),
        ):
            machine.attrs[name] = text(value)
        machine.attrs["processors"] = os.cpu_count() or 0
        root.attrs["fingerprints"] = text(json.dumps(self._simulation.fingerprints))
        _lines_of_text(root, "scene", [scene.to_toml(resolved=True)])
        for name, motion in zip(scene.stage_names, self._simulation.motions, strict=True):
            if motion is not None:
                unit = "g" if motion.quantity == "acceleration_g" else "m/s"
                dataset = _array(
                    root, f"motions/{name}/{motion.quantity}", getattr(motion, motion.quantity), unit
                )
                dataset.attrs["dt_s"] = motion.dt
                dataset.attrs["kind"] = text(motion.kind)

    def _write_nodes(self) -> None:
        particles, probes = self._simulation.particles, self._simulation.probes
        nodes = self._file.create_group("nodes")
        _array(nodes, "position", particles.position, "m")
        _array(nodes, "region", particles.region, "1")
        _array(nodes, "volume", particles.volume, "m3 per m")
        _array(nodes, "surface_elevation", particles.surface_elevation, "m")
        _array(nodes, "sigma_v_eff0", particles.sigma_v_eff0, "kPa")
        _array(nodes, "pore_pressure0", particles.pore_pressure0, "kPa")
        nodes.attrs["spacing_m"] = particles.spacing

        position = np.array([(probe.x, probe.y) for probe in probes])
        sigma_v_eff0, pore_pressure0 = particles.stress_at(position)
        group = self._file.create_group("probes")
        _lines_of_text(group, "label", [probe.label for probe in probes])
        _array(group, "position", position, "m")
        _array(group, "sigma_v_eff0", sigma_v_eff0, "kPa")
        _array(group, "pore_pressure0", pore_pressure0, "kPa")

    def _begin_vtk(self) -> None:
        nodes = len(self._simulation.particles.position)
        vtk = self._file.create_group("VTKHDF")
        vtk.attrs["Version"] = np.array(VTKHDF_VERSION, dtype=np.int64)
        # VTK reads the type as a fixed-length string only.
        vtk.attrs["Type"] = np.bytes_("PolyData")
        _array(vtk, "NumberOfPoints", np.array([nodes]), "1")
        # Places stand in the file in x, y, z: VTK knows no plane.
        _growing(vtk, "Points", (nodes, 3), "m")
        for kind in _CELL_KINDS:
            count = nodes if kind == "Vertices" else 0
            cells = vtk.create_group(kind)
            _array(cells, "NumberOfCells", np.array([count]), "1")
            _array(cells, "NumberOfConnectivityIds", np.array([count]), "1")
            _array(cells, "Connectivity", np.arange(count), "1")
            _array(cells, "Offsets", np.arange(count + 1), "1")
        steps = vtk.create_group("Steps")
        steps.attrs["NSteps"] = 0
        _growing(steps, "Values", (_ROWS_PER_CHUNK,), "s")
        for name, value in (("PartOffsets", 0), ("NumberOfParts", 1), ("PointOffsets", 0)):
            _growing(steps, name, (_ROWS_PER_CHUNK,), "1", np.int64, value)
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            _growing(steps, name, (_ROWS_PER_CHUNK, len(_CELL_KINDS)), "1", np.int64)
        data, offsets = vtk.create_group("PointData"), steps.create_group("PointDataOffsets")
        # Written once, read by every frame: its offset stays zero.
        data["region"] = self._file["nodes/region"]
        _growing(offsets, "region", (_ROWS_PER_CHUNK,), "1", np.int64)
        for name in written_fields(self._simulation.scene):
            shape = (nodes, 3) if name in VECTOR_FIELDS else (nodes,)
            dataset = _growing(data, name, shape, FIELDS[name].unit)
            dataset.attrs["description"] = text(FIELDS[name].description)
            _growing(offsets, name, (_ROWS_PER_CHUNK,), "1", np.int64)

    def _begin_frames(self) -> None:
        frames = self._file.create_group("frames")
        for name, unit in (("time", "s"), ("time_step", "s"), ("wall_time", "s")):
            _growing(frames, name, (_ROWS_PER_CHUNK,), unit)
        for name in ("stage", "step"):
            _growing(frames, name, (_ROWS_PER_CHUNK,), "1", np.int64)
        _growing(
            frames, "time_step_limit", (_ROWS_PER_CHUNK,), "1", h5py.string_dtype("utf-8", _LONGEST_LIMIT)
        )

    # What grows

    def begin_stage(self) -> None:
        """Take note of the stage that the simulation has just begun."""
        simulation = self._simulation
        stage = self._file.create_group(f"stages/{simulation.stage}")
        if simulation.stage == "gravity" and simulation.scene.seepage is not None:
            self._follow_seepage()
        stage.attrs["flow_scheme"] = text(simulation.flow_scheme)
        stage.attrs["duration_s"] = np.nan if simulation.duration is None else simulation.duration
        if simulation.base_impedance is not None:
            stage.attrs["base_impedance_kPa_s_per_m"] = simulation.base_impedance
        for name, size in simulation.arrays().items():
            stage.attrs[f"bytes_{name}"] = size
        self.commit()

    def _follow_seepage(self) -> None:
        """Write the state at rest anew: the water that a seepage stage has left."""
        particles = self._simulation.particles
        at_probes = particles.stress_at(self._file["probes/position"][:])
        for place, values in (
            ("nodes/sigma_v_eff0", particles.sigma_v_eff0),
            ("nodes/pore_pressure0", particles.pore_pressure0),
            ("probes/sigma_v_eff0", at_probes[0]),
            ("probes/pore_pressure0", at_probes[1]),
        ):
            _replace(self._file, place, values, "kPa")

    def end_stage(self) -> None:
        """Make the time of the frames to come count on from the end of the present stage."""
        if self._simulation.duration is not None:
            self._clock += self._simulation.time

    def write(self, wall_time: float, *, frame: bool = True) -> None:
        """Append a frame (unless `frame` is false) and the histories since the last one.

        They are committed if the last commit is some seconds ago. `wall_time` (s) is the stage's so far.
        """
        simulation = self._simulation
        # Water that flows before the grains may move has other fields than they: its end is their beginning.
        if frame and simulation.field_names == written_fields(simulation.scene):
            self._append_frame(wall_time)
        self._append_histories()
        self._append_energy()
        for kept in simulation.scene.output.envelopes:
            values = simulation.envelope(kept)
            if values is not None:
                _replace(self._file, f"envelopes/{simulation.stage}/{kept}", values, FIELDS[kept].unit)
        stage = self._file[f"stages/{simulation.stage}"]
        stage.attrs["steps"] = simulation.steps
        stage.attrs["time_s"] = simulation.time
        stage.attrs["wall_time_s"] = wall_time
        for name, count in simulation.counters().items():
            stage.attrs[f"count_{name}"] = count
        if simulation.stage == "seepage":
            self._replace_seepage()
        if time.monotonic() - self._committed_at >= _COMMIT_INTERVAL:
            self.commit()

    def _replace_seepage(self) -> None:
        """Write where the water of a seepage stage is, and what came through its conditions."""
        simulation = self._simulation
        for name, values in simulation.fields(list(SEEPAGE_FIELDS)).items():
            _replace(self._file, f"seepage/{name}", values, FIELDS[name].unit)
        discharge = np.array([inflow for _, inflow in simulation.discharge])
        _replace(self._file, "seepage/discharge", discharge, "m3/s per m")
        if (balance := simulation.water_balance) is not None:
            _replace(self._file, "seepage/inflow", np.array(balance[0]), "m3 per m")
            self._file["seepage"].attrs["stored_m3_per_m"] = balance[1]

    def _append_frame(self, wall_time: float) -> None:
        simulation = self._simulation
        vtk, frames = self._file["VTKHDF"], self._file["frames"]
        steps = vtk["Steps"]
        first = self._frames * len(simulation.particles.position)
        fields = simulation.fields(written_fields(simulation.scene))
        position = simulation.particles.position + fields.get("displacement", 0.0)
        _append(vtk["Points"], _with_depth(position))
        for name, values in fields.items():
            _append(vtk["PointData"][name], _with_depth(values) if values.ndim == 2 else values)
            _append(steps["PointDataOffsets"][name], [first])
        _append(steps["PointDataOffsets/region"], [0])
        _append(steps["PointOffsets"], [first])
        for name, value in (("PartOffsets", 0), ("NumberOfParts", 1)):
            _append(steps[name], [value])
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            _append(steps[name], np.zeros((1, len(_CELL_KINDS)), dtype=np.int64))
        is_static = simulation.duration is None
        _append(steps["Values"], [self._clock if is_static else self._clock + simulation.time])
        _append(frames["stage"], [simulation.scene.stage_names.index(simulation.stage)])
        _append(frames["time"], [simulation.time])
        _append(frames["step"], [simulation.steps])
        _append(frames["time_step"], [simulation.dt])
        _append(frames["time_step_limit"], [simulation.dt_limit])
        _append(frames["wall_time"], [wall_time])
        self._frames += 1
        steps.attrs["NSteps"] = self._frames

    def _append_histories(self) -> None:
        time, histories = self._simulation.take_histories()
        if not histories:
            return
        place = f"histories/{self._simulation.stage}"
        if place not in self._file:
            group = self._file.create_group(place)
            _growing(group, "time", (_ROWS_PER_CHUNK,), "s")
            for name, values in histories.items():
                _growing(group, name, (_ROWS_PER_CHUNK, values.shape[1]), HISTORIES[name].unit)
        _append(self._file[place]["time"], time)
        for name, values in histories.items():
            _append(self._file[place][name], values)

    def _append_energy(self) -> None:
        time, energy = self._simulation.take_energy()
        if not energy:
            return
        place = f"energy/{self._simulation.stage}"
        if place not in self._file:
            group = self._file.create_group(place)
            _growing(group, "time", (_ROWS_PER_CHUNK,), "s")
            for name in energy:
                dataset = _growing(group, name, (_ROWS_PER_CHUNK,), ENERGY[name].unit)
                dataset.attrs["description"] = ENERGY[name].description
        for name, values in {"time": time, **energy}.items():
            _append(self._file[place][name], values)

    def close(self, status: Status, message: str = "") -> None:
        """Say how the run ended, commit and close the file."""
        self._file.attrs["status"] = text(status)
        self._file.attrs["message"] = text(message)
        self.commit()
        self.abandon()

    def abandon(self) -> None:
        """Close the file as it was last committed, if it is open."""
        self._file.close()
        self._disk.close()


def _processor() -> str:
    """Name of the processor, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")


def holds(path: Path, mark: dict[str, Any]) -> bool:
    """Whether a results file can be read and reaches the mark of :meth:`Writer.mark`."""
    try:
        with h5py.File(path, "r") as file:
            return all(name in file for name in mark["names"]) and all(
                len(file[name]) >= count for name, count in mark["rows"].items()
            )
    except OSError:
        return False


def repair(path: Path) -> None:
    """Put the twin of a results file in its place if it cannot be read and the twin can, and tell."""
    nothing: dict[str, Any] = {"names": [], "rows": {}}
    twin = twin_of(path)
    if not holds(path, nothing) and holds(twin, nothing):
        warnings.warn(
            f"{path} cannot be read; its second copy is taken, which may be some frames shorter",
            ResumeWarning,
            stacklevel=3,
        )
        twin.replace(path)


def _array(group: h5py.Group, name: str, values: npt.ArrayLike, unit: str) -> h5py.Dataset:
    # Nothing has no sum.
    dataset = group.create_dataset(name, data=values, fletcher32=np.size(values) > 0)
    dataset.attrs["units"] = text(unit)
    return dataset


def _lines_of_text(group: h5py.Group, name: str, lines: list[str]) -> None:
    dataset = group.create_dataset(name, data=np.stack([text(line) for line in lines]), fletcher32=True)
    dataset.attrs["units"] = text("1")


def _growing(
    group: h5py.Group, name: str, chunk: tuple[int, ...], unit: str, dtype: Any = np.float64, fill: int = 0
) -> h5py.Dataset:
    """An empty dataset that grows along its first axis by whole chunks on disk."""
    dataset = group.create_dataset(
        name,
        shape=(0, *chunk[1:]),
        maxshape=(None, *chunk[1:]),
        chunks=chunk,
        dtype=dtype,
        shuffle=True,
        compression="gzip",
        compression_opts=_DEFLATE,
        fletcher32=True,
    )
    dataset.attrs["units"] = text(unit)
    return dataset


def _append(dataset: h5py.Dataset, rows: npt.ArrayLike) -> None:
    count = len(np.asarray(rows))
    dataset.resize(len(dataset) + count, axis=0)
    if count:
        dataset[-count:] = rows


def _replace(group: h5py.Group, name: str, values: Floats, unit: str) -> None:
    if name in group:
        group[name][...] = values
    else:
        _array(group, name, values, unit)


def _with_depth(vectors: Floats) -> Floats:
    """(n, 2) vectors with a third component 0, as VTK wants them."""
    return np.column_stack([vectors, np.zeros(len(vectors))])


# Reading


@dataclass(frozen=True)
class History:
    """A quantity over time.

    Attributes
    ----------
    name, unit, label : what it is, its unit, and where it was taken
    time : (m,) s, 0 at the beginning of the stage
    values : (m,)
    """

    name: str
    unit: str
    label: str
    time: Floats
    values: Floats


@dataclass(frozen=True)
class Profile:
    """A field along the column of nodes nearest to x, from the surface down.

    Attributes
    ----------
    name, unit : what it is
    time : of the frame, s
    x : initial place of the column, m
    depth : (m,) initial depth below the surface, m
    values : (m,), or (m, 2) for vectors
    """

    name: str
    unit: str
    time: float
    x: float
    depth: Floats
    values: Floats


@dataclass(frozen=True)
class Surface:
    """The ground surface at one time, from the uppermost node of every column.

    Attributes
    ----------
    time : of the frame, s
    x, y : (m,) present place of the surface, m
    displacement : (m, 2) since the scene was made, m
    """

    time: float
    x: Floats
    y: Floats
    displacement: Floats


class Run:
    """Results of a run, complete or not, read from its folder as they are asked for.

    Times count from the beginning of a stage; `stage` chooses it, by default the last one begun.

    Attributes
    ----------
    path : the results file
    scene : as it was computed, with every default written out
    status : "complete", "interrupted", "stopped" (by itself; see `message`), or "running" (also if killed)
    message : why the run ended early, else empty
    resumed : how often the run was gone on with after it had ended early
    fingerprints : what tells the scene from others, see :attr:`Simulation.fingerprints`
    accuracy : the preset asked for
    versions : of what wrote the file
    revision : of the sources in git, with "+changes" if they had some; empty of a build outside a checkout
    machine : what computed the run first: `threads`, `system`, `processor`, `processors`, `python_version`
    probes : points of the histories
    position : (n, 2) initial places of the nodes, m
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.path = Path(folder) / FILE_NAME
        if not self.path.is_file():
            raise InvalidInput(
                "folder", os.fspath(folder), f"must hold a {FILE_NAME}", "made by sandboil run"
            )
        with self._open() as file:
            refuse_foreign(file, "results")
            version = file.attrs.get("format_version")
            version = None if version is None else int(version)
            if version != FORMAT_VERSION:
                raise InvalidInput(
                    f"{self.path}.format_version",
                    version,
                    f"must be {FORMAT_VERSION}, the layout of this version of sandboil",
                    "read it with the sandboil that wrote it, or run the scene anew",
                )
            self.scene = Scene.from_toml(file["scene"].asstr()[0])
            self.status = cast(Status, said(file.attrs["status"]))
            self.message = said(file.attrs["message"])
            self.resumed = int(file.attrs["resumed"])
            self.fingerprints: dict[str, str] = json.loads(said(file.attrs["fingerprints"]))
            self.accuracy = said(file.attrs["accuracy"])
            self.versions = {
                name: said(file.attrs[f"{name}_version"]) for name in ("sandboil", "core", "h5py", "numpy")
            }
            self.revision = said(file.attrs.get("revision", ""))
            machine = file["machine"].attrs if "machine" in file else {}
            self.machine: dict[str, Any] = {
                name: int(value) if name.startswith(("threads", "processors")) else said(value)
                for name, value in machine.items()
            }
            labels, places = file["probes/label"].asstr()[:], file["probes/position"][:]
            self.probes = [Probe(label, *place) for label, place in zip(labels, places.tolist(), strict=True)]
            self.position: Floats = file["nodes/position"][:]
            self._depth: Floats = file["nodes/surface_elevation"][:] - self.position[:, 1]
            self._spacing: Floats = file["nodes"].attrs["spacing_m"]
            self._sigma_v_eff0: Floats = file["probes/sigma_v_eff0"][:]
            self._pore_pressure0: Floats = file["probes/pore_pressure0"][:]
            begun = set(file.get("stages", ()))
            self.stages = [name for name in self.scene.stage_names if name in begun]
            self._frame_stage = file["frames/stage"][:]
            self._frame_time: Floats = file["frames/time"][:]

    @contextmanager
    def _open(self) -> Iterator[h5py.File]:
        with opened(self.path, "results") as file:
            yield file

    def _stage(self, stage: str | None) -> str:
        if not self.stages:
            raise SandboilError(f"{self.path}: the run ended before its first stage began")
        if stage is None:
            return self.stages[-1]
        if stage not in self.stages:
            raise unknown_name("stage", stage, self.stages)
        return stage

    # Histories

    @property
    def history_names(self) -> list[str]:
        """Names that :meth:`history` knows in this run; stresses and strains need `output.stress_paths`."""
        spared = set() if self.scene.water is not None else set(WATER_FIELDS)
        spared |= set() if self.scene.output.stress_paths else set(STRESS_HISTORIES)
        return [name for name in HISTORIES if name not in spared]

    def history(
        self,
        name: str,
        *,
        at: tuple[float, float] | None = None,
        depth: float | None = None,
        stage: str | None = None,
        unit: str | None = None,
    ) -> History:
        """A quantity over time at a point of the histories.

        Parameters
        ----------
        name : one of `history_names`
        at : initial place (x, y) of the point, m
        depth : or its depth below the surface in the mid column, m; default the surface
        unit : "g" for an acceleration in g, default the unit of `HISTORIES`

        Raises
        ------
        InvalidInput : unknown name, a point without histories, a unit that does not fit
        """
        stage = self._stage(stage)
        if name not in self.history_names:
            raise unknown_name("history", name, self.history_names)
        place = self._probe(at, depth)
        probe = self.probes[place]
        with self._open() as file:
            group = file.get(f"histories/{stage}")
            if group is None:
                raise InvalidInput("stage", stage, "must be a shaking stage: only they have histories")
            time, values = group["time"][:], group[_STORED_AS.get(name, name)][:, place]
        if name == "pore_pressure":
            values = self._pore_pressure0[place] + values
        elif name in ("r_u", "r_u_stress"):
            ratio = pore_pressure_ratio(values, np.full_like(values, self._sigma_v_eff0[place]))
            values = ratio if name == "r_u" else 1.0 - ratio
        own = HISTORIES[name].unit
        if unit is not None and unit != own:
            if unit != "g" or own != "m/s2":
                allowed = f"must be {own!r}" + (" or 'g'" if own == "m/s2" else "")
                raise InvalidInput("unit", unit, allowed)
            values = values / STANDARD_GRAVITY
        return History(name, unit or own, probe.label, time, values)

    def _probe(self, at: tuple[float, float] | None, depth: float | None) -> int:
        if at is not None and depth is not None:
            raise InvalidInput("history(at, depth)", (at, depth), "takes one of the two")
        if at is None:
            surface = self.probes[0]
            at = (surface.x, surface.y - (0.0 if depth is None else depth))
        for place, probe in enumerate(self.probes):
            if max(abs(probe.x - at[0]), abs(probe.y - at[1])) <= COORDINATE_TOLERANCE:
                return place
        known = ", ".join(f"{probe.label} at ({probe.x:g}, {probe.y:g})" for probe in self.probes)
        raise InvalidInput(
            "at" if depth is None else "depth",
            at if depth is None else depth,
            f"must be a point of the histories: {known}",
            "name it in output.depths or output.points and run again",
        )

    def energy(self, stage: str | None = None) -> dict[str, Floats]:
        """Energy (kJ/m) and mass (Mg/m) of the section over a stage of shaking: `time` (s) and by name.

        ::

            kinetic + stress + water + damping + local_damping
                = kinetic at the beginning + constant_forces + base + sides + renewal

        `sandboil.simulation.ENERGY` tells what each is. `damping` is what the forces of the skeleton take
        beyond the work of its stress: without velocity filter and Rayleigh damping it is the error of the
        balance. With corrected inertia it holds what that stores, with printed operators what they lose.
        """
        stage = self._stage(stage)
        with self._open() as file:
            group = file.get(f"energy/{stage}")
            if group is None:
                raise InvalidInput("stage", stage, "must be a shaking stage: only they have energies")
            return {name: group[name][:] for name in ("time", *ENERGY)}

    def motion(self, stage: str | None = None) -> Motion | None:
        """The motion that shook the stage; None if it had none."""
        with self._open() as file:
            group = file.get(f"motions/{self._stage(stage)}")
            if group is None:
                return None
            ((quantity, samples),) = group.items()
            given: dict[str, Any] = {quantity: samples[:]}
            return Motion(
                dt=float(samples.attrs["dt_s"]), kind=cast(Kind, said(samples.attrs["kind"])), **given
            )

    def spectrum(
        self,
        *,
        at: tuple[float, float] | None = None,
        depth: float | None = None,
        stage: str | None = None,
        damping: float = 0.05,
        periods: npt.ArrayLike | None = None,
    ) -> ResponseSpectrum:
        """Pseudo-acceleration spectrum of the horizontal acceleration at a point, default the surface.

        See :func:`sandboil.response_spectrum` for `damping` (fraction) and `periods` (s).
        """
        history = self.history("acceleration_x", at=at, depth=depth, stage=stage, unit="g")
        return response_spectrum(history.values, interval_of(history), periods, damping)

    # Fields

    @property
    def field_names(self) -> list[str]:
        """Names that :meth:`field` knows in this run."""
        return written_fields(self.scene)

    @property
    def times(self) -> Floats:
        """(frames,) times of the fields of the last stage begun, s."""
        return self.frame_times()

    def frame_times(self, stage: str | None = None) -> Floats:
        """(frames,) times of the fields of a stage, s."""
        return self._frame_time[self._frames_of(self._stage(stage))]

    def field(self, name: str, time: Time = "last", *, stage: str | None = None) -> Floats:
        """A field at the nodes, (n,) or (n, 2), in the frame nearest to `time` (s).

        Raises :class:`InvalidInput` for an unknown name and for a time outside the run.
        """
        if name not in self.field_names:
            raise unknown_name("field", name, self.field_names)
        values: Floats = self._fields(name, [self._frame(time, self._stage(stage))])[0]
        return values

    def field_series(self, name: str, *, stage: str | None = None) -> Floats:
        """A field in every frame of a stage, (frames, n) or (frames, n, 2)."""
        if name not in self.field_names:
            raise unknown_name("field", name, self.field_names)
        return self._fields(name, list(self._frames_of(self._stage(stage))))

    def _fields(self, name: str, frames: list[int]) -> Floats:
        nodes = len(self.position)
        with self._open() as file:
            data = file["VTKHDF/PointData"][name]
            pages = [data[frame * nodes : (frame + 1) * nodes] for frame in frames]
        return np.stack([page[:, :2] if page.ndim == 2 else page for page in pages])

    def _frames_of(self, stage: str) -> npt.NDArray[np.intp]:
        frames = np.flatnonzero(self._frame_stage == self.scene.stage_names.index(stage))
        if not len(frames):
            raise InvalidInput(
                "stage", stage, "holds no field of its own", "its end is the beginning of the next stage"
            )
        return frames

    def _frame(self, time: Time, stage: str) -> int:
        frames = self._frames_of(stage)
        if time == "last":
            return int(frames[-1])
        times = self._frame_time[frames]
        if isinstance(time, str) or not times[0] <= time <= times[-1] + self.scene.output.field_dt:
            raise InvalidInput("time", time, f"must be 'last' or lie in [{times[0]:g}, {times[-1]:g}] s")
        return int(frames[np.argmin(np.abs(times - time))])

    def profile(
        self, name: str, time: Time = "last", *, x: float | None = None, stage: str | None = None
    ) -> Profile:
        """A field over depth in the column of nodes nearest to `x` (m), default the middle of the section."""
        values = self.field(name, time, stage=stage)
        column = self.column(x)
        return Profile(
            name=name,
            unit=FIELDS[name].unit,
            time=float(self._frame_time[self._frame(time, self._stage(stage))]),
            x=float(self.position[column[0], 0]),
            depth=self._depth[column],
            values=values[column],
        )

    def column(self, x: float | None = None) -> npt.NDArray[np.intp]:
        """Nodes of the column nearest to `x` (m, default the middle of the section), surface first."""
        x0, _, x1, _ = self.scene.bounds
        wanted = 0.5 * (x0 + x1) if x is None else x
        if not x0 <= wanted <= x1:
            raise InvalidInput("x", x, f"must lie in the section, [{x0:g}, {x1:g}] m")
        across = self.position[:, 0]
        nearest = across[np.argmin(np.abs(across - wanted))]
        column = np.flatnonzero(np.abs(across - nearest) < COORDINATE_TOLERANCE)
        return column[np.argsort(self._depth[column])]

    def envelope(self, name: str, *, stage: str | None = None) -> Floats:
        """Largest value of "r_u" or "gamma_max" over all steps of a stage, (n,)."""
        stage = self._stage(stage)
        with self._open() as file:
            group = file.get(f"envelopes/{stage}", {})
            if name not in group:
                known = ", ".join(group) or "none"
                raise InvalidInput(
                    "envelope", name, f"must be one that was kept: {known}", "see output.envelopes"
                )
            values: Floats = group[name][:]
        return values

    @cached_property
    def _surface_nodes(self) -> npt.NDArray[np.intp]:
        """The uppermost node of every column, from left to right."""
        order = np.lexsort((self._depth, self.position[:, 0]))
        _, first = np.unique(np.round(self.position[order, 0] / self._spacing[0], 3), return_index=True)
        top: npt.NDArray[np.intp] = order[first]
        return top

    def settlement(self, x: float | None = None, *, stage: str | None = None) -> History:
        """Settlement of the surface since the stage began, m, positive downwards, in every frame.

        Of the uppermost node in the column nearest to `x` (m), default the middle of the section.
        """
        top = self.column(x)[0]
        fall = -self.field_series("displacement", stage=stage)[:, top, 1]
        label = f"surface at x = {self.position[top, 0]:g} m"
        return History("settlement", "m", label, self.frame_times(stage), fall - fall[0])

    def surface(self, time: Time = "last", *, stage: str | None = None) -> Surface:
        """The displaced ground surface in the frame nearest to `time` (s)."""
        top = self._surface_nodes
        displacement = self.field("displacement", time, stage=stage)[top]
        x, y = (self.position[top] + displacement).T
        when = float(self._frame_time[self._frame(time, self._stage(stage))])
        return Surface(time=when, x=x, y=y + self._depth[top], displacement=displacement)

    # Seepage

    @property
    def discharge(self) -> list[tuple[str, float]]:
        """Kind of each seepage condition and inflow through it at the stage's end, m3/s per m.

        Negative where water leaves; empty without a seepage stage.
        """
        with self._open() as file:
            if "seepage" not in file or self.scene.seepage is None:
                return []
            kinds = [condition.kind for condition in self.scene.seepage.conditions]
            return list(zip(kinds, file["seepage/discharge"][:].tolist(), strict=True))

    @property
    def water_balance(self) -> tuple[list[float], float] | None:
        """Inflow through each condition in all the seepage stage, and gain of stored water, m3 per m.

        None without a seepage stage of some duration: a steady state stores nothing.
        """
        with self._open() as file:
            if "seepage/inflow" not in file:
                return None
            seepage = file["seepage"]
            return seepage["inflow"][:].tolist(), float(seepage.attrs["stored_m3_per_m"])

    def seepage_field(self, name: str) -> Floats:
        """ "pore_pressure" (kPa), "head" (m) or "saturation" where the seepage stage ended, (n,).

        Raises :class:`InvalidInput` for another name and in a run without such a stage.
        """
        if name not in SEEPAGE_FIELDS:
            raise unknown_name("seepage_field", name, list(SEEPAGE_FIELDS))
        with self._open() as file:
            if "seepage" not in file:
                raise InvalidInput(
                    "seepage_field", name, f"must be of a run with a seepage stage, not {self.stages}"
                )
            values: Floats = file[f"seepage/{name}"][:]
        return values

    # Summing up

    def summary(self) -> Summary:
        """What an engineer asks first, as a dict that prints as text."""
        return _summary(self)

    def accounts(self, stage: str | None = None) -> dict[str, Any]:
        """Steps, wall time (s), counters and the like of a stage, as stored with it."""
        with self._open() as file:
            accounts = file[f"stages/{self._stage(stage)}"].attrs
            return {
                name: said(value) if isinstance(value, bytes) else value for name, value in accounts.items()
            }

    def time_steps(self, stage: str | None = None) -> tuple[Floats, list[str]]:
        """Time step (frames,) in s, and what limits it, in every frame of a stage."""
        frames = self._frames_of(self._stage(stage))
        with self._open() as file:
            limits = file["frames/time_step_limit"].asstr()[:]
            return file["frames/time_step"][:][frames], [limits[frame] for frame in frames]

    def to_csv(self, path: str | os.PathLike[str], *, stage: str | None = None) -> None:
        """Write every history of a stage to one CSV: time_s, then name_unit of every point.

        Raises :class:`InvalidInput` if the file cannot be written.
        """
        stage = self._stage(stage)
        columns: dict[str, Floats] = {}
        for probe in self.probes:
            for name in self.history_names:
                history = self.history(name, at=(probe.x, probe.y), stage=stage)
                columns.setdefault("time_s", history.time)
                columns[f"{name} ({history.unit}) {probe.label}"] = history.values
        try:
            with Path(path).open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(columns)
                writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
        except OSError as error:
            raise InvalidInput("path", os.fspath(path), f"cannot be written: {error.strerror}") from error


def load(folder: str | os.PathLike[str]) -> Run:
    """Results of the run in `folder`; :class:`InvalidInput` if there are none that can be read."""
    return Run(folder)


def interval_of(history: History) -> float:
    """Spacing of a history, s."""
    if len(history.time) < 2:
        raise InvalidInput("history", history.name, "must hold at least two samples: the run ended too early")
    return float(history.time[-1] - history.time[0]) / (len(history.time) - 1)


class Summary(dict[str, Any]):
    """Key figures of a run by name; as text, one line for each."""

    def __str__(self) -> str:
        return "\n".join(_lines(self))


def _lines(figures: dict[str, Any], indent: str = "") -> Iterator[str]:
    """`name  value` for every figure, parts indented below their name."""
    plain = [name for name, value in figures.items() if not isinstance(value, dict)]
    width = max((len(name) for name in plain), default=0)
    for name, value in figures.items():
        if isinstance(value, dict):
            yield f"{indent}{name}"
            yield from _lines(value, indent + "  ")
        else:
            yield (
                f"{indent}{name:{width}}  {value:.4g}"
                if isinstance(value, float)
                else (f"{indent}{name:{width}}  {value}")
            )


def _summary(run: Run) -> Summary:
    figures = Summary(status=run.status, accuracy=run.accuracy)
    if run.resumed:
        figures["resumed, times"] = run.resumed
    if run.message:
        figures["message"] = run.message
    for stage in run.stages:
        figures[stage] = _stage_figures(run, stage)
    if run.scene.water is not None:
        coefficients = pore_pressure_coefficients(run.scene)
        figures["pore pressure coefficient B"] = {
            name: described_coefficient(value) for name, value in coefficients.items()
        }
    return figures


def _stage_figures(run: Run, stage: str) -> dict[str, Any]:
    accounts = run.accounts(stage)
    figures: dict[str, Any] = {
        "time, s": float(accounts.get("time_s", 0.0)),
        "steps": int(accounts.get("steps", 0)),
        "wall time, s": float(accounts.get("wall_time_s", 0.0)),
    }
    if run.scene.stage_names.index(stage) in run._frame_stage:
        dt, limits = run.time_steps(stage)
        if dt.max() > 0.0:
            figures["time step, s"] = f"{dt.min():.4g} to {dt.max():.4g}"
            figures["time step limited by"] = ", ".join(dict.fromkeys(limits))
    figures["pore pressure diffusion"] = str(accounts["flow_scheme"])
    with run._open() as file:
        shaken = f"histories/{stage}/time" in file and len(file[f"histories/{stage}/time"]) > 1
    if shaken:
        figures |= _response_figures(run, stage)
    if stage == "seepage":
        figures |= _water_figures(run)
    figures["counts"] = {
        name.removeprefix("count_"): int(count)
        for name, count in accounts.items()
        if name.startswith("count_")
    }
    return figures


def _water_figures(run: Run) -> dict[str, Any]:
    numbered = [f"{i} {kind}" for i, (kind, _) in enumerate(run.discharge)]
    inflows = [inflow for _, inflow in run.discharge]
    figures: dict[str, Any] = {"inflow by condition, m3/s per m": dict(zip(numbered, inflows, strict=True))}
    if (balance := run.water_balance) is not None:
        totals = dict(zip(numbered, balance[0], strict=True))
        figures["water in all by condition, m3 per m"] = totals
        figures["gain of stored water, m3 per m"] = balance[1]
    return figures


def _response_figures(run: Run, stage: str) -> dict[str, Any]:
    surface = run.history("acceleration_x", stage=stage, unit="g")
    dt = interval_of(surface)
    figures: dict[str, Any] = {"peak surface acceleration, g": float(np.abs(surface.values).max())}
    if 0.5 / dt > PGA_CORNER:
        smooth = butterworth(surface.values, dt, None, PGA_CORNER, PGA_ORDER)
        figures[f"the same below {PGA_CORNER:g} Hz, g"] = float(np.abs(smooth).max())
    motion = run.motion(stage)
    if motion is not None:
        figures[f"peak of the {motion.kind} motion, g"] = motion.pga_g
    figures["final settlement of the surface, m"] = float(run.settlement(stage=stage).values[-1])
    if run.scene.water is not None:
        figures["largest r_u"] = {
            probe.label: float(run.history("r_u", at=(probe.x, probe.y), stage=stage).values.max())
            for place, probe in enumerate(run.probes)
            if run._sigma_v_eff0[place] > 0.0
        }
    return figures
