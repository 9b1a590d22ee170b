"""Values that are allowed but improbable in their unit, and the unit that was probably meant."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, sqrt
from typing import TYPE_CHECKING, Any

from ..scene.phases import phases_of
from ..scene.region import Region
from ..scene.soils import PM4Sand

if TYPE_CHECKING:
    from ..scene.scene import Scene


@dataclass(frozen=True)
class Usual:
    """Range in which a quantity of soils and rocks usually lies.

    Attributes
    ----------
    low, high : the range
    unit : of the range and of the value
    others : further units in which the quantity is given, and their factor to `unit`
    """

    low: float
    high: float
    unit: str
    others: tuple[tuple[str, float], ...]

    def doubt(self, path: str, value: float) -> str | None:
        """Why a value is improbable; none inside the range."""
        if self.low <= value <= self.high:
            return None
        text = (
            f"{path} = {value:g} {self.unit} is outside the usual {self.low:g} to {self.high:g} {self.unit}"
        )
        for unit, factor in self.others:
            if self.low <= value * factor <= self.high:
                return f"{text}; was {unit} meant? {value:g} {unit} is {value * factor:.4g} {self.unit}"
        return text


GRAVITY = 9.81
# From peat and pumice to heavy rock.
UNIT_WEIGHT = Usual(8.0, 35.0, "kN/m3", (("Mg/m3", GRAVITY), ("kg/m3", GRAVITY / 1e3), ("N/m3", 1e-3)))
DENSITY = Usual(0.8, 3.5, "Mg/m3", (("kg/m3", 1e-3), ("kN/m3", 1.0 / GRAVITY)))
# From intact clay to open gravel (Terzaghi, Peck & Mesri 1996).
CONDUCTIVITY = Usual(1e-14, 1.0, "m/s", (("cm/s", 1e-2), ("m/day", 1.0 / 86400.0)))
ROCK_SPEED = Usual(60.0, 5000.0, "m/s", (("km/s", 1e3),))
# Water with much air to none.
WATER_MODULUS = Usual(1e2, 1e7, "kPa", (("GPa", 1e6), ("MPa", 1e3), ("Pa", 1e-3)))
WATER_WEIGHT = Usual(5.0, 15.0, "kN/m3", (("Mg/m3", GRAVITY), ("kg/m3", GRAVITY / 1e3), ("N/m3", 1e-3)))
STRENGTH = Usual(0.0, 2e4, "kPa", (("Pa", 1e-3),))
# G0 of PM4Sand is a shear modulus over the atmospheric pressure: some 300 to 1100 from loose to dense sand
# (Boulanger & Ziotopoulou 2017).
MODULUS_COEFFICIENT = Usual(50.0, 4000.0, "p_atm", (("kPa", 1e-2), ("MPa", 10.0)))
# Shear wave speeds of soil that a unit of its moduli implies: soft mud to sound rock.
LEAST_SPEED, LARGEST_SPEED = 8.0, 5000.0
# A friction angle below this was probably given in radians.
LEAST_ANGLE = 1.0


def improbable(scene: Scene) -> list[str]:
    """Doubts about the units of a scene's soils, water and bases."""
    found: list[str | None] = []
    for i, region in enumerate(scene.regions):
        found += _of_region(f"scene.regions[{i}]", region, scene)
    if scene.water is not None:
        found.append(WATER_MODULUS.doubt("scene.water.bulk_modulus", scene.water.bulk_modulus))
        found.append(WATER_WEIGHT.doubt("scene.water.unit_weight", scene.water.unit_weight))
    for i, stage in scene.shakings:
        base = stage.base
        for name, usual in (("density", DENSITY), ("Vs", ROCK_SPEED), ("Vp", ROCK_SPEED)):
            value = getattr(base, name)
            if value is not None:
                found.append(usual.doubt(f"scene.stages[{i}].base.{name}", value))
    return [doubt for doubt in found if doubt is not None]


def _of_region(path: str, region: Region, scene: Scene) -> list[str | None]:
    found = []
    for name in ("dry_unit_weight", "bulk_unit_weight", "saturated_unit_weight"):
        value = getattr(region, name)
        if value is not None:
            found.append(UNIT_WEIGHT.doubt(f"{path}.{name}", value))
    # Zero is undrained.
    if region.conductivity.major > 0.0:
        found.append(CONDUCTIVITY.doubt(f"{path}.hydraulic_conductivity", region.conductivity.major))
    material = region.material
    for name in ("c", "Su"):
        value = getattr(material, name, None)
        if value is not None:
            found.append(STRENGTH.doubt(f"{path}.material.{name}", value))
    found.append(_of_angle(f"{path}.material.phi", material))
    if isinstance(material, PM4Sand):
        found.append(MODULUS_COEFFICIENT.doubt(f"{path}.material.G0", material.G0))
    else:
        found.append(_of_moduli(f"{path}.material", region, scene))
    return found


def _of_angle(path: str, material: Any) -> str | None:
    phi = getattr(material, "phi", None)
    if phi is None or phi == 0.0 or phi >= LEAST_ANGLE:
        return None
    meant = f"{phi:g} rad is {degrees(phi):.1f} degrees"
    return f"{path} = {phi:g} degrees is hardly any friction; were radians meant? {meant}"


def _of_moduli(path: str, region: Region, scene: Scene) -> str | None:
    """Doubts about the shear wave speed that moduli in kPa imply."""
    material: Any = region.material
    shear = material.G if material.G is not None else material.E / (2.0 * (1.0 + material.nu))
    name = "G" if material.G is not None else "E"
    density = phases_of(region, scene.gravity, scene.water).dry_density
    # An improbable density has its own doubt.
    speed = sqrt(shear / min(max(density, DENSITY.low), DENSITY.high))
    if LEAST_SPEED <= speed <= LARGEST_SPEED:
        return None
    text = (
        f"{path}.{name} = {getattr(material, name):g} kPa gives a shear wave speed of {speed:.3g} m/s, "
        f"outside the usual {LEAST_SPEED:g} to {LARGEST_SPEED:g} m/s"
    )
    unit = "MPa" if speed < LEAST_SPEED else "Pa"
    return f"{text}; was {unit} meant?"
