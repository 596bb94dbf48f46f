"""Cells of fixed point turned into numbers all at once, exactly as ``float()`` turns each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.block import F8, I8

__all__ = ["read_cells"]

_MINUS, _NAN, _ZERO = (ord(c) for c in "-N0")
# Integers of 15 digits and powers of ten up to 22 are exact, so their quotient rounds as float() does.
_MAX_DIGITS = 15


def read_cells(
    raw: NDArray[np.uint8], begin: I8, end: I8, decimals: int, points: bytes = b"."
) -> tuple[F8, NDArray[np.bool_]]:
    """Read cells that are ``-?digits.decimals`` or NaN.

    Parameters
    ----------
    raw : (n,) uint8
        A text, one byte a character.
    begin, end : (m,) int64
        Each cell's first byte, and the one behind its last; there must be one.
    decimals : int
        Digits behind the point; at least 1.
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
    >>> text = np.frombuffer(b"-8.90;12.5;NaN;", np.uint8)
    >>> read_cells(text, np.array([0, 6, 11]), np.array([5, 10, 14]), 2)
    (array([-8.9,  nan,  nan]), array([ True, False,  True]))
    """
    lead = raw[begin]
    negative = lead == _MINUS
    digits = end - begin - 1 - negative
    plain = (digits > decimals) & (digits <= _MAX_DIGITS)
    plain &= np.isin(raw[end - decimals - 1], np.frombuffer(points, np.uint8), kind="table")
    digits[~plain] = 0
    # Place by place from the left, for all cells at once; a shorter one has no digit there.
    whole = np.zeros(end.size, np.int64)
    shortest = int(digits.min(initial=_MAX_DIGITS))
    for place in reversed(range(int(digits.max(initial=0)))):
        at = end - (place + 1 + (place >= decimals))  # the point is stepped over
        digit = raw.take(at, mode="clip") - np.uint8(_ZERO)  # unsigned: what is below "0" wraps to above 9
        if place >= shortest:
            digit *= place < digits
        plain &= digit <= 9
        whole *= 10
        whole += digit
    value: F8 = whole / 10.0**decimals
    np.negative(value, out=value, where=negative)
    value[~plain] = np.nan
    if len(maybe := np.flatnonzero((lead == _NAN) & (end - begin == 3))):
        first = begin[maybe]
        plain[maybe] = (raw[first + 1] == ord("a")) & (raw[first + 2] == _NAN)
    return value, plain
