"""Integrate a velocity column to a position, and join it with a position column."""

from __future__ import annotations

import numpy as np

from acquisition.block import B1, F8, I8


def integrate(velocity: F8, index: I8, rate_hz: float) -> tuple[F8, B1]:
    """Sum backward differences ``(x[i] - x[i-1]) * rate_hz`` to a position, m: zero at first, NaN if unknown.

    ``index`` are sample numbers, increasing; a jump is a gap, in which the velocity is interpolated linearly. The
    resulting offset is only an estimate, so the mask returned marks the first sample after each gap.
    """
    known = np.isfinite(velocity)
    start = velocity.size > 0 and not known[0]
    rows = np.flatnonzero(known)
    position = np.full(velocity.size, np.nan)
    bridged = np.zeros(velocity.size, bool)
    if start:
        position[0] = 0.0
    if rows.size == 0:
        return position, bridged
    # A first sample without a velocity is at position zero, and the second one is relative to it.
    previous = np.concatenate(([index[0] if start else index[rows[0]] - 1], index[rows[:-1]]))
    v_before = np.concatenate(([velocity[rows[0]]], velocity[rows[:-1]]))
    lost = index[rows] - previous - 1
    moved = velocity[rows] + lost * (velocity[rows] + v_before) / 2
    position[rows] = np.cumsum(moved) / rate_hz
    if not start:
        position[rows] -= position[rows[0]]
    bridged[rows] = lost > 0
    return position, bridged


def outer_join(left: I8, right: I8, regular: B1 | None = None) -> tuple[I8, I8]:
    """Pair the rows of two recordings by their sample numbers.

    If a number repeats, its n-th row on the left pairs with its n-th row on the right. ``regular`` marks the rows of
    ``left`` whose numbers are in order. Return the row of each joined sample in ``left`` and in ``right``, -1 if there
    is none. Rows of ``left`` keep their order, and rows that exist only in ``right`` are inserted according to their
    numbers.
    """
    rows_of = {key: row for row, key in enumerate(_with_turn(right))}
    partner = np.array([rows_of.pop(key, -1) for key in _with_turn(left)], np.int64)
    alone = np.array(sorted(rows_of.values()), np.int64)
    standing = left if regular is None else np.where(regular, left, np.iinfo(np.int64).min)
    where = np.searchsorted(np.maximum.accumulate(standing), right[alone], side="right")
    from_left = np.insert(np.arange(left.size), where, -1)
    from_right = np.insert(partner, where, alone)
    return from_left, from_right


def _with_turn(numbers: I8) -> list[tuple[int, int]]:
    if np.all(np.diff(numbers) > 0):
        return [(number, 0) for number in numbers.tolist()]
    seen: dict[int, int] = {}
    keys = []
    for number in numbers.tolist():
        keys.append((number, seen.get(number, 0)))
        seen[number] = seen.get(number, 0) + 1
    return keys
