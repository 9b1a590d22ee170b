"""Errors of pydantic as refusals in the terms of a scene: place, value, what is allowed, and the remedy."""

from __future__ import annotations

import typing
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from ._errors import InvalidInput, nearest_name

if TYPE_CHECKING:
    from ._model import Model

_NAME_CHARACTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_"


def refusal(model: type[Model], error: ValidationError) -> InvalidInput:
    """The first error to report of a model's arguments."""
    details = error.errors()
    # A misspelt key leaves the right one missing, too. The misspelling is what to report, and the missing
    # name is the likeliest one that was meant.
    missing = [str(detail["loc"][0]) for detail in details if detail["type"] == "missing"]
    details.sort(key=lambda detail: detail["type"] != "extra_forbidden")
    found = _Found.of(model, details[0], missing)
    if isinstance(found.cause, InvalidInput):
        cause = found.cause
        path = relocated(cause.path, found.path) if found.name else cause.path
        return InvalidInput(path, cause.value, cause.allowed, cause.hint)
    return _REFUSALS.get(found.kind, _other)(found)


def relocated(path: str, place: str) -> str:
    """A path that begins with the label of a part, with the place of that part in place of the label."""
    return place + path.lstrip(_NAME_CHARACTERS)


def unknown_key(path: str, value: object, known: list[str], suggestion: str | None) -> InvalidInput:
    """The refusal of a key that is none of `known`."""
    return InvalidInput(
        path,
        value,
        f"unknown key, known are {', '.join(known)}",
        suggestion or "leave it out, or take one of these",
    )


def suggested(name: object, candidates: list[str]) -> str | None:
    """The nearest of the candidates as a hint, if one comes near."""
    nearest = nearest_name(str(name), candidates)
    return f"did you mean {nearest!r}?" if nearest else None


def field_remedy(field: FieldInfo | None) -> str | None:
    """The remedy that a field names for a value it refuses."""
    extras = [info.json_schema_extra for info in _infos(field)]
    return next(
        (str(extra["remedy"]) for extra in extras if isinstance(extra, dict) and "remedy" in extra), None
    )


@dataclass(frozen=True)
class _Found:
    """One error of pydantic.

    Attributes
    ----------
    kind : pydantic's type of the error
    path : where the value stands
    value : as it was given
    context : pydantic's details
    name, field : of the argument, if the error concerns a single one
    keys : of the model
    missing : names that are required and were left out
    """

    kind: str
    path: str
    value: Any
    context: dict[str, Any]
    message: str
    name: str | None
    field: FieldInfo | None
    keys: list[str]
    missing: list[str]

    @classmethod
    def of(cls, model: type[Model], detail: ErrorDetails, missing: list[str]) -> _Found:
        location = detail["loc"]
        name = str(location[0]) if location else None
        # Parts report their own errors. Past the name of the field only indices of lists matter here: names
        # there are pydantic's labels of the members of a union.
        path = ".".join([model._label, *([] if name is None else [name])])
        path += "".join(f"[{part}]" for part in location[1:] if isinstance(part, int))
        return cls(
            kind=detail["type"],
            path=path,
            value=detail["input"],
            context=detail.get("ctx", {}),
            message=detail["msg"],
            name=name,
            field=None if name is None else model.model_fields.get(name),
            keys=model._keys(),
            missing=missing,
        )

    @property
    def cause(self) -> object:
        """The exception that a check of ours raised, if one did."""
        return self.context.get("error")

    @property
    def described(self) -> str:
        """The description of the field in parentheses."""
        return next((f" ({info.description})" for info in _infos(self.field) if info.description), "")

    @property
    def remedy(self) -> str | None:
        return field_remedy(self.field)

    def refused(self, allowed: str, hint: str | None) -> InvalidInput:
        """The refusal; `hint` is replaced by the field's own remedy if it has one."""
        return InvalidInput(self.path, self.value, allowed + self.described, self.remedy or hint)


def _unknown(found: _Found) -> InvalidInput:
    suggestion = suggested(found.name, found.missing) or suggested(found.name, found.keys)
    return unknown_key(found.path, found.value, found.keys, suggestion)


def _missing(found: _Found) -> InvalidInput:
    return InvalidInput(
        found.path, None, f"is required{found.described}", found.remedy or f"add {found.name}"
    )


def _one_of(found: _Found, path: str, value: object, names: list[str]) -> InvalidInput:
    hint = suggested(value, names) or found.remedy or f"for example {names[0]!r}"
    return InvalidInput(path, value, f"must be one of {', '.join(map(repr, names))}", hint)


def _literal(found: _Found) -> InvalidInput:
    return _one_of(found, found.path, found.value, _literals(found.field))


def _tag(found: _Found) -> InvalidInput:
    names, tag = _tags(found.field), found.context.get("tag")
    key = str(found.context["discriminator"]).strip("'")
    if tag is not None:
        return _one_of(found, f"{found.path}.{key}", tag, names)
    allowed = f"needs {key} = one of {', '.join(map(repr, names))}"
    return InvalidInput(
        found.path, found.value, allowed, found.remedy or f"add {key} = {names[0]!r}, or another"
    )


def _infinite(found: _Found) -> InvalidInput:
    return found.refused("must be finite", "find out where it comes from")


def _outside(found: _Found) -> InvalidInput:
    return found.refused(_range(found.field), _usual(found.field))


def _no_part(found: _Found) -> InvalidInput:
    name = found.context.get("class_name")
    allowed = f"must be {f'a {name}' if name else 'an object of sandboil'} or a table"
    return InvalidInput(
        found.path, found.value, allowed, found.remedy or "give the object itself, or its keys and values"
    )


def _wrong_count(found: _Found) -> InvalidInput:
    allowed = _COUNTS[found.kind].format(**{"actual_length": "none", **found.context})
    return found.refused(allowed, "check its commas and brackets")


def _wrong_type(found: _Found) -> InvalidInput:
    return found.refused(*_TYPES[found.kind])


def _other(found: _Found) -> InvalidInput:
    if found.cause is None:
        return found.refused(found.message.partition("; ")[0], None)
    allowed, _, hint = str(found.cause).partition("; ")
    return found.refused(allowed, hint or "write it as its description says")


# Wording for pydantic's errors of length, and of type with the usual remedy.
_COUNTS = {
    "too_short": "must hold at least {min_length}, not {actual_length}",
    "too_long": "must hold at most {max_length}, not {actual_length}",
    "string_too_short": "must have a character at least",
}
_TYPES = {
    "bool_type": ("must be true or false", "write it without quotes"),
    "int_type": ("must be a whole number", "write it without a point and without quotes"),
    "int_from_float": ("must be a whole number", "write it without a point"),
    "string_type": ("must be text", "write it in quotes"),
    "tuple_type": ("must be a list", "write it in brackets, for example [0.0, 1.0]"),
    "list_type": ("must be a list", "write it in brackets, for example [0.0, 1.0]"),
    "dict_type": ("must be a table", "write its keys and values"),
}
_REFUSALS: dict[str, Callable[[_Found], InvalidInput]] = {
    "extra_forbidden": _unknown,
    "missing": _missing,
    "literal_error": _literal,
    "union_tag_invalid": _tag,
    "union_tag_not_found": _tag,
    "finite_number": _infinite,
    **dict.fromkeys(("greater_than", "greater_than_equal", "less_than", "less_than_equal"), _outside),
    **dict.fromkeys(("model_type", "model_attributes_type"), _no_part),
    **dict.fromkeys(_COUNTS, _wrong_count),
    **dict.fromkeys(_TYPES, _wrong_type),
}


def _infos(field: FieldInfo | None) -> list[FieldInfo]:
    """The metadata of a field and of the members of its union."""
    if field is None:
        return []
    parts = typing.get_args(field.annotation)
    inner = [item for part in parts for item in getattr(part, "__metadata__", ())]
    return [field, *(item for item in inner if isinstance(item, FieldInfo))]


def _usual(field: FieldInfo | None) -> str:
    """The remedy for a number outside its range where the field names none."""
    if field is not None and isinstance(field.default, (int, float)):
        return f"leave it out for {field.default:g}"
    return "check its unit and its sign"


def _range(field: FieldInfo | None) -> str:
    """The whole allowed range in words, so that a remedy for one end does not miss the other."""
    bounds = _bounds([field.annotation, *field.metadata]) if field is not None else {}
    below = f"({bounds['gt']:g}" if "gt" in bounds else f"[{bounds['ge']:g}" if "ge" in bounds else None
    above = f"{bounds['lt']:g})" if "lt" in bounds else f"{bounds['le']:g}]" if "le" in bounds else None
    if below and above:
        return f"must lie in {below}, {above}"
    words = {"gt": "greater than", "ge": "at least", "lt": "less than", "le": "at most"}
    return "must be " + " and ".join(f"{words[name]} {bound:g}" for name, bound in bounds.items())


def _bounds(parts: typing.Iterable[Any]) -> dict[str, float]:
    """The limits attached to an annotation, at any depth of a union."""
    bounds: dict[str, float] = {}
    for part in parts:
        bounds |= {name: getattr(part, name) for name in ("gt", "ge", "lt", "le") if hasattr(part, name)}
        bounds |= _bounds(getattr(part, "metadata", ()))
        bounds |= _bounds(typing.get_args(part))
    return bounds


def _union_members(annotation: Any) -> list[Any]:
    """All plain types inside an annotation, looking through lists, unions and Annotated."""
    if typing.get_origin(annotation) is Literal:
        return [annotation]
    arguments = [part for part in typing.get_args(annotation) if not isinstance(part, FieldInfo)]
    if not arguments:
        return [annotation]
    return [member for part in arguments for member in _union_members(part)]


def _literals(field: FieldInfo | None) -> list[str]:
    members = _union_members(field.annotation) if field is not None else []
    return [str(name) for m in members if typing.get_origin(m) is Literal for name in typing.get_args(m)]


def _tags(field: FieldInfo | None) -> list[str]:
    members = _union_members(field.annotation) if field is not None else []
    return [
        str(m.model_fields["kind"].default)
        for m in members
        if isinstance(m, type) and issubclass(m, BaseModel) and "kind" in m.model_fields
    ]
