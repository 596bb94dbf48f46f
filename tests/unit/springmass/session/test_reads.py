"""What was read is recorded first and decoded after, and no read goes astray between the two."""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
import pytest

from acquisition.block import Flag, concatenate
from acquisition.decoders.registry import get_family
from acquisition.live.decoding import Chains, SensorChain
from acquisition.readings import Read
from springmass.session import reads
from springmass.session.reads import Tee
from storage.recorder import Recorder

STEP_NS = 10_000_000


class Log:
    """A recorder that remembers."""

    def __init__(self) -> None:
        self.taken: list[Read] = []
        self.events: list[str] = []
        self.awake = 0

    def take(self, reads: Sequence[Read]) -> None:
        """Remember reads."""
        self.taken += reads

    reads = take

    def wake(self) -> None:
        """Remember up to where it was to be appended."""
        self.awake = len(self.taken)

    def event(self, channel: int, host_ns: int, kind: str, facts: dict[str, Any]) -> None:
        """Remember an event."""
        self.events.append(f"{channel} {host_ns} {kind} {json.dumps(facts)}")


def chain() -> SensorChain:
    """Return a chain of the line protocol."""
    return SensorChain(get_family("line-protocol"), rate_hz=100.0)


def frame(i: int) -> bytes:
    """Return one reading."""
    return (
        get_family("line-protocol")
        .encoder()
        .encode(sequence=i, device_us=i * 10_000, echo_us=1500.0 + i, distance_m=0.25, temperature_c=21.0)
    )


def started(tee: Tee, chains: Sequence[SensorChain], since_ns: int) -> Log:
    """Record from here on."""
    log = Log()
    tee.start(cast(Recorder, log), Chains(chains), since_ns)
    return log


def test_what_is_recorded_decodes_to_what_was_shown() -> None:
    """Cut anywhere, with a break in between, the chain fed one read at a time gives the same bits as the tee."""
    data = b"".join(map(frame, range(40)))
    cuts = [0, *np.sort(np.random.default_rng(2).integers(1, len(data), 25)).tolist(), len(data)]
    tee = Tee(Chains([chain()]), {})
    log = started(tee, [chain()], 0)
    other = chain()
    expected = []
    for n, (a, b) in enumerate(itertools.pairwise(cuts)):
        if n == 12:
            tee.event(0, n * STEP_NS, "lost", {"why": "cable"})
            other.lost()
        tee.reads([(0, n * STEP_NS, data[a:b])])
        expected.append(other.feed(n * STEP_NS, data[a:b]))
    assert tee.blocks() == []
    assert tee.decode() is False
    ((channel, block),) = tee.blocks()
    whole = concatenate(expected)
    assert channel == 0
    assert block.host_ns is not None
    assert whole.host_ns is not None
    for name in ("t", "distance", "flags", "host_ns"):
        assert getattr(block, name).tobytes() == getattr(whole, name).tobytes()
    assert b"".join(data for _, _, data in log.taken) == data
    assert log.events == [f'0 {12 * STEP_NS} lost {{"why": "cable"}}']
    assert tee.gone == {0: "cable"}


def test_the_recorder_is_woken_after_each_piece() -> None:
    """What was read waits for the appending no longer than one piece of decoding takes, in a flood too."""
    tee = Tee(Chains([chain()]), {})
    log = started(tee, [chain()], 0)
    for i in range(1000):
        tee.reads([(0, i * STEP_NS, frame(i))])
    assert log.awake == 0
    assert tee.decode()
    assert log.awake == 1000
    tee.reads([(0, 1000 * STEP_NS, frame(1000))])
    tee.decode()
    assert log.awake == 1001


def test_samples_asked_for_once_a_second_are_decoded_then() -> None:
    """Nothing is decoded in between but a whole piece; what is asked for is all that was read, and the same bits."""
    tee, other = Tee(Chains([chain()]), {}), chain()
    expected, found, untouched = [], [], 0
    for i in range(1000):
        tee.reads([(0, i * STEP_NS, frame(i))])
        before = len(tee._chains)
        assert not tee.decode()
        untouched += len(tee._chains) == before
        expected.append(other.feed(i * STEP_NS, frame(i)))
        if i % 100 == 99:
            found += [block for _, block in tee.blocks()]
            assert sum(map(len, found)) == i + 1
    assert untouched > 800
    whole, parts = concatenate(expected), concatenate(found)
    for name in ("t", "distance", "flags", "host_ns"):
        assert getattr(parts, name).tobytes() == getattr(whole, name).tobytes()


def test_samples_asked_for_often_are_decoded_as_they_come() -> None:
    """Ten times a second is often, also after a time in which nobody asked."""
    tee = Tee(Chains([chain()]), {})
    for i in range(300):
        tee.reads([(0, i * STEP_NS, frame(i))])
        tee.decode()
        if i == 100 or (i > 200 and i % 10 == 0):
            tee.blocks()
        elif i > 220:
            assert len(tee._chains) == i % 10


def test_a_flood_is_decoded_piece_by_piece_though_nobody_asks() -> None:
    """Less than a piece waits until somebody asks."""
    tee = Tee(Chains([chain()]), {})
    tee.reads([(0, 0, frame(0))])
    tee.blocks()
    tee.reads([(0, 1000 * STEP_NS, frame(1))])
    tee.blocks()
    for i in range(2, 1000):
        tee.reads([(0, (1000 + i) * STEP_NS, frame(i))])
    while tee.decode():
        pass
    assert 1000 - len(tee._chains) < reads.ROUND_BYTES / len(frame(0)) + 1
    assert sum(len(block) for _, block in tee.blocks()) == 1000


def test_decoding_stops_after_a_piece_and_goes_on_later() -> None:
    """A flood does not keep the reader from its ports."""
    tee = Tee(Chains([chain()]), {})
    for i in range(1000):
        tee.reads([(0, i * STEP_NS, frame(i))])
    rounds = 1
    while tee.decode():
        rounds += 1
    assert rounds == -(-sum(len(frame(i)) for i in range(1000)) // reads.ROUND_BYTES)
    assert len(tee.blocks()[0][1]) == 1000


def test_more_than_the_decoders_can_do_is_recorded_counted_and_flagged(monkeypatch: pytest.MonkeyPatch) -> None:
    """The oldest reads are skipped, the log has all, and the first sample after them is flagged."""
    monkeypatch.setattr(reads, "HELD_BYTES", 4000)
    tee = Tee(Chains([chain()]), {})
    log = started(tee, [chain()], 0)
    for i in range(200):
        tee.reads([(0, i * STEP_NS, frame(i))])
    while tee.decode():
        pass
    ((_, block),) = tee.blocks()
    assert len(log.taken) == 200
    assert tee.skipped_bytes == sum(len(frame(i)) for i in range(200 - len(block)))
    assert 0 < len(block) < 200
    assert block.flags[0] == Flag.GAP_BEFORE
    assert not block.flags[1:].any()


def test_a_run_begins_with_the_reads_kept_from_before() -> None:
    """From the moment asked for on, each once, whether or not it was decoded before; breaks are no bytes."""
    tee = Tee(Chains([chain()]), {})
    tee.reads([(0, 0, frame(0))])
    tee.keep()
    for i in range(1, 20):
        tee.reads([(0, i * STEP_NS, frame(i))])
        if i == 10:
            tee.decode()
    tee.forget(3 * STEP_NS)
    log = started(tee, [chain()], 5 * STEP_NS)
    tee.reads([(0, 20 * STEP_NS, frame(20))])
    tee.decode()
    ((_, block),) = tee.blocks()
    assert [host_ns // STEP_NS for _, host_ns, _ in log.taken] == list(range(5, 21))
    np.testing.assert_allclose(block.t, np.arange(16) * 0.01, atol=1e-12)
    assert block.first == 0


def test_the_first_bytes_are_kept_until_the_sensor_is_known() -> None:
    """So that silence or garbage can be described; not for ever."""
    tee = Tee(Chains([chain()]), {})
    for _ in range(200):
        tee.reads([(0, 0, b"x" * 100)])
        tee.decode()
    assert tee.heard(0) == b"x" * reads.HEARD_BYTES
    tee.heard_enough()
    assert tee.heard(0) == b""
