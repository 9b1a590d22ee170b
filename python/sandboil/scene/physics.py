"""Which physics a scene computes, which it leaves out, and why."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .. import _core
from .edges import CompliantBase
from .section import side_profile
from .soils import Elastic

if TYPE_CHECKING:
    from .scene import Scene

_DRY, _STILL = "the scene has no water", "no shaking stage"
_IMPLICIT = "pore pressure diffusion is implicit"


class Physics(NamedTuple):
    """A part of the physics, whether a scene computes it, and why or why not."""

    name: str
    on: bool
    why: str


class Reasons(NamedTuple):
    """Why a part of the physics, by its name in the core, is on or off.

    Attributes
    ----------
    on : why it is on, if it is
    off : why the scene leaves it out; empty if it does not
    not_chosen : why the core may leave it out all the same; empty if the choice is not left to the core
    """

    name: str
    on: str
    off: str
    not_chosen: str = ""


def _reasons(name: str, on: str, *missing: tuple[bool, str]) -> Reasons:
    """Reasons of physics that is off for the first of the reasons that apply."""
    return Reasons(name, on, next((reason for applies, reason in missing if applies), ""))


def reasons(scene: Scene) -> list[Reasons]:
    """Why each part of the physics that a scene can leave out is on or off."""
    return [*_of_water(scene), *_of_soil(scene), *_of_edges(scene), *_of_numerics(scene)]


def active_physics(scene: Scene) -> list[Physics]:
    """Everything that a scene can leave out; what the scene leaves to the core is on."""
    return [Physics(each.name, not each.off, each.off or each.on) for each in reasons(scene)]


def computed_physics(scene: Scene, computed: Mapping[str, bool]) -> list[Physics]:
    """Everything that a scene can leave out, on where the core has computed it in a stage."""
    return [
        Physics(each.name, True, each.on)
        if computed.get(each.name, False)
        else Physics(each.name, False, each.off or each.not_chosen)
        for each in reasons(scene)
    ]


def _of_water(scene: Scene) -> list[Reasons]:
    dry, moves = (scene.water is None, _DRY), any(stage.moves for stage in scene.stages)
    permeable = [region.name for region in scene.regions if region.hydraulic_conductivity]
    no_flow = (dry, (not moves, _STILL), (not permeable, "no region is permeable"))
    seepage = scene.seepage
    steady = seepage is not None and seepage.duration is None
    term = scene.numerics.acceleration_term
    compared = "no region exceeds" if scene.uses_acceleration_term else "a region exceeds"
    chosen = f"{compared} {_core.ACCELERATION_TERM_CONDUCTIVITY:g} m/s"
    if term != "auto":
        chosen = f"numerics.acceleration_term is {term!r}"
    return [
        _reasons("pore water", _water_level(scene), dry),
        _reasons(
            "seepage",
            "to its steady state"
            if steady
            else "for its duration; the skeleton stores water by its small-strain stiffness",
            dry,
            (seepage is None, "no seepage stage"),
        ),
        _reasons("water diffusion", f"conductivity in {', '.join(permeable)}", *no_flow),
        _reasons(
            "water acceleration",
            chosen,
            *no_flow,
            (not scene.uses_acceleration_term, chosen),
            (scene.numerics.diffusion == "implicit", _IMPLICIT),
        )._replace(not_chosen=_IMPLICIT if scene.numerics.diffusion == "auto" else ""),
        _reasons(
            "partial saturation",
            ", ".join(region.name for region in scene.regions if region.retention) or "dry above the water",
            dry,
            (_is_always_full(scene), "the water table is at or above the ground surface everywhere"),
        ),
    ]


def _water_level(scene: Scene) -> str:
    x0, _, x1, _ = scene.bounds
    low, high = sorted(scene.water_level_at(np.array([x0, x1])))
    level = f"{low:g} m" if low == high else f"{low:g} to {high:g} m"
    return f"water table at elevation {level}"


def _is_always_full(scene: Scene) -> bool:
    """Whether no pore holds air at any time."""
    curves = scene.holds_suction and any(region.retention for region in scene.regions)
    drained = curves and any(stage.conditions for _, stage in scene.shakings)
    return not scene.is_partly_saturated and not drained


def _of_soil(scene: Scene) -> list[Reasons]:
    # Linear elasticity has no state besides the stress.
    stateful = [region.name for region in scene.regions if not isinstance(region.material, Elastic)]
    moves = any(stage.moves for stage in scene.stages)
    return [
        _reasons(
            "soil state",
            f"in {', '.join(stateful)}",
            (not stateful, "every region is linearly elastic"),
            (not moves, _STILL),
        )
    ]


def _of_edges(scene: Scene) -> list[Reasons]:
    shakings = [stage for _, stage in scene.shakings]
    still = (not shakings, _STILL)
    absorbing = [stage for stage in shakings if stage.base_vertical == "absorbing"]
    passing = [passage for stage in shakings if (passage := _passage(stage.base))]
    return [
        _reasons("base dashpots", "compliant base while shaking", still),
        _reasons(
            "vertical waves",
            "under a vertical motion" if any(s.vertical for s in absorbing) else "the base absorbs them",
            still,
            (not absorbing, "the base is a roller vertically"),
        ),
        _reasons(
            "wave passage",
            "; ".join(passing),
            still,
            (not passing, "the wave reaches all of the base at once"),
        ),
        _reasons(
            "free-field columns",
            _columns(scene),
            (scene.is_periodic, "the sides are periodic"),
            ("free-field" not in scene.side_kinds, f"the sides are {' and '.join(scene.side_kinds)}"),
            still,
        ),
    ]


def _passage(base: CompliantBase) -> str:
    """How a wave reaches different places of a base at different times; empty where it does not."""
    if base.apparent_velocity is not None:
        return f"at an apparent {base.apparent_velocity:g} m/s"
    return f"{len(base.segments)} segments" if len(base.segments) > 1 else ""


def _columns(scene: Scene) -> str:
    """Which sides have a column, and how many particles all columns together."""
    x0, _, x1, _ = scene.bounds
    edges = ((x0, "left", scene.outline.left), (x1, "right", scene.outline.right))
    free = [
        (side_profile(scene, x), round((top - bottom) / scene.spacing), hand)
        for (x, hand, (bottom, top)), kind in zip(edges, scene.side_kinds, strict=True)
        if kind == "free-field"
    ]
    hands = " and ".join(hand for _, _, hand in free)
    passing = any(_passage(stage.base) for _, stage in scene.shakings)
    alike = len(free) == 2 and free[0][0] == free[1][0] and not passing
    distinct = free[:1] if alike else free
    particles = sum(rows for _, rows, _ in distinct)
    number = f"{len(distinct)} column{'s' if len(distinct) > 1 else ''}"
    return f"on the {hands}: {number} of {particles} particles{' in all' if len(distinct) > 1 else ''}"


def _of_numerics(scene: Scene) -> list[Reasons]:
    numerics, run_out = scene.numerics, scene.run_out
    moves, still = any(stage.moves for stage in scene.stages), (not scene.shakings, _STILL)
    filtered = f"numerics.velocity_filter is {numerics.filter_strength:g}"
    damped = [str(stage.rayleigh) for _, stage in scene.shakings if stage.rayleigh]
    return [
        _reasons(
            "local damping",
            f"numerics.local_damping is {numerics.local_damping:g}",
            (not moves, _STILL),
            (numerics.local_damping == 0.0, "numerics.local_damping is 0"),
        ),
        _reasons("Rayleigh damping", "; ".join(damped), still, (not damped, "no shaking stage has it")),
        _reasons(
            "dispersion correction",
            "numerics.dispersion_correction is true",
            still,
            (not numerics.dispersion_correction, "numerics.dispersion_correction is false"),
        ),
        _reasons(
            "run-out",
            f"large displacements, viscosity {run_out.viscosity:g}" if run_out else "",
            (run_out is None, "no run-out stage"),
        ),
        _reasons(
            "velocity filter",
            filtered,
            (scene.is_at_rest, "no stage moves the ground"),
            (numerics.operators == "printed", "the printed operators have none"),
            (numerics.filter_strength == 0.0, filtered),
        ),
    ]
