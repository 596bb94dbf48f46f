"""What was read is recorded first and decoded after, and no read goes astray between the two."""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from acquisition.block import Block, concatenate
from acquisition.decoders.registry import get_family
from acquisition.live.decoding import SensorChain
from acquisition.live.line import Transport
from acquisition.readings import Read, Readings
from springmass.session import reads
from springmass.session.failures import Failures
from springmass.session.reads import Tee
from springmass.session.sensors import Sensor
from storage.recorder import Recorder

STEP_NS = 10_000_000


class Log:
    """A recorder that remembers."""

    def __init__(self) -> None:
        self.taken: list[Read] = []
        self.events: list[str] = []

    def reads(self, reads: Sequence[Read]) -> None:
        """Remember reads."""
        self.taken += reads

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


def met(numbers: Sequence[int]) -> np.ndarray:
    """Return when the sound of such readings met the bob, half of its time of flight after the ping, s."""
    return np.array([0.01 * i + 0.5e-6 * (1500.0 + i) for i in numbers])


def started(tee: Tee, chains: Sequence[SensorChain], since_ns: int) -> Log:
    """Record from here on."""
    log = Log()
    tee.start(cast(Recorder, log), chains, since_ns)
    return log


def test_what_is_recorded_decodes_to_what_was_shown() -> None:
    """Cut anywhere, with a break in between, the chain fed one read at a time gives the same bits as the tee."""
    data = b"".join(map(frame, range(40)))
    cuts = [0, *np.sort(np.random.default_rng(2).integers(1, len(data), 25)).tolist(), len(data)]
    tee = Tee([chain()])
    log = started(tee, [chain()], 0)
    other = chain()
    expected = []
    for n, (a, b) in enumerate(itertools.pairwise(cuts)):
        if n == 12:
            tee.event(0, n * STEP_NS, "lost", {"why": "cable"})
            other.lost()
        tee.reads([(0, n * STEP_NS, data[a:b])])
        expected.append(other.feed(n * STEP_NS, data[a:b]))
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


def test_what_is_asked_for_is_all_that_was_read() -> None:
    """Asked for after each read, or once for many, and the same bits."""
    often, seldom = Tee([chain()]), Tee([chain()])
    found: list[list[Block]] = [[], []]
    for i in range(1000):
        for tee, blocks in zip((often, seldom), found, strict=True):
            tee.reads([(0, i * STEP_NS, frame(i))])
            if tee is often or i % 100 == 99:
                blocks += [block for _, block in tee.blocks()]
                assert sum(map(len, blocks)) == i + 1
    whole, parts = (concatenate(blocks) for blocks in found)
    for name in ("t", "distance", "flags", "host_ns"):
        assert getattr(parts, name).tobytes() == getattr(whole, name).tobytes()


def test_samples_that_nobody_asks_for_do_not_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond a bound they are recorded, counted and not shown; those after them have the times they would have had."""
    monkeypatch.setattr(reads, "HELD_SAMPLES", 60)
    tee = Tee([chain()])
    log = started(tee, [chain()], 0)
    for i in range(200):
        tee.reads([(0, i * STEP_NS, frame(i))])
    ((_, block),) = tee.blocks()
    assert len(log.taken) == 200
    assert (len(block), tee.unshown) == (17, 183)
    assert block.first == 183
    np.testing.assert_allclose(block.t, met(range(183, 200)), atol=1e-12)


def test_a_defect_of_a_decoder_costs_no_byte_and_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was read is recorded before it is decoded; what the decoder raises is counted, and told once."""
    failures = Failures()
    tee, each = Tee([chain()], failures), chain()
    log = started(tee, [each], 0)
    events: list[str] = []
    failures.tell = lambda kind, facts: events.append(f"{kind} {facts['error']} {facts['why']}")

    def break_down(host_ns: int, data: bytes) -> Readings:
        raise RuntimeError("no such form")

    monkeypatch.setattr(each, "decoder", SimpleNamespace(feed=break_down))
    for i in range(5):
        tee.reads([(0, i, b"x")])
    assert log.taken == [(0, i, b"x") for i in range(5)]
    assert events == ["decoder_failed RuntimeError no such form"]
    assert list(failures.counts.values()) == [5]


def test_a_polled_sensor_is_asked_by_the_decoder_that_hears_its_replies() -> None:
    """The one of the chain in use, also after a recording has begun with another; a sensor that sends is not asked."""
    family = get_family("us100")
    first, second = (SensorChain(family, options={"temperature_every": 1}) for _ in range(2))
    tee = Tee([first, chain()])
    sensor = Sensor(family, cast(Transport, SimpleNamespace(name="port")))
    line = tee.line(0, [sensor])
    assert line.poll is family.poll
    assert line.decoder is not None
    assert line.decoder() is first.decoder
    tee.reads([(0, 1, bytes([1, 44]))])
    assert line.decoder().request == b"\x50"
    started(tee, [second, chain()], 0)
    assert line.decoder() is second.decoder
    assert line.decoder().request == b"\x55"
    assert tee.line(0, [replace(sensor, family=get_family("ffhls"))]).decoder is None


def test_a_run_begins_with_the_reads_kept_from_before() -> None:
    """From the moment asked for on, each once, whether or not it was decoded before; breaks are no bytes."""
    tee = Tee([chain()])
    tee.reads([(0, 0, frame(0))])
    tee.keep()
    for i in range(1, 20):
        tee.reads([(0, i * STEP_NS, frame(i))])
        if i == 10:
            tee.event(0, i * STEP_NS, "timeout", {})
            tee.blocks()
    tee.forget(3 * STEP_NS)
    log = started(tee, [chain()], 5 * STEP_NS)
    tee.reads([(0, 20 * STEP_NS, frame(20))])
    ((_, block),) = tee.blocks()
    assert [host_ns // STEP_NS for _, host_ns, _ in log.taken] == list(range(5, 21))
    np.testing.assert_allclose(block.t, met(range(5, 21)) - 0.05, atol=1e-12)
    assert block.first == 0


def test_the_first_bytes_are_kept_and_no_more() -> None:
    """So that silence or garbage can be described, with a bounded number of bytes."""
    tee = Tee([chain()])
    for _ in range(200):
        tee.reads([(0, 0, b"x" * 100)])
    assert tee.heard(0) == b"x" * reads.HEARD_BYTES


def test_another_sensor_on_a_port_is_recorded_in_a_channel_of_its_own() -> None:
    """From the first byte on, and the one after it in the next; the channels of other ports stay."""
    sensor = Sensor(get_family("line-protocol"), cast(Transport, SimpleNamespace(name="port", identified=False)))
    chains = [chain(), chain()]
    tee = Tee(chains)
    for port in range(2):
        tee.line(port, [sensor, sensor])
    log = started(tee, chains, 0)
    for turn in range(3):
        tee.reads([(0, turn * STEP_NS, frame(turn)), (1, turn * STEP_NS, frame(100 + turn))])
        tee.event(0, turn * STEP_NS, "lost", {"why": "cable"})
        tee.event(0, turn * STEP_NS, "reopened", {"port": "port", "gap_s": 0.5, "sensor": "another"})
        tee.event(1, turn * STEP_NS, "lost", {})
        tee.event(1, turn * STEP_NS, "reopened", {"sensor": "continued"})
    assert [channel for channel, _, _ in log.taken] == [0, 1, 2, 1, 3, 1]
    kinds = [" ".join(event.split()[0:3:2]) for event in log.events]
    assert kinds[:6] == ["0 lost", "0 replaced", "2 continues", "1 lost", "1 reopened", "2 lost"]
    assert json.loads(log.events[2].split(maxsplit=3)[3])["of"] == 0
    assert json.loads(log.events[1].split(maxsplit=3)[3])["channel"] == 2
    assert [len(each) for each in chains] == [1, 3, 1, 1, 0]
    assert tee.gone == {}


def test_before_a_recording_whatever_comes_back_is_what_will_be_recorded() -> None:
    """In a preview there is no run that another sensor could spoil."""
    sensor = Sensor(get_family("line-protocol"), cast(Transport, SimpleNamespace(name="port", identified=False)))
    chains, log = [chain()], Log()
    tee = Tee(chains)
    tee.line(0, [sensor])
    tee.start(cast(Recorder, log), chains, 0, preview=True)
    tee.event(0, 0, "lost", {})
    tee.event(0, 1, "reopened", {"sensor": "another"})
    tee.reads([(0, 2, frame(0))])
    assert [channel for channel, _, _ in log.taken] == [0]


def test_a_sensor_of_which_no_byte_tells_is_taken_for_the_same_and_noted() -> None:
    """Unless the serial number of its adapter says that it is."""
    for identified, noted in ((True, "identified"), (False, "assumed")):
        transport = cast(Transport, SimpleNamespace(name="port", identified=identified))
        tee = Tee([chain()])
        tee.line(0, [Sensor(get_family("us100"), transport)])
        log = started(tee, [chain()], 0)
        tee.event(0, 0, "reopened", {})
        assert json.loads(log.events[0].split(maxsplit=3)[3]) == {"sensor": noted}


def test_a_run_that_a_trigger_begins_holds_nothing_from_before_a_replug() -> None:
    """The port came back while the trigger waited: what was kept from before may be another sensor's, and goes."""
    sensor = Sensor(get_family("line-protocol"), cast(Transport, SimpleNamespace(name="/dev/x", identified=False)))
    tee, log, new = Tee([chain()], Failures()), Log(), chain()
    tee.line(0, [sensor])
    tee.keep()
    tee.reads([(0, i * STEP_NS, frame(i)) for i in range(100)])
    tee.event(0, 101 * STEP_NS, "lost", {"why": "unplugged"})
    tee.event(0, 150 * STEP_NS, "reopened", {"sensor": "another", "gap_s": 0.5})
    after = [(0, i * STEP_NS, frame(100_000 + i)) for i in range(150, 300)]
    tee.reads(after)
    tee.start(cast(Recorder, log), [new], 0)
    assert log.taken == after
    (found,) = (block for _, block in tee.blocks())
    assert np.ptp(found.t) == pytest.approx(149 * STEP_NS * 1e-9, abs=0.01)
