"""Cells of fixed point turned into numbers all at once, exactly as ``float()`` turns each.

Eight digits are one machine word: a word is loaded that ends where the digits end, the decimal mark is closed up, and
three multiplications add the digits up.

References
----------
D. Lemire, "Number parsing at a gigabyte per second", Software: Practice and Experience 51 (2021) 1700,
doi:10.1002/spe.2984: eight digits in a word.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8

__all__ = ["Page", "exceeding", "is_fixed", "read_alike", "read_fixed", "read_signed"]

PAD = 16
"""Bytes in front of a page, so that a word may begin before the first cell."""

# Integers of 15 digits and powers of ten up to 22 are exact, so their quotient rounds as float() does.
MOST_DIGITS = 15

U64 = NDArray[np.uint64]

_U8 = np.uint64
_WORD = 8
_MINUS, _ZERO, _NINE = (ord(c) for c in "-09")
_DIGITS = 0x0F0F0F0F0F0F0F0F
_TOP_BITS = _U8(0x8080808080808080)
_ABOVE_NINE, _ABOVE_NOTHING = 0x76, 0x7F
_SIGN_BIT = _U8(63)
_ALL = (1 << 64) - 1
# Times a word of which byte n is 1 and all others 0: its last byte becomes n.
_PLACE = _U8(int.from_bytes(range(_WORD), "big"))
# Of a word's last n bytes, which are its most significant.
_LAST = np.array([_ALL ^ ((1 << 8 * (_WORD - n)) - 1) for n in range(_WORD + 1)], np.uint64)


class Page:
    """Some lines of a text, one byte a character. One page is used again and again, and so is its memory.

    Parameters
    ----------
    text : (n,) uint8
        At least one byte.
    """

    __slots__ = ("_mask", "_padded", "_room", "raw", "words")

    raw: NDArray[np.uint8]
    words: U64

    def __init__(self, text: NDArray[np.uint8]) -> None:
        self._padded = np.zeros(0, np.uint8)
        self._mask = np.empty(0, bool)
        self._room = np.empty((2, 0), np.uint64)
        self.fill(text)

    def fill(self, text: NDArray[np.uint8]) -> None:
        """Take a copy of another text."""
        if PAD + text.size > self._padded.size:
            self._padded = np.zeros(_roomy(PAD + text.size), np.uint8)
        self._padded[PAD : PAD + text.size] = text
        self._show(self._padded, PAD, PAD + text.size)

    def show(self, text: NDArray[np.uint8], begin: int, end: int) -> None:
        """Take a piece of another text: where it stands, if there is enough before it, for a copy costs memory anew."""
        if begin < _WORD:
            self.fill(text[begin:end])
        else:
            self._show(text, begin, end)

    def _show(self, text: NDArray[np.uint8], begin: int, end: int) -> None:
        self.raw = text[begin:end]
        # words[i] holds the eight bytes before byte i of raw, the last of them as the most significant.
        self.words = np.ndarray((end - begin + 1,), "<u8", text.data, begin - _WORD, (1,))
        if self.raw.size + _WORD > self._mask.size:
            self._mask = np.empty(_roomy(self.raw.size + _WORD), bool)

    def below(self, byte: int) -> NDArray[np.bool_]:
        """Tell where bytes below another stand; the answer holds until the next one."""
        return np.less(self.raw, byte, out=self._mask[: self.raw.size])

    def equal(self, byte: int) -> NDArray[np.bool_]:
        """Tell where a byte stands; the answer holds until the next one."""
        return np.equal(self.raw, byte, out=self._mask[: self.raw.size])

    def places(self, byte: int) -> I8:
        """Return where a byte stands, fastest if it does so a few dozen bytes apart."""
        found = self.equal(byte)
        whole = -(-found.size // _WORD) * _WORD
        self._mask[found.size : whole] = False
        words = self._mask[:whole].view("<u8")
        at = np.flatnonzero(words != 0)
        one = words.take(at)
        if np.bitwise_or.reduce(one & (one - _U8(1))):  # some words hold two of them
            return np.flatnonzero(found)
        one *= _PLACE
        one >>= _U8(8 * (_WORD - 1))
        at <<= 3
        at += one.view(np.int64)
        return at

    def room(self, slot: int, count: int) -> U64:
        """Return one of two arrays to calculate in; what is in it holds until it is asked for again."""
        if count > self._room.shape[1]:
            self._room = np.empty((2, _roomy(count)), np.uint64)
        return self._room[slot, :count]


def _roomy(size: int) -> int:
    """Return a size that is enough for the next page, too, if that is a little longer."""
    return size + size // _WORD


def is_fixed(cell: bytes, decimals: int) -> bool:
    """Tell whether a number that prints so many decimals is ``-?digits.decimals``, of at most 15 digits.

    Examples
    --------
    >>> [is_fixed(cell, 2) for cell in (b"-8.90", b"8,90", b".90", b"+8.90", b" 8.90")]
    [True, True, False, False, False]
    """
    body = cell[cell[:1] == b"-" :]
    whole = len(body) - decimals - (decimals > 0)
    digits = body[:whole] + body[len(body) - decimals :]
    return whole > 0 and len(digits) <= MOST_DIGITS and digits.isdigit()


def read_alike(page: Page, count: int, width: int, cell: tuple[int, int], form: tuple[int, int], out: F8) -> None:
    """Read the same cell of lines that all have the same length, digits in the same places and all else alike.

    Parameters
    ----------
    page : Page
    count, width : int
        Lines, and bytes of each.
    cell : (int, int)
        Where the cell of the first line begins and ends; of the form that :func:`is_fixed` demands.
    form : (int, int)
        Digits behind the point, and the power of ten that the numbers are multiplied with.
    out : (count,) float64
        Receives the numbers, each rounded once.
    """
    (begin, end), (decimals, shift) = cell, form
    negative = int(page.raw[begin]) == _MINUS
    begin += negative
    point = end - decimals - 1 if decimals else -1
    words = page.words[end::width][:count]
    used = int(_LAST[min(end - begin, _WORD)]) & _DIGITS
    behind = int(_LAST[min(decimals, _WORD)]) & _DIGITS
    if 0 < decimals < _WORD:
        word = np.bitwise_and(words, _U8(used & ((1 << 8 * (_WORD - 1 - decimals)) - 1)), out=page.room(0, count))
        word <<= _U8(8)
        word |= np.bitwise_and(words, _U8(behind), out=page.room(1, count))
    else:
        word = np.bitwise_and(words, _U8(used), out=page.room(0, count))
    total = _add_up(word).view(np.int64)
    rest = [at for at in range(begin, end - _WORD) if at != point]
    if rest:
        high = np.zeros(count, np.int64)
        for at in rest:
            high *= 10
            high += page.raw[at::width][:count] & 0x0F
        high *= 10 ** (_WORD - (point >= end - _WORD))
        total += high
    _scale(total, decimals - shift, -1.0 if negative else 1.0, out)


def read_fixed(
    page: Page, begin: I8, end: I8, decimals: int, shift: int = 0, points: bytes = b".", out: F8 | None = None
) -> tuple[F8, NDArray[np.bool_] | None]:
    """Read cells that are ``-?digits.decimals``.

    Parameters
    ----------
    page : Page
    begin, end : (m,) int64
        Where each cell begins and ends.
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
    plain : (m,) bool or None
        Cells that are of this form; None where all are.

    Examples
    --------
    >>> page = Page(np.frombuffer(b"-8.90;12.5;NaN;", np.uint8))
    >>> read_fixed(page, np.array([0, 6, 11]), np.array([5, 10, 14]), 2)
    (array([-8.9,  nan,  nan]), array([ True, False, False]))
    """
    value = np.empty(end.size) if out is None else out
    if not end.size:
        return value, None
    negative = page.raw.take(begin, mode="clip") == _MINUS
    length = end - begin
    signed = bool(negative.any())
    if signed:
        length -= negative
    return value, read_signed(page, end, length, negative if signed else None, (decimals, shift), points, value)


def read_signed(
    page: Page,
    end: I8,
    length: I8,
    negative: NDArray[np.bool_] | None,
    form: tuple[int, int],
    points: bytes,
    out: F8,
) -> NDArray[np.bool_] | None:
    """Read cells that are ``-?digits.decimals``, their signs and lengths known.

    Parameters
    ----------
    page : Page
    end : (m,) int64
        Where each cell ends; at least one.
    length : (m,) or (1,) int64
        Characters of each, without a minus; one number if all have as many.
    negative : (m,) bool or None
        Cells that begin with a minus; None where none does.
    form : (int, int)
        Digits behind the point, and the power of ten that the numbers are multiplied with.
    points : bytes
        What is a decimal mark.
    out : (m,) float64
        Receives the values, each rounded once; NaN in cells that are not plain.

    Returns
    -------
    (m,) bool or None
        Cells that are of this form; None where all are.
    """
    decimals, shift = form
    if decimals >= MOST_DIGITS:
        out[:] = np.nan
        return np.zeros(end.size, bool)
    digits = length - 1 if decimals else length.copy()
    odd: NDArray[np.bool_] | None = None
    least, most = int(digits.min()), int(digits.max())
    if most > MOST_DIGITS or least <= decimals:
        odd = (digits <= decimals) | (digits > MOST_DIGITS)
        digits[odd] = decimals + 1
        most = int(digits.max())
        odd = np.broadcast_to(odd, end.shape)
    elif least == most:
        digits = digits[:1]  # one number for all cells
    total, odd = _digits(page, end, digits, most, decimals, points, odd)
    _scale(total, decimals - shift, 1.0, out)
    if negative is not None:
        out.view(np.uint64)[:] ^= negative.astype(np.uint64) << _SIGN_BIT  # no branch, so no wrong guess of one
    if odd is None:
        return None
    out[odd] = np.nan
    return ~odd


def _digits(
    page: Page, end: I8, digits: I8, most: int, decimals: int, points: bytes, odd: NDArray[np.bool_] | None
) -> tuple[I8, NDArray[np.bool_] | None]:
    """Return the digits of each cell as a whole number, and which cells hold anything else."""
    if decimals < _WORD:  # the point stands in the last word, so seven digits do
        room = _WORD - (decimals > 0)
        places, above = _WORD, 0
        total, found = _word(page, end, np.minimum(digits, room) if most > room else digits, decimals, points)
    else:
        room = _WORD
        total, found = _word(page, end, np.minimum(digits, room), 0, points)
        places, above = (_WORD, decimals - _WORD) if decimals > _WORD else (_WORD + 1, 0)
        if not above:
            mark = page.raw.take(end - places, mode="clip")
            found = _either(found, ~np.isin(mark, np.frombuffer(points, np.uint8)))
    odd = _either(odd, found)
    if most > room:
        # Where nothing is left before the last word, nothing of this one is used.
        high, found = _word(page, np.maximum(end - places, 0), np.maximum(digits - room, 0), above, points)
        odd = _either(odd, found)
        high *= 10**room
        total += high
    return total, odd


def _word(page: Page, end: I8, digits: I8, decimals: int, points: bytes) -> tuple[I8, NDArray[np.bool_] | None]:
    """Add up the digits, at most eight with a point, that end where each word ends; tell which words hold others."""
    word = page.words[end]
    template = [_ZERO] * _WORD
    if decimals:
        template[_WORD - 1 - decimals] = points[0]
    word ^= _U8(int.from_bytes(template, "little"))
    used = _LAST.take(digits + 1 if decimals else digits)
    word &= used
    odd = _odd(page, word, decimals)
    if odd is not None and decimals:
        for other in points[1:]:
            there = page.raw.take(end - decimals - 1, mode="clip") == other
            word[there] ^= _U8((other ^ points[0]) << 8 * (_WORD - 1 - decimals))
            odd = _odd(page, word, decimals)
    if decimals:
        before = np.bitwise_and(word, _U8((1 << 8 * (_WORD - 1 - decimals)) - 1), out=page.room(1, end.size))
        before *= _U8(255)  # added to itself so many times, a byte moves up by one
        word += before
    return _add_up(word).view(np.int64), odd


def _odd(page: Page, word: U64, decimals: int) -> NDArray[np.bool_] | None:
    """Tell words, their template taken off, in which some byte is no digit, or no point; None where none is."""
    limits = [_ABOVE_NINE] * _WORD
    if decimals:
        limits[_WORD - 1 - decimals] = _ABOVE_NOTHING
    return exceeding(word, _U8(int.from_bytes(limits, "little")), page.room(1, word.size))


def exceeding(word: U64, limits: np.uint64, room: U64) -> NDArray[np.bool_] | None:
    """Tell words of which some byte, added to its limit, reaches 128; None where none does."""
    np.add(word, limits, out=room)
    room |= word
    if not np.bitwise_or.reduce(room) & _TOP_BITS:
        return None
    found: NDArray[np.bool_] = (room & _TOP_BITS) != 0
    return found


def _add_up(word: U64) -> U64:
    """Return the number that the eight digits in each word make, the first the least significant byte, in place."""
    word *= _U8(2561)  # 10 and 1, a byte apart
    word >>= _U8(8)
    word &= _U8(0x00FF00FF00FF00FF)
    word *= _U8(6553601)  # 100 and 1, two bytes apart
    word >>= _U8(16)
    word &= _U8(0x0000FFFF0000FFFF)
    word *= _U8(42949672960001)  # 10000 and 1, four bytes apart
    word >>= _U8(32)
    return word


def _scale(total: I8, decimals: int, sign: float, out: F8) -> None:
    """Put a decimal point into whole numbers, rounded once."""
    if decimals >= 0:
        np.divide(total, sign * 10.0**decimals, out=out)
    else:
        np.multiply(total, sign * 10.0**-decimals, out=out)


def _either(one: NDArray[np.bool_] | None, other: NDArray[np.bool_] | None) -> NDArray[np.bool_] | None:
    if one is None or other is None:
        return one if other is None else other
    return one | other
