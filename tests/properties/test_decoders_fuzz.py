"""Decoders under random bytes: never an exception, never a distance that no frame in the bytes vouches for.

What vouches is told by :data:`ORACLES`, which look for frames anywhere in the bytes, slowly and with none of the
decoders' code.
"""

import contextlib
import math
import random
import re
from collections.abc import Callable, Iterable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.decoders.registry import describe_bytes, families, probe
from acquisition.decoders.sensor import Sensor
from acquisition.readings import Reading
from springmass.session.detect import described
from tests.encoders import crc16, frames
from tests.properties.test_formats_fuzz import spoil

FAMILIES = {family.name: family for family in families()}
MOST_PENDING = 512
every_family = pytest.mark.parametrize("name", FAMILIES)


def windows(data: bytes, size: int) -> Iterable[bytes]:
    """Yield every run of so many bytes."""
    return (data[i : i + size] for i in range(len(data) - size + 1))


def summed(data: bytes, size: int, value: int, unit_m: float, first: int = 0) -> set[float]:
    """Return the distances of every window whose last byte is the sum of the others, from ``first`` on."""
    sound = (w for w in windows(data, size) if sum(w[first:-1]) % 256 == w[-1])
    return {int.from_bytes(w[value : value + 2], "big") * unit_m for w in sound}


def r_lines(digits: int, unit_m: float) -> Callable[[bytes], set[float]]:
    """Return the oracle of MaxBotix lines."""
    form = re.compile(rb"(?=R(\d{%d})( P\d| )?\r)" % digits)
    return lambda data: {int(found[1]) * unit_m for found in form.finditer(data)}


def sealed_lines(data: bytes) -> set[float]:
    """Return the echo times of every line whose CRC holds."""
    found = re.finditer(rb"\$([^$*\n]*)\*([0-9A-F]{4})\r?\n", data)
    bodies = [each[1].split(b",") for each in found if crc16(each[1]) == int(each[2], 16)]
    return {float(body[3]) for body in bodies if len(body) == 6 and body[3] and body[5] == b"E"}


def whole_lines(data: bytes) -> set[float]:
    """Return every number, in m, cm, mm and inches, of every line that is ended and was begun after another."""
    numbers = set()
    for line in re.split(rb"\n|\r|\*/", data)[1:-1]:
        for run in re.findall(rb"[-+.,\deE]+", line):
            within = re.findall(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", run)
            for text in (run.replace(b",", b"."), *run.split(b","), *within):
                with contextlib.suppress(ValueError):
                    numbers |= {float(text) * scale for scale in (1.0, 0.01, 0.001, 0.0254)}
    return numbers


ORACLES: dict[str, Callable[[bytes], set[float]]] = {
    "line-protocol": sealed_lines,
    "maxbotix-lv": r_lines(3, 0.0254),
    "maxbotix-lv-p": r_lines(3, 0.0254),
    "maxbotix-xl": r_lines(3, 0.01),
    "maxbotix-xl-long": r_lines(4, 0.01),
    "maxbotix-hr": r_lines(4, 0.001),
    "maxbotix-wr": r_lines(4, 0.001),
    "ffhls": lambda data: summed(data, 4, 1, 0.001) | summed(data, 4, 1, 0.001, first=1),
    "us100": lambda data: {int.from_bytes(w, "big") * 0.001 for w in windows(data, 2)},
    "urm37": lambda data: summed(data, 4, 1, 0.01),
    "sen0149": lambda data: summed(data, 8, 5, 0.001),
    "tfmini": lambda data: {
        int.from_bytes(w[2:4], "little") * 0.01 for w in windows(data, 9) if w[8] == sum(w[:8]) & 0xFF
    },
    "text-lines": whole_lines,
}


def own_stream(family: Sensor, seed: int, n: int = 12) -> list[bytes]:
    """Return frames as the simulated sensor sends them."""
    rng = random.Random(seed)
    return frames(family.name, [math.nan if rng.random() < 0.2 else rng.uniform(0.3, 1.6) for _ in range(n)])


def decode(family: Sensor, data: bytes, cuts: Iterable[int] = ()) -> list[Reading]:
    """Feed bytes cut at places; hold the decoder to its bounds."""
    decoder = family.decoder()
    edges = [0, *sorted(cuts), len(data)]
    parts = [decoder.feed(i, data[a:b]) for i, (a, b) in enumerate(pairwise(edges))]
    assert decoder.pending <= MOST_PENDING
    assert 0 <= decoder.faults.get("garbage_bytes", 0) <= len(data)
    assert all(count >= 0 for count in decoder.faults.values())
    decoder.flush()
    assert decoder.pending == 0
    return [reading for part in parts for reading in part]


def content(readings: Iterable[Reading]) -> list[str]:
    """Return readings without the host's time, comparable bit for bit."""
    return [repr(reading._replace(host_ns=0)) for reading in readings]


def check(name: str, data: bytes, cuts: Iterable[int] = ()) -> list[Reading]:
    """Decode and hold the readings to what the bytes vouch for."""
    readings = decode(FAMILIES[name], data, cuts)
    measured = [each.distance_m if math.isnan(each.echo_us) else each.echo_us for each in readings]
    given_m = [value for value in measured if not math.isnan(value)]
    assert all(value > 0 for value in given_m)
    vouched = sorted(ORACLES[name](data)) if given_m else []
    for value in given_m:
        assert any(math.isclose(value, other, rel_tol=1e-9) for other in vouched), (value, data)
    return readings


ALPHABET = st.sampled_from(
    [b"R", b"$", b"*", b"\r", b"\n", b"0", b"12", b"3.4", b",", b"\xff", b"\x22", b"\x11", b"U\xaa"]
)


@every_family
@given(
    data=st.binary(max_size=300) | st.lists(ALPHABET | st.binary(max_size=4), max_size=60).map(b"".join),
    cuts=st.lists(st.integers(0, 300), max_size=6),
)
def test_bytes_give_no_distance_without_a_frame(name: str, data: bytes, cuts: list[int]) -> None:
    """Any bytes, and headers, ends and digits in any order: no exception, nothing made up, and cuts do not matter."""
    whole = content(check(name, data))
    assert whole == content(check(name, data, [min(cut, len(data)) for cut in cuts]))
    assert whole == content(check(name, data, range(1, len(data))))


KIND = st.sampled_from(["flip", "drop", "insert", "repeat", "cut"])
FAULTS = st.lists(st.tuples(KIND, st.floats(0, 1, exclude_max=True), st.binary(min_size=1, max_size=9)), max_size=8)
"""Faults of the line: what is done, where (as a share of the stream), and with what."""


@every_family
@given(seed=st.integers(0, 99), faults=FAULTS, cuts=st.lists(st.floats(0, 1), max_size=6))
def test_its_own_stream_spoiled_is_back_in_step_within_two_frames(
    name: str, seed: int, faults: list[tuple[str, float, bytes]], cuts: list[float]
) -> None:
    """Cuts, splits and flips cost no sound frame after the second; nothing is made up in between."""
    family = FAMILIES[name]
    spoiled = spoil(b"".join(own_stream(family, seed)), faults)
    after = own_stream(family, seed + 1)
    check(name, spoiled, [int(cut * len(spoiled)) for cut in cuts])
    decoder = family.decoder()
    decoder.feed(0, spoiled)
    if not family.self_framing:
        decoder.flush()
    begin = b"\n" if family.self_framing else b""  # ends the piece of a line that text may have begun with
    clean = decode(family, begin + b"".join(after))
    tail = decoder.feed(1, b"".join(after))
    wanted = len(after) - 2
    assert len(tail) >= wanted
    assert [repr(each[3:5]) for each in tail[-wanted:]] == [repr(each[3:5]) for each in clean[-wanted:]]


@given(data=st.binary(max_size=400))
def test_describing_bytes_never_fails_and_takes_one_line(data: bytes) -> None:
    """Whatever a port has to offer; bytes without structure are no family's."""
    line = described(describe_bytes(data))
    assert line
    assert "\n" not in line
    assert line.isprintable()
    assert all(name in FAMILIES for name in probe(data))
