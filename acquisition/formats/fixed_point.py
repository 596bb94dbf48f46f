"""Cells of fixed point turned into numbers all at once, exactly as ``float()`` turns each.

Eight digits are one machine word: a word is loaded that ends where the digits end, what stands before them is
shifted out, and three multiplications add the digits up.

References
----------
D. Lemire, "Number parsing at a gigabyte per second", Software: Practice and Experience 51 (2021) 1700,
doi:10.1002/spe.2984: eight digits in a word.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8

__all__ = ["Page", "Span", "read_fixed"]

PAD = 16
"""Bytes in front of a page, so that a word may begin before the first cell."""

# Integers of 15 digits and powers of ten up to 22 are exact, so their quotient rounds as float() does.
MOST_DIGITS = 15

_U8 = np.uint64
_MINUS, _ZERO = (ord(c) for c in "-0")
_ZEROS = _U8(0x3030303030303030)
_ABOVE_NINE = _U8(0x7676767676767676)
_TOP_BITS = _U8(0x8080808080808080)
_PAIRS = _U8(0x000000FF000000FF)
_HIGH, _LOW = _U8(0x000F424000000064), _U8(0x0000271000000001)


class Page:
    """Some lines of a text, one byte a character. One page is filled again and again: its memory is used once.

    Parameters
    ----------
    text : (n,) uint8
        At least one byte.
    """

    __slots__ = ("_masks", "_padded", "raw", "words")

    raw: NDArray[np.uint8]
    words: NDArray[np.uint64]

    def __init__(self, text: NDArray[np.uint8]) -> None:
        self._padded = np.zeros(0, np.uint8)
        self._masks = np.empty((0, 0), bool)
        self.fill(text)

    def fill(self, text: NDArray[np.uint8]) -> None:
        """Take another text."""
        if PAD + text.size > self._padded.size:
            self._padded = np.zeros(PAD + text.size, np.uint8)
            self._masks = np.empty((3, text.size), bool)
        self.raw = self._padded[PAD : PAD + text.size]
        self.raw[:] = text
        # words[i] holds the eight bytes before byte i of raw, the last of them as the most significant.
        self.words = np.ndarray((text.size + 1,), "<u8", self._padded.data, PAD - 8, (1,))

    def where(self, byte: int, slot: int) -> NDArray[np.bool_]:
        """Tell where a byte stands; the answer holds until the next one for that slot."""
        return np.equal(self.raw, byte, out=self._masks[slot, : self.raw.size])


@dataclass(frozen=True, slots=True, eq=False)
class Span:
    """Where some cells of a page begin and end.

    Parameters
    ----------
    page : Page
    count : int
    width : int
        Bytes from one cell to the next where all lines are laid out alike; 0 where they are not.
    first, last : int
        Where the first cell begins and ends, in alike lines.
    given : ((count,) int64, (count,) int64) or None
        Where each cell begins and ends, in others.
    """

    page: Page
    count: int
    width: int = 0
    first: int = 0
    last: int = 0
    given: tuple[I8, I8] | None = None

    @property
    def begin(self) -> I8:
        """Each cell's first byte."""
        return self._steps(self.first) if self.given is None else self.given[0]

    @property
    def end(self) -> I8:
        """The byte behind each cell."""
        return self._steps(self.last) if self.given is None else self.given[1]

    @property
    def length(self) -> I8 | int:
        """Bytes of each cell; one number where all are alike."""
        return self.last - self.first if self.given is None else self.given[1] - self.given[0]

    def lead(self) -> NDArray[np.uint8]:
        """Return the first character of each cell."""
        return self._bytes(self.first, 0) if self.given is None else self.page.raw.take(self.given[0], mode="clip")

    def before_end(self, places: int) -> NDArray[np.uint8]:
        """Return the character so many places before the end of each cell."""
        if self.given is None:
            return self._bytes(self.last, places)
        return self.page.raw.take(self.given[1] - places, mode="clip")

    def words(self, places: int = 0) -> NDArray[np.uint64]:
        """Return the eight characters that end so many places before the end of each cell."""
        words = self.page.words
        if self.given is None and self.last >= places:
            return words[self.last - places :: self.width][: self.count].copy()
        return words[np.maximum(self.end - places, 0)]

    def _steps(self, first: int) -> I8:
        return np.arange(first, first + self.count * self.width, self.width)

    def _bytes(self, first: int, places: int) -> NDArray[np.uint8]:
        if first >= places:
            return self.page.raw[first - places :: self.width][: self.count]
        return self.page.raw.take(self._steps(first) - places, mode="clip")


def read_fixed(
    span: Span, decimals: int, shift: int = 0, points: bytes = b".", out: F8 | None = None
) -> tuple[F8, NDArray[np.bool_]]:
    """Read cells that are ``-?digits.decimals``.

    Parameters
    ----------
    span : Span
    decimals : int
        Digits behind the point; 0: no point.
    shift : int
        The value times ten to this power is returned, rounded once.
    points : bytes
        What is a decimal mark.
    out : (m,) float64, optional
        Receives the values.

    Returns
    -------
    value : (m,) float64
        NaN in cells that are not plain.
    plain : (m,) bool
        Cells that are of this form.

    Examples
    --------
    >>> page = Page(np.frombuffer(b"-8.90;12.5;NaN;", np.uint8))
    >>> read_fixed(Span(page, 3, given=(np.array([0, 6, 11]), np.array([5, 10, 14]))), 2)
    (array([-8.9,  nan,  nan]), array([ True, False, False]))
    """
    negative = span.lead() == _MINUS
    signed = bool(negative.any())
    digits = span.length - (decimals > 0)
    if signed:
        digits = digits - negative
    plain = np.ones(span.count, bool)
    if decimals:
        point = span.before_end(decimals + 1)
        plain = point == points[0]
        for other in points[1:]:
            if plain.all():
                break
            plain |= point == other
    enough = (digits > decimals) & (digits <= MOST_DIGITS)
    if not np.all(enough):
        plain &= enough
        digits = np.where(enough, digits, decimals + 1)
    if 0 < decimals < 7 and np.max(digits, initial=0) <= 7:
        whole = _one_word(span, digits, decimals, plain)
    else:
        whole = _words(span, decimals + 1 if decimals else 0, digits - decimals, plain)
        if decimals:
            whole *= 10**decimals
            whole += _words(span, 0, decimals, plain)
    power = decimals - shift
    value: F8 = np.divide(whole, 10.0**power, out=out) if power >= 0 else np.multiply(whole, 10.0**-power, out=out)
    if signed:
        np.negative(value, out=value, where=negative)
    if not plain.all():
        value[~plain] = np.nan
    return value, plain


def _one_word(span: Span, digits: I8 | int, decimals: int, plain: NDArray[np.bool_]) -> I8:
    """Add up at most seven digits around a point: the point is closed up, and all stand in one word."""
    word = span.words()
    behind = _U8((1 << 64) - (1 << 8 * (8 - decimals)))
    before = word & _U8((1 << 8 * (7 - decimals)) - 1)
    before <<= _U8(8)
    word &= behind
    word |= before
    return _add_up(word, digits, plain)


def _words(span: Span, places: int, digits: I8 | int, plain: NDArray[np.bool_]) -> I8:
    """Add up at most sixteen digits that end so many places before the end of the cell."""
    total = _add_up(span.words(places), np.minimum(digits, 8), plain)
    rest = digits - np.minimum(digits, 8)
    if not np.any(rest):
        return total
    good = np.ones(span.count, bool)
    high = _add_up(span.words(places + 8), np.maximum(rest, 1), good)
    more = np.broadcast_to(np.asarray(rest) > 0, span.count)
    plain &= good | ~more
    total += np.where(more, high, 0) * 10**8
    return total


def _add_up(word: NDArray[np.uint64], digits: I8 | int, plain: NDArray[np.bool_]) -> I8:
    """Return the number that the last ``digits`` characters of each word spell; clear ``plain`` where they do not."""
    unused = np.asarray((8 - digits) << 3).astype(np.uint64)
    word ^= _ZEROS
    if np.any(unused):
        word >>= unused
        word <<= unused
    above = word + _ABOVE_NINE
    above |= word
    above &= _TOP_BITS
    if above.any():
        plain &= above == 0
    pairs = word >> _U8(8)
    word *= _U8(10)
    word += pairs
    upper = word >> _U8(16)
    word &= _PAIRS
    word *= _HIGH
    upper &= _PAIRS
    upper *= _LOW
    word += upper
    word >>= _U8(32)
    return word.view(np.int64)
