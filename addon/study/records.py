# SPDX-License-Identifier: GPL-3.0-or-later
"""Dataclasses from the plain lists and dictionaries of JSON, checked field by field."""

from __future__ import annotations

import dataclasses
import json
import reprlib
import types
import typing
from typing import Any, TypeVar

T = TypeVar("T")

_short = reprlib.Repr()  # of values in messages: a sentence, however long or deep the value
_short.maxstring = _short.maxother = _short.maxlong = 80


def parse_json(text: str) -> Any:
    """The plain lists and dictionaries of a JSON text; raises ValueError.

    Unlike `json.loads` it takes no NaN and no infinity, which no results have and JSON knows not.
    """
    try:
        return json.loads(text, parse_float=_finite, parse_constant=_finite)
    except RecursionError:
        raise ValueError("lists or objects are nested too deeply") from None


def _finite(text: str) -> float:
    number = float(text)
    if not abs(number) < float("inf"):
        raise ValueError(f"{text[:40]} is no finite number")
    return number


def from_plain(kind: type[T], plain: Any, where: str = "") -> T:
    """The inverse of `dataclasses.asdict`; ``kind`` is a dataclass, scalar, list, dict or union.

    Raises ValueError naming the place of an unknown or missing field or a value of another type.
    """
    return typing.cast(T, _convert(kind, plain, where or getattr(kind, "__name__", str(kind))))


def _convert(kind: Any, plain: Any, where: str) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any:
        return plain
    if origin in (typing.Union, types.UnionType):
        return _convert_union(arguments, plain, where)
    if origin is list:
        _expect(isinstance(plain, list), "a list", plain, where)
        return [_convert(arguments[0], item, f"{where}[{i}]") for i, item in enumerate(plain)]
    if origin is dict:
        _expect(isinstance(plain, dict), "an object", plain, where)
        return {
            key: _convert(arguments[1], value, f"{where}.{key}") for key, value in plain.items()
        }
    if dataclasses.is_dataclass(kind):
        return _convert_record(kind, plain, where)
    if kind is float and type(plain) is int:
        _expect(abs(plain) < 2**1023, "in the range of float", plain, where)
        return float(plain)
    _expect(type(plain) is kind, f"of type {kind.__name__}", plain, where)
    return plain


def _convert_union(kinds: tuple[Any, ...], plain: Any, where: str) -> Any:
    for kind in kinds:
        try:
            return None if kind is type(None) and plain is None else _convert(kind, plain, where)
        except ValueError:
            continue
    names = " or ".join(getattr(kind, "__name__", str(kind)) for kind in kinds)
    raise ValueError(f"{where} must be {names}, not {_short.repr(plain)}")


def _convert_record(kind: Any, plain: Any, where: str) -> Any:
    _expect(isinstance(plain, dict), "an object", plain, where)
    hints = typing.get_type_hints(kind)
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}
    unknown = sorted(set(plain) - set(fields))
    if unknown:
        raise ValueError(
            f"{where} has no field {_short.repr(unknown[0])}; it has {', '.join(fields)}"
        )
    values = {name: _convert(hints[name], plain[name], f"{where}.{name}") for name in plain}
    try:
        return kind(**values)
    except TypeError as error:
        raise ValueError(f"{where}: {error}") from error


def _expect(condition: bool, wanted: str, plain: Any, where: str) -> None:
    if not condition:
        raise ValueError(f"{where} must be {wanted}, not {_short.repr(plain)}")
