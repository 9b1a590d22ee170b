"""Base of every scene model: immutable, no unknown keys, and errors in the terms of the scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from . import _changes
from ._errors import InvalidInput
from ._refusals import refusal


class Model(BaseModel):
    """Frozen model whose arguments may be positional (`_positional`) or carry long names (`_aliases`).

    Every refusal is an :class:`InvalidInput`. The path in it starts with `_label`; when the model is a part
    of another one, that one replaces the label by the place of the part.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    _label: ClassVar[str] = "value"
    _positional: ClassVar[tuple[str, ...]] = ()
    _aliases: ClassVar[dict[str, str]] = {}

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        if len(args) > len(self._positional):
            raise InvalidInput(
                f"{self._label}({type(self).__name__})",
                args,
                f"takes {len(self._positional)} positional arguments, {len(args)} were given",
                f"give the rest by name: {', '.join(self._keys())}",
            )
        for name, value in [
            *zip(self._positional, args, strict=False),
            *((short, kwargs.pop(long)) for long, short in self._aliases.items() if long in kwargs),
        ]:
            if name in kwargs:
                raise InvalidInput(
                    f"{self._label}.{name}",
                    kwargs[name],
                    f"was given twice, also as {value!r}",
                    "leave one of them out",
                )
            kwargs[name] = value
        try:
            super().__init__(**kwargs)
        except ValidationError as error:
            raise refusal(type(self), error) from None
        # Files need the kind, which the name of the class gives in Python.
        if "kind" in type(self).model_fields:
            self.__pydantic_fields_set__.add("kind")

    @classmethod
    def _keys(cls) -> list[str]:
        return [*(name for name in cls.model_fields if name != "kind"), *cls._aliases]

    def changed(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked as a new one is.

        Names are fields, or paths into parts, given by a dict: ``scene.changed(spacing=0.1)``,
        ``scene.changed(**{"stages[1].motion": motion, "regions['sand'].K0": 0.6})``. A part of a sequence is
        named by its place, negative from the end, or by its name if it has one. Raises :class:`InvalidInput`
        for an unknown path, and for everything that construction refuses.
        """
        return type(self)(**_changes.applied(self, changes))

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy; with an `update`, as :meth:`changed` makes it."""
        return self.changed(**update) if update else super().model_copy(deep=deep)
