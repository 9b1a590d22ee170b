"""Base of every scene model: immutable, no unknown keys, and errors told in the scene's own terms."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable, Sequence
from typing import Annotated, Any, ClassVar, Literal, ParamSpec, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationError, create_model
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from ._errors import InvalidInput, nearest_name

# What is told, and how it is mended, of what is refused by a check of ours within pydantic's.
_NO_NUMBER = "must be a number; write it without quotes, for example 0.5"


def as_float(value: object) -> float:
    """Take any real number (numpy's too), but no text and no truth value: those are slips."""
    if isinstance(value, (bool, str, bytes)) or not hasattr(value, "__float__"):
        raise ValueError(_NO_NUMBER)
    try:
        return float(value)
    except (TypeError, OverflowError):
        # An array of several numbers, or an integer beyond all floats.
        raise ValueError(_NO_NUMBER) from None


def _as_list(value: object) -> object:
    """Let numpy arrays stand where lists may."""
    return value.tolist() if hasattr(value, "tolist") else value


# Most regions, stages, conditions and the like of a scene, and most points of a line: far beyond any section
# that is drawn by hand, and few enough that each may be compared with each in seconds.
MAX_PARTS = 200
MAX_POINTS = 5000

Number = Annotated[float, BeforeValidator(as_float)]

_P = ParamSpec("_P")
_R = TypeVar("_R")
_Item = TypeVar("_Item")
Many = Annotated[Sequence[_Item], BeforeValidator(_as_list), AfterValidator(tuple)]
"""Any sequence on entry, a tuple ever after: equal scenes compare equal and cannot be changed."""


class Model(BaseModel):
    """Frozen model whose arguments may be positional (`_positional`) or carry long names (`_aliases`).

    Every refusal leaves as :class:`InvalidInput`. The path in it starts with `_label`; when the model is
    a part of another one, that one puts the place where the part stands in its stead.
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
                f"name the rest: {', '.join(self._keys())}",
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
            raise self._invalid_input(error) from None
        # The kind is part of what was said even when it was said by the class's name: files need it.
        if "kind" in type(self).model_fields:
            self.__pydantic_fields_set__.add("kind")

    @classmethod
    def _keys(cls) -> list[str]:
        return [*(name for name in cls.model_fields if name != "kind"), *cls._aliases]

    @classmethod
    def _invalid_input(cls, error: ValidationError) -> InvalidInput:
        details = error.errors()
        # A misspelt key also leaves the right one missing: the misspelling is the thing to tell, and the
        # missing name the likeliest one meant.
        missing = [str(detail["loc"][0]) for detail in details if detail["type"] == "missing"]
        details.sort(key=lambda detail: detail["type"] != "extra_forbidden")
        return cls._told(details[0], missing)

    @classmethod
    def _told(cls, detail: ErrorDetails, missing: list[str]) -> InvalidInput:
        """One pydantic error as path, value, what is allowed, and the nearest name or remedy."""
        kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
        cause = context.get("error")
        # Parts tell their own errors, so past the field's name only list indices say something;
        # names there are pydantic's labels of union members.
        location = [str(part) for part in detail["loc"][:1]]
        path = ".".join([cls._label, *location]) + "".join(
            f"[{part}]" for part in detail["loc"][1:] if isinstance(part, int)
        )
        if isinstance(cause, InvalidInput):
            rest = cause.path if not location else path + cause.path.lstrip(_NAME_CHARACTERS)
            return InvalidInput(rest, cause.value, cause.allowed, cause.hint)
        field = cls.model_fields.get(location[0]) if location else None
        remedy = field_remedy(field)
        if kind == "extra_forbidden":
            known = cls._keys()
            meant = _meant(location[0], missing) or _meant(location[0], known)
            told = f"unknown key, known are {', '.join(known)}"
            return InvalidInput(path, value, told, meant or "leave it out, or take one of these")
        if kind == "missing":
            return InvalidInput(path, None, f"is required{_described(field)}", remedy or f"add {location[0]}")
        if kind == "literal_error":
            names = _literals(field)
            meant = _meant(value, names) or remedy or f"for example {names[0]!r}"
            return InvalidInput(path, value, f"must be one of {', '.join(map(repr, names))}", meant)
        if kind in ("union_tag_invalid", "union_tag_not_found"):
            names = _tags(field)
            tag = context.get("tag")
            key = str(context["discriminator"]).strip("'")
            if tag is None:
                told = f"needs {key} = one of {', '.join(map(repr, names))}"
                return InvalidInput(path, value, told, remedy or f"add {key} = {names[0]!r}, or another")
            return InvalidInput(
                f"{path}.{key}",
                tag,
                f"must be one of {', '.join(map(repr, names))}",
                _meant(tag, names) or remedy or f"for example {names[0]!r}",
            )
        if kind == "finite_number":
            told = f"must be finite{_described(field)}"
            return InvalidInput(path, value, told, remedy or "find out where it comes from")
        if kind in ("greater_than", "greater_than_equal", "less_than", "less_than_equal"):
            told = _range(field)
            return InvalidInput(path, value, told + _described(field), remedy or _usual(field))
        if kind in ("model_type", "model_attributes_type"):
            name = context.get("class_name")
            told = f"must be {f'a {name}' if name else 'an object of sandboil'} or a table"
            return InvalidInput(path, value, told, remedy or "give the object itself, or its keys and values")
        if kind in _COUNTS:
            told = _COUNTS[kind].format(**{"actual_length": "none", **context})
            return InvalidInput(
                path, value, told + _described(field), remedy or "check its commas and brackets"
            )
        if kind in _KINDS:
            told, usual = _KINDS[kind]
            return InvalidInput(path, value, told + _described(field), remedy or usual)
        if cause is not None and not remedy:
            told, _, remedy = str(cause).partition("; ")
            return InvalidInput(
                path, value, told + _described(field), remedy or "write it as its description says"
            )
        allowed = str(cause) if cause is not None else detail["msg"]
        return InvalidInput(path, value, allowed.partition("; ")[0] + _described(field), remedy)


# What pydantic says of lengths, in our words.
_COUNTS = {
    "too_short": "must hold at least {min_length}, not {actual_length}",
    "too_long": "must hold at most {max_length}, not {actual_length}",
    "string_too_short": "must have a character at least",
}
# What it says of kinds, with what is usually the matter.
_KINDS = {
    "bool_type": ("must be true or false", "write it without quotes"),
    "int_type": ("must be a whole number", "write it without a point and without quotes"),
    "int_from_float": ("must be a whole number", "write it without a point"),
    "string_type": ("must be text", "write it in quotes"),
    "tuple_type": ("must be a list", "write it in brackets, for example [0.0, 1.0]"),
    "list_type": ("must be a list", "write it in brackets, for example [0.0, 1.0]"),
    "dict_type": ("must be a table", "write its keys and values"),
}

_NAME_CHARACTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_"


def _meant(name: object, candidates: list[str]) -> str | None:
    nearest = nearest_name(str(name), candidates)
    return f"did you mean {nearest!r}?" if nearest else None


def _infos(field: FieldInfo | None) -> list[FieldInfo]:
    """What is said of a field: of itself, and of the members of its union."""
    if field is None:
        return []
    parts = typing.get_args(field.annotation)
    inner = [item for part in parts for item in getattr(part, "__metadata__", ())]
    return [field, *(item for item in inner if isinstance(item, FieldInfo))]


def _described(field: FieldInfo | None) -> str:
    return next((f" ({info.description})" for info in _infos(field) if info.description), "")


def field_remedy(field: FieldInfo | None) -> str | None:
    """What to do about a value that a field refuses, where the field says it."""
    extras = [info.json_schema_extra for info in _infos(field)]
    return next(
        (str(extra["remedy"]) for extra in extras if isinstance(extra, dict) and "remedy" in extra), None
    )


def _usual(field: FieldInfo | None) -> str:
    """What may be done about a number that lies outside its range."""
    if field is not None and isinstance(field.default, (int, float)):
        return f"leave it out for {field.default:g}"
    return "check its unit and its sign"


def _range(field: FieldInfo | None) -> str:
    """The whole allowed range in words, so that mending one end does not run into the other."""
    bounds = _bounds([field.annotation, *field.metadata]) if field is not None else {}
    below = f"({bounds['gt']:g}" if "gt" in bounds else f"[{bounds['ge']:g}" if "ge" in bounds else None
    above = f"{bounds['lt']:g})" if "lt" in bounds else f"{bounds['le']:g}]" if "le" in bounds else None
    if below and above:
        return f"must lie in {below}, {above}"
    words = {"gt": "greater than", "ge": "at least", "lt": "less than", "le": "at most"}
    return "must be " + " and ".join(f"{words[name]} {bound:g}" for name, bound in bounds.items())


def _bounds(parts: typing.Iterable[Any]) -> dict[str, float]:
    """The limits attached to an annotation, wherever in a union they stand."""
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


def checked(owner: str) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Check a function's arguments against its own annotations, and refuse them as those of a scene are.

    The function raises :class:`InvalidInput` with a path such as ``lab.cyclic_dss.csr``, which begins with
    `owner`; an unknown keyword is told with the nearest right one.
    """

    def decorated(function: Callable[_P, _R]) -> Callable[_P, _R]:
        @functools.cache
        def arguments() -> type[Model]:
            # Made when the function is first called: whoever only runs scenes does not wait for it.
            hints = typing.get_type_hints(function, include_extras=True)
            parameters = inspect.signature(function).parameters.values()
            fields: dict[str, Any] = {
                parameter.name: (
                    hints[parameter.name],
                    ... if parameter.default is inspect.Parameter.empty else parameter.default,
                )
                for parameter in parameters
            }
            made = create_model(function.__name__, __base__=Model, **fields)
            made._label = f"{owner}.{function.__name__}"
            made._positional = tuple(
                parameter.name
                for parameter in parameters
                if parameter.kind is not inspect.Parameter.KEYWORD_ONLY
            )
            return made

        @functools.wraps(function)
        def checking(*args: _P.args, **kwargs: _P.kwargs) -> _R:
            valid = arguments()(*args, **kwargs)
            given = {name: getattr(valid, name) for name in type(valid).model_fields}
            try:
                return typing.cast(Callable[..., _R], function)(**given)
            except InvalidInput as error:
                # What one function refuses of what another one hands it is told as the other one's.
                inner, _, argument = error.path.removeprefix(f"{owner}.").partition(".")
                if f"{owner}.{inner}.{argument}" != error.path or argument.partition("[")[0] not in given:
                    raise
                path = f"{owner}.{function.__name__}.{argument}"
                raise InvalidInput(path, error.value, error.allowed, error.hint) from None

        return checking

    return decorated
