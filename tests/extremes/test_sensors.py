"""Sensors at the ends of what their frames and a log can hold: sound frames, and numbers that no bench sends."""

import itertools
import json
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from acquisition.block import Flag
from acquisition.decoders.registry import families, get_family
from acquisition.errors import SensorError
from acquisition.live.decoding import SensorChain
from tests.encoders import frames, sealed
from tests.sampling import sampled

LAST = 2**32 - 1
STAMP = 2**63 - 1
ENDS_US = ("0.00", "0.01", "999999.99")


def lines(values: Iterable[tuple[int, int, str, str]]) -> bytes:
    """Lines of sequence, clock, echo and temperature."""
    return b"".join(sealed(f"R1,{number},{clock},{echo},{celsius},E") for number, clock, echo, celsius in values)


NUMBERS = ["0", "1", "-1", "1e-99", "9223372036854775807", "9e18", "999999999999999e99", "123456789012345.123456789012"]
PAIRS = "".join(f"{a},{b}\n" for a, b in itertools.product(NUMBERS, NUMBERS) for _ in range(4))
WIRES: dict[str, tuple[str, dict[str, Any], bytes]] = {
    "every end of every field": (
        "line-protocol",
        {},
        lines(itertools.product((0, 1, LAST), (0, 1, LAST // 2, LAST), ENDS_US, ("", "99999", "-99999"))),
    ),
    "a clock that stands still": ("line-protocol", {}, lines([(i, 777, "1000.00", "") for i in range(300)])),
    "a clock that leaps": ("line-protocol", {}, lines([(i, i * LAST // 7 % LAST, "9.00", "") for i in range(300)])),
    "a regular stream": ("line-protocol", {}, lines([(i, i * 10_000, "1000.00", "2000") for i in range(300)])),
    "clock of seconds": (
        "text-lines",
        {"column": 1, "time": 0, "time_unit": "s", "unit": "us"},
        b"t,d\n" + PAIRS.encode(),
    ),
    "counter": ("text-lines", {"column": 1, "sequence": 0, "unit": "in"}, b"n,d\n" + PAIRS.encode()),
} | {
    f"{family.name} by its encoder": (
        family.name,
        {},
        b"".join(frames(family.name, (0.3, float("nan"), 0.0, 1e-9, 5.0, 9.0) * 30)),
    )
    for family in families()
}
STAMPS: dict[str, Callable[[int], int]] = {
    "all together": lambda _: 0,
    "forward": lambda i: i * 10_000_000,
    "backward": lambda i: -i * 10_000_000,
    "from end to end": lambda i: -STAMP - 1 if i % 2 else STAMP,
    "at the end": lambda _: STAMP,
}


@pytest.mark.parametrize("stamps", sampled(STAMPS))
@pytest.mark.parametrize("wire", WIRES)
def test_sound_frames_of_any_content_are_samples(wire: str, stamps: str) -> None:
    """In one read or many, at any rate: finite times, a flag on what has no distance, and a report that JSON holds."""
    name, options, data = WIRES[wire]
    for rate_hz, cut in itertools.product((None, 1e-6, 1e9), (len(data), 50)):
        chain = SensorChain(get_family(name), options=options, rate_hz=rate_hz)
        blocks = [
            chain.feed(STAMPS[stamps](i), data[start : start + cut]) for i, start in enumerate(range(0, len(data), cut))
        ]
        t = np.concatenate([block.t for block in blocks])
        distance = np.concatenate([block.distance for block in blocks])
        flags = np.concatenate([block.flags for block in blocks])
        assert t.size
        assert np.isfinite(t).all()
        np.testing.assert_array_equal(np.isnan(distance), (flags & Flag.MISSING) != 0)
        report = chain.report()
        assert json.loads(json.dumps(report, allow_nan=False)) == report


def test_many_readings_of_one_read_tell_no_clock() -> None:
    """A burst over TCP: 128 device readings with one stamp are samples, and nobody divides by nothing."""
    chain = SensorChain(get_family("line-protocol"))
    chain.feed(0, lines([(i, i * 10_000, "1000.00", "") for i in range(128)]))
    report = chain.report()
    assert report["clock"]["rate_error_ppm"] is None
    assert (report["clock"]["stalls"], report["clock"]["held_readings"]) == (1, 127)


@pytest.mark.parametrize("wrong", [{"rate_hz": 1e300}, {"rate_hz": "100"}, {"clock_ppm": -1.0}, {"clock_ppm": "200"}])
def test_what_no_sensor_can_be_set_to_is_one_line(wrong: dict[str, Any]) -> None:
    """A rate or a clock out of its range, or no number: the range and the value are named."""
    with pytest.raises(SensorError, match=rf"{next(iter(wrong))} of a sensor must be a number from \S+ to \S+, got"):
        SensorChain(get_family("line-protocol"), **wrong)
