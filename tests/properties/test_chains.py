"""Samples are the same whether they are asked for after each read or many reads later, and whoever else sends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acquisition.block import Block, concatenate
from acquisition.decoders.line_protocol import LineProtocolEncoder, frame
from acquisition.decoders.registry import get_family
from acquisition.live.calibration import Calibration
from acquisition.live.decoding import SensorChain
from acquisition.readings import Read
from springmass.session.reads import Tee

SENSORS = 7
STEP_US, STEP_NS = 10_000, 10_000_000
WRAP_US = 1 << 32
COLUMNS = ("t", "distance", "flags", "host_ns")
ODD = (
    b"",
    b"# a comment\n",
    b"$R1,1,2,3\n",
    frame(b"R2,1,2"),
    frame(b"R1,5,6,0.00,,E"),
    frame(b"R1,99999999999,6,,,N")[:-1],
    frame(b"R1,4294967296,6,,,N"),
    b"x" * 120,
)


def line(sequence: int, device_us: int, *, target: bool = True, warm: bool = True) -> bytes:
    """Return one line."""
    return LineProtocolEncoder().encode(
        sequence=sequence,
        device_us=device_us,
        echo_us=1500.0 + sequence % 9 if target else np.nan,
        distance_m=0.25,
        temperature_c=21.37 if warm else np.nan,
    )


def chains() -> list[SensorChain]:
    """Return chains that differ in their calibration."""
    return [
        SensorChain(
            get_family("line-protocol"), rate_hz=100.0, calibration=Calibration(340.0 + i, 1.0 + 1e-3 * i, 1e-4 * i)
        )
        for i in range(SENSORS)
    ]


def alone(reads: Sequence[Read], each: Sequence[SensorChain]) -> list[Block]:
    """Feed every read to its chain, and take its samples immediately."""
    parts: list[list[Block]] = [[] for _ in each]
    for channel, host_ns, data in reads:
        parts[channel].append(each[channel].feed(host_ns, data))
    return [concatenate(blocks) for blocks in parts]


def assert_same(
    held: Sequence[SensorChain], rounds: Sequence[Sequence[Read]], each: Sequence[SensorChain]
) -> list[Block]:
    """Take the samples of a tee once a round, compare all that comes of it bit by bit; return the samples."""
    parts: list[list[Block]] = [[] for _ in each]
    tee = Tee(held)
    for reads in rounds:
        for read in reads:
            tee.reads([read])
        for channel, block in tee.blocks():
            assert len(block)
            parts[channel].append(block)
    expected = alone([read for reads in rounds for read in reads], each)
    found = [concatenate(blocks) for blocks in parts]
    for got, want, chain, other in zip(found, expected, held, each, strict=True):
        for name in COLUMNS:
            if len(want):
                assert getattr(got, name).tobytes() == getattr(want, name).tobytes(), name
        assert len(got) == len(want)
        assert chain.decoder.faults == other.decoder.faults
    return found


@st.composite
def recordings(draw: st.DrawFn) -> list[list[Read]]:
    """Rounds of reads of sensors that skip, repeat, wrap, start again, miss targets, cut lines, send rubbish and go."""
    clocks_us = [draw(st.sampled_from([0, 5, WRAP_US - 35_000])) for _ in range(SENSORS)]
    sequence, host_ns = [0] * SENSORS, 0
    rounds = []
    for _ in range(draw(st.integers(1, 3))):
        reads: list[Read] = []
        for _ in range(draw(st.integers(1, 9))):
            host_ns += STEP_NS
            for i in range(SENSORS):
                what = draw(
                    st.sampled_from(["line"] * 24 + ["skip", "repeat", "restart", "mute", "cold", "cut", "odd"])
                )
                clocks_us[i] += 0 if what == "repeat" else STEP_US * (4 if what == "skip" else 1)
                if what == "restart":
                    clocks_us[i] = 0
                sequence[i] += 1
                text = line(sequence[i], clocks_us[i], target=what != "mute", warm=what != "cold")
                if what == "odd":
                    text = draw(st.sampled_from(ODD))
                if what == "cut":
                    at = draw(st.integers(1, len(text) - 1))
                    reads.append((i, host_ns, text[:at]))
                    text = text[at:]
                reads.append((i, host_ns, text))
        rounds.append(reads)
    return rounds


@given(recordings())
def test_held_is_as_taken_at_once(rounds: list[list[Read]]) -> None:
    """Samples and faults are the same bit by bit, whatever comes between sound lines."""
    assert_same(chains(), rounds, chains())


def test_half_lines_of_two_ports_make_no_line() -> None:
    """What one port's read begins and another's would end is no reading of either."""
    text = line(1, STEP_US)
    reads = [(0, 0, text[:9]), (1, 0, text[9:]), (2, 0, text + text), (3, 0, text), (4, 0, b"x" + text)]
    found = assert_same(chains(), [reads, [(0, 1, text[9:])]], chains())
    assert [len(block) for block in found] == [1, 0, 2, 1, 1, 0, 0]
