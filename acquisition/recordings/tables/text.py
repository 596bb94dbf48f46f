"""Text with columns of numbers: its encoding and its lines."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from acquisition.block import I8
from acquisition.errors import FormatError
from acquisition.line_numbers import uncoloured
from acquisition.recordings.tables.numbers import plain

HEAD_BYTES = 8192
"""Number of bytes at the start of a file from which a format recognises it."""
_TURNS = 10
_DELIMITERS = {"tab": "\t", "\\t": "\t", "comma": ",", "semicolon": ";", "space": " "}
_CONTROL = bytes(c for c in range(32) if c not in b"\t\n\r\f\x1a")
_FOREIGN = re.compile(rb"[\x80-\xff]+[\x21-\x7e]?")
_HANZI = re.compile(rb"(?:[\xb0-\xd7\xa1-\xa3][\xa1-\xfe])+[\x21-\x7e]?")
"""Common Chinese characters in GB 2312; in cp1252 these codes are capitals with accents, which rarely come in pairs."""
_NUMBER = re.compile(rb"[\s,;]*[-+]?[.,]?\d")
_LOG = re.compile(rb"^[EWIDV] \([\d:.]{1,12}\) ", re.MULTILINE)
ZIP_MAGIC = b"PK\x03\x04"
_PAGE_BYTES = 1 << 16
_HEAD_SPAN = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class Text:
    """A text as bytes in which every digit, sign and separator is ASCII; a LF ends every line but perhaps the last.

    ``starts`` are the positions of its lines, and its end. ``zeros`` counts zero bytes that were left out at its end.
    """

    data: bytes
    starts: I8
    zeros: int

    @classmethod
    def of(cls, data: bytes) -> Text:
        """Return the text of a file's bytes."""
        if encoding := _utf16(data[:HEAD_BYTES]):
            data = data.decode(encoding, errors="replace").removeprefix("\ufeff").encode("utf-8", "replace")
        data = _uncoloured(data)
        if not data.isascii() and (numbered := plain(printed := decode(data))) != printed:
            data = numbered.encode("utf-8", "replace")
        whole = data.rstrip(b"\0\x1a") if data[-1:] in (b"\0", b"\x1a") else data
        text = whole.removeprefix(codecs.BOM_UTF8).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        starts = np.flatnonzero(np.frombuffer(text, np.uint8) == ord("\n")) + 1
        last = [] if not text or text.endswith(b"\n") else [len(text)]
        return cls(text, np.concatenate(([0], starts, last)).astype(np.int64), len(data) - len(whole))

    def __len__(self) -> int:
        """Return the number of lines."""
        return self.starts.size - 1

    @property
    def ended(self) -> bool:
        """Whether the last line has a line end."""
        return self.data.endswith(b"\n")

    def line(self, at: int) -> str:
        """Return a line without its line end."""
        return decode(self.data[self.starts[at] : self.starts[at + 1]].removesuffix(b"\n"))

    def lines(self, first: int = 0, limit: int | None = None) -> list[str]:
        """Return the lines from line ``first`` on, at most ``limit``."""
        return [self.line(at) for at in range(first, len(self) if limit is None else min(first + limit, len(self)))]

    def head(self, limit: int, first: int = 0) -> list[str]:
        """Return at most ``limit`` lines from line ``first`` on, all of which start within 64 KiB."""
        near = int(np.searchsorted(self.starts[:-1], self.starts[first] + _HEAD_SPAN, side="right"))
        return self.lines(first, min(limit, near - first))

    def matching(self, pattern: re.Pattern[bytes], first: int) -> Iterator[int]:
        """Yield the lines from line ``first`` on in which a pattern matches."""
        yield from (self.at(match.start()) for match in pattern.finditer(self.data, self.starts[first]))

    def at(self, position: int) -> int:
        """Return the line of a byte."""
        return int(np.searchsorted(self.starts, position, side="right")) - 1

    def words_above(self, low: int, at: int) -> int:
        """Return the first of the lines above line ``at``, not below ``low``, that do not begin with a number."""
        while at > low and not _NUMBER.match(self.data, self.starts[at - 1], self.starts[at]):
            at -= 1
        return at

    def pages(self, first: int, stop: int) -> Iterator[bytes]:
        """Yield the lines from ``first`` to before ``stop``, about 64 KiB at a time."""
        while first < stop:
            end = min(max(self.at(self.starts[first] + _PAGE_BYTES), first + 1), stop)
            yield self.data[self.starts[first] : self.starts[end]]
            first = end


def restated(path: str, data: bytes, delimiter: str | None, decimal: str | None) -> bytes:
    """Return a text with tabs between its cells and decimal points, given its separator and its decimal mark.

    If only a decimal point is given, commas separate the cells unless tabs or semicolons do.
    """
    mark = _DELIMITERS.get((delimiter or "").lower(), delimiter or "")
    allowed = len(mark) < 2 and not mark.isalnum() and mark not in tuple('.+-"') and (not mark or mark != decimal)
    if not allowed or decimal not in (None, ".", ","):
        problem = f"delimiter must be one mark like , ; tab or space, and decimal . or , (got {delimiter}, {decimal})"
        raise FormatError(path, problem, "state those of the file")
    text = decode(text_of(path, data).data)
    if not mark and decimal == "." and not re.search("[\t;]", text):
        mark = ","
    lines = text.split("\n")
    if mark:
        if mark != " " and mark not in text:
            raise FormatError(path, f"the delimiter {delimiter} is not in the file", "state that of the file")
        cells = rf'{re.escape(mark)}(?=(?:[^"]*"[^"]*")*[^"]*$)' if mark != " " else r"\s+"
        lines = ["\t".join(re.split(cells, line.strip(" "))) for line in lines]
    if decimal == ",":
        lines = [re.sub(r"(?<=\d),(?=\d)", ".", line) for line in lines]
    return "\n".join(lines).encode()


def joined_in_turn(lines: list[str], kind: Callable[[str], object], mark: str) -> list[str]:
    """Return lines of which two kinds come in turn, time and then distance, joined: the second of each becomes blank.

    ``kind`` gives the kind of a line, false for no row.
    """
    rows = [at for at, line in enumerate(lines) if line.strip()]
    kinds = [kind(lines[at]) for at in rows[: 4 * _TURNS]]
    first = next((at for at, each in enumerate(kinds) if each), 0)
    odd, even = kinds[first : first + 2 * _TURNS : 2], kinds[first + 1 : first + 2 * _TURNS : 2]
    if len(even) < _TURNS or len({*odd}) > 1 or len({*even}) > 1 or not even[0] or odd[0] == even[0]:
        return lines
    joined, at = list(lines), first
    while at + 1 < len(rows):
        upper, lower = rows[at : at + 2]
        at += 1
        if (kind(lines[upper]), kind(lines[lower])) == (odd[0], even[0]):
            joined[upper], joined[lower] = f"{lines[upper].strip()}{mark}{lines[lower].strip()}", ""
            at += 1
    return joined


def text_of(path: str, data: bytes) -> Text:
    """Return the text of a file, or raise an error if the file is binary."""
    if not is_text(data):
        raise FormatError(path, "expected rows of text, got binary data", "export the run as text again")
    return Text.of(data)


def is_text(data: bytes) -> bool:
    """Return whether bytes can be text: UTF-8, UTF-16 or an 8-bit code with few control characters."""
    head = data[:HEAD_BYTES]
    if head.startswith(ZIP_MAGIC):  # an uncompressed archive of texts has few control characters
        return False
    if _utf16(head):
        return True
    head = _uncoloured(head.rstrip(b"\0") or head)
    return len(head) - len(head.translate(None, _CONTROL)) <= 0.02 * len(head)


def _uncoloured(data: bytes) -> bytes:
    """Return a log of a terminal or of ESP-IDF as its lines are read from a port."""
    if b"\x1b[" not in data and not _LOG.search(data[:HEAD_BYTES]):
        return data
    return uncoloured(data.decode("latin-1")).encode("latin-1")


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
    if not is_text(head):
        return [""]
    return plain(decode(_uncoloured(head))).replace("\r\n", "\n").replace("\r", "\n").split("\n")


def says_simulated(text: str) -> bool:
    """Return whether a title or a name marks simulated data, which must not be mistaken for measured data."""
    plain = text.lower()
    return "simulat" in plain or "synthe" in plain
