"""Checks of a whole scene: each refuses the first thing wrong that it finds."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from .bases import check_bases
from .output import check_depths, check_frames, check_points
from .rules import check_choices
from .section import check_names, check_overlaps, check_section, check_sides, check_size, check_spacing
from .soils import check_densities, check_materials
from .stages import check_order, check_run_out
from .water import check_moving_water, check_seepage, check_water_table

if TYPE_CHECKING:
    from ..scene import Scene

# In the order in which a user would correct the scene. Later checks rely on earlier ones.
CHECKS: tuple[Callable[[Scene], None], ...] = (
    check_names,
    check_size,
    check_overlaps,
    check_section,
    check_sides,
    check_spacing,
    check_water_table,
    check_seepage,
    check_moving_water,
    check_densities,
    check_materials,
    check_order,
    check_run_out,
    check_choices,
    check_bases,
    check_frames,
    check_depths,
    check_points,
)
