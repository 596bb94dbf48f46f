"""Text with columns of numbers: encoding, lines, separators of cells, and the parsing of numbers."""

from __future__ import annotations

import codecs
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from acquisition.errors import FormatError

__all__ = [
    "Line",
    "Text",
    "decode",
    "guess_delimiter",
    "head_lines",
    "is_text",
    "parse_number",
    "printed_decimals",
    "says_simulated",
    "split_cells",
    "text_of",
    "unify",
]

_NUMBER = re.compile(r"[+-]?(?:\d+\.?(\d*)|\.(\d+))(?:[eE][+-]?\d{1,3})?", re.ASCII)
_CONTROL = bytes(c for c in range(32) if c not in b"\t\n\r\f\x1a")
_FOREIGN = re.compile(rb"[\x80-\xff]+[\x21-\x7e]?")
_HANZI = re.compile(rb"(?:[\xb0-\xd7\xa1-\xa3][\xa1-\xfe])+[\x21-\x7e]?")
"""Common Chinese characters in GB 2312; in cp1252 these codes are capitals with accents, which rarely come in pairs."""
_LINE_END = re.compile(rb"\r\n|\r|\n")
_BLANKS = "\t\f "
_ZIP = b"PK\x03\x04"


class Line(NamedTuple):
    """One line of a text: its one-based number, the byte positions of its start and of the next line, its content."""

    number: int
    start: int
    next: int
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Text:
    """A text as bytes in which every digit, sign and separator is one byte.

    Parameters
    ----------
    data : bytes
        UTF-8 or an 8-bit code; UTF-16 has been converted to UTF-8.
    start, stop : int
        Position of the first byte after a byte order mark, and of the end of the text before trailing zero bytes.
    zeros : int
        Number of bytes that were cut off at the end: zero bytes and end-of-file characters.
    """

    data: bytes
    start: int
    stop: int
    zeros: int

    @classmethod
    def of(cls, data: bytes) -> Text:
        """Return the text of a file's bytes.

        Examples
        --------
        >>> text = Text.of("\\ufeff0,5\\n".encode("utf-16"))
        >>> [line.text for line in text.lines()], Text.of(b"1\\n\\0\\0").zeros
        (['0,5'], 2)
        """
        if encoding := _utf16(data[:8192]):
            data = data.decode(encoding, errors="replace").removeprefix("\ufeff").encode("utf-8", "replace")
        start = 3 if data.startswith(codecs.BOM_UTF8) else 0
        stop = len(data)
        if data[-1:] in (b"\0", b"\x1a"):
            stop = max(len(data.rstrip(b"\0\x1a")), start)
        return cls(data, start, stop, len(data) - stop)

    def lines(self, start: int | None = None, number: int = 1) -> Iterator[Line]:
        """Yield the lines from byte ``start`` to the end; ``number`` is the number of the first line.

        An empty last line is not yielded.
        """
        at = self.start if start is None else start
        for match in _LINE_END.finditer(self.data, at, self.stop):
            yield Line(number, at, match.end(), decode(self.data[at : match.start()]))
            at, number = match.end(), number + 1
        if at < self.stop:
            yield Line(number, at, self.stop, decode(self.data[at : self.stop]))

    def head(self, limit: int = 64) -> list[Line]:
        """Return the first lines: at most ``limit`` lines, all of which start within 64 KiB."""
        lines: list[Line] = []
        for line in self.lines():
            if len(lines) == limit or line.start - self.start > 65536:
                break
            lines.append(line)
        return lines


def text_of(path: str, data: bytes) -> Text:
    """Return the text of a file.

    Raises
    ------
    FormatError
        If the file is binary.
    """
    if not is_text(data):
        raise FormatError(path, "expected rows of text, got binary data", "export the run as text again")
    return Text.of(data)


def is_text(data: bytes) -> bool:
    """Return whether bytes can be text: UTF-8, UTF-16 or an 8-bit code with few control characters.

    Examples
    --------
    >>> is_text(b"0.010\\t31.433\\r\\n"), is_text(bytes(range(256)) * 9)
    (True, False)
    """
    head = data[:8192]
    if head.startswith(_ZIP):  # an uncompressed archive of texts has few control characters
        return False
    if _utf16(head):
        return True
    head = head.rstrip(b"\0") or head
    return len(head) - len(head.translate(None, _CONTROL)) <= 0.02 * len(head)


def decode(data: bytes) -> str:
    """Decode a text of unknown encoding; an invalid byte becomes U+FFFD, which is not part of a number.

    Byte order marks are obeyed and removed. UTF-16 without one is recognised by its zero bytes. Text that is not UTF-8
    is read as GB 2312 if its bytes look like that, else as cp1252. An incomplete character at the end is ignored.

    Examples
    --------
    >>> decode("\\ufeff0,5".encode("utf-16-le")), decode(b"20 \\xb0C")
    ('0,5', '20 °C')
    """
    if data.isascii() and b"\0" not in data:
        return data.decode("ascii")  # the usual case, without further checks
    if data.startswith(codecs.BOM_UTF8):
        data = data[3:]
    elif encoding := _utf16(data[:8192]):
        return data.decode(encoding, errors="replace").removeprefix("\ufeff")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.reason == "unexpected end of data" and error.end == len(data) and error.start:
            return data[: error.start].decode("utf-8")
        if all(_HANZI.fullmatch(each) for each in _FOREIGN.findall(data)):
            return data.decode("gb18030", errors="replace")
        return data.decode("cp1252", errors="replace")


def _utf16(head: bytes) -> str:
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16-le" if head.startswith(codecs.BOM_UTF16_LE) else "utf-16-be"
    if len(head) < 8 or b"\0" not in head:
        return ""
    even, odd = head[::2], head[1::2]
    # Digits in UTF-16 have one zero byte each, always on the same side.
    zero_even, zero_odd = even.count(0) / len(even), odd.count(0) / len(odd)
    if zero_odd > 0.8 and zero_even < 0.1:
        return "utf-16-le"
    return "utf-16-be" if zero_even > 0.8 and zero_odd < 0.1 else ""


def says_simulated(text: str) -> bool:
    """Return whether a title or a name marks simulated data.

    In most formats only a title or a name can mark simulated data, which must not be mistaken for measured data.

    Examples
    --------
    >>> says_simulated("Undamped, Simulated"), says_simulated("bench 3")
    (True, False)
    """
    plain = text.lower()
    return "simulat" in plain or "synthe" in plain


def unify(text: str) -> str:
    """Convert every line end (CRLF, CR, LF) to LF.

    Examples
    --------
    >>> unify("a\\r\\nb\\rc\\n")
    'a\\nb\\nc\\n'
    """
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def head_lines(head: bytes) -> list[str]:
    """Return the lines of the head of a file; one empty line for a binary file.

    Examples
    --------
    >>> head_lines(b"Time (s)\\r\\n0.5"), head_lines(bytes(64))
    (['Time (s)', '0.5'], [''])
    """
    return unify(decode(head)).split("\n") if is_text(head) else [""]


def parse_number(cell: str, shift: int = 0) -> float | None:
    """Parse one cell: a decimal number, with a point or a comma, or NaN; return None for any other text.

    It is stricter than ``float()``: it rejects ``1_000``, ``inf``, digits of other scripts, and numbers that overflow.

    Parameters
    ----------
    cell : str
    shift : int
        The number is multiplied by ten to this power and rounded once.

    Examples
    --------
    >>> parse_number("-8,90E-4"), parse_number("NaN"), parse_number("1_0"), parse_number("1.234,5")
    (-0.00089, nan, None, None)
    >>> parse_number("16.509", -2)
    0.16509
    """
    if "," in cell and "." not in cell:
        cell = cell.replace(",", ".", 1)
    if not _NUMBER.fullmatch(cell):
        return math.nan if cell.lower() in ("nan", "-nan", "+nan") else None
    if shift:
        mantissa, _, exponent = cell.lower().partition("e")
        cell = f"{mantissa}e{int(exponent or 0) + shift}"
    value = float(cell)
    return value if math.isfinite(value) else None


def printed_decimals(cell: str) -> int:
    """Return the number of printed decimals of a number, or of its mantissa if it has an exponent."""
    match = _NUMBER.fullmatch(cell.replace(",", ".", 1))
    return len(match[1] or match[2] or "") if match else 0


def guess_delimiter(line: str) -> str:
    """Return the separator of the cells of a row; an empty string means runs of white space.

    A comma is the separator only if there is no other separator, because it may be a decimal mark.

    Examples
    --------
    >>> guess_delimiter("0,43;16,5"), guess_delimiter("0.43 16.5"), guess_delimiter("0.43,16.5")
    (';', '', ',')
    """
    for mark in "\t;":
        if mark in line:
            return mark
    if "," not in line:
        return ""
    # "0,43 16,5" is separated by blanks; "0.43, 16.5" by commas.
    by_blanks = any(cell and cell[-1] != "," for cell in line.strip(" ").split(" ")[:-1])
    return "" if by_blanks and ", " not in line else ","


def split_cells(line: str, delimiter: str) -> list[str]:
    """Split a row into stripped cells; separators at the end of the row are ignored.

    Only blanks are stripped. Any other white space is damage, and a number next to it may have lost digits.
    """
    if not delimiter:
        return [cell for cell in line.replace("\t", " ").split(" ") if cell]
    cells = [cell.strip(" ") for cell in line.split(delimiter)]
    while cells and not cells[-1]:
        cells.pop()
    return cells
