"""Dialects that a user declares without code: a TOML file describes the tables of a family.

Each file in ``springmass/dialects`` under the user's configuration folder is a family with the name of the file::

    title = "height log of bench 12"
    begins = "Height log"            # what line 1 begins with
    separator = ";"                  # or "tab", "blank"
    heading = 1                      # lines above the rows
    rate_hz = 100                    # if no column holds times

    [[column]]
    name = "n"
    aside = true                     # read only if it is named

    [[column]]
    name = "height"
    unit = "mm"                      # a column of times has time = true
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import PurePath
from typing import Any

from acquisition.errors import AcquisitionError, FormatError
from acquisition.recordings.base import dialect_folder
from acquisition.recordings.tables.contents import Channel, Contents, Formula, Sheet
from acquisition.recordings.tables.sheet import ColumnFormat
from acquisition.recordings.tables.text import head_lines, text_of
from acquisition.recordings.units import TIMES, time_power
from acquisition.regular_file import open_regular_text

__all__ = ["dialect", "dialects"]

_SEPARATORS = {"tab": "\t", "blank": "", ";": ";", ",": ",", "|": "|"}
_KEYS: dict[str, tuple[type, ...]] = {
    "title": (str,),
    "begins": (str,),
    "separator": (str,),
    "heading": (int,),
    "rate_hz": (int, float),
    "column": (list,),
}
_COLUMN_KEYS: dict[str, tuple[type, ...]] = {"name": (str,), "unit": (str,), "time": (bool,), "aside": (bool,)}
_MOST_HEADING = 1000


def dialects() -> Iterator[ColumnFormat]:
    """Yield the families that the user declares, sorted by name.

    Raises
    ------
    AcquisitionError
        If a declaration is not valid.
    """
    for path in sorted(dialect_folder().glob("*.toml")):
        try:
            with open_regular_text(path, "utf-8") as file:
                text = file.read()
        except (OSError, UnicodeError) as error:
            raise AcquisitionError(f"{path}: cannot be read ({error}); repair or remove it") from error
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
        If the declaration is not valid; the message is one line with the file, the key and the allowed values.

    Examples
    --------
    >>> family = dialect("bench.toml", 'begins = "#bench"\\nheading = 1\\n[[column]]\\nname = "y"\\nunit = "mm"')
    >>> family.name, family.recognises(b"#bench 12\\n0.5\\n")
    ('bench', True)
    """
    try:
        declared = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise AcquisitionError(f"{path}: expected TOML, got {error}; repair or remove it") from error
    _demand_keys(path, "", declared, _KEYS, ("begins", "column"))
    for number, each in enumerate(declared["column"], 1):
        if not isinstance(each, dict):
            raise AcquisitionError(f"{path}: column {number} must be a table, got {each!r}; write it under [[column]]")
        _demand_keys(path, f"column {number}: ", each, _COLUMN_KEYS, ("name",))
        if each.get("time") and each.get("unit") and time_power(each["unit"]) is None:
            allowed = ", ".join(TIMES)
            raise AcquisitionError(
                f'{path}: column {number}: unit of a time must be one of {allowed}, got "{each["unit"]}"'
            )
    if not declared["begins"].strip():
        raise AcquisitionError(f'{path}: begins must be the beginning of line 1, got "{declared["begins"]}"')
    if declared.get("separator", ",") not in _SEPARATORS:
        allowed = ", ".join(f'"{each}"' for each in _SEPARATORS)
        raise AcquisitionError(f'{path}: separator must be one of {allowed}, got "{declared["separator"]}"')
    if not 0 <= declared.get("heading", 1) <= _MOST_HEADING:
        raise AcquisitionError(f"{path}: heading must be 0 to {_MOST_HEADING} lines, got {declared['heading']}")
    if not 0 < declared.get("rate_hz", 1) < float("inf"):
        raise AcquisitionError(f"{path}: rate_hz must be a positive number, got {declared['rate_hz']}")
    name = PurePath(path).stem

    def evidence(head: bytes) -> str:
        first = head_lines(head)[0].lstrip("\ufeff")
        return (
            f'line 1 begins with "{declared["begins"]}", as {name}.toml says'
            if first.startswith(declared["begins"])
            else ""
        )

    return ColumnFormat(
        name,
        declared.get("title", f"declared in {PurePath(path).name}"),
        evidence,
        lambda p, d: _contents(p, d, declared),
    )


def _demand_keys(
    path: str, where: str, declared: Mapping[str, Any], keys: Mapping[str, tuple[type, ...]], needed: tuple[str, ...]
) -> None:
    for key, value in declared.items():
        if key not in keys:
            raise AcquisitionError(f'{path}: {where}key must be one of {", ".join(keys)}, got "{key}"; correct it')
        if type(value) not in keys[key]:
            kinds = " or ".join(each.__name__ for each in keys[key])
            raise AcquisitionError(f"{path}: {where}{key} must be {kinds}, got {value!r}; correct it")
    for key in needed:
        if not declared.get(key):
            raise AcquisitionError(f"{path}: {where}expected {key}, got none; write it")


def _contents(path: str, data: bytes, declared: Mapping[str, Any]) -> Contents:
    text, heading = text_of(path, data), declared.get("heading", 1)
    lines = [line for line, _ in zip(text.lines(), range(heading + 1), strict=False)]
    if len(lines) <= heading:
        raise FormatError(path, f"expected rows below {heading} lines, got none", "check that the export ended")
    columns = declared["column"]
    names = tuple(each["name"] for each in columns)
    mark = _SEPARATORS[declared.get("separator", ",")]
    sheet = Sheet(text, lines[heading].start, text.stop, heading + 1, mark, names=names)
    times = [column for column, each in enumerate(columns) if each.get("time")]
    formula = Formula(0.0, 1.0 / declared["rate_hz"]) if "rate_hz" in declared and not times else None
    channels = []
    for column, each in enumerate(columns):
        if column not in times:
            time = max((at for at in times if at < column), default=times[0] if times else None)
            time_unit = "" if time is None else columns[time].get("unit", "")
            unit, aside = each.get("unit", ""), each.get("aside", False)
            channels.append(Channel(each["name"], unit, sheet, "", column, time, time_unit, formula, aside=aside))
    if not channels:
        raise FormatError(path, "expected a column beside the times, got none", "declare what is measured too")
    return Contents(tuple(channels), title=lines[0].text.strip() if heading else "", zeros=text.zeros)
