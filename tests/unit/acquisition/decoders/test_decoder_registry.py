"""Families of sensors: how bytes are recognised, what options are refused, and what single frames mean."""

import math
from dataclasses import replace

import numpy as np
import pytest

from acquisition.decoders.registry import describe_bytes, families, get_family, probe
from acquisition.decoders.sensor import Sensor
from acquisition.errors import SensorError
from acquisition.live.decoding import SensorChain
from tests.encoders import frames

THREE_DIGITS = {"maxbotix-lv", "maxbotix-lv-p", "maxbotix-xl"}
FOUR_DIGITS = {"maxbotix-xl-long", "maxbotix-hr", "maxbotix-wr"}
LOOK_ALIKE = {name: names for names in (THREE_DIGITS, FOUR_DIGITS) for name in names}
"""Families that differ in the unit alone, which no byte shows."""

every_family = pytest.mark.parametrize("family", families(), ids=lambda family: family.name)


@every_family
def test_the_bytes_of_a_family_are_recognised(family: Sensor) -> None:
    """Its own name, those that differ in the unit alone, and no other; also from the middle of a frame."""
    data = b"".join(frames(family.name, [0.7 + 0.2 * math.sin(0.3 * i) for i in range(20)]))  # a bob that swings
    for start in (0, 1) if family.self_framing else (0,):
        assert set(probe(data[start:])) == LOOK_ALIKE.get(family.name, {family.name})
    assert f"[{family.name}]" in describe_bytes(data).looks


@pytest.mark.parametrize(
    "options",
    [{"unit": "ft"}, {"time_unit": "h"}, {"column": -1}, {"column": "a=b"}, {"separator": "::"}, {"separator": "."}],
    ids=str,
)
def test_an_option_without_sense_is_refused_in_one_line(options: dict[str, object]) -> None:
    """The error names the option, before anything is read."""
    with pytest.raises(SensorError, match=next(iter(options))) as caught:
        get_family("text-lines").decoder(**options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({}, b"nan"),
        ({}, b"1_0"),
        ({}, b"1e999"),
        ({}, "１２".encode()),
        ({"unit": "cm"}, b"12.5mm"),
        ({}, b"512;12.5"),
        ({}, b"26,87 cm"),
        ({}, b"Temperature: 21.5 C"),
        ({}, b"Left: 26.9 cm Right: 30.1 cm"),
        ({}, b"26.9 cm/s"),
        ({}, b"192.168.1.1"),
        ({}, b"Starting at 9600 baud"),
        ({"column": 1}, b"12.5"),
        ({"column": "d"}, b"12.5"),
        ({"column": "d", "unit": "mm"}, b"d: 12.5 cm"),
        ({"sequence": 1}, b"12.5 -4"),
        ({"time": 1}, b"12.5"),
    ],
    ids=str,
)
def test_a_line_without_a_number_where_one_belongs_is_a_fault(options: dict[str, object], line: bytes) -> None:
    """Counted, and never a distance; nor is a number whose unit is another's."""
    decoder = get_family("text-lines").decoder(**options)
    assert len(decoder.feed(0, b"\n" + line + b"\r\n")) == 0
    assert decoder.faults["bad_frame"] == 1


@pytest.mark.parametrize("start", [1, 2, 3])
@pytest.mark.parametrize("mm", [255, 511, 767, 1023])
def test_a_steady_distance_full_of_headers_does_not_hold_ffhls_out_of_step(mm: int, start: int) -> None:
    """FF 01 FF FF for ever has the right sum one byte early too, as 65 m."""
    decoder = get_family("ffhls").decoder()
    readings = decoder.feed(0, b"".join(frames("ffhls", [mm / 1000] * 20))[start:])
    assert len(readings) >= 18
    np.testing.assert_allclose(readings.distance_m[-18:], mm / 1000)


def test_a_decoder_without_the_defaults_is_refused() -> None:
    """One line says what its class must inherit, when the sensor is opened."""
    with pytest.raises(SensorError, match=r"must inherit from springmass\.extend\.Decoder, got object"):
        SensorChain(replace(get_family("us100"), decoder=object))
