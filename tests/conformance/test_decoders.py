"""Every family of rangefinders passes ``springmass.testing``; a new one joins by adding its cases to ``CASES``."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np
import pytest

from acquisition.decoders.registry import families, get_family
from acquisition.errors import SensorError
from springmass.testing import check
from tests.encoders import ENCODERS, frames


@dataclass(frozen=True)
class Case:
    """A family with options, the rounding of a distance on its wire, and frames of its data sheet."""

    family: str
    step_m: float
    changes: Literal["detected", "unseen"]
    options: Mapping[str, Any] = field(default_factory=dict)
    known: Mapping[bytes, float] = field(default_factory=dict)
    no_target: tuple[bytes, ...] = ()


hexed = bytes.fromhex
NO_FFHLS = (hexed("ff0000ff"), hexed("fffffdfb"), hexed("fffffefc"))
NO_LIDAR = (hexed("5959ffff2c05180a03"), hexed("59591b006300180a52"), hexed("59591b00ffff180aed"))
COLUMNS = {"unit": "mm", "column": 2, "separator": ";", "sequence": 0, "time": 1, "temperature": 3}
NAMES = {"unit": "in", "column": "d", "time": "t", "time_unit": "ms"}

CASES = [
    Case("line-protocol", 343 * 0.25e-6 / 2, "detected", no_target=(b"$R1,2,1020001,,2130,N*AAE6\n",)),
    Case("maxbotix-lv", 0.0254, "unseen", known={b"R012\r": 12 * 0.0254}, no_target=(b"R255\r", b"R000\r")),
    Case("maxbotix-lv-p", 0.0254, "unseen", known={b"R012 P1\r": 12 * 0.0254, b"R006\r": 6 * 0.0254}),
    Case("maxbotix-xl", 0.01, "unseen", known={b"R123\r": 1.23}, no_target=(b"R765\r",)),
    Case("maxbotix-xl-long", 0.01, "unseen", known={b"R0123\r": 1.23}, no_target=(b"R1068\r",)),
    Case("maxbotix-hr", 0.001, "unseen", known={b"R1234 \r": 1.234, b"R0300\r": 0.3}, no_target=(b"R5000\r",)),
    Case("maxbotix-wr", 0.001, "unseen", known={b"R1234\r": 1.234}, no_target=(b"R4999\r", b"R9999\r")),
    Case("ffhls", 0.001, "detected", known={hexed("ff07a1a7"): 1.953}, no_target=NO_FFHLS),
    Case("us100", 0.001, "unseen", known={hexed("07a1"): 1.953}, no_target=(hexed("0000"), hexed("ffff"))),
    Case("urm37", 0.01, "detected", known={hexed("220123 46"): 2.91}, no_target=(hexed("22ffff20"),)),
    Case(
        "sen0149", 0.001, "detected", known={hexed("55aa110202 1234 5a"): 4.66}, no_target=(hexed("55aa110202ffff12"),)
    ),
    Case("tfmini", 0.01, "detected", known={hexed("59591b002c05180a20"): 0.27}, no_target=NO_LIDAR),
    Case("tfmini", 0.001, "detected", {"unit": "mm"}, known={hexed("59590d012c05180a13"): 0.269}),
    Case("text-lines", 1e-6, "unseen", known={b"123.4\n": 1.234}, no_target=(b"0\r\n", b"-1\n")),
    Case("text-lines", 1e-6, "unseen", {"unit": "us"}, no_target=(b"0\n", b"38000\n")),
    Case("text-lines", 1e-6, "unseen", COLUMNS, known={b"7;70000;253;21.5\r\n": 0.253}),
    Case("text-lines", 1e-6, "unseen", NAMES, known={b"t=70 d=10\n": 0.254, b"t: 70, d: 10 in\n": 0.254}),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: "-".join([case.family, *map(str, case.options.values())]))
def test_it_keeps_the_rules_for_sensors(case: Case) -> None:
    """Its decoder gives what an encoder of the tests, written from the data sheet, sends."""
    family = get_family(case.family)
    spoken = replace(
        family,
        decoder=partial(family.decoder, **case.options),
        encoder=partial(ENCODERS[case.family], **case.options),
        resolution_m=case.step_m,
        has_device_time=family.has_device_time or "time" in case.options,
    )
    frames = [*case.known.items(), *((frame, math.nan) for frame in case.no_target)]
    check(spoken, *frames, checksum=case.changes == "detected")


def test_every_family_of_the_registry_has_a_case() -> None:
    """A family without a case is not held to the rules."""
    assert {family.name for family in families()} == {case.family for case in CASES}


TEMPERATURES = {
    "us100": hexed("07a1 07a2 42 07a3"),
    "urm37": hexed("22007b9d 22007c9e 1100d5e6 22007d9f"),
    "sen0149": hexed("55aa110202 07a1 bc 55aa110202 07a2 bd 55aa110203 00d5 ea 55aa110202 07a3 be"),
}
"""Replies of 0.2.0's recordings with a temperature after every two distances."""


@pytest.mark.parametrize("name", TEMPERATURES)
def test_polled_temperatures_of_old_logs_are_no_distances(name: str) -> None:
    """A decoder with the option of 0.2.0 gives the three distances in order, and a recording cannot ask for it."""
    family = get_family(name)
    decoder = family.decoder(temperature_every=2)
    distances = decoder.feed(0, TEMPERATURES[name]).distance_m
    expected = [1.23, 1.24, 1.25] if name == "urm37" else [1.953, 1.954, 1.955]
    np.testing.assert_allclose(distances, expected, atol=1e-9)
    assert not any(decoder.faults.values())
    with pytest.raises(SensorError, match="temperature_every"):
        family.demand_options({"temperature_every": 2})


def test_out_of_step_the_us100_gives_no_distance_and_finds_back() -> None:
    """A surplus byte shifts every reply; two impossible distances in a row give it away."""
    sent = 0.300 + 0.001 * np.arange(20)
    decoder = get_family("us100").decoder()
    found = decoder.feed(0, b"\x99" + b"".join(frames("us100", sent.tolist()))).distance_m
    assert decoder.faults["resynchronised"] == 1
    np.testing.assert_allclose(found, [math.nan, math.nan, *sent[1:]], atol=1e-9)
