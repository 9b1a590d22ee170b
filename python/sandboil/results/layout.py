"""Layout of `results.h5`, the file that a run leaves: one HDF5 file that ParaView opens as it stands.

The format version is in the root attributes; every dataset has a `units` attribute.

    /VTKHDF           temporal PolyData, version 2: one vertex per node, the fields of every frame
    /frames           stage, stage time, step, time step and wall time of every frame
    /nodes            initial place, region and geostatic state of the nodes
    /probes           points of the histories
    /histories/STAGE  time (m,) and every channel (m, probes)
    /energy/STAGE     time (m,), energy and work by kind, and mass of each phase (m,)
    /envelopes/STAGE  largest values over all steps, (nodes,)
    /motions/STAGE    the motion that shook the stage
    /stages/STAGE     attributes: steps, wall time, counters
    /machine          attributes: the machine that computed the run first
    /seepage          of a seepage stage: its last fields, discharge and inflow of every condition
    /scene            the scene as TOML with every default written out

During a run a second copy `.results.h5.twin` lies beside it: one is written while the other can be read. The
root attributes hold how the run ended and how often it was resumed.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

FILE_NAME = "results.h5"
FORMAT = "sandboil results"
# Raised when a reader of the old layout would misunderstand the new one.
FORMAT_VERSION = 1

# Attributes of datasets.
UNITS, DESCRIPTION = "units", "description"


class Dataset(NamedTuple):
    """Where a dataset stands, and its unit."""

    path: str
    unit: str


class Root:
    """Attributes of the file."""

    FORMAT = "format"
    FORMAT_VERSION = "format_version"
    REVISION = "revision"
    ACCURACY = "accuracy"
    STATUS = "status"
    MESSAGE = "message"
    RESUMED = "resumed"
    FINGERPRINTS = "fingerprints"
    # Names of what has a version, in the order of :attr:`Run.versions`.
    VERSIONED = ("sandboil", "core", "h5py", "numpy")

    @staticmethod
    def version(name: str) -> str:
        """Attribute with the version of a part."""
        return f"{name}_version"


SCENE = Dataset("scene", "1")


class Machine:
    """Attributes of the machine."""

    GROUP = "machine"
    THREADS = "threads"
    PROCESSORS = "processors"
    SYSTEM = "system"
    PROCESSOR = "processor"
    PYTHON_VERSION = "python_version"
    # Those that are numbers; the others are texts.
    NUMBERS = (THREADS, PROCESSORS)


class Nodes:
    """Datasets of the nodes, and an attribute."""

    GROUP = "nodes"
    POSITION = Dataset("nodes/position", "m")
    REGION = Dataset("nodes/region", "1")
    VOLUME = Dataset("nodes/volume", "m3 per m")
    SURFACE_ELEVATION = Dataset("nodes/surface_elevation", "m")
    SIGMA_V_EFF0 = Dataset("nodes/sigma_v_eff0", "kPa")
    PORE_PRESSURE0 = Dataset("nodes/pore_pressure0", "kPa")
    SPACING = "spacing_m"


class Probes:
    """Datasets of the points of the histories."""

    LABEL = Dataset("probes/label", "1")
    POSITION = Dataset("probes/position", "m")
    SIGMA_V_EFF0 = Dataset("probes/sigma_v_eff0", "kPa")
    PORE_PRESSURE0 = Dataset("probes/pore_pressure0", "kPa")


class Frames:
    """Datasets with a row for every frame."""

    STAGE = Dataset("frames/stage", "1")
    TIME = Dataset("frames/time", "s")
    STEP = Dataset("frames/step", "1")
    TIME_STEP = Dataset("frames/time_step", "s")
    TIME_STEP_LIMIT = Dataset("frames/time_step_limit", "1")
    WALL_TIME = Dataset("frames/wall_time", "s")


class Stage:
    """Attributes of a stage."""

    GROUP = "stages"
    FLOW_SCHEME = "flow_scheme"
    DURATION = "duration_s"
    BASE_IMPEDANCE = "base_impedance_kPa_s_per_m"
    STEPS = "steps"
    TIME = "time_s"
    WALL_TIME = "wall_time_s"
    # Before the names of counters, and of the core's arrays.
    COUNT = "count_"
    BYTES = "bytes_"

    @staticmethod
    def path(stage: str) -> str:
        return f"{Stage.GROUP}/{stage}"


class Motions:
    """The motion of a stage, and attributes of it. The dataset has the name of the motion's quantity."""

    DT = "dt_s"
    KIND = "kind"
    UNITS: ClassVar[dict[str, str]] = {"acceleration_g": "g", "velocity": "m/s"}

    @staticmethod
    def group(stage: str) -> str:
        return f"motions/{stage}"

    @staticmethod
    def samples(stage: str, quantity: str) -> Dataset:
        return Dataset(f"{Motions.group(stage)}/{quantity}", Motions.UNITS[quantity])


class Histories:
    """Histories of a stage: the time, and datasets by the names of the quantities."""

    @staticmethod
    def group(stage: str) -> str:
        return f"histories/{stage}"

    @staticmethod
    def time(stage: str) -> Dataset:
        return Dataset(f"{Histories.group(stage)}/time", "s")

    @staticmethod
    def of(stage: str, name: str, unit: str = "1") -> Dataset:
        return Dataset(f"{Histories.group(stage)}/{name}", unit)


class Energy:
    """Energies and masses of a stage: the time, and datasets by the names of the quantities."""

    @staticmethod
    def group(stage: str) -> str:
        return f"energy/{stage}"

    @staticmethod
    def time(stage: str) -> Dataset:
        return Dataset(f"{Energy.group(stage)}/time", "s")

    @staticmethod
    def of(stage: str, name: str, unit: str = "1") -> Dataset:
        return Dataset(f"{Energy.group(stage)}/{name}", unit)


class Envelopes:
    """Envelopes of a stage by the names of the fields."""

    @staticmethod
    def group(stage: str) -> str:
        return f"envelopes/{stage}"

    @staticmethod
    def of(stage: str, name: str, unit: str = "1") -> Dataset:
        return Dataset(f"{Envelopes.group(stage)}/{name}", unit)


class Seepage:
    """Water at the end of a seepage stage: fields by their names, and the flow at each condition."""

    GROUP = "seepage"
    DISCHARGE = Dataset("seepage/discharge", "m3/s per m")
    INFLOW = Dataset("seepage/inflow", "m3 per m")
    STORED = "stored_m3_per_m"

    @staticmethod
    def field(name: str, unit: str = "1") -> Dataset:
        return Dataset(f"{Seepage.GROUP}/{name}", unit)


class Vtk:
    """The part that VTK reads, in VTK's names. Its places have x, y and z, since VTK has no plane data."""

    GROUP = "VTKHDF"
    VERSION, TYPE = "Version", "Type"
    # Of the layout that is written, and the type of data in it.
    LAYOUT_VERSION = (2, 0)
    POLY_DATA = "PolyData"

    NUMBER_OF_POINTS = Dataset("VTKHDF/NumberOfPoints", "1")
    POINTS = Dataset("VTKHDF/Points", "m")

    # Kinds of cells that a PolyData may have, in VTK's order, and the one that nodes are.
    CELL_KINDS = ("Vertices", "Lines", "Polygons", "Strips")
    VERTICES = "Vertices"
    # Datasets of each kind.
    NUMBER_OF_CELLS = "NumberOfCells"
    NUMBER_OF_CONNECTIVITY_IDS = "NumberOfConnectivityIds"
    CONNECTIVITY = "Connectivity"
    OFFSETS = "Offsets"

    STEPS = "VTKHDF/Steps"
    NUMBER_OF_STEPS = "NSteps"
    TIMES = Dataset("VTKHDF/Steps/Values", "s")
    PART_OFFSETS = Dataset("VTKHDF/Steps/PartOffsets", "1")
    NUMBER_OF_PARTS = Dataset("VTKHDF/Steps/NumberOfParts", "1")
    POINT_OFFSETS = Dataset("VTKHDF/Steps/PointOffsets", "1")
    # One column for each kind of cells.
    CELL_OFFSETS = Dataset("VTKHDF/Steps/CellOffsets", "1")
    CONNECTIVITY_OFFSETS = Dataset("VTKHDF/Steps/ConnectivityIdOffsets", "1")

    REGION = "region"

    @staticmethod
    def cells(kind: str, name: str) -> Dataset:
        """A dataset of the cells of a kind."""
        return Dataset(f"{Vtk.GROUP}/{kind}/{name}", "1")

    @staticmethod
    def data(name: str, unit: str = "1") -> Dataset:
        """A field of all frames, one after the other."""
        return Dataset(f"{Vtk.GROUP}/PointData/{name}", unit)

    @staticmethod
    def data_offsets(name: str) -> Dataset:
        """The first row of each frame in a field."""
        return Dataset(f"{Vtk.STEPS}/PointDataOffsets/{name}", "1")
