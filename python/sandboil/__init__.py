"""Simulation of saturated ground in earthquakes.

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
from .core.simulation import Simulation
from .ground.discretise import Discretisation, discretise
from .motion import Motion, ResponseSpectrum, response_spectrum
from .results.reader import Run, load
from .results.records import History, Profile, Surface
from .results.summary import Summary
from .run.plan import Plan
from .run.run import run
from .scene.conditions import Drain, Flux, Head, Pressure, Rain, Reservoir, SeepageFace
from .scene.edges import BaseSegment, CompliantBase, Fixed, FreeField, Periodic, Roller, Sides
from .scene.motion_spec import MotionSpec
from .scene.numerics import Numerics
from .scene.output import Output
from .scene.region import Region
from .scene.scene import Scene
from .scene.shapes import Box, Polygon, box, polygon
from .scene.soils import DruckerPrager, Elastic, MohrCoulomb, PM4Sand, PressureElastic, TotalStress
from .scene.stages import Gravity, Rayleigh, RunOut, Seepage, Shaking
from .scene.water import Conductivity, VanGenuchten, Water, WaterTable
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
