"""Cells of fixed point turned into numbers all at once, exactly as ``float()`` turns each.

Eight digits are one machine word: a word is loaded that ends where the digits end, what stands before them is
shifted out, and three multiplications add the digits up.

References
----------
D. Lemire, "Number parsing at a gigabyte per second", Software: Practice and Experience 51 (2021) 1700,
doi:10.1002/spe.2984: eight digits in a word.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8

__all__ = ["Page", "read_fixed"]

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
    """Some lines of a text, one byte a character.

    Parameters
    ----------
    text : bytes-like
        At least one byte.
    """

    __slots__ = ("raw", "words")

    raw: NDArray[np.uint8]
    words: NDArray[np.uint64]

    def __init__(self, text: NDArray[np.uint8]) -> None:
        padded = np.zeros(PAD + text.size, np.uint8)
        padded[PAD:] = text
        self.raw = padded[PAD:]
        # words[i] holds the eight bytes before byte i of raw, the last of them as the most significant.
        self.words = np.ndarray((text.size + 1,), "<u8", padded.data, PAD - 8, (1,))


def read_fixed(
    page: Page, begin: I8, end: I8, decimals: int, shift: int = 0, points: bytes = b"."
) -> tuple[F8, NDArray[np.bool_]]:
    """Read cells that are ``-?digits.decimals``.

    Parameters
    ----------
    page : Page
    begin, end : (m,) int64
        Each cell's first byte, and the one behind its last.
    decimals : int
        Digits behind the point; 0: no point.
    shift : int
        The value times ten to this power is returned, rounded once.
    points : bytes
        What is a decimal mark.

    Returns
    -------
    value : (m,) float64
        NaN in cells that are not plain.
    plain : (m,) bool
        Cells that are of this form.

    Examples
    --------
    >>> page = Page(np.frombuffer(b"-8.90;12.5;NaN;", np.uint8))
    >>> read_fixed(page, np.array([0, 6, 11]), np.array([5, 10, 14]), 2)
    (array([-8.9,  nan,  nan]), array([ True, False, False]))
    """
    negative = page.raw.take(begin, mode="clip") == _MINUS
    digits = end - begin
    digits -= negative
    if decimals:
        digits -= 1
        point = page.raw.take(end - (decimals + 1), mode="clip")
        plain = point == points[0]
        for other in points[1:]:
            plain |= point == other
        plain &= digits > decimals
    else:
        plain = digits > 0
    most = int(digits.max(initial=0))
    if most > MOST_DIGITS:
        plain &= digits <= MOST_DIGITS
        digits[~plain] = 1
        most = int(digits.max(initial=0))
    if 0 < decimals < 7 and most <= 7:
        whole = _one_word(page, end, digits, decimals, plain)
    else:
        whole = _words(page, end - (decimals + 1 if decimals else 0), digits - decimals, plain)
        if decimals:
            whole *= 10**decimals
            whole += _words(page, end, np.full(end.size, decimals), plain)
    power = decimals - shift
    value = np.divide(whole, 10.0**power) if power >= 0 else np.multiply(whole, 10.0**-power)
    if negative.any():
        np.negative(value, out=value, where=negative)
    if not plain.all():
        value[~plain] = np.nan
    return value, plain


def _one_word(page: Page, end: I8, digits: I8, decimals: int, plain: NDArray[np.bool_]) -> I8:
    """Add up at most seven digits around a point: the point is closed up, and all stand in one word."""
    word = page.words[end]
    behind = _U8((1 << 64) - (1 << 8 * (8 - decimals)))
    before = word & _U8((1 << 8 * (7 - decimals)) - 1)
    before <<= _U8(8)
    word &= behind
    word |= before
    return _add_up(word, digits, plain)


def _words(page: Page, end: I8, digits: I8, plain: NDArray[np.bool_]) -> I8:
    """Add up at most sixteen digits that end at ``end``."""
    low = np.minimum(digits, 8)
    total = _add_up(page.words[end], low, plain)
    rest = digits - low
    more = np.flatnonzero(rest > 0)
    if more.size:
        good = np.ones(more.size, bool)
        total[more] += 10**8 * _add_up(page.words[end[more] - 8], rest[more], good)
        plain[more] &= good
    return total


def _add_up(word: NDArray[np.uint64], digits: I8, plain: NDArray[np.bool_]) -> I8:
    """Return the number that the last ``digits`` characters of each word spell; clear ``plain`` where they do not."""
    # Of a cell without digits the shift is out of range: its number is rubbish, and it is not plain anyway.
    unused = ((8 - digits) << 3).view(np.uint64)
    word ^= _ZEROS
    word >>= unused
    word <<= unused
    above = word + _ABOVE_NINE
    above |= word
    above &= _TOP_BITS
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
