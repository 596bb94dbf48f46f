"""Which families there are, what bytes look like, and what is said where one is asked for that is not."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from acquisition.decoders import registry
from acquisition.decoders.family import Family
from acquisition.decoders.registry import describe_bytes, families, get_family, probe
from acquisition.errors import AcquisitionError, SensorError

LOOK_ALIKE = {
    "maxbotix-lv": {"maxbotix-lv", "maxbotix-lv-p", "maxbotix-xl"},
    "maxbotix-lv-p": {"maxbotix-lv", "maxbotix-lv-p", "maxbotix-xl"},
    "maxbotix-xl": {"maxbotix-lv", "maxbotix-lv-p", "maxbotix-xl"},
    "maxbotix-xl-long": {"maxbotix-xl-long", "maxbotix-hr", "maxbotix-wr"},
    "maxbotix-hr": {"maxbotix-xl-long", "maxbotix-hr", "maxbotix-wr"},
    "maxbotix-wr": {"maxbotix-xl-long", "maxbotix-hr", "maxbotix-wr"},
}
"""Families that differ in the unit alone, which no byte shows."""

every_family = pytest.mark.parametrize("family", families(), ids=lambda family: family.name)


def stream(family: Family, n: int = 20) -> bytes:
    """Return frames of a bob that swings."""
    encoder = family.encoder()
    distances = [0.7 + 0.2 * math.sin(0.3 * i) for i in range(n)]
    return b"".join(
        encoder.encode(sequence=i, device_us=i * 10_000, echo_us=d / 171.5e-6, distance_m=d, temperature_c=21.0)
        for i, d in enumerate(distances)
    )


def add_entry(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    """Pretend that an installed package adds a sensor."""
    entry = EntryPoint("theirs", value, registry.GROUP)
    monkeypatch.setattr(registry, "_entry_points", lambda: {"theirs": entry})


@every_family
def test_each_family_says_what_a_user_must_know(family: Family) -> None:
    """Numbers that can be, one sentence of limits, a source; its description is JSON."""
    assert get_family(family.name) is family
    assert family.baud in (9600, 19200, 115200)
    assert 0 < family.rate_hz <= 100
    assert 0 < family.resolution_m < 0.03
    assert 0 < family.range_m[0] < family.range_m[1] < 12
    assert family.limits.endswith(".")
    assert family.source
    assert json.loads(json.dumps(family.describe()))["name"] == family.name
    assert family.poll is None or 0 < family.poll.interval_s <= family.poll.timeout_s


def test_a_name_that_is_not_known_is_refused_in_one_line() -> None:
    """It lists those that are, and is one of acquisition's errors."""
    with pytest.raises(SensorError) as caught:
        get_family("hcsr04")
    text = str(caught.value)
    assert "'hcsr04'" in text
    assert all(family.name in text for family in families())
    assert "\n" not in text
    assert isinstance(caught.value, AcquisitionError)


def test_another_package_adds_a_family(monkeypatch: pytest.MonkeyPatch) -> None:
    """By an entry point; it comes after ours."""
    add_entry(monkeypatch, "acquisition.decoders.example:FAMILY")
    assert get_family("theirs").name == "example"
    assert families()[-1].name == "example"


@pytest.mark.parametrize("value", ["absent_module:FAMILY", "acquisition.decoders.example:NOTHING", "math:pi"])
def test_a_broken_package_is_named_in_one_line(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    """Whatever is wrong with it."""
    add_entry(monkeypatch, value)
    with pytest.raises(SensorError, match="theirs") as caught:
        get_family("theirs")
    assert "\n" not in str(caught.value)
    assert value in str(caught.value)


def test_asking_for_a_family_imports_no_other() -> None:
    """The table is lazy."""
    code = (
        "import sys; from acquisition.decoders.registry import get_family; get_family('ffhls'); "
        "print([m for m in sys.modules if m.endswith(('us100', 'maxbotix', 'text_lines', 'serial'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@every_family
def test_the_bytes_of_a_family_are_recognised(family: Family) -> None:
    """Its own name, those that differ in the unit alone, and no other; also from the middle of a frame."""
    data = stream(family)
    for start in (0, 1) if family.self_framing else (0,):
        assert set(probe(data[start:])) == LOOK_ALIKE.get(family.name, {family.name})
    assert f"[{family.name}]" in describe_bytes(data)


def test_the_likeliest_is_named_first() -> None:
    """Two lines out of three in one form, one in none."""
    assert probe(b"R0123\rR0124\rnoise!\r")[0].startswith("maxbotix")
    assert probe(b"x" * 50 + b"R0123\r") == []


@pytest.mark.parametrize(
    ("data", "described"),
    [
        (b"", "silence"),
        (b"\0" * 40, "40 bytes, all 0x00"),
        (b"\xff" * 7, "7 bytes, all 0xFF"),
        (b"hello\r\nworld\r\n", "text lines without a distance ('hello')"),
        (np.random.default_rng(2).bytes(200), "noise: wrong baud rate"),
        (bytes.fromhex("ff07a1a7ff07a2a8"), "FF-H-L-SUM frames (A02YYUW"),
        (b"12.1\r\n12.2\r\n12.3\r\n12.2\r\n", "text lines with a number"),
    ],
    ids=["silence", "held-low", "held-high", "text", "noise", "ffhls", "numbers"],
)
def test_bytes_are_described_for_people(data: bytes, described: str) -> None:
    """One line that says what to look for."""
    line = describe_bytes(data)
    assert described in line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("text-lines", {"unit": "ft"}, "unit of text-lines must be one of m, cm, mm, in, us, got 'ft'"),
        ("text-lines", {"time_unit": "h"}, "time_unit of text-lines must be one of us, ms, s"),
        ("text-lines", {"column": -1}, "column of text-lines must be a column from 0 to 63 or a name, got -1"),
        ("text-lines", {"column": "a=b"}, "column of text-lines"),
        ("text-lines", {"separator": "::"}, "separator of text-lines"),
        ("text-lines", {"separator": "."}, "separator of text-lines"),
        ("us100", {"temperature_every": -3}, "temperature_every must be a whole number"),
        ("urm37", {"temperature_every": "often"}, "temperature_every must be a whole number"),
    ],
    ids=str,
)
def test_an_option_without_sense_is_refused_in_one_line(name: str, options: dict[str, object], message: str) -> None:
    """By decoder and encoder alike, before anything is read."""
    for make in (get_family(name).decoder, get_family(name).encoder):
        with pytest.raises(SensorError, match="must be") as caught:
            make(**options)
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)


@every_family
def test_options_are_those_of_the_decoder(family: Family) -> None:
    """Every option that is described is taken, with its value given as text from a command line."""
    text = {"temperature_every": "5", "separator": "tab", "unit": "mm", "time_unit": "ms", "column": "d"}
    for name in family.options:
        family.decoder(**{name: text.get(name, "2")})
        family.encoder(**{name: text.get(name, "2")})


@pytest.mark.parametrize(
    ("options", "line", "distance"),
    [
        ({}, b"12.5", 0.125),
        ({}, b" 12.5 cm", 0.125),
        ({}, b"12.5cm", 0.125),
        ({}, b"+1.25e1", 0.125),
        ({"column": 1}, b"512, 12.5", 0.125),
        ({"column": 1, "separator": "tab"}, b"a b\t12.5", 0.125),
        ({"column": "Distance"}, b"Distance: 12.5 cm", 0.125),
        ({"column": "Distance"}, b"t=5 Distance = 12.5, ok", 0.125),
        ({"column": "d", "unit": "m"}, b"dd=1 d=0.125", 0.125),
        ({"unit": "mm"}, b"125", 0.125),
        ({"unit": "in"}, b"10", 0.254),
        ({}, b"0", math.nan),
        ({}, b"-1", math.nan),
        ({}, b"99999", math.nan),
    ],
    ids=str,
)
def test_text_lines_of_many_sketches_are_read(options: dict[str, object], line: bytes, distance: float) -> None:
    """Numbers as sketches print them; no target is missing."""
    readings = get_family("text-lines").decoder(**options).feed(0, b"begun before\n" + line + b"\r\n")
    np.testing.assert_allclose(readings.distance_m, [distance], rtol=1e-12)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({}, b"nan"),
        ({}, b"inf"),
        ({}, b"1_0"),
        ({}, b"12.5.1"),
        ({}, b"0x12"),
        ({}, b"1e999"),
        ({}, "１２".encode()),
        ({}, b"12.5mm"),
        ({}, b"Ready"),
        ({"column": 1}, b"12.5"),
        ({"column": 1}, b"12.5, far"),
        ({"column": "d"}, b"12.5"),
        ({"column": "d"}, b"d=far"),
        ({"column": "d"}, b"d=12.5.1"),
        ({"column": "d", "unit": "mm"}, b"d: 12.5 cm"),
        ({"sequence": 1}, b"12.5 x"),
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


@pytest.mark.parametrize(
    ("frame", "celsius"),
    [("1100d2e3", 21.0), ("11f00a0b", -1.0), ("11fff6 06", -1.0), ("11ffff0f", math.nan), ("11000011", 0.0)],
)
def test_the_urm37_says_frost_in_either_of_two_ways(frame: str, celsius: float) -> None:
    """Sign and magnitude, or two's complement; FF FF is no temperature."""
    readings = get_family("urm37").decoder().feed(0, bytes.fromhex(frame + "22002a4c"))
    np.testing.assert_array_equal(readings.temperature_c, [celsius])
    np.testing.assert_allclose(readings.distance_m, [0.42])


def test_the_sen0149_s_temperature_is_that_of_its_manual() -> None:
    """00 FF is 25.5 degC."""
    frames = bytes.fromhex("55aa11020300ff14 55aa11020212345a")
    assert get_family("sen0149").decoder().feed(0, frames).temperature_c.tolist() == [25.5]


def test_an_impossible_us100_temperature_is_counted() -> None:
    """-44 degC is what a low byte of a distance looks like."""
    decoder = get_family("us100").decoder(temperature_every=1)
    readings = decoder.feed(0, bytes.fromhex("0200 01 0200 42 0200"))
    assert decoder.faults["bad_temperature"] == 1
    np.testing.assert_array_equal(readings.temperature_c, [math.nan, math.nan, 21.0])


@pytest.mark.parametrize("start", [1, 2, 3])
@pytest.mark.parametrize("mm", [255, 511, 767, 1023])
def test_a_steady_distance_full_of_headers_does_not_hold_ffhls_out_of_step(mm: int, start: int) -> None:
    """FF 01 FF FF for ever has the right sum one byte early too, as 65 m."""
    decoder = get_family("ffhls").decoder()
    frame = (
        get_family("ffhls")
        .encoder()
        .encode(sequence=0, device_us=0, echo_us=math.nan, distance_m=mm / 1000, temperature_c=20.0)
    )
    readings = decoder.feed(0, (frame * 20)[start:])
    assert len(readings) >= 18
    np.testing.assert_allclose(readings.distance_m[-18:], mm / 1000)


@pytest.mark.parametrize("before", [b"noise", b"\xff\xfe", b"R012", b"R0123"], ids=repr)
def test_a_maxbotix_line_behind_garbage_is_read(before: bytes) -> None:
    """What follows the last R may be whole; what stands before is counted."""
    decoder = get_family("maxbotix-hr").decoder()
    assert decoder.feed(0, before + b"R0456\r").distance_m.tolist() == [0.456]
    assert dict(decoder.faults) == {"garbage_bytes": len(before), "bad_frame": 1}
    assert decoder.feed(0, b"\nR0457\r\n").distance_m.tolist() == [0.457]
    assert decoder.faults["bad_frame"] == 1
