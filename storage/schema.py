"""Convert JSON to structs that declare its keys, types and ranges, and back to canonical JSON.

A correct checksum shows that a header is unchanged, not that its values make sense. So ``msgspec`` structs declare
them: :class:`storage.run_file.header.RunHeader` and :class:`storage.wire_log.records.LogHeader`.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

import msgspec
import numpy as np
from msgspec import Meta, Struct

Count = Annotated[int, Meta(ge=0, le=2**53)]
"""A count: an integer that a float can represent exactly."""

_T = TypeVar("_T")
_AT = " - at `$"
_SHOWN = 60


class ValueRefused(ValueError):
    """A value that is not allowed for its key: the dotted path of the key, and the reason."""

    def __init__(self, key: str, reason: str = "") -> None:
        super().__init__(f"{key}: {reason}" if reason else key)  # from a pickle comes the whole text


def parsed(text: bytes, key: str) -> Any:
    """Return the value of a JSON text with finite numbers. ``key`` is its name in the ValueRefused of another text."""
    try:
        value = json.loads(text)
        json.dumps(value, allow_nan=False)
    except (ValueError, RecursionError) as error:
        raise ValueRefused(key, f"expected JSON with finite numbers, got {shown(text)}") from error
    return value


def decoded(content: object, kind: type[_T], key: str) -> _T:
    """Convert parsed JSON to its struct; raise ValueRefused for the first value that the struct does not allow.

    >>> class Rate(Struct):
    ...     rate_hz: Annotated[float, Meta(ge=1e-6)]
    >>> decoded({"rate_hz": 0}, Rate, "info")
    Traceback (most recent call last):
    storage.schema.ValueRefused: info.rate_hz: expected `float` >= 1e-06
    """
    try:
        return msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        reason, _, path = ascii(str(error))[1:-1].partition(_AT)
        raise ValueRefused(key + path.removesuffix("`"), reason[:1].lower() + reason[1:]) from error
    except (UnicodeEncodeError, OverflowError) as error:  # half a surrogate pair in a key, an integer of 400 digits
        raise ValueRefused(key, f"expected names of characters and finite numbers ({type(error).__name__})") from error


def shown(value: object) -> str:
    """Return the beginning of a value in visible ASCII, because a text from a file may contain terminal commands."""
    words = ascii(value)
    return words if len(words) <= _SHOWN else f"{words[:_SHOWN]}..."


def plain(value: Any) -> dict[str, Any]:
    """Return the fields of a struct or dataclass by name; nested ones are not converted."""
    if isinstance(value, Struct):
        return {name: getattr(value, name) for name in value.__struct_fields__}
    if dataclasses.is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    raise TypeError(f"expected a value that JSON can store, got {value!r} ({type(value).__name__})")


def json_text(value: Any) -> str:
    """Return canonical JSON: sorted keys, no blanks, ASCII; numpy numbers become plain numbers.

    Raises TypeError or ValueError if JSON cannot store a value: an object, NaN, an infinity.

    >>> json_text({"b": np.float64(0.5), "a": [1, None]})
    '{"a":[1,null],"b":0.5}'
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, default=_jsonable)


def _jsonable(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else plain(value)
