"""Changes of a model by the paths of its fields, as ``stages[2].motion``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

from pydantic import BaseModel

from ._errors import InvalidInput
from ._refusals import suggested, unknown_key

if TYPE_CHECKING:
    from ._model import Model

# A field by its name, or a part of a sequence by its place or its name.
_STEP = re.compile(r"\.?([^\W\d]\w*)|\[(-?\d+)\]|\[(?:'([^']*)'|\"([^\"]*)\")\]")
_EXAMPLE = "for example 'spacing', 'water.bulk_modulus' or 'stages[1].motion'"


def applied(model: Model, changes: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments that make `model` with its changes; :class:`InvalidInput` for a path that leads nowhere.

    Parts that change become tables of their arguments. The model that is made from them checks them.
    """
    whole = _Opened(model)
    for path, value in changes.items():
        *way, last = _steps(f"{model._label}.{path}", value)
        part, place = whole, model._label
        for step in way:
            part, place = part.opened(step, place, value), _joined(place, step)
        part.values[part.key(last, place, value)] = value
    return cast(dict[str, Any], whole.arguments())


def _steps(path: str, value: object) -> list[str | int]:
    """The names and places of a path after its first name, which is the model's."""
    steps: list[str | int] = []
    end = 0
    while end < len(path):
        found = _STEP.match(path, end)
        if found is None:
            raise InvalidInput(path, value, "must be a path of fields", _EXAMPLE)
        name, place, single, double = found.groups()
        steps.append(int(place) if place else _Name(single or double or "") if name is None else name)
        end = found.end()
    return steps[1:]


class _Name(str):
    """The name of a part in a sequence."""


def _joined(place: str, step: str | int) -> str:
    return f"{place}.{step}" if type(step) is str else f"{place}[{step!r}]"


@dataclass
class _Opened:
    """A model, or a sequence, and what is given in place of its parts."""

    original: Any
    values: dict[str | int, Any] = field(default_factory=dict)

    def key(self, step: str | int, place: str, value: object) -> str | int:
        """The field or the index that a step means."""
        path = _joined(place, step)
        if isinstance(self.original, BaseModel):
            model = cast("Model", self.original)
            name = model._aliases.get(str(step), step)
            if type(step) is str and name in type(model).model_fields:
                return name
            raise unknown_key(path, value, model._keys(), suggested(step, model._keys()))
        count = len(self.original)
        if isinstance(step, int) and -count <= step < count:
            return step % count
        names = [part.name for part in self.original if hasattr(part, "name")]
        if isinstance(step, _Name) and step in names:
            return names.index(step)
        known = [*map(repr, names), *map(str, range(count))]
        hint = suggested(repr(str(step)), known) or "places count from 0"
        raise InvalidInput(path, value, f"must be one of {', '.join(known) or 'none: it is empty'}", hint)

    def opened(self, step: str | int, place: str, value: object) -> _Opened:
        """The part at a step, opened."""
        key = self.key(step, place, value)
        if key not in self.values:
            self.values[key] = getattr(self.original, key) if isinstance(key, str) else self.original[key]
        part = self.values[key]
        if isinstance(part, BaseModel | tuple):
            part = self.values[key] = _Opened(part)
        if isinstance(part, _Opened):
            return part
        raise InvalidInput(
            _joined(place, step), part, "has no fields that could change", "give it as a whole"
        )

    def arguments(self) -> object:
        """The arguments of the model, or the parts of the sequence, with the changes."""
        changes = {
            key: part.arguments() if isinstance(part, _Opened) else part for key, part in self.values.items()
        }
        if isinstance(self.original, BaseModel):
            return {name: getattr(self.original, name) for name in self.original.model_fields_set} | changes
        return [changes.get(index, part) for index, part in enumerate(self.original)]
