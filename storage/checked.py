"""What a header from outside may say: the type and range of each value, checked in one place with one message.

A header behind a right checksum is still a stranger's: the checksum says that it is what was written, not that it makes
sense. Rules are data (:class:`Number`, :class:`Text`, ...), put together as the header is, and :func:`demand` goes
through both. Whatever it lets pass has the types, ranges, sizes and depth that the code behind relies on.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

__all__ = ["Choice", "Json", "Number", "Optional", "Rows", "Rule", "Table", "Text", "ValueRefused", "demand", "parsed"]

_SHOWN = 60
_GREATEST = sys.float_info.max  # an integer beyond it is no float's equal, and NaN compares as false


class ValueRefused(ValueError):
    """A value of a header that it may not have.

    Parameters
    ----------
    key : str
        Where it stands, dotted.
    allowed : str
        What may stand there.
    value : object
        What does.
    """

    def __init__(self, key: str, allowed: str, value: object) -> None:
        super().__init__(key, allowed, value)

    def __str__(self) -> str:
        key, allowed, value = self.args
        return f"{key} must be {allowed}, got {_short(value)}"


@dataclass(frozen=True, slots=True)
class Number:
    """A finite number within a range, both ends allowed."""

    least: float
    greatest: float
    whole: bool = False

    def allowed(self) -> str:
        """Return the rule in words."""
        return f"a {'whole' if self.whole else 'finite'} number from {self.least:g} to {self.greatest:g}"

    def demand(self, value: object, key: str) -> None:
        """Refuse what the rule does not allow."""
        kinds = int if self.whole else int | float
        # Python compares an integer of any length with a float; NaN compares as false.
        if isinstance(value, bool) or not isinstance(value, kinds) or not self.least <= value <= self.greatest:
            raise ValueRefused(key, self.allowed(), value)


@dataclass(frozen=True, slots=True)
class Text:
    """A text up to a length, of a pattern where one is given."""

    longest: int = 1 << 20
    pattern: str = ""
    words: str = "a text"

    def allowed(self) -> str:
        """Return the rule in words."""
        return f"{self.words} of at most {self.longest} characters"

    def demand(self, value: object, key: str) -> None:
        """Refuse what the rule does not allow."""
        if not isinstance(value, str) or len(value) > self.longest:
            raise ValueRefused(key, self.allowed(), value)
        if self.pattern and not re.fullmatch(self.pattern, value):
            raise ValueRefused(key, self.allowed(), value)


@dataclass(frozen=True, slots=True)
class Choice:
    """One of a few texts."""

    words: tuple[str, ...]

    def demand(self, value: object, key: str) -> None:
        """Refuse what the rule does not allow."""
        if not isinstance(value, str) or value not in self.words:
            raise ValueRefused(key, f"one of {', '.join(word or repr('') for word in self.words)}", value)


@dataclass(frozen=True, slots=True)
class Optional:
    """Nothing (null), or what another rule allows."""

    rule: Rule

    def demand(self, value: object, key: str) -> None:
        """Refuse what the rule does not allow."""
        if value is not None:
            self.rule.demand(value, key)


@dataclass(frozen=True, slots=True)
class Rows:
    """A list of things of one rule."""

    rule: Rule
    most: int = 100_000

    def demand(self, value: object, key: str) -> None:
        """Refuse what the rule does not allow."""
        if not isinstance(value, Sequence) or isinstance(value, str) or len(value) > self.most:
            raise ValueRefused(key, f"a list of at most {self.most}", value)
        for number, each in enumerate(value):
            self.rule.demand(each, f"{key}[{number}]")


@dataclass(frozen=True, slots=True)
class Table:
    """A table by keys: those that must be there, those that may, and what any other holds (None: there is no other)."""

    keys: Mapping[str, Rule] = field(default_factory=dict)
    may: Mapping[str, Rule] = field(default_factory=dict)
    other: Rule | None = None

    def demand(self, value: object, key: str) -> None:
        """Refuse what the rule does not allow."""
        known = {**self.keys, **self.may}
        if not isinstance(value, Mapping):
            raise ValueRefused(key, "a table", value)
        if missing := [name for name in self.keys if name not in value]:
            raise ValueRefused(key, f"a table with {missing[0]}", dict(value))
        for name, inner in value.items():
            rule = known.get(name, self.other)
            if rule is None:
                raise ValueRefused(key, f"a table of {', '.join(known)}", {name: inner})
            rule.demand(inner, f"{key}.{_short(name)[1:-1]}")


@dataclass(frozen=True, slots=True)
class Json:
    """Whatever JSON holds, to a depth."""

    deepest: int = 32

    def demand(self, value: object, key: str) -> None:
        """Refuse what the rule does not allow."""
        level = [value]
        for _ in range(self.deepest):
            inner: list[object] = []
            for each in level:
                if isinstance(each, Mapping):
                    inner += each.values()
                elif isinstance(each, list | tuple):
                    inner += each
                elif isinstance(each, int | float) and not -_GREATEST <= each <= _GREATEST:
                    raise ValueRefused(key, "finite where it holds numbers", each)
            level = inner
            if not level:
                return
        raise ValueRefused(key, f"nested at most {self.deepest} deep", value)


Rule = Number | Text | Choice | Optional | Rows | Table | Json


def demand(rule: Rule, value: object, key: str) -> None:
    """Hold a value against its rule.

    Parameters
    ----------
    rule : Rule
    value : object
        As ``json`` gives it.
    key : str
        What the message calls it; keys inside are added after dots.

    Raises
    ------
    ValueRefused
        For the first that its rule does not allow: key, what is allowed, value.

    Examples
    --------
    >>> demand(Table({"rate_hz": Number(1e-6, 1e9)}), {"rate_hz": "fast"}, "info")
    Traceback (most recent call last):
    storage.checked.ValueRefused: info.rate_hz must be a finite number from 1e-06 to 1e+09, got 'fast'
    """
    rule.demand(value, key)


def parsed(text: bytes, key: str) -> Any:
    """Return what a JSON text holds.

    Raises
    ------
    ValueRefused
        If it is none, or is nested deeper than Python's own reader goes.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueRefused(key, "JSON", text[:_SHOWN]) from error


def _short(value: object) -> str:
    """Return the beginning of a value as Python writes it."""
    if isinstance(value, int | float):
        try:
            return repr(value)[:_SHOWN]
        except ValueError:
            return "an integer of thousands of digits"  # Python refuses to print it
    if isinstance(value, str | bytes):
        words = ascii(value[:_SHOWN])
        return words if len(value) <= _SHOWN else f"{words}..."
    if isinstance(value, Mapping):
        names = [_short(name) for name in list(value)[:4]]
        return f"a table of {', '.join(names)}{', ...' if len(value) > 4 else ''}" if names else "an empty table"
    if isinstance(value, Sequence):
        return f"a list of {len(value)}"
    return "nothing" if value is None else ascii(value)[:_SHOWN]
