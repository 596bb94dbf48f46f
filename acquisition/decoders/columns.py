"""Find a number in a line of text, by its column or by the name before it."""

from __future__ import annotations

import re
from dataclasses import dataclass

from acquisition.errors import SensorError

__all__ = ["Column", "as_column", "as_separator", "split"]

# float() alone would also accept "nan", "inf" and "1_0".
_NUMBER = rb"[+-]?(?:[0-9]{1,15}(?:\.[0-9]{0,12})?|\.[0-9]{1,12})(?:[eE][+-]?[0-9]{1,2})?"
_NAME = re.compile(r"[A-Za-z_][\w .-]{0,31}", re.ASCII)
_ANY = re.compile(rb"[\s,;]+")


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a line.

    Parameters
    ----------
    index : int or None
        Number of the column, from 0; None for a column that is found by name.
    name : bytes
        Name of the column; empty for a column that is found by index.
    form : re.Pattern
        Pattern of the whole cell, or of the name and its number.
    """

    index: int | None
    name: bytes
    form: re.Pattern[bytes]

    def number(self, line: bytes, cells: list[bytes]) -> float | None:
        """Return the number of this column in a line that was split into cells, or None if there is no number."""
        if self.index is None:
            match = self.form.search(line)
        elif self.index < len(cells):
            match = self.form.fullmatch(cells[self.index].strip())
        else:
            return None
        return None if match is None else float(match[1])


def as_column(option: str, where: int | str, unit: str = "") -> Column:
    """Return the column that an option names.

    Only the given unit may follow the number: a line with "12.3 cm" is refused if the unit is mm.

    Raises
    ------
    SensorError
        If the option is neither a number from 0 to 63 nor a name.
    """
    text = str(where).strip()
    tail = rb"(?:[ ]?" + re.escape(unit.encode()) + rb")?" if unit else b""
    if text.isdecimal() and text.isascii() and int(text) < 64:
        return Column(int(text), b"", re.compile(rb"(" + _NUMBER + rb")" + tail))
    if _NAME.fullmatch(text) is None:
        raise SensorError(f"{option} of text-lines must be a column from 0 to 63 or a name, got {where!r}")
    before, after = rb"(?:^|[\s,;:|])", rb"\s*[=:]\s*(" + _NUMBER + rb")" + tail + rb"(?=$|[\s,;|])"
    no_other_unit = rb"(?!\s+(?:m|cm|mm|in|us|ms|s)(?:$|[\s,;|]))" if unit else b""
    return Column(None, text.encode(), re.compile(before + re.escape(text.encode()) + after + no_other_unit))


def as_separator(text: str | None) -> bytes:
    """Return a separator as bytes; it is empty if blanks, commas and semicolons are all separators.

    Raises
    ------
    SensorError
        If the separator is not one ASCII character, or belongs to a number or a line end.
    """
    named = {"tab": "\t", "space": " ", "comma": ",", "semicolon": ";", None: "", "any": ""}
    plain = named.get(text, text or "")
    if len(plain) > 1 or not plain.isascii() or (plain and plain in "\r\n.+-"):
        raise SensorError(f"separator of text-lines must be one character, tab or any, got {text!r}")
    return plain.encode()


def split(line: bytes, separator: bytes) -> list[bytes]:
    """Split a line into its cells."""
    return line.split(separator) if separator else _ANY.split(line)
