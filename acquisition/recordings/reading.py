"""How a file is read: what the user states about a recording that its file leaves out or open.

This is the only list of these options. The command line, the keywords of Python, the notes next to a recording, the
columns of a table of runs and the questions of a reader have its names; a format takes the options as they are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from enum import Enum
from pathlib import Path
from typing import Any, Self


class ValueKind(Enum):
    """What the value of an option is."""

    NAME = "name"
    POSITIVE = "positive number"
    FILE = "file"
    YES = "yes"


def words_of(metavar: str, words: str, kind: ValueKind = ValueKind.NAME) -> Mapping[str, Any]:
    """Return what a person reads of an option, as the metadata of its field."""
    return {"metavar": metavar, "help": words, "kind": kind}


@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """The statements of a user about a file; None for each that is not made, then only the file's own are used."""

    velocity: str | Path | None = field(
        default=None, metadata=words_of("FILE", "velocity file that belongs to the position file", ValueKind.FILE)
    )
    channel: str | None = field(
        default=None, metadata=words_of("NAME", "channel to use if there are several; for a wire log, the sensor")
    )
    run: str | None = field(default=None, metadata=words_of("NAME", "run to use if there are several: name or number"))
    rate_hz: float | None = field(
        default=None, metadata=words_of("R", "samples per second if the file does not state them", ValueKind.POSITIVE)
    )
    unit: str | None = field(
        default=None, metadata=words_of("U", "unit of the channel if the file does not state it: m, cm, rad, V ...")
    )
    time: str | None = field(
        default=None, metadata=words_of("NAME", "column with the times if the file does not state it")
    )
    time_unit: str | None = field(
        default=None, metadata=words_of("U", "unit of the times if the file does not state it: s, ms, us, min, h, d")
    )
    delimiter: str | None = field(
        default=None, metadata=words_of("C", "separator of a text's cells, else found out: comma, tab, space, ';' ...")
    )
    decimal: str | None = field(default=None, metadata=words_of("C", "decimal mark of a text, else found out: . or ,"))

    def given(self) -> dict[str, Any]:
        """Return the values of all options that are not the default, by name."""
        return {each.name: value for each in fields(self) if (value := getattr(self, each.name)) != each.default}

    @classmethod
    def of(cls, answers: Mapping[str, Any]) -> Self:
        """Return the options given as keyword arguments."""
        names = [each.name for each in fields(cls)]
        if unknown := [name for name in answers if name not in names]:
            raise TypeError(f"{unknown[0]!r} is no option of reading; the options are {', '.join(names)}")
        return cls(**answers)

    def about_the_file(self) -> ReadOptions:
        """Return the options of reading alone, without those that a subclass adds."""
        return ReadOptions(**{name: getattr(self, name) for name in READ_FIELDS})


READ_FIELDS: Mapping[str, Field[Any]] = {each.name: each for each in fields(ReadOptions)}
"""The options by name; their metadata are the placeholder of the value, the help, and the kind of the value."""
READ_DEFAULTS = ReadOptions()
"""Nothing is stated."""


def value_of(name: str, value: object, options: Mapping[str, Field[Any]] = READ_FIELDS) -> str | float | bool:
    """Return the value of an option that a person wrote; ValueError says what it must be."""
    if name not in options:
        raise ValueError(f"{name!r} is no option of reading; the options are {', '.join(options)}")
    kind = options[name].metadata["kind"]
    if kind is ValueKind.YES:
        if value != "yes":
            raise ValueError(f"{name} must be yes or left out, got {value!r}")
        return True
    if kind is not ValueKind.POSITIVE:
        if not isinstance(value, str) or not value:
            raise ValueError(f"{name} must be a text, got {value!r}")
        return value
    try:
        number = float(value) if isinstance(value, str | int | float) and not isinstance(value, bool) else math.nan
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise ValueError(f"{name} must be a positive number, got {value!r}")
    return number
