"""Functions that check their arguments as a scene checks its own."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from pydantic import create_model

from ._errors import InvalidInput
from ._model import Model

_P = ParamSpec("_P")
_R = TypeVar("_R")


def checked(owner: str) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Check a function's arguments against its annotations; refusals are as those of a scene.

    The function raises :class:`InvalidInput` with a path such as ``lab.cyclic_dss.csr``, which begins with
    `owner`. An unknown keyword is reported with the nearest right one. An argument without an annotation, as
    `self`, is not checked.
    """

    def decorated(function: Callable[_P, _R]) -> Callable[_P, _R]:
        parameters = list(inspect.signature(function).parameters.values())
        unchecked = [p for p in parameters if p.annotation is inspect.Parameter.empty]

        @functools.cache
        def arguments() -> type[Model]:
            # Made when the function is first called, so that runs of scenes do not wait for it.
            hints = typing.get_type_hints(function, include_extras=True)
            own = [parameter for parameter in parameters if parameter not in unchecked]
            fields: dict[str, Any] = {
                parameter.name: (
                    hints[parameter.name],
                    ... if parameter.default is inspect.Parameter.empty else parameter.default,
                )
                for parameter in own
            }
            made = create_model(function.__name__, __base__=Model, **fields)
            made._label = f"{owner}.{function.__name__}"
            made._positional = tuple(
                parameter.name for parameter in own if parameter.kind is not inspect.Parameter.KEYWORD_ONLY
            )
            return made

        @functools.wraps(function)
        def checking(*args: _P.args, **kwargs: _P.kwargs) -> _R:
            first = len(unchecked)
            valid = arguments()(*args[first:], **kwargs)
            given = {name: getattr(valid, name) for name in type(valid).model_fields}
            try:
                return typing.cast(Callable[..., _R], function)(*args[:first], **given)
            except InvalidInput as error:
                # An argument that one function passes on to another is reported as that of the first.
                inner, _, argument = error.path.removeprefix(f"{owner}.").partition(".")
                if f"{owner}.{inner}.{argument}" != error.path or argument.partition("[")[0] not in given:
                    raise
                path = f"{owner}.{function.__name__}.{argument}"
                raise InvalidInput(path, error.value, error.allowed, error.hint) from None

        return checking

    return decorated
