"""What boards send besides plain lines: other ends, colours, encodings, clocks that turn, several sensors, frames."""

import math

import numpy as np
import pytest

from acquisition.decoders.registry import describe_bytes, get_family, probe
from acquisition.readings import Readings
from springmass.session.detect import described

DISTANCES_CM = [round(26.9 + 5.2 * math.cos(0.2 * i), 2) for i in range(40)]


def lines(form: str, encoding: str = "ascii") -> bytes:
    """Return the distances in a form of lines."""
    return "".join(form.format(d=d, mm=10 * d, ms=20 * i) for i, d in enumerate(DISTANCES_CM)).encode(encoding)


def read(data: bytes, family: str = "text-lines", **options: object) -> Readings:
    """Return the readings of bytes."""
    return get_family(family).decoder(**options).feed(0, data)


@pytest.mark.parametrize(
    ("data", "options"),
    [
        (lines("\x1b[0;32mI ({ms}) hcsr04: Distance: {d:.2f} cm\x1b[0m\r\n"), {}),
        (lines("{d:.2f}\r"), {}),
        (lines("Distance: {d:.2f} cm\r"), {}),
        (lines("\x02{d:.2f}\x03"), {}),
        (lines("/*{mm:.1f},21.3*/"), {"column": 0, "separator": "comma", "unit": "mm"}),
        (lines("距离：{d:.2f}厘米\r\n", "gbk"), {}),
        (lines("Расстояние: {d:.2f} см\r\n", "cp1251"), {}),
    ],
)
def test_lines_of_boards_are_read(data: bytes, options: dict[str, object]) -> None:
    """Colours, a carriage return alone, frames without line ends, and words in another encoding than UTF-8."""
    found = read(data, **options).distance_m
    np.testing.assert_allclose(found, np.array(DISTANCES_CM[-found.size :]) / 100)
    assert found.size >= len(DISTANCES_CM) - 1


def test_the_time_of_a_log_of_esp_idf_is_read() -> None:
    """``I (4140)`` are milliseconds since the start of the board."""
    readings = read(lines("I ({ms}) hcsr04: Distance: {d:.2f} cm\r\n"))
    assert [reading.device_us for reading in readings[:2]] == [20_000, 40_000]


@pytest.mark.parametrize(
    ("begin", "bits", "signed", "unit", "step_us"),
    [(32_600, 16, True, "ms", 20_000), (65_400, 16, False, "ms", 20_000), (2**31 - 90_000, 32, True, "us", 20_000)],
)
def test_a_clock_goes_on_over_its_turn(begin: int, bits: int, signed: bool, unit: str, step_us: int) -> None:
    """A signed clock of 16 or 32 bits continues at its smallest number, and time at its step."""
    step = step_us // (1000 if unit == "ms" else 1)
    clock = [(begin + step * i) % 2**bits for i in range(len(DISTANCES_CM))]
    clock = [value - 2**bits if signed and value >= 2 ** (bits - 1) else value for value in clock]
    data = "".join(f"{value},{d}\n" for value, d in zip(clock, DISTANCES_CM, strict=True)).encode()
    readings = read(data, column=1, separator="comma", unit="cm", time=0, time_unit=unit)
    assert set(np.diff([reading.device_us for reading in readings])) == {step_us}
    assert len(readings) == len(DISTANCES_CM) - 1


@pytest.mark.parametrize(("first", "form"), [("Left", "{d:.2f} cm\r\nRight: 50.00 cm"), ("A", "{d:.2f}\r\nB: 50.00")])
def test_two_sensors_in_turn_are_asked_about(first: str, form: str) -> None:
    """Lines of two names are no single distance; the option that the answer names reads one of them."""
    data = lines(f"{first}: {form}\r\n")
    decoder = get_family("text-lines").decoder()
    decoder.feed(0, data)
    assert decoder.refused
    assert describe_bytes(data, {}).alternatives == ({"column": first},)
    distances = read(data, column=first).distance_m
    np.testing.assert_allclose(distances, np.array(DISTANCES_CM[-distances.size :]) / 100)
    both = get_family("text-lines").decoder()
    both.feed(0, lines("Distance in cm: {d:.2f} cm\r\nDistance in mm: {mm:.1f} mm\r\n"))
    assert not both.refused


def test_numbers_that_must_be_metres_are_asked_about() -> None:
    """0.27 is no distance in cm for any such sensor; with a unit it is read, and 26.9 is read as cm and said to be."""
    data = "".join(f"{d / 100:.2f}\r\n" for d in DISTANCES_CM).encode()
    decoder = get_family("text-lines").decoder()
    decoder.feed(0, data)
    assert decoder.refused
    assert describe_bytes(data, {}).alternatives == ({"unit": "m"},)
    assert read(data, unit="m").distance_m.max() == pytest.approx(0.32)
    usual = get_family("text-lines").decoder()
    usual.feed(0, lines("{d:.2f}\r\n"))
    assert (usual.refused, usual.assumed_unit) == (False, "cm")


@pytest.mark.parametrize("first", [0, 1])
def test_frames_whose_sum_leaves_the_header_out_are_read(first: int) -> None:
    """FF 01 0D 0E and FF 01 0D 0D are both 269 mm; until it is clear which, three frames at most are lost."""
    frames = [bytes([255, mm >> 8, mm & 255]) for mm in (round(10 * d) for d in DISTANCES_CM)]
    sound = [frame + bytes([sum(frame[first:]) & 255]) for frame in frames]
    found = read(b"".join(sound), "ffhls").distance_m
    np.testing.assert_allclose(found, np.array(DISTANCES_CM[-found.size :]) / 100, atol=5e-4)
    assert found.size >= len(sound) - 2
    assert probe(b"".join(sound)) == ["ffhls"]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (lines("{d:.2f},"), "without line ends"),
        (bytes(x | (0x80 if x.bit_count() % 2 else 0) for x in lines("{d:.2f}\r\n")), "--framing 7E1"),
        (bytes(x | (0 if x.bit_count() % 2 else 0x80) for x in lines("{d:.2f}\r\n")), "--framing 7O1"),
        (
            b"".join(bytes([0xAA, 0x55, i * 7 & 255, i * 13 & 255, i * 91 & 255]) for i in range(40)),
            "frames of 5 bytes",
        ),
        (np.random.default_rng(1).bytes(400), "noise"),
        (lines("/*{mm:.1f},21.3*/"), "--option column=0"),
    ],
)
def test_what_is_not_read_is_named(data: bytes, words: str) -> None:
    """The likeliest cause is said, and noise only of bytes that repeat nothing and are no text."""
    assert words in described(describe_bytes(data, {}))
    assert probe(data) == []
