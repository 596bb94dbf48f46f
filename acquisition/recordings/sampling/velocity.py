"""Process a velocity column: find the sensor's tick, integrate to a position, and join it with a position column."""

from __future__ import annotations

import numpy as np

from acquisition.block import B1, F8, I8

_FEWEST_VALUES = 20
_FINEST = 4  # minimum tick, in last printed digits; a smaller one cannot be distinguished from rounding
_SHARE = 0.95
_COARSEST = 24
_COHERENT = 0.9


def find_tick(values: F8, resolution: float) -> float | None:
    """Find the largest step of which the printed values are multiples, within rounding; None if there is none.

    Gaps between neighbouring sizes of values are candidates for the step s. Each is refined by least squares of ``v =
    k s`` over an increasing range of v, because the integers k of large v are certain only if s is accurate. The step
    must explain 95 % of the different sizes.
    """
    size = np.unique(np.rint(np.abs(values[np.isfinite(values)]) / resolution))
    if size.size < _FEWEST_VALUES or size[-1] > 2**50:
        return None
    gaps, counts = np.unique(np.diff(size), return_counts=True)
    usual = (gaps >= _FINEST) & (counts >= 0.01 * size.size)
    for gap in gaps[usual][::-1][:40]:
        step = _refine(size, float(gap))
        if step >= _FINEST and np.mean(np.abs(size - step * np.rint(size / step)) <= 0.51) >= _SHARE:
            return float(step * resolution)
    return None


def _refine(size: F8, step: float) -> float:
    limit = max(step * step / 4, float(size[size > 0][0]))
    tolerance = step / 4
    while True:
        k = np.rint(size / step)
        use = (size <= limit) & (k > 0) & (np.abs(size - k * step) <= max(tolerance, 0.75))
        if use.any():
            step = float(np.sum(k[use] * size[use]) / np.sum(k[use] ** 2))
        if limit >= size[-1]:
            if tolerance <= 0.75:
                return step
            tolerance = 0.75
        limit *= 4


def find_quantum(values: F8, tick: float) -> float:
    """Return the spacing of the clusters of values: ``tick`` itself, or a multiple of it.

    A device that converts timer ticks to distance by integer arithmetic gives values at ``j m tick`` and ``(j m + 1)
    tick``: exact multiples of a small step, in clusters one timer tick apart. The spacing of the clusters is the
    quantum. It is found by phase coherence, ``|mean exp(2 pi i k / m)|``, which must reach 0.9.
    """
    k = np.rint(values[np.isfinite(values)] / tick).astype(np.int64)
    spread = float(np.std(k)) if k.size else 0.0
    for m in range(min(_COARSEST, int(spread / 3)), 1, -1):
        phase = np.exp(2j * np.pi / m * np.arange(m))
        if abs(np.bincount(k % m, minlength=m) @ phase) >= _COHERENT * k.size:
            return m * tick
    return tick


def integrate(velocity: F8, index: I8, rate_hz: float, tick: float | None, rounding: float) -> tuple[F8, B1]:
    """Sum backward differences ``(x[i] - x[i-1]) * rate_hz`` to a position, m: zero at first, NaN if unknown.

    ``index`` are sample numbers, increasing; a jump is a gap. A value within ``rounding`` of a multiple of the tick is
    replaced by that multiple, so that rounding errors do not add up. In a gap the velocity is interpolated linearly.
    The resulting offset is only an estimate, so the mask returned marks the first sample after each gap.
    """
    known = np.isfinite(velocity)
    v = velocity.copy()
    if tick is not None:
        multiple = tick * np.rint(v / tick)
        v = np.where(np.abs(v - multiple) <= rounding * 1.02, multiple, v)
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
    v_before = np.concatenate(([v[rows[0]]], v[rows[:-1]]))
    lost = index[rows] - previous - 1
    moved = v[rows] + lost * (v[rows] + v_before) / 2
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
