"""Dialects that a user declares without code, in TOML files; docs/how-to/add-a-format.md shows one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from acquisition.errors import AcquisitionError
from acquisition.recordings.identify import dialect_folder
from acquisition.recordings.sampling.timing import Formula
from acquisition.recordings.tables.format import ColumnFormat, text_format
from acquisition.recordings.tables.headings import Heading
from acquisition.recordings.tables.table import Header
from acquisition.regular_file import open_regular_text
from acquisition.units import TIMES, time_unit


class _DeclaredColumn(msgspec.Struct, forbid_unknown_fields=True):
    name: Annotated[str, msgspec.Meta(min_length=1)]
    unit: str = ""
    time: bool = False
    aside: bool = False

    def __post_init__(self) -> None:
        if self.time and self.unit and time_unit(self.unit) is None:
            raise ValueError(f'unit of a time must be one of {", ".join(TIMES)}, got "{self.unit}"')


class _Declared(msgspec.Struct, forbid_unknown_fields=True):
    begins: Annotated[str, msgspec.Meta(pattern=r"\S")]
    column: Annotated[list[_DeclaredColumn], msgspec.Meta(min_length=1)]
    title: str = ""
    separator: Literal["tab", "blank", ";", ",", "|"] = ","
    heading: Annotated[int, msgspec.Meta(ge=0, le=1000)] = 1
    rate_hz: Annotated[float, msgspec.Meta(gt=0, lt=1e12)] | None = None


def dialects() -> Iterator[ColumnFormat]:
    """Yield the families that the user declares, sorted by name; an invalid declaration is an error."""
    for path in sorted(dialect_folder().glob("*.toml")):
        try:
            with open_regular_text(path, "utf-8") as file:
                text = file.read()
        except (OSError, UnicodeError) as error:
            raise AcquisitionError(f"{path}: cannot be read ({error})", "repair or remove it") from error
        yield dialect(str(path), text)


def dialect(path: str, text: str) -> ColumnFormat:
    """Return the family that a TOML text declares.

    Parameters
    ----------
    path : str
        Path of the declaration; its stem is the family's name.
    text : str

    Raises
    ------
    AcquisitionError
        If the declaration is not valid; the message is one line.
    """
    try:
        declared = msgspec.toml.decode(text, type=_Declared)
    except msgspec.ValidationError as error:
        raise AcquisitionError(f"{path}: {' '.join(str(error).split())}", "correct it") from error
    except msgspec.DecodeError as error:
        raise AcquisitionError(f"{path}: expected TOML, got {error}", "repair or remove it") from error
    name = Path(path).stem
    headings = [
        Heading(each.name, each.unit, role="time" if each.time else "aside" if each.aside else "channel")
        for each in declared.column
    ]
    timed = any(each.time for each in declared.column)
    formula = None if declared.rate_hz is None or timed else Formula(0.0, 1.0 / declared.rate_hz)

    def header(lines: Sequence[str]) -> Header | None:
        if not lines[0].lstrip("\ufeff").startswith(declared.begins):
            return None
        why = f'line 1 begins with "{declared.begins}", as {name}.toml says'
        mark = {"tab": "\t", "blank": ""}.get(declared.separator, declared.separator)
        title = lines[0].strip() if declared.heading else ""
        return Header(why, declared.heading, mark, headings, formula=formula, title=title)

    return text_format(name, declared.title or f"declared in {Path(path).name}", header)
