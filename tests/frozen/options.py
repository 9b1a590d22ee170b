"""The options that the public schema has, and those that scenes use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Literal, get_args, get_origin

import sandboil as sb


def schema() -> set[str]:
    """Every field of every public part of a scene, and every word that one of them may be."""
    return {option for model in _models() for option in _of_model(model)}


def used(scenes: Iterable[sb.Scene]) -> set[str]:
    """The options of the schema that some scene sets, or leaves at the word that is their default."""
    return {option for scene in scenes for option in _of_value(scene)}


def _models() -> list[Any]:
    named = [getattr(sb, name) for name in sb.__all__]
    # Site profiles are for equivalent-linear analysis: no scene holds one.
    beside = (sb.HalfSpace, sb.ModulusCurve, sb.SiteLayer, sb.SiteProfile)
    return [model for model in named if hasattr(model, "model_fields") and model not in beside]


def _of_model(model: Any) -> Iterator[str]:
    for name, field in model.model_fields.items():
        if name == "kind" and model is not sb.MotionSpec:
            yield model.__name__
            continue
        yield f"{model.__name__}.{name}"
        yield from (f"{model.__name__}.{name} = {word}" for word in _words(field.annotation))


def _words(annotation: Any) -> set[Any]:
    """The words, or truth values, that an annotation allows."""
    if annotation is bool:
        return {True, False}
    if get_origin(annotation) is Literal:
        return set(get_args(annotation))
    return {word for part in get_args(annotation) for word in _words(part)}


def _of_value(value: Any) -> Iterator[str]:
    if isinstance(value, tuple | list):
        for part in value:
            yield from _of_value(part)
    model = type(value)
    if not hasattr(model, "model_fields"):
        return
    for name, field in model.model_fields.items():
        given = getattr(value, name)
        if name == "kind" and model is not sb.MotionSpec:
            yield model.__name__
            continue
        if name in value.model_fields_set:
            yield f"{model.__name__}.{name}"
        words = given if isinstance(given, tuple | list) else [given]
        allowed = _words(field.annotation)
        yield from (
            f"{model.__name__}.{name} = {word}"
            for word in words
            if isinstance(word, str | bool) and word in allowed
        )
        yield from _of_value(given)
