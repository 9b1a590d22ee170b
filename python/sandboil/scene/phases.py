"""Porosity and densities of a soil from those that are given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .._errors import InvalidInput
from .soils import PM4Sand
from .water import Water

if TYPE_CHECKING:
    from .region import Region

# Density of water where a scene without water gives Gs, Mg/m3: the scenes' usual 10 kN/m3 at 9.81 m/s2.
REFERENCE_WATER_DENSITY = 10.0 / 9.81

# Relative mismatch up to which densities given twice are the same: they have three to four digits.
DENSITY_TOLERANCE = 1.0e-3

_GIVEN = ("Gs", "porosity", "void_ratio", "dry_unit_weight", "bulk_unit_weight", "saturated_unit_weight")


@dataclass(frozen=True)
class SoilPhases:
    """How much solid and water a soil holds. Densities in Mg/m3, per volume of soil but for the solid's."""

    porosity: float
    void_ratio: float
    Gs: float
    solid_density: float
    dry_density: float
    saturated_density: float


@dataclass(frozen=True)
class _Densities:
    """The densities given, Mg/m3: of water, and of the soil dry and saturated where they are known."""

    water: float
    dry: float | None
    saturated: float | None


def phases_of(region: Region, gravity: float, water: Water | None) -> SoilPhases:
    """Porosity and densities of a region; :class:`InvalidInput` if those given are too few or contradict.

    `gravity` in m/s2; `water` is that of the scene.
    """
    given = _given_densities(region, gravity, water)
    n = _given_porosity(region)
    dry_alone = n is None and region.Gs is None and given.saturated is None
    if dry_alone and water is None and given.dry is not None:
        # Nothing flows through a dry soil, so the division of its volume into grains and pores is left out:
        # all of it counts as solid.
        return SoilPhases(0.0, 0.0, given.dry / given.water, given.dry, given.dry, given.dry)
    if n is None:
        n = _porosity(region, given, water)
    Gs = _specific_gravity(region, given, n, water)
    phases = SoilPhases(
        porosity=n,
        void_ratio=n / (1.0 - n),
        Gs=Gs,
        solid_density=Gs * given.water,
        dry_density=(1.0 - n) * Gs * given.water,
        saturated_density=((1.0 - n) * Gs + n) * given.water,
    )
    _agreed("dry_unit_weight", given.dry, phases.dry_density, gravity)
    _agreed("saturated_unit_weight", given.saturated, phases.saturated_density, gravity)
    return phases


def _given_densities(region: Region, gravity: float, water: Water | None) -> _Densities:
    """The unit weights as densities; the bulk one is saturated in a scene with water, else dry."""
    dry = None if region.dry_unit_weight is None else region.dry_unit_weight / gravity
    saturated = None if region.saturated_unit_weight is None else region.saturated_unit_weight / gravity
    if region.bulk_unit_weight is not None:
        bulk = region.bulk_unit_weight / gravity
        if water is None:
            dry = _agreed("bulk_unit_weight", bulk, dry, gravity)
        else:
            saturated = _agreed("bulk_unit_weight", bulk, saturated, gravity)
    return _Densities(
        REFERENCE_WATER_DENSITY if water is None else water.unit_weight / gravity, dry, saturated
    )


def _porosity(region: Region, given: _Densities, water: Water | None) -> float:
    """The porosity that two densities give."""
    Gs, rho_w, dry, saturated = region.Gs, given.water, given.dry, given.saturated
    if Gs is not None and dry is not None:
        n = 1.0 - dry / (Gs * rho_w)
    elif Gs is not None and saturated is not None:
        n = (Gs - saturated / rho_w) / (Gs - 1.0)
    elif dry is not None and saturated is not None:
        n = (saturated - dry) / rho_w
    else:
        raise _insufficient(region, water)
    if not 0.0 < n < 1.0:
        raise InvalidInput(
            "region",
            _given(region),
            f"these densities give a porosity of {n:.4g}, which must lie in (0, 1)",
            f"the density of water is {rho_w:.4g} Mg/m3",
        )
    return n


def _specific_gravity(region: Region, given: _Densities, n: float, water: Water | None) -> float:
    if region.Gs is not None:
        return region.Gs
    if given.dry is not None:
        return given.dry / ((1.0 - n) * given.water)
    if given.saturated is not None:
        return (given.saturated / given.water - n) / (1.0 - n)
    raise _insufficient(region, water)


def _given_porosity(region: Region) -> float | None:
    """Porosity given as such, by the void ratio or by PM4Sand's relative density; they must agree."""
    found: list[tuple[str, float, float]] = []
    if isinstance(region.material, PM4Sand):
        e = region.material.initial_void_ratio
        found.append((f"material.Dr = {region.material.Dr:g}", e, e / (1.0 + e)))
    if region.void_ratio is not None:
        found.append(("void_ratio", region.void_ratio, region.void_ratio / (1.0 + region.void_ratio)))
    if region.porosity is not None:
        found.append(("porosity", region.porosity, region.porosity))
    for name, value, n in found[1:]:
        first, _, expected = found[0]
        if abs(n - expected) > DENSITY_TOLERANCE * expected:
            right = expected if name == "porosity" else expected / (1.0 - expected)
            raise InvalidInput(
                f"region.{name}",
                value,
                f"contradicts {first}, which gives {name} = {right:.5g}",
                "give only one",
            )
    return found[0][2] if found else None


def _agreed(name: str, density: float | None, other: float | None, gravity: float) -> float | None:
    """The one of two densities that is given, or both if they agree."""
    if density is not None and other is not None and abs(density - other) > DENSITY_TOLERANCE * other:
        raise InvalidInput(
            f"region.{name}",
            density * gravity,
            f"contradicts the other densities given, which make it {other * gravity:.5g} kN/m3",
            "give only a sufficient set",
        )
    return other if density is None else density


def _given(region: Region) -> dict[str, float]:
    return {name: getattr(region, name) for name in _GIVEN if getattr(region, name) is not None}


def _insufficient(region: Region, water: Water | None) -> InvalidInput:
    return InvalidInput(
        "region",
        _given(region),
        "needs enough densities: two of Gs, porosity (or void_ratio; known for PM4Sand), "
        "dry_unit_weight, saturated_unit_weight" + (", or a dry_unit_weight alone" if water is None else ""),
        "for example Gs = 2.65 with porosity = 0.4",
    )
