"""What an earthquake does to saturated ground.

Stress-particle SPH with coupled pore water and PM4Sand. Units kN, m, s, Mg; x horizontal, y up; stresses and
pressures reported to people are positive in compression. Start with :class:`Scene` and :func:`run`.
"""

from . import lab
from ._core import __version__
from ._errors import (
    DamagedState,
    InvalidInput,
    ResumeWarning,
    RunInterrupted,
    SandboilError,
    SandboilWarning,
    SimulationDiverged,
    SuctionWarning,
)
from ._motion_spec import MotionSpec
from .boundaries import BaseSegment, CompliantBase, Fixed, FreeField, Periodic, Roller, Sides
from .discretise import Discretisation, discretise
from .hydraulics import (
    Conductivity,
    Drain,
    Flux,
    Head,
    Pressure,
    Rain,
    Reservoir,
    Seepage,
    SeepageFace,
    VanGenuchten,
)
from .materials import DruckerPrager, Elastic, MohrCoulomb, PM4Sand, PressureElastic, TotalStress
from .motion import Motion, ResponseSpectrum, response_spectrum
from .plan import Plan
from .results import History, Profile, Run, Summary, Surface, load
from .run import run
from .scene import (
    Box,
    Gravity,
    Numerics,
    Output,
    Polygon,
    Rayleigh,
    Region,
    RunOut,
    Scene,
    Shaking,
    Water,
    WaterTable,
    box,
    polygon,
)
from .simulation import Simulation
from .site import HalfSpace, ModulusCurve, SiteLayer, SiteProfile

__all__ = [
    "BaseSegment",
    "Box",
    "CompliantBase",
    "Conductivity",
    "DamagedState",
    "Discretisation",
    "Drain",
    "DruckerPrager",
    "Elastic",
    "Fixed",
    "Flux",
    "FreeField",
    "Gravity",
    "HalfSpace",
    "Head",
    "History",
    "InvalidInput",
    "ModulusCurve",
    "MohrCoulomb",
    "Motion",
    "MotionSpec",
    "Numerics",
    "Output",
    "PM4Sand",
    "Periodic",
    "Plan",
    "Polygon",
    "Pressure",
    "PressureElastic",
    "Profile",
    "Rain",
    "Rayleigh",
    "Region",
    "Reservoir",
    "ResponseSpectrum",
    "ResumeWarning",
    "Roller",
    "Run",
    "RunInterrupted",
    "RunOut",
    "SandboilError",
    "SandboilWarning",
    "Scene",
    "Seepage",
    "SeepageFace",
    "Shaking",
    "Sides",
    "Simulation",
    "SimulationDiverged",
    "SiteLayer",
    "SiteProfile",
    "SuctionWarning",
    "Summary",
    "Surface",
    "TotalStress",
    "VanGenuchten",
    "Water",
    "WaterTable",
    "__version__",
    "box",
    "discretise",
    "lab",
    "load",
    "polygon",
    "response_spectrum",
    "run",
]
