"""Writing the results file of a run as it goes."""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import time
import warnings
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np

from .. import _core
from .._errors import ResumeWarning
from ..core.quantities import ENERGY, FIELDS, HISTORIES, SEEPAGE_FIELDS, written_fields
from ..core.simulation import Simulation
from ..files.committed_file import CommittedFile, twin_of
from ..files.hdf5 import LAYOUT, text
from . import vtk
from .datasets import ROWS_PER_CHUNK, append, create, create_growing, create_texts, replace
from .layout import (
    DESCRIPTION,
    FORMAT,
    FORMAT_VERSION,
    SCENE,
    Energy,
    Envelopes,
    Frames,
    Histories,
    Machine,
    Motions,
    Nodes,
    Probes,
    Root,
    Seepage,
    Stage,
)

# Longest name of what limits a time step, bytes.
_LONGEST_LIMIT = 64

# Least wall time between commits of frames, s: each waits for the disk, some hundredths of a second.
_COMMIT_INTERVAL = 5.0

Status = Literal["running", "complete", "interrupted", "stopped"]


class Writer:
    """Writes a run into a file as it goes. The file on disk is whole at every moment, also after a kill.

    Parameters
    ----------
    path : of the file
    simulation : that is run
    accuracy : the preset asked for, of a new file
    mark : what :meth:`mark` returned when the state was stored from which the run continues: everything after
        it is removed; None: a new file

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
            self._write_root(accuracy)
            self._write_machine()
            self._write_scene()
            self._write_nodes()
            self._write_probes()
            vtk.begin(self._file, len(simulation.particles.position), written_fields(simulation.scene))
            self._begin_frames()
        else:
            self._return_to(mark)
        try:
            self.commit()
        except OSError:
            self.abandon()
            raise

    # Committing

    def commit(self) -> None:
        """Make the disk hold what has been written."""
        self._file.flush()
        self._disk.commit()
        self._committed_at = time.monotonic()

    def mark(self) -> dict[str, Any]:
        """Commit, and return how far the file has come: to be stored beside the simulation's state."""
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
            # It may have gone with the group that held it.
            if name in self._file:
                del self._file[name]
        for name, count in mark["rows"].items():
            self._file[name].resize(count, axis=0)
        self._frames, self._clock = mark["frames"], mark["clock"]
        vtk.set_frames(self._file, self._frames)
        self._set_status("running", "")
        self._file.attrs[Root.RESUMED] = self._file.attrs[Root.RESUMED] + 1

    def close(self, status: Status, message: str = "") -> None:
        """Write how the run ended, commit and close the file."""
        self._set_status(status, message)
        self.commit()
        self.abandon()

    def abandon(self) -> None:
        """Close the file as it was last committed, if it is open."""
        self._file.close()
        self._disk.close()

    def _set_status(self, status: Status, message: str) -> None:
        self._file.attrs[Root.STATUS] = text(status)
        self._file.attrs[Root.MESSAGE] = text(message)

    # Written once

    def _write_root(self, accuracy: str) -> None:
        attributes = self._file.attrs
        attributes[Root.FORMAT] = text(FORMAT)
        attributes[Root.FORMAT_VERSION] = FORMAT_VERSION
        versions = (
            importlib.metadata.version("sandboil"),
            _core.__version__,
            h5py.__version__,
            np.__version__,
        )
        for name, version in zip(Root.VERSIONED, versions, strict=True):
            attributes[Root.version(name)] = text(version)
        attributes[Root.REVISION] = text(_core.__revision__)
        attributes[Root.ACCURACY] = text(accuracy)
        attributes[Root.FINGERPRINTS] = text(json.dumps(self._simulation.fingerprints))
        attributes[Root.RESUMED] = 0
        self._set_status("running", "")

    def _write_machine(self) -> None:
        attributes = self._file.create_group(Machine.GROUP).attrs
        attributes[Machine.THREADS] = self._simulation.threads
        attributes[Machine.PROCESSORS] = os.cpu_count() or 0
        attributes[Machine.SYSTEM] = text(platform.platform())
        attributes[Machine.PROCESSOR] = text(_processor())
        attributes[Machine.PYTHON_VERSION] = text(platform.python_version())

    def _write_scene(self) -> None:
        scene = self._simulation.scene
        create_texts(self._file, SCENE, [scene.to_toml(resolved=True)])
        for stage, motion in zip(scene.stage_names, self._simulation.motions, strict=True):
            if motion is not None:
                samples = getattr(motion, motion.quantity)
                dataset = create(self._file, Motions.samples(stage, motion.quantity), samples)
                dataset.attrs[Motions.DT] = motion.dt
                dataset.attrs[Motions.KIND] = text(motion.kind)

    def _write_nodes(self) -> None:
        particles = self._simulation.particles
        for place, values in (
            (Nodes.POSITION, particles.position),
            (Nodes.REGION, particles.region),
            (Nodes.VOLUME, particles.volume),
            (Nodes.SURFACE_ELEVATION, particles.surface_elevation),
            (Nodes.SIGMA_V_EFF0, particles.sigma_v_eff0),
            (Nodes.PORE_PRESSURE0, particles.pore_pressure0),
        ):
            create(self._file, place, values)
        self._file[Nodes.GROUP].attrs[Nodes.SPACING] = particles.spacing

    def _write_probes(self) -> None:
        probes = self._simulation.probes
        position = np.array([(probe.x, probe.y) for probe in probes])
        sigma_v_eff0, pore_pressure0 = self._simulation.particles.stress_at(position)
        create_texts(self._file, Probes.LABEL, [probe.label for probe in probes])
        create(self._file, Probes.POSITION, position)
        create(self._file, Probes.SIGMA_V_EFF0, sigma_v_eff0)
        create(self._file, Probes.PORE_PRESSURE0, pore_pressure0)

    def _begin_frames(self) -> None:
        for place in (Frames.TIME, Frames.TIME_STEP, Frames.WALL_TIME):
            create_growing(self._file, place)
        for place in (Frames.STAGE, Frames.STEP):
            create_growing(self._file, place, dtype=np.int64)
        create_growing(self._file, Frames.TIME_STEP_LIMIT, dtype=h5py.string_dtype("utf-8", _LONGEST_LIMIT))

    # Stages

    def begin_stage(self) -> None:
        """Write down the stage that the simulation has just begun."""
        simulation = self._simulation
        attributes = self._file.create_group(Stage.path(simulation.stage)).attrs
        if simulation.follows_seepage:
            self._replace_rest()
        attributes[Stage.FLOW_SCHEME] = text(simulation.flow_scheme)
        attributes[Stage.DURATION] = np.nan if simulation.duration is None else simulation.duration
        if simulation.base_impedance is not None:
            attributes[Stage.BASE_IMPEDANCE] = simulation.base_impedance
        for name, size in simulation.arrays().items():
            attributes[Stage.BYTES + name] = size
        self.commit()

    def _replace_rest(self) -> None:
        """Replace the state at rest by that with the water of the seepage stage."""
        particles = self._simulation.particles
        sigma_v_eff0, pore_pressure0 = particles.stress_at(self._file[Probes.POSITION.path][:])
        replace(self._file, Nodes.SIGMA_V_EFF0, particles.sigma_v_eff0)
        replace(self._file, Nodes.PORE_PRESSURE0, particles.pore_pressure0)
        replace(self._file, Probes.SIGMA_V_EFF0, sigma_v_eff0)
        replace(self._file, Probes.PORE_PRESSURE0, pore_pressure0)

    def end_stage(self) -> None:
        """Let the time of later frames count from the end of the present stage."""
        if self._simulation.duration is not None:
            self._clock += self._simulation.time

    def write(self, wall_time: float, *, frame: bool = True) -> None:
        """Append a frame (unless `frame` is false) and the histories since the last one.

        They are committed if the last commit is some seconds ago. `wall_time` (s) is the stage's so far.
        """
        simulation = self._simulation
        # A seepage stage before others has fields that these lack: its end is their beginning.
        if frame and simulation.field_names == written_fields(simulation.scene):
            self._append_frame(wall_time)
        self._append_histories()
        self._append_energy()
        for kept in simulation.scene.output.envelopes:
            values = simulation.envelope(kept)
            if values is not None:
                replace(self._file, Envelopes.of(simulation.stage, kept, FIELDS[kept].unit), values)
        attributes = self._file[Stage.path(simulation.stage)].attrs
        attributes[Stage.STEPS] = simulation.steps
        attributes[Stage.TIME] = simulation.time
        attributes[Stage.WALL_TIME] = wall_time
        for name, count in simulation.counters().items():
            attributes[Stage.COUNT + name] = count
        if simulation.is_seeping:
            self._replace_seepage()
        if time.monotonic() - self._committed_at >= _COMMIT_INTERVAL:
            self.commit()

    def _replace_seepage(self) -> None:
        """Write where the water of a seepage stage is, and the flow through its conditions."""
        simulation = self._simulation
        for name, values in simulation.fields(list(SEEPAGE_FIELDS)).items():
            replace(self._file, Seepage.field(name, FIELDS[name].unit), values)
        discharge = np.array([inflow for _, inflow in simulation.discharge])
        replace(self._file, Seepage.DISCHARGE, discharge)
        if (balance := simulation.water_balance) is not None:
            replace(self._file, Seepage.INFLOW, np.array(balance[0]))
            self._file[Seepage.GROUP].attrs[Seepage.STORED] = balance[1]

    def _append_frame(self, wall_time: float) -> None:
        simulation, file = self._simulation, self._file
        fields = simulation.fields(written_fields(simulation.scene))
        position = simulation.particles.position + fields.get("displacement", 0.0)
        is_timed = simulation.duration is not None
        vtk.append_frame(
            file, self._frames, self._clock + (simulation.time if is_timed else 0.0), position, fields
        )
        append(file, Frames.STAGE, [simulation.scene.stage_names.index(simulation.stage)])
        append(file, Frames.TIME, [simulation.time])
        append(file, Frames.STEP, [simulation.steps])
        append(file, Frames.TIME_STEP, [simulation.dt])
        append(file, Frames.TIME_STEP_LIMIT, [simulation.dt_limit])
        append(file, Frames.WALL_TIME, [wall_time])
        self._frames += 1

    def _append_histories(self) -> None:
        stage = self._simulation.stage
        times, histories = self._simulation.take_histories()
        if not histories:
            return
        places = {name: Histories.of(stage, name, HISTORIES[name].unit) for name in histories}
        if Histories.group(stage) not in self._file:
            create_growing(self._file, Histories.time(stage))
            for name, values in histories.items():
                create_growing(self._file, places[name], (ROWS_PER_CHUNK, values.shape[1]))
        append(self._file, Histories.time(stage), times)
        for name, values in histories.items():
            append(self._file, places[name], values)

    def _append_energy(self) -> None:
        stage = self._simulation.stage
        times, energy = self._simulation.take_energy()
        if not energy:
            return
        places = {name: Energy.of(stage, name, ENERGY[name].unit) for name in energy}
        if Energy.group(stage) not in self._file:
            create_growing(self._file, Energy.time(stage))
            for name, place in places.items():
                create_growing(self._file, place).attrs[DESCRIPTION] = ENERGY[name].description
        append(self._file, Energy.time(stage), times)
        for name, values in energy.items():
            append(self._file, places[name], values)


def _processor() -> str:
    """Name of the processor; empty where the system does not give it."""
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
    """Replace a results file that cannot be read by its twin if that can be read, and warn."""
    nothing: dict[str, Any] = {"names": [], "rows": {}}
    twin = twin_of(path)
    if not holds(path, nothing) and holds(twin, nothing):
        warnings.warn(
            f"{path} cannot be read; its second copy is used, which may be some frames shorter",
            ResumeWarning,
            stacklevel=3,
        )
        twin.replace(path)
