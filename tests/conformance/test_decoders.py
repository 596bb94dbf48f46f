"""The rules that every family of rangefinders keeps; a new one joins by adding its cases to ``CASES``.

Where a frame carries a checksum, no flipped bit may make a reading. Where it carries none, what is guaranteed is less
and held here as well: one flip spoils at most two readings, and the ones after are as sent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pytest

from acquisition.decoders.family import Decoder, Family
from acquisition.decoders.registry import families, get_family
from acquisition.errors import SensorError
from acquisition.readings import Reading
from tests.encoders import ENCODERS
from tests.sampling import sampled

N = 24
_I = np.arange(N)
DISTANCE = np.where(_I % 7 == 5, np.nan, 0.8 + 0.4 * np.sin(1.3 * _I))
TEMPERATURE_C = 18.0 + 0.25 * _I
SEQUENCE = 4_294_967_290 + _I  # wraps midway where the device's counter has 32 bits
DEVICE_US = 10_000 * _I + 7
MOST_PENDING = 512


@dataclass(frozen=True)
class Case:
    """A family, options of it, and what it promises.

    Parameters
    ----------
    family : str
        Name in the registry.
    step_m : float
        Rounding of a distance on the wire, m (or of an echo time, as a distance).
    changes : str
        "detected" by a checksum, or "unseen".
    options : mapping
        Of decoder and encoder.
    lead : int
        Readings lost at the start, because nothing shows that the first was received from its beginning.
    known : mapping of bytes to float
        Frames of a data sheet with their distance, m.
    no_target : tuple of bytes
        Frames that say that nothing was there.
    """

    family: str
    step_m: float
    changes: Literal["detected", "unseen"]
    options: Mapping[str, Any] = field(default_factory=dict)
    lead: int = 0
    known: Mapping[bytes, float] = field(default_factory=dict)
    no_target: tuple[bytes, ...] = ()

    @property
    def member(self) -> Family:
        """The family."""
        return get_family(self.family)

    def decoder(self) -> Decoder:
        """Return a fresh decoder."""
        return self.member.decoder(**self.options)

    def frames(self, distance: np.ndarray[Any, np.dtype[np.float64]] = DISTANCE) -> list[bytes]:
        """Return the bytes of each reading."""
        encoder = ENCODERS[self.family](**self.options)
        return [
            encoder.encode(
                sequence=int(SEQUENCE[i]),
                device_us=int(DEVICE_US[i]),
                echo_us=2e6 * float(distance[i]) / 343.0,
                distance_m=float(distance[i]),
                temperature_c=float(TEMPERATURE_C[i]),
            )
            for i in range(len(distance))
        ]


def hexed(text: str) -> bytes:
    """Return bytes written in hex."""
    return bytes.fromhex(text)


CASES = [
    Case("line-protocol", 343 * 0.25e-6 / 2, "detected", no_target=(b"$R1,2,1020001,,2130,N*AAE6\n",)),
    Case("maxbotix-lv", 0.0254, "unseen", known={b"R012\r": 12 * 0.0254}, no_target=(b"R255\r", b"R000\r")),
    Case("maxbotix-lv-p", 0.0254, "unseen", known={b"R012 P1\r": 12 * 0.0254, b"R006\r": 6 * 0.0254}),
    Case("maxbotix-xl", 0.01, "unseen", known={b"R123\r": 1.23}, no_target=(b"R765\r",)),
    Case("maxbotix-xl-long", 0.01, "unseen", known={b"R0123\r": 1.23}, no_target=(b"R1068\r",)),
    Case("maxbotix-hr", 0.001, "unseen", known={b"R1234 \r": 1.234, b"R0300\r": 0.3}, no_target=(b"R5000\r",)),
    Case("maxbotix-wr", 0.001, "unseen", known={b"R1234\r": 1.234}, no_target=(b"R4999\r", b"R9999\r")),
    Case(
        "ffhls",
        0.001,
        "detected",
        known={hexed("ff07a1a7"): 1.953},
        no_target=(hexed("ff0000ff"), hexed("fffffdfb"), hexed("fffffefc")),
    ),
    Case("us100", 0.001, "unseen", known={hexed("07a1"): 1.953}, no_target=(hexed("0000"), hexed("ffff"))),
    Case("urm37", 0.01, "detected", known={hexed("220123 46"): 2.91}, no_target=(hexed("22ffff20"),)),
    Case(
        "sen0149", 0.001, "detected", known={hexed("55aa110202 1234 5a"): 4.66}, no_target=(hexed("55aa110202ffff12"),)
    ),
    Case("text-lines", 1e-6, "unseen", lead=1, known={b"123.4\n": 1.234}, no_target=(b"0\r\n", b"-1\n")),
    Case("text-lines", 1e-6, "unseen", {"unit": "us"}, lead=1, no_target=(b"0\n", b"38000\n")),
    Case(
        "text-lines",
        1e-6,
        "unseen",
        {"unit": "mm", "column": 2, "separator": ";", "sequence": 0, "time": 1, "temperature": 3},
        lead=1,
        known={b"7;70000;253;21.5\r\n": 0.253},
    ),
    Case(
        "text-lines",
        1e-6,
        "unseen",
        {"unit": "in", "column": "d", "time": "t", "time_unit": "ms"},
        lead=1,
        known={b"t=70 d=10\n": 0.254, b"t: 70, d: 10 in\n": 0.254},
    ),
]


def of(cases: list[Case]) -> pytest.MarkDecorator:
    """Return the mark that puts each of the cases before a test."""
    return pytest.mark.parametrize(
        "case", cases, ids=lambda case: "-".join([case.family, *map(str, case.options.values())])
    )


every_case = of(CASES)
every_framed_case = of([case for case in CASES if case.member.self_framing])  # of the others any two bytes are a reply


def run(case: Case, *reads: bytes) -> tuple[list[Reading], Decoder]:
    """Feed reads to a fresh decoder, return all it gave and the decoder."""
    decoder = case.decoder()
    return [reading for i, data in enumerate(reads) for reading in decoder.feed(1_000 + i, data)], decoder


def columns(readings: Sequence[Reading], rows: slice = slice(None)) -> list[str]:
    """Return every reading without the host's time, comparable bit for bit."""
    return [repr(reading._replace(host_ns=0)) for reading in readings[rows]]


def in_metres(readings: Sequence[Reading]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return distances, echo times turned into them as the encoder's were made; NaN for no target."""
    echoes = np.array([reading.echo_us for reading in readings], float)
    distances = np.array([reading.distance_m for reading in readings], float)
    return np.where(np.isnan(echoes), distances, echoes * 343.0 / 2e6)


def numbered(readings: Sequence[Reading]) -> list[tuple[int, float]]:
    """Return the counter and the distance of each reading."""
    return [(reading.sequence, at) for reading, at in zip(readings, in_metres(readings).tolist(), strict=True)]


def flushes(case: Case) -> bool:
    """Tell whether the reader must flush after garbage, because bytes alone do not show where a frame begins."""
    return not case.member.self_framing


def test_every_family_of_the_registry_has_a_case() -> None:
    """A family without a case is not held to the rules."""
    assert {family.name for family in families()} == {case.family for case in CASES}


@every_case
def test_what_was_encoded_is_decoded(case: Case) -> None:
    """Distances come back to the rounding of the wire, and no target as NaN."""
    readings, decoder = run(case, b"".join(case.frames()))
    assert len(readings) == N - case.lead
    np.testing.assert_allclose(in_metres(readings), DISTANCE[case.lead :], atol=case.step_m / 2 + 1e-9)
    np.testing.assert_array_equal(np.isnan(in_metres(readings)), np.isnan(DISTANCE[case.lead :]))
    assert decoder.pending == 0
    assert sum(decoder.faults.values()) == 0 or case.lead


@every_case
def test_device_time_and_counter_come_back(case: Case) -> None:
    """Where the family has them; -1 where it has none."""
    readings, _ = run(case, b"".join(case.frames()))
    own = case.member.has_device_time
    if own or "sequence" in case.options:
        assert [reading.sequence for reading in readings] == (
            SEQUENCE[case.lead :] % (1 << 32 if own else 1 << 62)
        ).tolist()
    else:
        assert {reading.sequence for reading in readings} == {-1}
    if own or "time" in case.options:
        assert [reading.device_us for reading in readings] == DEVICE_US[case.lead :].tolist()
    else:
        assert {reading.device_us for reading in readings} == {-1}


@every_case
def test_frames_carry_the_time_of_the_read_that_completed_them(case: Case) -> None:
    """All of one read the same; a frame cut in two the later."""
    frames = case.frames()
    half = len(frames[3]) // 2
    decoder = case.decoder()
    first = decoder.feed(111, b"".join(frames[:3]) + frames[3][:half])
    second = decoder.feed(222, frames[3][half:] + frames[4])
    assert [reading.host_ns for reading in first] == [111] * (3 - case.lead)
    assert [reading.host_ns for reading in second] == [222] * 2


@every_case
def test_frames_of_the_data_sheet_are_read(case: Case) -> None:
    """Distances as the maker's examples say."""
    lead = b"\n" if case.lead else b""
    for frame, distance in case.known.items():
        readings, _ = run(case, lead + frame)
        np.testing.assert_allclose(in_metres(readings), [distance], rtol=1e-12)


@every_case
def test_no_target_is_a_missing_sample_and_never_a_distance(case: Case) -> None:
    """Codes of the data sheet, and what the encoder writes."""
    lead = b"\n" if case.lead else b""
    for frame in [*case.no_target, *case.frames(np.full(4, np.nan))]:
        readings, _ = run(case, lead + frame)
        assert len(readings) == 1, frame
        assert np.isnan(in_metres(readings)).all()


def dirty(case: Case, seed: int) -> bytes:
    """Return a stream with garbage, lost bytes and flips in it."""
    rng = np.random.default_rng(seed)
    data = bytearray(b"".join(case.frames()))
    for _ in range(6):
        at = int(rng.integers(len(data)))
        kind = rng.integers(3)
        if kind == 0:
            data[at:at] = rng.bytes(int(rng.integers(1, 12)))
        elif kind == 1:
            del data[at]
        else:
            data[at] ^= 1 << int(rng.integers(8))
    return bytes(data)


@every_case
@pytest.mark.parametrize("state", ["clean", "dirty", "long"])
@pytest.mark.parametrize("step", sampled([5, 1], 1))
def test_readings_do_not_depend_on_how_the_stream_was_cut(case: Case, state: str, step: int) -> None:
    """Cut in two at many places, into single bytes, and at random: the same readings and the same faults."""
    frames = case.frames()
    long = [*frames[:3], b"x" * 300, *frames[3:6], b"x" * 300]  # more than any line may have, before a frame
    data = {"clean": b"".join(frames), "dirty": dirty(case, 5), "long": b"".join(long)}[state]
    whole, decoder = run(case, data)
    expected = (columns(whole), dict(decoder.faults), decoder.pending)
    rng = np.random.default_rng(6)
    cuts = [[at] for at in range(0, len(data) + 1, step)]
    cuts += [list(range(1, len(data)))]
    cuts += [sorted(rng.integers(0, len(data), 9).tolist()) for _ in range(30 // step)]
    for cut in cuts:
        reads = [data[a:b] for a, b in zip([0, *cut], [*cut, len(data)], strict=True)]
        readings, decoder = run(case, *reads)
        assert (columns(readings), dict(decoder.faults), decoder.pending) == expected, cut


def garbage(seed: int) -> bytes:
    """Return noise as a wrong baud rate, a cable or a start-up banner makes it."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(1, 40))
    kinds = [rng.bytes(size), b"\xff" * size, b"\0" * size, b"MaxSonar-WR PN:7\rv"[:size], b"R$FF:\x22\x55"[:size]]
    return kinds[seed % len(kinds)]


@every_case
@pytest.mark.parametrize("at", [0, 9, N], ids=["before", "between", "after"])
@pytest.mark.parametrize("seeds", sampled([20, 100], 1))
def test_back_in_step_within_two_frames_of_garbage(case: Case, at: int, seeds: int) -> None:
    """What came before the garbage stands, and from the third frame after it on every one is read as sent."""
    frames = case.frames()
    clean, _ = run(case, b"".join(frames))
    for seed in range(seeds):
        decoder = case.decoder()
        before = decoder.feed(0, b"".join(frames[:at]))
        decoder.feed(1, garbage(seed))
        if flushes(case):
            decoder.flush()
            clean, _ = run(case, b"".join(frames[:at]))
            after = decoder.feed(2, b"".join(case.frames()[: N - at]))
            sent, _ = run(case, b"".join(case.frames()[: N - at]))
            assert columns(before) == columns(clean)
        else:
            after = decoder.feed(2, b"".join(frames[at:]))
            assert columns(before) == columns(clean, slice(0, max(at - case.lead, 0)))
            sent = clean
        remaining = min(N - at, len(sent)) - 2
        if remaining > 0:
            assert columns(after, slice(-remaining, None)) == columns(sent, slice(-remaining, None)), garbage(seed)


@every_case
def test_back_in_step_within_two_frames_of_a_lost_byte(case: Case) -> None:
    """Whichever byte is lost, at most two readings are; without marks, once the late reply is flushed."""
    frames = case.frames()
    clean, _ = run(case, b"".join(frames))
    start = sum(map(len, frames[:8]))
    for at in range(start, start + len(frames[8])):
        data = b"".join(frames)
        if flushes(case):
            decoder = case.decoder()
            decoder.feed(0, data[start:at] + data[at + 1 : start + len(frames[8])])
            decoder.flush()
            assert columns(decoder.feed(0, b"".join(frames))) == columns(clean)
            continue
        readings, _ = run(case, data[:at] + data[at + 1 :])
        remaining = N - 8 - 2
        assert len(readings) >= len(clean) - 2
        assert columns(readings, slice(-remaining, None)) == columns(clean, slice(-remaining, None)), at


@every_case
def test_a_flipped_bit_makes_no_reading_or_costs_no_more_than_two(case: Case) -> None:
    """With a checksum nothing that was not sent is read; without, one flip changes at most two readings."""
    data = b"".join(case.frames()[:10])
    clean, _ = run(case, data)
    sent = set(numbered(clean))
    for bit in range(len(data) * 8):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        readings, decoder = run(case, bytes(flipped))
        strange = [row for row in numbered(readings) if row not in sent and not math.isnan(row[1])]
        assert len(strange) <= (0 if case.changes == "detected" else 2), (bit, strange)
        assert abs(len(clean) - len(readings)) <= (2 if case.member.self_framing else 3)
        if case.changes == "detected":
            assert sum(decoder.faults.values()) or decoder.pending


@every_framed_case
def test_every_byte_of_noise_is_accounted_for(case: Case) -> None:
    """What is no frame is counted, and what is held is known."""
    noise = np.random.default_rng(3).bytes(5000)
    readings, decoder = run(case, noise)
    assert len(readings) == 0
    blank = decoder.faults.get("blank_line", 0)
    assert decoder.faults["garbage_bytes"] + decoder.pending + blank == len(noise)


@every_case
def test_a_flush_forgets_the_frame_that_has_begun(case: Case) -> None:
    """Its rest is no frame, what comes after is read, and a flush of nothing counts nothing."""
    frames = case.frames()
    decoder = case.decoder()
    decoder.flush()
    assert sum(decoder.faults.values()) == 0
    decoder.feed(0, b"".join(frames[:2]) + frames[2][:1])
    assert decoder.pending == 1
    faults = sum(decoder.faults.values())
    decoder.flush()
    assert decoder.pending == 0
    assert sum(decoder.faults.values()) > faults
    fresh, _ = run(case, b"".join(frames))
    assert columns(decoder.feed(0, b"".join(frames))) == columns(fresh)


@every_case
@pytest.mark.parametrize("filler", sampled([b"\xff", b"R", b"\0", b"1", b"$", b"\x55\xaa", b"noise"]), ids=repr)
def test_memory_is_bounded_on_a_stream_without_frame_ends(case: Case, filler: bytes) -> None:
    """Many bytes of anything leave a few hundred bytes behind, in small reads or large."""
    decoder = case.decoder()
    for size in [1] * 600 + [4096] * 16:
        decoder.feed(0, (filler * size)[:size])
        assert decoder.pending <= MOST_PENDING


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
    distances = 0.300 + 0.001 * np.arange(20)
    encoder = ENCODERS["us100"]()
    data = b"".join(
        encoder.encode(sequence=0, device_us=0, echo_us=math.nan, distance_m=d, temperature_c=20.0) for d in distances
    )
    decoder = get_family("us100").decoder()
    readings = decoder.feed(0, b"\x99" + data)
    assert decoder.faults["resynchronised"] == 1
    np.testing.assert_allclose(in_metres(readings), [math.nan, math.nan, *distances[1:]], atol=1e-9)
