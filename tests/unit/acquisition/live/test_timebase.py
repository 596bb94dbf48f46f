"""Sensor time from the device's clock, its counter or the host."""

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.block import Flag
from acquisition.decoders.registry import get_family
from acquisition.live.decoding import SensorChain
from acquisition.live.timebase import Timebase
from acquisition.readings import Reading, Readings
from tests.wire import line

RATE_HZ = 100.0
STEP_US = 10_000
SECOND_NS = 1_000_000_000
WRAP = 1 << 32


def readings(
    device_us: object = None, sequence: object = None, host_ns: object = None, *, start_ns: int = 5 * SECOND_NS
) -> Readings:
    """Return readings with those columns; the host's is on time where it is left out."""
    given_columns = [column for column in (device_us, sequence, host_ns) if column is not None]
    n = len(given_columns[0])  # type: ignore[arg-type]
    none = np.full(n, -1, np.int64)
    host = start_ns + np.arange(n) * SECOND_NS // 100 if host_ns is None else np.asarray(host_ns, np.int64)
    columns = (host, none if sequence is None else sequence, none if device_us is None else device_us)
    whole = zip(*(np.asarray(column, np.int64).tolist() for column in columns), strict=True)
    return Readings(Reading(*row, echo_us=1000.0) for row in whole)


def times(base: Timebase, part: Iterable[Reading]) -> tuple[np.ndarray, np.ndarray]:
    """Return times and flags of readings."""
    rows = [base.push(reading) for reading in part]
    return np.array([t for t, _ in rows]), np.array([flag for _, flag in rows], np.uint8)


def pushed(whole: Readings) -> tuple[np.ndarray, np.ndarray, Timebase]:
    """Return times and flags of readings, and the timebase."""
    base = Timebase(RATE_HZ)
    return *times(base, whole), base


def test_device_time_goes_on_through_its_wrap() -> None:
    """Microseconds that start over at 2^32 give even steps and no flag."""
    ticks = np.arange(200) * STEP_US
    t, flags, base = pushed(readings(device_us=(WRAP - 700_000 + ticks) % WRAP))
    np.testing.assert_array_equal(t, ticks * 1e-6)
    assert not flags.any()
    assert (base.restarts, base.clock) == (0, "device")


def test_two_wraps_within_one_silence_are_counted() -> None:
    """After three hours without a reading the host tells how often the device's clock went round."""
    silence_s = 3 * 3600
    device = np.array([100, 100 + silence_s * 1_000_000]) % WRAP
    t, flags, base = pushed(readings(device_us=device, host_ns=[0, silence_s * SECOND_NS]))
    assert t[1] == pytest.approx(silence_s, abs=1e-9)
    assert flags[1] == Flag.GAP_BEFORE
    assert base.restarts == 0


def test_host_stamps_alone_are_the_time() -> None:
    """With neither clock nor counter the stamps count; a late one is no gap, a quarter second of silence is."""
    host = 7 * SECOND_NS + np.arange(20) * SECOND_NS // 100
    host[8:] += 60_000_000
    host[15:] += 400_000_000
    t, flags, base = pushed(readings(host_ns=host))
    np.testing.assert_allclose(t, (host - host[0]) * 1e-9, atol=1e-12)
    assert np.flatnonzero(flags).tolist() == [15]
    assert base.clock == "host"


@pytest.mark.parametrize("column", ["device_us", "sequence"])
def test_a_gap_has_its_length(column: str) -> None:
    """Seven readings left out are a gap of eight steps, at the first reading after it."""
    index = np.concatenate([np.arange(10), np.arange(17, 27)])
    values = index * STEP_US if column == "device_us" else index
    t, flags, _ = pushed(readings(**{column: values}))
    assert np.flatnonzero(flags).tolist() == [10]
    assert flags[10] == Flag.GAP_BEFORE
    np.testing.assert_allclose(t, index / RATE_HZ, atol=1e-12)


def test_repeats_and_steps_back_are_flagged_and_move_nothing_after_them() -> None:
    """A repeated and a late reading keep their own time; those that follow stand where they would have stood."""
    order = np.array([0, 1, 2, 2, 3, 1, 4, 5, 6])
    t, flags, _ = pushed(readings(device_us=50_000 + order * STEP_US))
    np.testing.assert_allclose(t, order / RATE_HZ, atol=1e-12)
    expected = np.zeros(9, np.uint8)
    expected[3], expected[5] = Flag.DUPLICATE_TIME, Flag.NON_MONOTONIC_TIME
    np.testing.assert_array_equal(flags, expected)


@pytest.mark.parametrize("column", ["device_us", "sequence"])
@pytest.mark.parametrize("silence_s", [0.0, 0.01, 3.0, 30.0])
def test_a_device_that_starts_again_is_joined_by_the_host_clock(column: str, silence_s: float) -> None:
    """After a restart time goes on by the host's elapsed time, and the first reading is flagged in any case."""
    unit = STEP_US if column == "device_us" else 1
    values = np.concatenate([500 + np.arange(10), np.arange(10)]) * unit
    host = np.arange(20) * SECOND_NS // 100
    host[10:] += int(silence_s * SECOND_NS)
    t, flags, base = pushed(readings(**{column: values}, host_ns=host))
    assert base.restarts == 1
    assert np.flatnonzero(flags).tolist() == [10]
    assert t[10] - t[9] == pytest.approx(0.01 + silence_s, abs=1e-9)
    np.testing.assert_allclose(np.diff(t[10:]), 0.01, atol=1e-12)


STEPS = st.lists(
    st.one_of(
        st.just(STEP_US),
        st.just(STEP_US),
        st.just(STEP_US),
        st.just(STEP_US),
        st.integers(9_000, 15_001),
        st.sampled_from([0, -STEP_US, 40_000, 3_000_000, -2_000_000, WRAP - 30_000]),
    ),
    min_size=1,
    max_size=120,
)


@given(steps=STEPS, start=st.integers(0, WRAP - 1), kind=st.integers(0, 2))
def test_times_without_a_flag_go_forward(steps: list[int], start: int, kind: int) -> None:
    """Whatever clock is read and however it runs, a time that does not go forward is flagged."""
    device = (start + np.cumsum(steps)) % WRAP
    host = np.cumsum(np.abs(steps)) * 1000
    whole = [
        readings(device_us=device, host_ns=host),
        readings(sequence=device // STEP_US, host_ns=host),
        readings(host_ns=host),
    ][kind]
    t, flags, _ = pushed(whole)
    assert np.all(np.diff(t[(flags & (Flag.DUPLICATE_TIME | Flag.NON_MONOTONIC_TIME)) == 0]) > 0)


def test_a_stall_that_lost_a_few_readings_is_no_restart() -> None:
    """A young device whose clock goes on 40 ms later behind 13 s of silence has not started again."""
    device = 1_500_000 + np.concatenate([np.arange(10), np.arange(13, 40)]) * STEP_US
    host = np.concatenate([np.arange(10), np.full(27, 1310)]) * SECOND_NS // 100
    t, flags, base = pushed(readings(device_us=device, host_ns=host))
    assert base.restarts == 0
    assert np.flatnonzero(flags).tolist() == [10]
    np.testing.assert_allclose(t, (device - device[0]) * 1e-6, atol=1e-12)


SPEED_M_PER_S = 344.0
OMEGA, AMPLITUDE_M, REST_M = 8.3, 0.05, 0.25


def flight_us(t: float) -> float:
    """Return how long sound that leaves at a time is on its way to the bob and back: it meets it half way."""
    distance_m = REST_M
    for _ in range(20):
        distance_m = REST_M + AMPLITUDE_M * np.cos(OMEGA * (t + distance_m / SPEED_M_PER_S))
    return float(2e6 * distance_m / SPEED_M_PER_S)


def test_times_are_those_of_the_reflection() -> None:
    """Half of the time of flight is added to the device's clock; without an echo, that of the ping before."""
    chain = SensorChain(get_family("line-protocol"), rate_hz=100.0)
    echoes = [np.nan, 1500.0, 1600.0, np.nan, np.nan, 1700.0]
    t = chain.feed(0, b"".join(line(i, echo) for i, echo in enumerate(echoes))).t
    ways = np.array([0.0, 750.0, 800.0, 800.0, 800.0, 850.0])
    np.testing.assert_allclose(t, 0.01 * np.arange(6) + 1e-6 * ways, rtol=0, atol=1e-12)


def test_an_echo_of_an_earlier_ping_moves_no_time() -> None:
    """Sound on its way for longer than a period did not come from this ping: times go on forward."""
    chain = SensorChain(get_family("line-protocol"), rate_hz=100.0)
    t = chain.feed(0, b"".join(line(i, echo) for i, echo in enumerate([1500.0, 24_000.0, 1500.0]))).t
    np.testing.assert_allclose(t, [0.00075, 0.01075, 0.02075], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("at_the_ping", "least_um", "most_um"), [(True, 20.0, 40.0), (False, 0.0, 1.0)])
def test_no_second_harmonic_is_left(at_the_ping: bool, least_um: float, most_um: float) -> None:
    """A sinusoid stays one; at the times of the pings it had a second harmonic of omega A^2 / 2c, 30 um."""
    chain = SensorChain(get_family("line-protocol"), rate_hz=100.0)
    block = chain.feed(0, b"".join(line(i, flight_us(0.01 * i)) for i in range(2000)))
    t = 0.01 * np.arange(2000) if at_the_ping else block.t
    waves = [np.ones_like(t), *(wave(n * OMEGA * t) for n in (1, 2) for wave in (np.cos, np.sin))]
    result = np.linalg.lstsq(np.stack(waves, axis=1), block.distance, rcond=None)[0]
    assert least_um <= 1e6 * np.hypot(result[3], result[4]) <= most_um
