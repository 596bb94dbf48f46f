"""Validate the JSON of headers and events against declarations of their content.

A correct checksum shows that a header is unchanged, not that its values make sense. So the keys with their types and
ranges are declared as ``msgspec`` structs: :class:`storage.run_file.header.Header` and
:class:`storage.wire_log.log_header.LogHeader`. The result of :func:`decoded` has the types, ranges, sizes and depth
that later code relies on.
"""

from __future__ import annotations

import dataclasses
import json
import re
import sys
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

import msgspec
import numpy as np
from msgspec import Meta, Struct, field

from acquisition.errors import CalibrationError
from acquisition.live.calibration import Calibration

__all__ = [
    "Calibrated",
    "Count",
    "ValueRefused",
    "converted",
    "decoded",
    "demand_calibration",
    "json_text",
    "parsed",
    "plain",
    "shown",
]

Count = Annotated[int, Meta(ge=0, le=2**53)]
"""A count: an integer that a float can represent exactly."""

_T = TypeVar("_T")
_SHOWN = 60
_GREATEST = sys.float_info.max  # larger integers have no finite float, and any comparison with NaN is false
_AT = re.compile(r" - at `(?:key` in `)?\$(.*)`$", re.DOTALL)
_STEP = re.compile(r"\.(\w+)|\[([0-9]+)\]")
_ANY_KEY = "[...]"
"""Notation of msgspec for a value in a table with arbitrary keys; the message then shows the whole table."""


class ValueRefused(ValueError):
    """A value that is not allowed for its key.

    Parameters
    ----------
    key : str
        Dotted path of the key.
    reason : str
        The expected value and the actual one.
    """

    def __init__(self, key: str, reason: str) -> None:
        super().__init__(key, reason)

    def __str__(self) -> str:
        return "{}: {}".format(*self.args)


class Calibrated(Struct, frozen=True, kw_only=True):
    """A struct with the numbers of a :class:`acquisition.live.calibration.Calibration`, checked against its ranges."""

    calibration: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        demand_calibration(self.calibration, "calibration")


def demand_calibration(numbers: Mapping[str, Any], key: str) -> None:
    """Check the numbers of a calibration.

    Raises
    ------
    ValueRefused
    """
    try:
        Calibration.from_mapping(converted(numbers, dict[str, float], key))
    except CalibrationError as error:
        raise ValueRefused(key, _visible(str(error))) from error


def parsed(text: bytes, key: str) -> Any:
    """Return the value of a JSON text.

    Raises
    ------
    ValueRefused
        If the text is not JSON, or is nested too deeply for Python's JSON reader.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueRefused(key, f"expected JSON, got {shown(text)}") from error


def decoded(content: object, kind: type[_T], key: str, deepest: int) -> _T:
    """Convert the content of a header or event to its struct.

    Parameters
    ----------
    content : object
        The content, as returned by :func:`parsed`.
    kind : type
        The struct.
    key : str
        Name of the content in messages; inner keys are appended after dots.
    deepest : int
        Maximum depth of nested tables and lists.

    Raises
    ------
    ValueRefused
        For the first value that the struct does not allow, that is nested too deeply, or that is not finite.

    Examples
    --------
    >>> class Rate(Struct):
    ...     rate_hz: Annotated[float, Meta(ge=1e-6)]
    >>> decoded({"rate_hz": 0}, Rate, "info", 1)
    Traceback (most recent call last):
    storage.schema.ValueRefused: info.rate_hz: expected `float` >= 1e-06, got 0
    """
    value = converted(content, kind, key)
    level = [content]
    for _ in range(deepest + 1):
        inner: list[object] = []
        for each in level:
            if isinstance(each, Mapping):
                inner += each.values()
            elif isinstance(each, list):
                inner += each
            elif isinstance(each, int | float) and not -_GREATEST <= each <= _GREATEST:
                raise ValueRefused(key, f"expected finite numbers, got {shown(each)}")
        level = inner
    if level:
        raise ValueRefused(key, f"expected tables nested at most {deepest} deep, got deeper ones")
    return value


def converted(content: object, kind: type[_T], key: str) -> _T:
    """Convert plain content to a type. Unlike :func:`decoded`, this does not check untyped tables."""
    try:
        return msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        raise _refused(error, content, key) from error
    except UnicodeEncodeError as error:  # a key with half a surrogate pair
        raise ValueRefused(key, f"expected names of characters, got {shown(error.object)}") from error


def _refused(error: msgspec.ValidationError, content: object, key: str) -> ValueRefused:
    """Return an error that shows the refused value; msgspec gives only its path."""
    message = str(error)
    at = _AT.search(message)
    path, reason = (at[1], message[: at.start()]) if at else ("", message)
    if isinstance(error.__cause__, ValueRefused):  # raised by a check inside the struct
        inner, reason = error.__cause__.args
        return ValueRefused(f"{key}{_visible(path)}.{inner}", reason)
    value: Any = content
    for name, number in _STEP.findall(path.partition(_ANY_KEY)[0]):
        value = value[int(number)] if number else value[name]
    reason = reason.partition(", got `")[0]
    return ValueRefused(f"{key}{_visible(path)}", f"{_visible(reason[:1].lower() + reason[1:])}, got {shown(value)}")


def shown(value: object) -> str:
    """Return the beginning of a value in visible ASCII, because a text from a file may contain terminal commands."""
    if isinstance(value, Mapping):
        names = [shown(name) for name in list(value)[:4]]
        return f"a table of {', '.join(names)}{', ...' if len(value) > 4 else ''}" if names else "an empty table"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    if isinstance(value, str | bytes):
        return ascii(value[:_SHOWN]) + "..." * (len(value) > _SHOWN)
    try:
        return ascii(value)[:_SHOWN]
    except ValueError:
        return "an integer of thousands of digits"  # Python refuses to print it


def _visible(message: str) -> str:
    """Return at most 200 characters of a message in visible ASCII, because it may quote a name from a file."""
    return ascii(message[:200])[1:-1]


def plain(value: Any) -> dict[str, Any]:
    """Return the fields of a struct or dataclass by name; nested ones are not converted."""
    return {name: getattr(value, name) for name in _names(value)}


def _names(value: object) -> tuple[str, ...]:
    if isinstance(value, Struct):
        return value.__struct_fields__
    if dataclasses.is_dataclass(value):
        return tuple(field.name for field in dataclasses.fields(value))
    raise TypeError(f"expected a value that JSON can store, got {value!r} ({type(value).__name__})")


def json_text(value: Any) -> str:
    """Return canonical JSON: sorted keys, no blanks, ASCII; numpy numbers become plain numbers.

    Raises
    ------
    TypeError, ValueError
        If JSON cannot store a value: an object, NaN, an infinity.

    Examples
    --------
    >>> json_text({"b": np.float64(0.5), "a": [1, None]})
    '{"a":[1,null],"b":0.5}'
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, default=_jsonable)


def _jsonable(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else plain(value)
