"""Bases of shaking stages, and the waves that arrive there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._errors import InvalidInput
from ..._types import COORDINATE_TOLERANCE

if TYPE_CHECKING:
    from ..scene import Scene
    from ..stages import Shaking


def check_bases(scene: Scene) -> None:
    """All shaking stages have the same base vertically, and waves reach all of it in time."""
    for i, stage in scene.shakings:
        path = f"scene.stages[{i}].base"
        first = scene.shakings[0][1].base_vertical
        if stage.base_vertical != first:
            # The force that holds the weight is that of the moment when the first shaking began.
            raise InvalidInput(
                f"{path}.vertical",
                stage.base_vertical,
                f"must be as in the first shaking stage, {first!r}",
                "give each of them base = CompliantBase(vertical='absorbing')",
            )
        if stage.base.Vs is not None and stage.base.Vp is None and not scene.outline.base_is_level:
            raise InvalidInput(
                f"{path}.Vp",
                None,
                "is required beside Vs under a base that is not level: there it resists both waves",
                "Vp = Vs sqrt((2 - 2 nu)/(1 - 2 nu)); or leave Vs and density out too",
            )
        _refuse_arrivals(scene, stage, path)


def _refuse_arrivals(scene: Scene, stage: Shaking, path: str) -> None:
    base = stage.base
    x0, _, x1, _ = scene.bounds
    name = "segments" if base.segments else "apparent_velocity"
    given = getattr(base, name)
    if not given:
        return
    if scene.is_periodic:
        raise InvalidInput(
            f"{path}.{name}",
            given,
            "must be left out between periodic sides: what differs along the base is not periodic",
            "sides = FreeField()",
        )
    arrivals = base.arrivals(x0, x1)
    if base.segments:
        ends = [x0, *(end for arrival in arrivals for end in arrival.x), x1]
        for before, after in zip(ends[::2], ends[1::2], strict=True):
            if abs(after - before) > COORDINATE_TOLERANCE:
                fault = "overlap" if after < before else "leave a gap"
                low, high = sorted((before, after))
                raise InvalidInput(
                    f"{path}.segments",
                    [arrival.x for arrival in arrivals],
                    f"must cover the base, x {x0:g} to {x1:g} m, side by side, but they {fault} from "
                    f"{low:g} to {high:g}",
                    "let each begin where the one before ends",
                )
    duration = stage.duration
    for arrival in arrivals:
        if duration is not None and arrival.latest >= duration:
            # The place of the segment in the scene, not from left to right.
            places = [segment.x for segment in base.segments]
            raise InvalidInput(
                f"{path}.segments[{places.index(arrival.x)}].delay" if places else f"{path}.{name}",
                arrival.delay if places else given,
                f"must let the wave arrive before the stage ends: it arrives at {arrival.latest:g} s, "
                f"the stage ends at {duration:g} s",
                "a longer duration",
            )
