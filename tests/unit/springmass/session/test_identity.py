"""What a sensor says that it is: shown, compared with the firmware that travels here, and asked of one that returns."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from acquisition.decoders.family import Identity
from acquisition.decoders.line_protocol import FAMILY, frame
from acquisition.decoders.registry import get_family
from acquisition.live.firmware import MODEL, VERSION
from acquisition.live.line import Transport
from acquisition.readings import Reading
from springmass.session.identity import meeting, outdated, settings_of
from springmass.session.sensors import PROOF_BYTES, Back, Sensor

SETTINGS = {"rate_hz": 100, "near_us": 116, "far_us": 25_000, "spread_us": 0, "thermometer": 0}
MINE = Identity(MODEL, VERSION, "bench-3", SETTINGS)


def sensor(identity: Identity | None = None, rate_hz: float | None = None) -> Sensor:
    """Return a rangefinder on a port that nobody reads."""
    return Sensor(FAMILY, cast(Transport, SimpleNamespace(name="port")), rate_hz, identity=identity)


def identity_line(model: str = MODEL, name: str = "bench-3", version: str = VERSION) -> bytes:
    """Return the line by which a device says what it is."""
    return frame(f"I1,{model},{version},{name},100,116,25000,0,0".encode("ascii"))


def readings(count: int) -> bytes:
    """Return sound readings."""
    return b"".join(frame(f"R1,{i},{i * 10_000},2000.00,,E".encode("ascii")) for i in range(count))


@pytest.mark.parametrize(
    ("version", "older"),
    [("1.0.0", True), ("1.9.9", True), ("1.10.0", True), (VERSION, False), ("2.0.1", False), ("10.0.0", False)],
)
def test_an_update_is_asked_for_where_the_firmware_is_older(version: str, older: bool) -> None:
    """By numbers, not by letters; with the command that flashes it, and of no other model."""
    identity = Identity(MODEL, version, "", SETTINGS)
    assert outdated(identity) == older
    lines = list(meeting(sensor(), identity))
    assert (len(lines) == 2) == older
    if older:
        assert f"firmware {version} is older than {VERSION}" in lines[1]
        assert "`springmass firmware --port port --flash` updates it" in lines[1]
    assert not outdated(Identity("another-rangefinder", version))


def test_what_it_is_set_to_is_shown() -> None:
    """Name, rate, gate, spread and thermometer; nothing where a first firmware could not say."""
    (line,) = meeting(sensor(), MINE)
    assert line == f"port: {MODEL} {VERSION} named bench-3: 100 Hz, echoes of 116 to 25000 us, no thermometer"
    more = Identity(MODEL, VERSION, "", SETTINGS | {"spread_us": 500, "thermometer": 1})
    assert settings_of(more).endswith(", pings spread over 500 us, with a thermometer")
    assert settings_of(Identity(MODEL, "1.0.0")) == ""


def test_a_rate_that_contradicts_the_device_is_said() -> None:
    """With both ways out of it."""
    line = list(meeting(sensor(rate_hz=50.0), MINE))[-1]
    assert "it is set to 100 Hz, and --rate-hz says 50" in line
    assert "--rate 50" in line
    assert len(list(meeting(sensor(rate_hz=100.0), MINE))) == 1


@pytest.mark.parametrize(
    ("came", "verdict"),
    [
        (identity_line(), True),
        (readings(20) + identity_line(), True),
        (identity_line(version="2.1.0"), True),  # flashed meanwhile: the same board
        (identity_line(name="bench-4"), False),
        (identity_line(name=""), False),
        (identity_line(model="another-rangefinder"), False),
        (readings(20), None),
        (readings(PROOF_BYTES // 30), False),
        (identity_line()[:-3] + b"00\n", None),
    ],
    ids=["same", "behind readings", "updated", "another's name", "none", "model", "unsaid", "never said", "spoilt"],
)
def test_a_port_that_came_back_has_to_say_the_same_again(came: bytes, verdict: bool | None) -> None:
    """Model and name, before a byte of it is believed; readings alone do not prove it, however sound."""
    proof: Any = sensor(MINE).proof()
    assert proof.feed(0, came) is verdict


def test_one_that_never_said_what_it_is_proves_itself_by_its_wire_form() -> None:
    """Three readings; one reading is not enough, and garbage is another device."""
    proof: Any = sensor().proof()
    assert proof.feed(0, readings(2)) is None
    assert proof.feed(1, readings(1)) is True
    other: Any = sensor().proof()
    assert other.feed(0, b"\x00garbage" * 1000) is False
    assert Sensor(get_family("us100"), cast(Transport, SimpleNamespace(name="port"))).proof() is None


@pytest.mark.parametrize(
    ("step_s", "clock_s", "back"),
    [
        (2.0, 100.0, Back.CONTINUED),
        (1.9, 100.0, Back.CONTINUED),
        (2.2, 100.0, Back.CONTINUED),
        (1.0, 100.0, Back.ANOTHER),
        (3.0, 100.0, Back.ANOTHER),
        (2992.0, 100.0, Back.ANOTHER),
        (-3.0, 100.0, Back.ANOTHER),
        (-99.5, 100.0, Back.RESTARTED),
        (-98.0, 100.0, Back.RESTARTED),
        (-97.0, 100.0, Back.ANOTHER),
        (2.0, 4294.0, Back.CONTINUED),
    ],
)
@pytest.mark.parametrize("counter", ["device_us", "sequence"])
def test_a_counter_tells_which_sensor_came_back(step_s: float, clock_s: float, back: Back, counter: str) -> None:
    """By its step against the host's in two seconds, and by whether it can have begun anew since."""
    unit_s = 1e-6 if counter == "device_us" else 0.01
    wrap = 1 << 32 if counter == "device_us" else 1 << 60
    counts = [round(each / unit_s) % wrap for each in (clock_s, clock_s + step_s)]
    before, now = (
        Reading(ns, **{counter: count}) for ns, count in zip((5_000_000_000, 7_000_000_000), counts, strict=True)
    )
    assert on_port("port").judged(before, now) is back
    assert on_port("port", identified=True).judged(before, now) is Back.IDENTIFIED


def test_a_link_may_have_held_what_comes_first_behind_a_gap() -> None:
    """Through a network a counter that goes on where it stopped is the same sensor; at a cable it is another."""
    before, now = Reading(5_000_000_000, device_us=100_000_000), Reading(9_000_000_000, device_us=100_500_000)
    assert on_port("socket://bench:7000").judged(before, now) is Back.CONTINUED
    assert on_port("/dev/ttyACM0").judged(before, now) is Back.ANOTHER


def test_nothing_tells_sensors_without_counters_apart() -> None:
    """They are taken for the same, and it is said."""
    before, now = Reading(5_000_000_000, distance_m=0.5), Reading(7_000_000_000, distance_m=0.5)
    for pair in ((before, now), (None, now), (before, None), (before, now._replace(device_us=5))):
        assert on_port("port").judged(*pair) is Back.ASSUMED


def on_port(name: str, *, identified: bool = False) -> Sensor:
    """Return a sensor on a port."""
    return Sensor(FAMILY, cast(Transport, SimpleNamespace(name=name, identified=identified)))


def test_a_sensor_that_says_its_name_only_now_is_another() -> None:
    """It has twelve readings to say it; one that nobody named and that stays mute is judged by its counter."""
    last = Reading(0, device_us=0, sequence=0)
    named: Any = on_port("port").proof(last)
    assert named.feed(10_000_000, readings(5)) is None
    assert named.feed(20_000_000, identity_line() + readings(7)) is True
    assert named.facts["sensor"] is Back.ANOTHER
    mute: Any = on_port("port").proof(last)
    assert mute.feed(10_000_000, readings(12)) is True
    assert mute.facts["sensor"] is Back.CONTINUED
