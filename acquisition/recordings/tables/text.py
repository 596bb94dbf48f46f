"""Text with columns of numbers: its encoding and its lines."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from acquisition.errors import FormatError

HEAD_BYTES = 8192
"""Number of bytes at the start of a file from which a format recognises it."""
_TURNS = 10
_DELIMITERS = {"tab": "\t", "\\t": "\t", "comma": ",", "semicolon": ";", "space": " "}
_CONTROL = bytes(c for c in range(32) if c not in b"\t\n\r\f\x1a")
_FOREIGN = re.compile(rb"[\x80-\xff]+[\x21-\x7e]?")
_HANZI = re.compile(rb"(?:[\xb0-\xd7\xa1-\xa3][\xa1-\xfe])+[\x21-\x7e]?")
"""Common Chinese characters in GB 2312; in cp1252 these codes are capitals with accents, which rarely come in pairs."""
_LINE_END = re.compile(rb"\r\n|\r|\n")
_NUMBER = re.compile(rb"[\s,;]*[-+]?[.,]?\d")
_ZIP = b"PK\x03\x04"
_PAGE_BYTES = 1 << 16
_HEAD_SPAN = 1 << 16


class Line(NamedTuple):
    """One line: its one-based number, the byte positions of its start and of the next line, its text."""

    number: int
    start: int
    next: int
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Text:
    """A text as bytes in which every digit, sign and separator is one byte.

    It lies between ``start``, after a byte order mark, and ``stop``, before trailing zero bytes (``zeros`` in number).
    """

    data: bytes
    start: int
    stop: int
    zeros: int

    @classmethod
    def of(cls, data: bytes) -> Text:
        """Return the text of a file's bytes."""
        if encoding := _utf16(data[:HEAD_BYTES]):
            data = data.decode(encoding, errors="replace").removeprefix("\ufeff").encode("utf-8", "replace")
        start = 3 if data.startswith(codecs.BOM_UTF8) else 0
        stop = len(data)
        if data[-1:] in (b"\0", b"\x1a"):
            stop = max(len(data.rstrip(b"\0\x1a")), start)
        return cls(data, start, stop, len(data) - stop)

    def lines(self, start: int | None = None, number: int = 1) -> Iterator[Line]:
        """Yield the lines from byte ``start``, the first with this number; an empty last line is not yielded."""
        at = self.start if start is None else start
        for match in _LINE_END.finditer(self.data, at, self.stop):
            yield Line(number, at, match.end(), decode(self.data[at : match.start()]))
            at, number = match.end(), number + 1
        if at < self.stop:
            yield Line(number, at, self.stop, decode(self.data[at : self.stop]))

    def head(self, limit: int, start: int | None = None, number: int = 1) -> list[Line]:
        """Return at most ``limit`` lines, all of which start within 64 KiB."""
        lines: list[Line] = []
        for line in self.lines(start, number):
            if len(lines) == limit or line.start - (self.start if start is None else start) > _HEAD_SPAN:
                break
            lines.append(line)
        return lines

    def words_above(self, low: int, at: int) -> int:
        """Return where the lines begin that stand above position ``at``, as far as they do not begin with a number."""
        while at > low:
            above = max(self.data.rfind(b"\n", low, at - 1) + 1, low)
            if _NUMBER.match(self.data, above, at):
                break
            at = above
        return at

    def line_ends(self, start: int, stop: int) -> int:
        """Return the number of line ends between two positions."""
        return self.data.count(b"\n", start, stop) or self.data.count(b"\r", start, stop)

    def pages(self, start: int, stop: int) -> Iterator[bytes]:
        """Yield whole lines, about 64 KiB at a time."""
        while start < stop:
            end = min(start + _PAGE_BYTES, stop)
            if end < stop:
                # A page ends after a LF, after a CR that is not part of CRLF, or at the end of its only line.
                whole = self.data.rfind(b"\n", start, end) + 1 or self.data.rfind(b"\r", start, end - 1) + 1
                if not whole:
                    match = _LINE_END.search(self.data, end - 1, stop)
                    whole = match.end() if match else stop
                end = whole
            yield self.data[start:end]
            start = end


def restated(path: str, data: bytes, delimiter: str | None, decimal: str | None) -> bytes:
    """Return a text with tabs between its cells and decimal points, given its separator and its decimal mark.

    If only a decimal point is given, commas separate the cells unless tabs or semicolons do.
    """
    mark = _DELIMITERS.get((delimiter or "").lower(), delimiter or "")
    allowed = len(mark) < 2 and not mark.isalnum() and mark not in tuple('.+-"') and (not mark or mark != decimal)
    if not allowed or decimal not in (None, ".", ","):
        problem = f"delimiter must be one mark like , ; tab or space, and decimal . or , (got {delimiter}, {decimal})"
        raise FormatError(path, problem, "state those of the file")
    own = text_of(path, data)
    text = re.sub("\r\n?", "\n", decode(own.data[own.start : own.stop]))
    if not mark and decimal == "." and not re.search("[\t;]", text):
        mark = ","
    lines = text.split("\n")
    if mark:
        cells = rf'{re.escape(mark)}(?=(?:[^"]*"[^"]*")*[^"]*$)' if mark != " " else r"\s+"
        lines = ["\t".join(re.split(cells, line.strip(" "))) for line in lines]
    if decimal == ",":
        lines = [re.sub(r"(?<=\d),(?=\d)", ".", line) for line in lines]
    return "\n".join(lines).encode()


def in_turn(kinds: Sequence[object]) -> int | None:
    """Return the first of lines of two kinds that come in turn, given the kinds of lines (false for no row)."""
    first = next((at for at, kind in enumerate(kinds) if kind), 0)
    one, two = kinds[first : first + 2 * _TURNS : 2], kinds[first + 1 : first + 2 * _TURNS : 2]
    if len(two) < _TURNS or len({*one}) > 1 or len({*two}) > 1:
        return None
    return first if two[0] and one[0] != two[0] else None


def text_of(path: str, data: bytes) -> Text:
    """Return the text of a file, or raise an error if the file is binary."""
    if not is_text(data):
        raise FormatError(path, "expected rows of text, got binary data", "export the run as text again")
    return Text.of(data)


def is_text(data: bytes) -> bool:
    """Return whether bytes can be text: UTF-8, UTF-16 or an 8-bit code with few control characters."""
    head = data[:HEAD_BYTES]
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
    """
    if data.isascii() and b"\0" not in data:
        return data.decode("ascii")  # the usual case, without further checks
    if data.startswith(codecs.BOM_UTF8):
        data = data[3:]
    elif encoding := _utf16(data[:HEAD_BYTES]):
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


def head_lines(head: bytes) -> list[str]:
    """Return the lines of the first bytes of a file; one empty line if the file is binary."""
    return decode(head).replace("\r\n", "\n").replace("\r", "\n").split("\n") if is_text(head) else [""]


def says_simulated(text: str) -> bool:
    """Return whether a title or a name marks simulated data, which must not be mistaken for measured data."""
    plain = text.lower()
    return "simulat" in plain or "synthe" in plain
