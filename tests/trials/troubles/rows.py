"""Troubles of the rows: echoes of something else, lost and repeated rows, wrong times, wrong units, wrong files."""

import math
from dataclasses import replace

import numpy as np

from tests.trials.troubles.motion import swing
from tests.trials.troubles.record import Bench, Record, kind


def _echoes(seed: int, share: float, *, how: str = "anywhere", sigma_m: float = 3e-4) -> Record:
    """Distances of something else: anywhere, in clusters at the turning points, in bursts, or the same object's."""
    b = Bench(seed, f"echoes {share} {how}", sigma_m=sigma_m, seconds=30.0)
    x, n = b.motion.position(b.t), b.t.size
    y = b.rest_m + x + b.noise()
    if how == "turns":
        # Three samples in a hundred begin a cluster, at the far turning point alone.
        top = x > 0.9 * b.motion.amplitude(15.0)
        wrong = top & (np.repeat(b.rng.random(n // 6 + 1), 6)[:n] < share / max(top.mean(), 1e-9))
        return b.record(np.where(wrong, y - b.rng.uniform(0.004, 0.03, n), y))
    if how == "bursts":
        wrong = np.repeat(b.rng.random(n // 30 + 1) < share, 30)[:n]
    else:
        wrong = b.rng.random(n) < share
    level = b.rest_m + 0.02 if how == "object" else b.rng.uniform(0.16, 1.5, n)
    return b.record(np.where(wrong, level + b.noise(), y))


def _spikes(seed: int) -> Record:
    """Readings of 0 and of the greatest range in one sample of twenty-five."""
    b = Bench(seed, "spikes")
    y = b.distance() + b.noise()
    wrong = b.rng.random(y.size)
    return b.record(np.where(wrong < 0.02, 0.0, np.where(wrong > 0.98, 9.999, y)))


def _missing(seed: int, how: str, share: float) -> Record:
    """Samples without a distance: anywhere, beyond a distance, or for several periods."""
    b = Bench(seed, f"missing {how}", seconds=30.0)
    y = b.distance() + b.noise()
    if how == "half":
        gone = y > b.rest_m + 0.005
    elif how == "periods":
        gone = (b.t > 9.0) & (b.t < 9.0 + share * 30.0)
    else:
        gone = b.rng.random(y.size) < share
    return b.record(np.where(gone, np.nan, y))


def _rows_lost(seed: int, share: float, *, times: str) -> Record:
    """Rows that went missing; what is left has its true times, or times counted by rows."""
    b = Bench(seed, f"lost {share} {times}", seconds=30.0)
    y = b.distance() + b.noise()
    if times == "block":
        at = int(b.rng.integers(1000, 2000))
        kept = np.ones(y.size, bool)
        kept[at : at + round(share * 75.0)] = False  # a share of a period
    else:
        kept = b.rng.random(y.size) >= share
        kept[0] = True
    t = b.t[kept] if times == "true" else b.t[: int(kept.sum())]
    return b.record(y[kept], t=t)


def _doubled(seed: int) -> Record:
    """One row in five written twice, and times counted by rows."""
    b = Bench(seed, "doubled", seconds=30.0)
    rows = np.sort(np.concatenate([np.arange(b.t.size), b.rng.choice(b.t.size, b.t.size // 5, replace=False)]))
    y = (b.distance() + b.noise())[rows]
    return b.record(y, t=np.arange(rows.size) / b.rate_hz)


def _slipped(seed: int) -> Record:
    """The clock stands still for a tenth of a second: the phase slips."""
    b = Bench(seed, "slip", seconds=30.0)
    at = b.rng.uniform(10.0, 20.0)
    return b.record(b.distance(b.t + 0.1 * (b.t > at)) + b.noise())


def _interleaved(seed: int, *, same: bool) -> Record:
    """Rows of two sensors in turn: of two bobs, or of one bob from two places."""
    b = Bench(seed, f"interleaved {same}", seconds=20.0)
    first = b.distance() + b.noise()
    if same:
        second = first + 0.03 + b.noise()
    else:
        other = replace(b.bob, omega=1.12 * b.bob.omega, amplitude=0.8 * b.bob.amplitude)
        second = b.rest_m + 0.02 + swing(other, 20.0).position(b.t) + b.noise()
    y = np.where(np.arange(b.t.size) % 2, second, first)
    return b.record(y, *(("period", "amplitude", "damping_rate") if same else ("period", "amplitude", "offset")))


def _velocity(seed: int, rest: float) -> Record:
    """Velocities taken for distances."""
    b = Bench(seed, f"velocity {rest}")
    y = b.motion.velocity(b.t) + rest + 0.003 * b.rng.standard_normal(b.t.size)
    return b.record(y, "period", "amplitude", "offset")


def _unit(seed: int, factor: float) -> Record:
    """Distances in another unit than they are said to be."""
    b = Bench(seed, f"unit {factor}")
    return b.record(factor * (b.distance() + b.noise()))


def _times(seed: int, how: str) -> Record:
    """Times that are not those of the samples."""
    b = Bench(seed, f"times {how}", seconds=30.0)
    t = b.t
    if how == "jitter":
        return b.record(b.distance(t + 1e-3 * b.rng.standard_normal(t.size)) + b.noise())
    if how == "measured jitter":
        t = np.sort(t + 2e-3 * b.rng.standard_normal(t.size))
        t -= t[0]
        return b.record(b.distance(t) + b.noise(), t=t)
    if how == "drift":
        # A clock whose rate grows by a thousandth in the course of the record, right at its middle.
        stamped = t + 5e-4 * (t - 0.5 * b.seconds) ** 2 / b.seconds
        return b.record(b.distance() + b.noise(), "period", "amplitude", "offset", t=stamped - stamped[0])
    y = b.distance() + b.noise()
    if how == "duplicates":
        rows = np.sort(np.concatenate([np.arange(t.size), b.rng.choice(t.size, t.size // 10, replace=False)]))
        return b.record(y[rows], t=t[rows])
    if how == "stamped twice":
        # Two rows in a row carry one time: the times are too coarse for the rate.
        return b.record(y, t=np.floor(t * 50.0) / 50.0)
    # Two runs in one file, the times beginning anew.
    other = replace(b.bob, amplitude=0.7 * b.bob.amplitude, phase=b.bob.phase + 1.0)
    second = b.rest_m + swing(other, 10.0).position(t[:1000]) + b.noise(1000)
    return b.record(np.concatenate([y, second]), t=np.concatenate([t, t[:1000]]))


def _backwards(seed: int) -> Record:
    """Blocks of rows written in the wrong order."""
    b = Bench(seed, "backwards", seconds=20.0)
    rows = np.arange(b.t.size)
    for at in b.rng.choice(np.arange(100, 1800, 100), 4, replace=False):
        rows[at : at + 40] = np.roll(rows[at : at + 40], 20)
    return b.record((b.distance() + b.noise())[rows], t=b.t[rows])


def _room(seed: int) -> Record:
    """A file of MotionSensor.vi, which takes sound for 344 m/s, from a room of 17 to 23 degrees that nobody states."""
    b = Bench(seed, "room", seconds=20.0)
    kelvin = 273.15 + b.rng.uniform(17.0, 23.0)
    speed = 331.3 * math.sqrt(kelvin / 273.15) * 1.0012  # of air that is a little humid
    y = (b.distance() + b.noise()) * 344.0 / speed
    head = "Motion Sensor Data File Mar 12, 2024 2:05 PM\nTime (s)\tDistance (cm)\tDist Error (cm)\n"
    rows = "".join(f"{t:.3f}\t{100.0 * d:.3f}\t0.239\n" for t, d in zip(b.t, y, strict=True))
    return replace(b.record(y), text=(head + rows).replace("\n", "\r\n").encode())


KINDS = (
    kind("echoes: 2 %", "false_echoes", _echoes, 0.02, cure=True),
    kind("echoes: 15 %", "false_echoes", _echoes, 0.15, cure=True),
    kind("echoes: 30 %", "false_echoes", _echoes, 0.30, cure=True),
    kind("echoes: 15 % at far crests", "false_echoes", _echoes, 0.15, how="turns", cure=True),
    kind("echoes: bursts of 0.3 s", "false_echoes", _echoes, 0.15, how="bursts", cure=True),
    kind("echoes: of one object within", "false_echoes", _echoes, 0.15, how="object", cure=True),
    kind("echoes: 0 and 9.999 m", "false_echoes", _spikes, cure=True),
    kind("missing: 30 % anywhere", "missing", _missing, "anywhere", 0.3, cure=True),
    kind("missing: beyond a distance", "missing", _missing, "half", 0.5, cure=True),
    kind("missing: several periods", "missing", _missing, "periods", 0.3, cure=True),
    kind("rows lost: 5 %, times counted", "rows_lost", _rows_lost, 0.05, times="counted"),
    kind("rows lost: 30 %, times counted", "rows_lost", _rows_lost, 0.30, times="counted"),
    kind("rows lost: 20 %, true times", "missing", _rows_lost, 0.20, times="true", cure=True),
    kind("rows lost: half a period together", "rows_lost", _rows_lost, 0.5, times="block", cure=True),
    kind("rows doubled: 20 %, times counted", "rows_doubled", _doubled),
    kind("phase slips by 0.1 s", "rows_lost", _slipped, cure=True),
    kind("interleaved: two bobs", "interleaved", _interleaved, same=False),
    kind("interleaved: two places", "interleaved", _interleaved, same=True),
    kind("velocity taken for distance", "impossible", _velocity, 0.0),
    kind("unit: cm taken for m", "impossible", _unit, 100.0),
    kind("unit: mm taken for m", "impossible", _unit, 1000.0),
    kind("unit: mm taken for cm", "impossible", _unit, 10.0),
    kind("unit: inches taken for m", "impossible", _unit, 1.0 / 0.0254),
    kind("times: jitter of 1 ms", "nothing", _times, "jitter", cure=True),
    kind("times: jitter, measured", "nothing", _times, "measured jitter", cure=True),
    kind("times: rate drifts by 0.1 %", "clock", _times, "drift"),
    kind("times: rows repeated", "duplicate", _times, "duplicates", cure=True),
    kind("times: two rows a stamp", "duplicate", _times, "stamped twice"),
    kind("times: two runs in one file", "joined", _times, "joined", cure=True),
    kind("times: blocks out of order", "joined", _backwards, cure=True),
    kind("room: air not stated", "air", _room),
)
