"""Functions that a class offers as a method, and that are built on the class itself.

The class declares such a function, the module with the function provides it,
and `import sandboil` loads both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")


class Provided(Generic[_P, _R]):
    """A function that another module provides."""

    def __init__(self) -> None:
        self._function: Callable[_P, _R] | None = None

    def by(self, function: Callable[_P, _R]) -> Callable[_P, _R]:
        """Provide the function; as a decorator."""
        self._function = function
        return function

    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        assert self._function is not None, "the module that provides the function is not loaded"
        return self._function(*args, **kwargs)
