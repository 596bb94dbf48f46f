"""Whole lines of a text, a page at a time, and where the cells in them begin and end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.block import I8
from acquisition.recordings.tables.fixed_point import Page, exceeding

__all__ = ["NEWLINE", "RETURN", "Alike", "Lines", "alike_lines", "first_cells", "next_page", "starts_of"]

NEWLINE, RETURN = ord("\n"), ord("\r")
_TAB, _BLANK = ord("\t"), ord(" ")
_WORD = 8
_LONGEST_ALIKE = 512

U8 = NDArray[np.uint8]
Mask = NDArray[np.bool_]


def next_page(raw: U8, at: int, size: int, delimiter: str, page: Page) -> int:
    """Put about so many bytes of whole lines, ended by LF, on a page, and return where they end."""
    end = min(at + size, raw.size)
    if end < raw.size:
        end = _line_end(raw, at, end)
    text = raw[at:end]
    ended = text[-1] == NEWLINE
    if ended and delimiter:
        page.show(raw, at, end)
        return end
    if not ended:
        text = np.append(text, np.uint8(NEWLINE))
    page.fill(text if delimiter else _tabbed(text))
    return end


def _line_end(raw: U8, at: int, end: int) -> int:
    """Return the end of the last line that ends before ``end``, or of the first line if it ends later."""
    for begin in (max(end - 1024, at), at):
        found = np.flatnonzero(raw[begin:end] == NEWLINE)
        if found.size:
            return begin + int(found[-1]) + 1
    size = end - at
    for step in range(at, raw.size, size):
        piece = raw[step : step + size]
        found = np.flatnonzero((piece == NEWLINE) | (piece == RETURN))
        if found.size:
            # A CR alone ends a line; of CRLF both do.
            last = step + int(found[-1] if step == at else found[0])
            pair = raw[last] == RETURN and last + 1 < raw.size and raw[last + 1] == NEWLINE
            return last + 2 if pair else last + 1
    return int(raw.size)


def _tabbed(page: U8) -> U8:
    """Put one tab in place of every run of white space, and none at the ends of a line."""
    blank = (page == _BLANK) | (page == _TAB)
    ends = (page == NEWLINE) | (page == RETURN)
    after = np.concatenate(([True], (blank | ends)[:-1]))  # behind another blank, or at a line's begin
    before_end = np.zeros(page.size, bool)
    # A run that a line ends in: walk back from the end through single blanks left.
    keep = ~(blank & after)
    kept = page[keep]
    blank_kept = blank[keep]
    before_end[: kept.size - 1] = blank_kept[:-1] & ends[keep][1:]
    return np.where(blank_kept, np.uint8(_TAB), kept)[~before_end[: kept.size]]


class Alike(NamedTuple):
    """Lines of one length with digits in the same places and everything else the same.

    Parameters
    ----------
    rows, width : int
        How many, and bytes of each.
    cells : tuple of (int, int)
        Where each cell of the first line begins and ends.
    """

    rows: int
    width: int
    cells: tuple[tuple[int, int], ...]


def alike_lines(page: Page, mark: int) -> Alike | None:
    """Tell whether all lines of a page are laid out alike, as fixed point gives them; None where they are not."""
    line = page.raw[:_LONGEST_ALIKE].tobytes()
    width = line.find(b"\n") + 1
    count = page.raw.size // max(width, 1)
    if width < _WORD or count * width != page.raw.size or b"\r" in line[: width - 2]:
        return None
    line = line[:width]
    template = bytes(ord("0") if byte in b"0123456789" else byte for byte in line)
    # A digit less "0" stays below 128 if 118 is added, nothing stays so if 127 is.
    limits = bytes(0x76 if byte == ord("0") else 0x7F for byte in template)
    for at in (*range(_WORD, width, _WORD), width):
        word, limit = (np.uint64(int.from_bytes(each[at - _WORD : at], "little")) for each in (template, limits))
        differs = np.bitwise_xor(page.words[at::width][:count], word, out=page.room(0, count))
        if exceeding(differs, limit, page.room(1, count)) is not None:
            return None
    return Alike(count, width, first_cells(page, mark))


def first_cells(page: Page, mark: int) -> tuple[tuple[int, int], ...]:
    """Return where each cell of a page's first line begins and ends; none of a very long line."""
    line = page.raw[:_LONGEST_ALIKE].tobytes()
    content = line[: line.find(b"\n") + 1].removesuffix(b"\n").removesuffix(b"\r")
    ends = [at for at, byte in enumerate(content) if byte == mark] + [len(content)]
    return tuple(zip([0, *(end + 1 for end in ends[:-1])], ends, strict=True))


class Lines(NamedTuple):
    """Where the lines of a page and their cells are.

    Parameters
    ----------
    start, stop : (n,) int64
    ends : (m,) int64
        Every separator and line end.
    first : (n,) int64
        Of those, the first of each line.
    cells : (n,) int64
    regular : int
        Cells of every line, where all have as many and no end is left out of ``ends``; else 0.
    """

    start: I8
    stop: I8
    ends: I8
    first: I8
    cells: I8
    regular: int

    @classmethod
    def of(cls, page: Page, mark: int) -> Lines | None:
        """Find the lines; None where a CR stands alone."""
        ends = np.flatnonzero(_may_end(page, mark))
        what = page.raw.take(ends)
        if (found := cls._regular(ends, what, mark)) is not None:
            return found
        returns = int(np.count_nonzero(what == RETURN))
        newline = what == NEWLINE
        kept = newline | (what == mark)
        ends, newline = ends[kept], newline[kept]
        last = np.flatnonzero(newline)
        stop, cells = ends[last], np.diff(last, prepend=-1)
        start = starts_of(stop)
        if returns:
            paired = page.raw.take(stop - 1, mode="clip") == RETURN
            if np.count_nonzero(paired & (stop > start)) != returns:
                return None
            stop = stop - paired
        return cls(start, stop, ends, last - cells + 1, cells, 0)

    @classmethod
    def _regular(cls, ends: I8, what: U8, mark: int) -> Lines | None:
        """Take lines that all have the same separators and line ends, and nothing that looks like one; else None."""
        size = int((what[:_LONGEST_ALIKE] == NEWLINE).argmax()) + 1
        count = ends.size // size
        line = what[:size].tobytes()
        cells = line.count(mark) + 1
        paired = line.endswith(b"\r\n")
        if line != bytes([mark]) * (cells - 1) + (b"\r\n" if paired else b"\n") or count * size != ends.size:
            return None
        if not all((what[at::size] == byte).all() for at, byte in enumerate(line)):
            return None
        newlines = ends[size - 1 :: size]
        stop = ends[size - 2 :: size] if paired else newlines
        if paired and (newlines - stop != 1).any():
            return None
        every = ends.reshape(count, size)[:, :cells]
        first = np.arange(0, count * cells, cells)
        return cls(starts_of(newlines), stop, every.ravel(), first, np.broadcast_to(np.int64(cells), count), cells)

    def keep(self, rows: Mask) -> Lines:
        """Return some of the lines."""
        return Lines(self.start[rows], self.stop[rows], self.ends, self.first[rows], self.cells[rows], 0)

    def bounds(self, column: int) -> tuple[I8, I8]:
        """Return where the cells of a column begin and end; a cell that is not there is empty."""
        if column < self.regular:
            begin = self.start if column == 0 else self.ends[column - 1 :: self.regular] + 1
            return begin, self.stop if column == self.regular - 1 else self.ends[column :: self.regular].copy()
        at = self.first + column
        begin = self.start if column == 0 else self.ends.take(at - 1, mode="clip") + 1
        end = np.minimum(self.ends.take(at, mode="clip"), self.stop)
        absent = self.cells <= column
        return np.where(absent, self.stop, begin), np.where(absent, self.stop, end)

    def blank(self, raw: U8) -> Mask | None:
        """Tell lines that hold nothing but white space; None where there is none."""
        lead = raw.take(self.start, mode="clip")
        if lead.min() > _BLANK:
            return None
        blank: Mask = self.stop <= self.start
        white = np.flatnonzero((lead <= _BLANK) & ~blank)
        if white.size:
            seen = np.cumsum((raw != _BLANK) & (raw != _TAB))
            before = np.where(self.start[white] > 0, seen[self.start[white] - 1], 0)
            blank[white] = seen[self.stop[white] - 1] == before
        return blank if blank.any() else None

    def not_of_width(self, raw: U8, mark: int, width: int) -> Mask | None:
        """Tell lines that have not so many cells; None where none is. Separators at a line's end make no cell."""
        if self.regular == width:
            return None
        bad: Mask = self.cells != width
        for row in np.flatnonzero(self.cells > width).tolist():
            begin = int(self.ends[self.first[row] + width - 1])
            bad[row] = bool(raw[begin : self.stop[row]].tobytes().strip(bytes((mark, _BLANK))))
        return bad


def _may_end(page: Page, mark: int) -> Mask:
    """Tell which bytes may be separators or line ends, and some that are none."""
    if mark <= ord(","):
        return page.below(max(mark, RETURN) + 1)
    found = page.below(RETURN + 1)
    found |= page.raw == mark
    return found


def starts_of(newlines: I8) -> I8:
    """Return where lines start, from where each ends."""
    start = np.empty_like(newlines)
    start[0] = 0
    np.add(newlines[:-1], 1, out=start[1:])
    return start
