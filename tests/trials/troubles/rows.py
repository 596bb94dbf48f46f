"""Troubles of the rows: echoes of something else, lost and repeated rows, wrong times, wrong units, wrong files."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tests.trials.troubles.motion import swing
from tests.trials.troubles.record import Bench, Kind, Make, Record


def _echoes(share: float, *, how: str = "anywhere", sigma_m: float = 3e-4) -> Make:
    """Distances of something else: anywhere, in clusters at the turning points, in bursts, or the same object's."""

    def make(seed: int) -> Record:
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

    return make


def _spikes(seed: int) -> Record:
    """Readings of 0 and of the greatest range in one sample of twenty-five."""
    b = Bench(seed, "spikes")
    y = b.distance() + b.noise()
    wrong = b.rng.random(y.size)
    return b.record(np.where(wrong < 0.02, 0.0, np.where(wrong > 0.98, 9.999, y)))


def _missing(how: str, share: float) -> Make:
    """Samples without a distance: anywhere, beyond a distance, or for several periods."""

    def make(seed: int) -> Record:
        b = Bench(seed, f"missing {how}", seconds=30.0)
        y = b.distance() + b.noise()
        if how == "half":
            gone = y > b.rest_m + 0.005
        elif how == "periods":
            gone = (b.t > 9.0) & (b.t < 9.0 + share * 30.0)
        else:
            gone = b.rng.random(y.size) < share
        return b.record(np.where(gone, np.nan, y))

    return make


def _rows_lost(share: float, *, times: str) -> Make:
    """Rows that went missing; what is left has its true times, or times counted by rows."""

    def make(seed: int) -> Record:
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

    return make


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


def _interleaved(*, same: bool) -> Make:
    """Rows of two sensors in turn: of two bobs, or of one bob from two places."""

    def make(seed: int) -> Record:
        b = Bench(seed, f"interleaved {same}", seconds=20.0)
        first = b.distance() + b.noise()
        if same:
            second = first + 0.03 + b.noise()
        else:
            other = replace(b.bob, omega=1.12 * b.bob.omega, amplitude=0.8 * b.bob.amplitude)
            second = b.rest_m + 0.02 + swing(other, 20.0).position(b.t) + b.noise()
        y = np.where(np.arange(b.t.size) % 2, second, first)
        return b.record(y, *(("period", "amplitude", "damping_rate") if same else ("period", "amplitude", "offset")))

    return make


def _velocity(rest: float) -> Make:
    """Velocities taken for distances."""

    def make(seed: int) -> Record:
        b = Bench(seed, f"velocity {rest}")
        y = b.motion.velocity(b.t) + rest + 0.003 * b.rng.standard_normal(b.t.size)
        return b.record(y, "period", "amplitude", "offset")

    return make


def _unit(factor: float) -> Make:
    """Distances in another unit than they are said to be."""

    def make(seed: int) -> Record:
        b = Bench(seed, f"unit {factor}")
        return b.record(factor * (b.distance() + b.noise()))

    return make


def _times(how: str) -> Make:
    """Times that are not those of the samples."""

    def make(seed: int) -> Record:
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

    return make


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
    Kind(name="echoes: 2 %", cause="false_echoes", make=_echoes(0.02), cure=True),
    Kind(name="echoes: 15 %", cause="false_echoes", make=_echoes(0.15), cure=True),
    Kind(name="echoes: 30 %", cause="false_echoes", make=_echoes(0.30), cure=True),
    Kind(name="echoes: 15 % at far crests", cause="false_echoes", make=_echoes(0.15, how="turns"), cure=True),
    Kind(name="echoes: bursts of 0.3 s", cause="false_echoes", make=_echoes(0.15, how="bursts"), cure=True),
    Kind(name="echoes: of one object within", cause="false_echoes", make=_echoes(0.15, how="object"), cure=True),
    Kind(name="echoes: 0 and 9.999 m", cause="false_echoes", make=_spikes, cure=True),
    Kind(name="missing: 30 % anywhere", cause="missing", make=_missing("anywhere", 0.3), cure=True),
    Kind(name="missing: beyond a distance", cause="missing", make=_missing("half", 0.5), cure=True),
    Kind(name="missing: several periods", cause="missing", make=_missing("periods", 0.3), cure=True),
    Kind(name="rows lost: 5 %, times counted", cause="rows_lost", make=_rows_lost(0.05, times="counted")),
    Kind(name="rows lost: 30 %, times counted", cause="rows_lost", make=_rows_lost(0.30, times="counted")),
    Kind(name="rows lost: 20 %, true times", cause="missing", make=_rows_lost(0.20, times="true"), cure=True),
    Kind(name="rows lost: half a period together", cause="rows_lost", make=_rows_lost(0.5, times="block"), cure=True),
    Kind(name="rows doubled: 20 %, times counted", cause="rows_doubled", make=_doubled),
    Kind(name="phase slips by 0.1 s", cause="rows_lost", make=_slipped, cure=True),
    Kind(name="interleaved: two bobs", cause="interleaved", make=_interleaved(same=False)),
    Kind(name="interleaved: two places", cause="interleaved", make=_interleaved(same=True)),
    Kind(name="velocity taken for distance", cause="impossible", make=_velocity(0.0)),
    Kind(name="unit: cm taken for m", cause="impossible", make=_unit(100.0)),
    Kind(name="unit: mm taken for m", cause="impossible", make=_unit(1000.0)),
    Kind(name="unit: mm taken for cm", cause="impossible", make=_unit(10.0)),
    Kind(name="unit: inches taken for m", cause="impossible", make=_unit(1.0 / 0.0254)),
    Kind(name="times: jitter of 1 ms", cause="nothing", make=_times("jitter"), cure=True),
    Kind(name="times: jitter, measured", cause="nothing", make=_times("measured jitter"), cure=True),
    Kind(name="times: rate drifts by 0.1 %", cause="clock", make=_times("drift")),
    Kind(name="times: rows repeated", cause="duplicate", make=_times("duplicates"), cure=True),
    Kind(name="times: two rows a stamp", cause="duplicate", make=_times("stamped twice")),
    Kind(name="times: two runs in one file", cause="joined", make=_times("joined"), cure=True),
    Kind(name="times: blocks out of order", cause="joined", make=_backwards, cure=True),
    Kind(name="room: air not stated", cause="air", make=_room),
)
