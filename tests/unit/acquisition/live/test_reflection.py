"""A sample of a sensor that stamps its ping has the time at which the sound met the bob."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.decoders.registry import get_family
from acquisition.live.decoding import SensorChain

SPEED_M_PER_S = 344.0
OMEGA, AMPLITUDE_M, REST_M = 8.3, 0.05, 0.25


def line(i: int, echo_us: float) -> bytes:
    """Return the line of one ping, 10 ms after the one before; NaN for no echo."""
    encoder = get_family("line-protocol").encoder()
    return encoder.encode(sequence=i, device_us=i * 10_000, echo_us=echo_us, distance_m=0.25, temperature_c=np.nan)


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
