"""Layers with strain-dependent stiffness and damping, given by the user or derived from a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator
from pydantic.config import JsonDict

from .. import _core, lab
from .._checked import checked
from .._errors import InvalidInput
from .._model import Model
from .._types import COORDINATE_TOLERANCE, Floats, Many, NonNegative, Number, Positive
from ..ground.discretise import discretise
from ..scene.edges import CompliantBase
from ..scene.soils import Elastic, Material, PressureElastic

if TYPE_CHECKING:
    from ..scene.scene import Scene

# Thickness of the layers that a profile is divided into, m: a fifth of the wavelength at 20 Hz in soil of
# 100 m/s.
DEFAULT_LAYER = 1.0
# Most layers of a profile: the waves of a long record in them fill about 2 GB.
MAX_LAYERS = 1000
# Upper limit of damping ratios: at 0.5, a wave decreases to a thirtieth within one wavelength.
DAMPING_LIMIT = 0.5

# Atmospheric pressure of Darendeli (2001), kPa.
_ATMOSPHERE = 101.325
# Default strains of a published curve, 1: the range of its tests, ten values per decade.
_STRAINS = tuple(np.logspace(-6.0, -2.0, 41).tolist())
# Number of cycles for the damping of a published curve: that of a moderate earthquake.
_CYCLES = 10.0

Damping = Annotated[Number, Field(ge=0.0, lt=DAMPING_LIMIT)]
CurveChoice = Literal["darendeli", "material"]

_IN_FRACTIONS: JsonDict = {"remedy": "it is a fraction: 5 % of critical is written 0.05"}


class ModulusCurve(Model):
    """Shear modulus and damping as functions of the strain amplitude.

    Values are interpolated linearly in the logarithm of strain, and constant outside the given strains.
    """

    _label: ClassVar[str] = "curve"

    strain: Many[Positive] = Field(min_length=1, description="engineering shear strain, 1, increasing")
    G_ratio: Many[Annotated[Number, Field(gt=0.0, le=1.0)]] = Field(
        min_length=1, description="secant shear modulus over that at small strain"
    )
    damping: Many[Damping] = Field(
        min_length=1,
        description=f"fraction of critical, in [0, {DAMPING_LIMIT:g})",
        json_schema_extra=_IN_FRACTIONS,
    )

    @model_validator(mode="after")
    def _one_table(self) -> ModulusCurve:
        if any(high <= low for low, high in zip(self.strain, self.strain[1:], strict=False)):
            raise InvalidInput("curve.strain", self.strain, "must be strictly increasing")
        for name in ("G_ratio", "damping"):
            values = getattr(self, name)
            if len(values) != len(self.strain):
                raise InvalidInput(
                    f"curve.{name}", values, f"must have one value per strain, {len(self.strain)}"
                )
        return self

    def at(self, strain: float) -> tuple[float, float]:
        """Modulus ratio and damping ratio at a strain amplitude, 1."""
        at = math.log(max(strain, self.strain[0]))
        strains = np.log(self.strain)
        return float(np.interp(at, strains, self.G_ratio)), float(np.interp(at, strains, self.damping))


@checked("site")
def darendeli(
    sigma_m: Positive,
    plasticity_index: NonNegative = 0.0,
    OCR: Annotated[Number, Field(ge=1.0)] = 1.0,
    *,
    strains: Many[Positive] = _STRAINS,
) -> ModulusCurve:
    """Mean modulus and damping curve of Darendeli (2001) for 10 cycles at 1 Hz.

    Parameters
    ----------
    sigma_m : mean effective stress, kPa
    plasticity_index : plasticity index, %
    OCR : overconsolidation ratio, 1
    strains : (n,) engineering shear strains of the curve, 1

    Raises
    ------
    InvalidInput : a value out of range, or a damping ratio above 0.5
    """
    atmospheres, percent = sigma_m / _ATMOSPHERE, 100.0 * np.array(strains)
    reference = (0.0352 + 0.0010 * plasticity_index * OCR**0.3246) * atmospheres**0.3483
    curvature = 0.9190
    ratio = 1.0 / (1.0 + (percent / reference) ** curvature)
    # Damping of Masing's loops, %, for a hyperbola with curvature 1; then the correction for the actual
    # curvature.
    logarithm = np.log((percent + reference) / reference)
    loop = 4.0 * (percent - reference * logarithm) * (percent + reference) / percent**2 - 2.0
    masing = 100.0 / math.pi * loop
    c1 = -1.1143 * curvature**2 + 1.8618 * curvature + 0.2523
    c2 = 0.0805 * curvature**2 - 0.0710 * curvature - 0.0095
    c3 = -0.0005 * curvature**2 + 0.0002 * curvature + 0.0003
    share = (0.6329 - 0.0057 * math.log(_CYCLES)) * ratio**0.1
    least = (0.8005 + 0.0129 * plasticity_index * OCR**-0.1069) * atmospheres**-0.2889
    damping = 0.01 * (least + share * (c1 * masing + c2 * masing**2 + c3 * masing**3))
    return ModulusCurve(strain=strains, G_ratio=ratio.tolist(), damping=damping.tolist())


def measured(soil: Material, sigma_v0: float, K0: float) -> ModulusCurve:
    """Modulus and damping curve of a soil model by :func:`sandboil.lab.modulus_reduction`.

    This takes a second or more. Damping ratios above the limit of equivalent-linear analysis, 0.5, are
    reduced to it.

    Parameters
    ----------
    soil : the soil model
    sigma_v0 : vertical effective stress, kPa, compression positive
    K0 : horizontal over vertical effective stress
    """
    test = lab.modulus_reduction(soil, sigma_v0=sigma_v0, K0=K0)
    damping = np.clip(test.damping, 0.0, math.nextafter(DAMPING_LIMIT, 0.0))
    return ModulusCurve(
        strain=test.gamma.tolist(), G_ratio=np.minimum(test.G_ratio, 1.0).tolist(), damping=damping.tolist()
    )


class SiteLayer(Model):
    """A level layer, with strain-dependent stiffness and damping by `curve`, or linear with `damping`."""

    _label: ClassVar[str] = "layer"
    _positional: ClassVar[tuple[str, ...]] = ("thickness", "unit_weight", "Vs")

    thickness: Positive = Field(description="m")
    unit_weight: Positive = Field(description="total unit weight of soil and water, kN/m3")
    Vs: Positive = Field(description="shear wave velocity at small strain, m/s")
    damping: Damping = Field(default=0.0, description="fraction of critical", json_schema_extra=_IN_FRACTIONS)
    curve: ModulusCurve | None = None

    if TYPE_CHECKING:

        def __init__(
            self,
            thickness: float,
            unit_weight: float,
            Vs: float,
            *,
            damping: float = 0.0,
            curve: ModulusCurve | None = None,
        ) -> None: ...

    @model_validator(mode="after")
    def _one_damping(self) -> SiteLayer:
        if self.curve is not None and self.damping > 0.0:
            raise InvalidInput(
                "layer.damping", self.damping, "must be left out with a curve, which contains the damping"
            )
        return self

    def at(self, strain: float) -> tuple[float, float]:
        """Modulus ratio and damping ratio at a strain amplitude, 1; strain 0 gives those at small strain."""
        return (1.0, self.damping) if self.curve is None else self.curve.at(strain)


class HalfSpace(Model):
    """Elastic half-space of rock or soil below the layers; a compliant base models the same half-space."""

    _label: ClassVar[str] = "half_space"
    _positional: ClassVar[tuple[str, ...]] = ("unit_weight", "Vs")

    unit_weight: Positive = Field(description="kN/m3")
    Vs: Positive = Field(description="shear wave velocity, m/s")

    if TYPE_CHECKING:

        def __init__(self, unit_weight: float, Vs: float) -> None: ...


class SiteProfile(Model):
    """Layers from the surface down, on a half-space; its default has the properties of the lowest layer."""

    _label: ClassVar[str] = "profile"
    _positional: ClassVar[tuple[str, ...]] = ("layers",)

    layers: Many[SiteLayer] = Field(
        min_length=1,
        max_length=MAX_LAYERS,
        description="from the surface down",
        json_schema_extra={"remedy": f"one to {MAX_LAYERS} layers, each a SiteLayer"},
    )
    half_space: HalfSpace | None = None

    if TYPE_CHECKING:

        def __init__(
            self,
            layers: Sequence[SiteLayer],
            *,
            half_space: HalfSpace | None = None,
        ) -> None: ...

    @property
    def base(self) -> HalfSpace:
        """The given half-space, or one with the properties of the lowest layer at small strain."""
        lowest = self.layers[-1]
        return self.half_space or HalfSpace(lowest.unit_weight, lowest.Vs)

    @property
    def depth(self) -> Floats:
        """Depth of the middle of each layer below the surface, m, (m,)."""
        thickness = np.array([layer.thickness for layer in self.layers])
        middles: Floats = np.cumsum(thickness) - 0.5 * thickness
        return middles

    @property
    def travel_time(self) -> float:
        """Travel time of a shear wave of small strain through all layers, s."""
        return sum(layer.thickness / layer.Vs for layer in self.layers)


def profile(scene: Scene, x: float | None, *, curves: CurveChoice, thickness: float) -> SiteProfile:
    """The column of a scene's particles nearest to `x` as a profile; see :meth:`Scene.profile`."""
    x0, _, x1, _ = scene.bounds
    place = 0.5 * (x0 + x1) if x is None else x
    if not x0 <= place <= x1:
        raise InvalidInput(
            "scene.profile.x",
            x,
            f"must lie in the section, [{x0:g}, {x1:g}] m",
            "leave it out for the middle of the section",
        )
    particles = discretise(scene)
    across, up = particles.position.T
    distance = np.abs(across - place)
    # Of two equally near columns, use the left one.
    nearest = across[distance <= distance.min() + COORDINATE_TOLERANCE].min()
    column = np.flatnonzero(np.abs(across - nearest) <= COORDINATE_TOLERANCE)
    column = column[np.argsort(-up[column])]
    dy = particles.spacing[1]

    layers = []
    borders = np.flatnonzero(np.diff(particles.region[column])) + 1
    for stratum in np.split(column, borders):
        region = int(particles.region[stratum[0]])
        for part in np.array_split(stratum, min(math.ceil(len(stratum) * dy / thickness), len(stratum))):
            sigma_v = float(particles.sigma_v_eff0[part].mean())
            unit_weight, Vs = _small_strain(scene, region, sigma_v)
            curve = _curve(scene, region, sigma_v, curves)
            layers.append(SiteLayer(len(part) * dy, unit_weight, Vs, curve=curve))

    base = scene.shakings[0][1].base if scene.shakings else CompliantBase()
    if base.Vs is not None and base.density is not None:
        half_space = HalfSpace(base.density * scene.gravity, base.Vs)
    else:
        lowest = column[-1]
        foot = np.array([[across[lowest], scene.outline.base_elevation(float(across[lowest]))]])
        sigma_v = float(particles.stress_at(foot)[0][0])
        half_space = HalfSpace(*_small_strain(scene, int(particles.region[lowest]), sigma_v))
    return SiteProfile(layers, half_space=half_space)


def _small_strain(scene: Scene, region: int, sigma_v: float) -> tuple[float, float]:
    """Unit weight, kN/m3, and Vs, m/s, of a region's soil at a vertical effective stress, kPa."""
    ground = scene.regions[region]
    phases = ground.resolved(scene)
    density = phases.dry_density if scene.water is None else phases.saturated_density
    lateral = ground.K0 * sigma_v
    shear, _ = _core.small_strain_moduli(ground.material.core(), (-lateral, -sigma_v, 0.0, -lateral))
    return density * scene.gravity, math.sqrt(shear / density)


def _curve(scene: Scene, region: int, sigma_v: float, curves: CurveChoice) -> ModulusCurve | None:
    """Curve of the soil of a region; None for a linear soil model."""
    ground = scene.regions[region]
    if isinstance(ground.material, Elastic | PressureElastic):
        return None
    if curves == "material":
        return measured(ground.material, sigma_v, ground.K0)
    return darendeli(sigma_v * (1.0 + 2.0 * ground.K0) / 3.0)
