"""Where in a line of text a number stands: by its place, or after a name."""

from __future__ import annotations

import re
from dataclasses import dataclass

from acquisition.errors import SensorError

__all__ = ["Column", "as_column", "as_separator", "split"]

# No float() on what came: it takes "nan", "inf" and "1_0" for numbers.
_NUMBER = rb"[+-]?(?:[0-9]{1,15}(?:\.[0-9]{0,12})?|\.[0-9]{1,12})(?:[eE][+-]?[0-9]{1,2})?"
_NAME = re.compile(r"[A-Za-z_][\w .-]{0,31}", re.ASCII)
_ANY = re.compile(rb"[\s,;]+")


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a line.

    Parameters
    ----------
    index : int or None
        Place from 0; None where it is found by name.
    name : bytes
        Empty where it is found by place.
    form : re.Pattern
        Of the whole cell, or of name and number.
    """

    index: int | None
    name: bytes
    form: re.Pattern[bytes]

    def number(self, line: bytes, cells: list[bytes]) -> float | None:
        """Return the number of a line split into cells, None where there is none."""
        if self.index is None:
            found = self.form.search(line)
        elif self.index < len(cells):
            found = self.form.fullmatch(cells[self.index].strip())
        else:
            return None
        return None if found is None else float(found[1])


def as_column(option: str, where: int | str, unit: str = "") -> Column:
    """Return the column that an option names.

    The unit may stand behind the number, and no other: "12.3 cm" read as millimetres is refused line by line.

    Raises
    ------
    SensorError
        If it is neither a number from 0 nor a name.
    """
    text = str(where).strip()
    tail = rb"(?:[ ]?" + re.escape(unit.encode()) + rb")?" if unit else b""
    if text.isdecimal() and text.isascii() and int(text) < 64:
        return Column(int(text), b"", re.compile(rb"(" + _NUMBER + rb")" + tail))
    if _NAME.fullmatch(text) is None:
        raise SensorError(f"{option} of text-lines must be a column from 0 to 63 or a name, got {where!r}")
    before, after = rb"(?:^|[\s,;:|])", rb"\s*[=:]\s*(" + _NUMBER + rb")" + tail + rb"(?=$|[\s,;|])"
    other = rb"(?!\s+(?:m|cm|mm|in|us|ms|s)(?:$|[\s,;|]))" if unit else b""
    return Column(None, text.encode(), re.compile(before + re.escape(text.encode()) + after + other))


def as_separator(text: str | None) -> bytes:
    """Return a separator as bytes, empty for any of blanks, commas and semicolons.

    Raises
    ------
    SensorError
        If it is longer than one character.
    """
    named = {"tab": "\t", "space": " ", "comma": ",", "semicolon": ";", None: "", "any": ""}
    plain = named.get(text, text or "")
    if len(plain) > 1 or not plain.isascii() or (plain and plain in "\r\n.+-"):
        raise SensorError(f"separator of text-lines must be one character, tab or any, got {text!r}")
    return plain.encode()


def split(line: bytes, separator: bytes) -> list[bytes]:
    """Return the cells of a line."""
    return line.split(separator) if separator else _ANY.split(line)
