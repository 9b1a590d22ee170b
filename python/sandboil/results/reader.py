"""Reading the results of a run."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, cast

import h5py
import numpy as np
import numpy.typing as npt

from .._errors import InvalidInput, SandboilError, unknown_name
from .._types import COORDINATE_TOLERANCE, Floats
from ..core.probes import Probe
from ..core.quantities import (
    ENERGY,
    FIELDS,
    HISTORIES,
    SEEPAGE_FIELDS,
    STRESS_HISTORIES,
    WATER_FIELDS,
    pore_pressure_ratio,
    written_fields,
)
from ..files.hdf5 import opened, refuse_foreign, text_of
from ..motion import Kind, Motion, ResponseSpectrum, response_spectrum
from ..motion._series import STANDARD_GRAVITY
from ..scene.scene import Scene
from .layout import (
    FILE_NAME,
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
    Vtk,
)
from .records import History, Profile, Surface, interval_of
from .summary import Summary, summary_of
from .writer import Status

# Histories that follow from a stored one and the geostatic state.
_STORED_AS = {
    "r_u": "excess_pore_pressure",
    "pore_pressure": "excess_pore_pressure",
    "r_u_stress": "sigma_v_eff",
}

Time = float | Literal["last"]


class Run:
    """Results of a run, complete or not, read from its folder as they are asked for.

    Times count from the beginning of a stage; `stage` chooses it, by default the last one begun.

    Attributes
    ----------
    path : the results file
    scene : as it was computed, with every default written out
    status : "complete", "interrupted", "stopped" (by itself; see `message`), or "running" (also if killed)
    message : why the run ended early, else empty
    resumed : how often the run was resumed
    fingerprints : identify the scene, see :attr:`Simulation.fingerprints`
    accuracy : the preset asked for
    versions : of what wrote the file
    revision : of the sources in git, with "+changes" if they had some; empty of a build outside a checkout
    machine : on which the run was begun: `threads`, `system`, `processor`, `processors`, `python_version`
    probes : points of the histories
    position : (n, 2) initial places of the nodes, m
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.path = Path(folder) / FILE_NAME
        if not self.path.is_file():
            raise InvalidInput(
                "folder", os.fspath(folder), f"must contain a {FILE_NAME}", "give the folder of a run"
            )
        with self._open() as file:
            refuse_foreign(file, "results")
            self._refuse_other_version(file)
            attributes = file.attrs
            self.scene = Scene.from_toml(file[SCENE.path].asstr()[0])
            self.status = cast(Status, text_of(attributes[Root.STATUS]))
            self.message = text_of(attributes[Root.MESSAGE])
            self.resumed = int(attributes[Root.RESUMED])
            self.fingerprints: dict[str, str] = json.loads(text_of(attributes[Root.FINGERPRINTS]))
            self.accuracy = text_of(attributes[Root.ACCURACY])
            self.versions = {name: text_of(attributes[Root.version(name)]) for name in Root.VERSIONED}
            self.revision = text_of(attributes.get(Root.REVISION, ""))
            self.machine = _machine(file)
            labels, places = file[Probes.LABEL.path].asstr()[:], file[Probes.POSITION.path][:]
            self.probes = [Probe(label, *place) for label, place in zip(labels, places.tolist(), strict=True)]
            self.position: Floats = file[Nodes.POSITION.path][:]
            self._depth: Floats = file[Nodes.SURFACE_ELEVATION.path][:] - self.position[:, 1]
            self._spacing: Floats = file[Nodes.GROUP].attrs[Nodes.SPACING]
            self._sigma_v_eff0: Floats = file[Probes.SIGMA_V_EFF0.path][:]
            self._pore_pressure0: Floats = file[Probes.PORE_PRESSURE0.path][:]
            begun = set(file.get(Stage.GROUP, ()))
            self.stages = [name for name in self.scene.stage_names if name in begun]
            self._frame_stage = file[Frames.STAGE.path][:]
            self._frame_time: Floats = file[Frames.TIME.path][:]

    def _refuse_other_version(self, file: h5py.File) -> None:
        version = file.attrs.get(Root.FORMAT_VERSION)
        version = None if version is None else int(version)
        if version != FORMAT_VERSION:
            raise InvalidInput(
                f"{self.path}.{Root.FORMAT_VERSION}",
                version,
                f"must be {FORMAT_VERSION}, the layout of this version of sandboil",
                "read it with the sandboil that wrote it, or run the scene again",
            )

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
        """Names for :meth:`history` in this run; stresses and strains need `output.stress_paths`."""
        absent = set() if self.scene.water is not None else set(WATER_FIELDS)
        absent |= set() if self.scene.output.stress_paths else set(STRESS_HISTORIES)
        return [name for name in HISTORIES if name not in absent]

    def has_histories(self, stage: str) -> bool:
        """Whether a stage has at least two samples of histories."""
        with self._open() as file:
            time = file.get(Histories.time(stage).path)
            return time is not None and len(time) > 1

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
            group = file.get(Histories.group(stage))
            if group is None:
                raise InvalidInput("stage", stage, "must be a shaking stage: only they have histories")
            time = file[Histories.time(stage).path][:]
            values = file[Histories.of(stage, _STORED_AS.get(name, name)).path][:, place]
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
                = kinetic at the beginning + weight + still_water + reaction + renewal_force + load
                + base + sides + renewal

        `sandboil.core.quantities.ENERGY` describes each. `damping` is the work of the forces of the skeleton
        beyond that of its stress: without velocity filter and Rayleigh damping it is the error of the
        balance. It includes the energy stored by corrected inertia, and the losses of printed operators.
        """
        stage = self._stage(stage)
        with self._open() as file:
            group = file.get(Energy.group(stage))
            if group is None:
                raise InvalidInput("stage", stage, "must be a shaking stage: only they have energies")
            places = {"time": Energy.time(stage)} | {name: Energy.of(stage, name) for name in ENERGY}
            return {name: file[place.path][:] for name, place in places.items()}

    def motion(self, stage: str | None = None) -> Motion | None:
        """The motion that shook the stage; None if it had none."""
        with self._open() as file:
            group = file.get(Motions.group(self._stage(stage)))
            if group is None:
                return None
            ((quantity, samples),) = group.items()
            given: dict[str, Any] = {quantity: samples[:]}
            return Motion(
                dt=float(samples.attrs[Motions.DT]),
                kind=cast(Kind, text_of(samples.attrs[Motions.KIND])),
                **given,
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
        """Names for :meth:`field` in this run."""
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
            data = file[Vtk.data(name).path]
            pages = [data[frame * nodes : (frame + 1) * nodes] for frame in frames]
        return np.stack([page[:, :2] if page.ndim == 2 else page for page in pages])

    def _frames_of(self, stage: str) -> npt.NDArray[np.intp]:
        frames = np.flatnonzero(self._frame_stage == self.scene.stage_names.index(stage))
        if not len(frames):
            raise InvalidInput("stage", stage, "has no frames", "its end is the beginning of the next stage")
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
            group = file.get(Envelopes.group(stage), {})
            if name not in group:
                known = ", ".join(group) or "none"
                raise InvalidInput(
                    "envelope", name, f"must be one that was kept: {known}", "see output.envelopes"
                )
            values: Floats = file[Envelopes.of(stage, name).path][:]
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
            if Seepage.GROUP not in file or self.scene.seepage is None:
                return []
            kinds = [condition.kind for condition in self.scene.seepage.conditions]
            return list(zip(kinds, file[Seepage.DISCHARGE.path][:].tolist(), strict=True))

    @property
    def water_balance(self) -> tuple[list[float], float] | None:
        """Inflow through each condition over the whole seepage stage, and gain of stored water, m3 per m.

        None without a seepage stage of some duration: a steady state stores nothing.
        """
        with self._open() as file:
            if Seepage.INFLOW.path not in file:
                return None
            stored = float(file[Seepage.GROUP].attrs[Seepage.STORED])
            return file[Seepage.INFLOW.path][:].tolist(), stored

    def seepage_field(self, name: str) -> Floats:
        """ "pore_pressure" (kPa), "head" (m) or "saturation" where the seepage stage ended, (n,).

        Raises :class:`InvalidInput` for another name and in a run without such a stage.
        """
        if name not in SEEPAGE_FIELDS:
            raise unknown_name("seepage_field", name, list(SEEPAGE_FIELDS))
        with self._open() as file:
            if Seepage.GROUP not in file:
                raise InvalidInput(
                    "seepage_field", name, f"must be of a run with a seepage stage, not {self.stages}"
                )
            values: Floats = file[Seepage.field(name).path][:]
        return values

    # Summing up

    def summary(self) -> Summary:
        """Key figures as a dict that prints as text."""
        return summary_of(self)

    def accounts(self, stage: str | None = None) -> dict[str, Any]:
        """Steps, wall time (s) and counters of a stage, as stored with it."""
        with self._open() as file:
            accounts = file[Stage.path(self._stage(stage))].attrs
            return {
                name: text_of(value) if isinstance(value, bytes) else value
                for name, value in accounts.items()
            }

    def time_steps(self, stage: str | None = None) -> tuple[Floats, list[str]]:
        """Time step (frames,) in s, and what limits it, in every frame of a stage."""
        frames = self._frames_of(self._stage(stage))
        with self._open() as file:
            limits = file[Frames.TIME_STEP_LIMIT.path].asstr()[:]
            return file[Frames.TIME_STEP.path][:][frames], [limits[frame] for frame in frames]

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


def _machine(file: h5py.File) -> dict[str, Any]:
    """The attributes of the machine; none of a file without them."""
    attributes = file[Machine.GROUP].attrs if Machine.GROUP in file else {}
    return {
        name: int(value) if name in Machine.NUMBERS else text_of(value) for name, value in attributes.items()
    }
