"""What was read is recorded first and decoded after, and no read goes astray between the two."""

import json
from collections.abc import Sequence
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from acquisition.block import Flag, concatenate
from acquisition.decoders.registry import get_family
from acquisition.events import Event, Lost, Reopened, TimedOut
from acquisition.live.decoding import SensorChain
from acquisition.live.serial_port import SerialPort
from acquisition.readings import Read, Readings
from springmass.session import reads
from springmass.session.failures import Failures
from springmass.session.reads import Tee
from springmass.session.sensors import OpenSensor
from storage.recorder import Recorder
from tests.wire import line

STEP_NS = 10_000_000


class Log:
    """A recorder that remembers."""

    def __init__(self) -> None:
        self.taken: list[Read] = []
        self.events: list[str] = []

    def reads(self, reads: Sequence[Read]) -> None:
        """Remember reads."""
        self.taken += reads

    def event(self, channel: int, host_ns: int, event: Event) -> None:
        """Remember an event."""
        self.events.append(f"{channel} {host_ns} {event.kind} {json.dumps(event.facts)}")


def chain() -> SensorChain:
    """Return a chain of the line protocol."""
    return SensorChain(get_family("line-protocol"), rate_hz=100.0)


def frame(i: int) -> bytes:
    """Return one reading."""
    return line(i, 1500.0 + i)


def met(numbers: Sequence[int]) -> np.ndarray:
    """Return when the sound of such readings met the bob, half of its time of flight after the ping, s."""
    return np.array([0.01 * i + 0.5e-6 * (1500.0 + i) for i in numbers])


def started(tee: Tee, chains: Sequence[SensorChain], since_ns: int) -> Log:
    """Record from here on."""
    log = Log()
    tee.start(cast(Recorder, log), chains, since_ns)
    return log


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

    def break_down(host_ns: int, data: bytes) -> Readings:
        raise RuntimeError("no such form")

    monkeypatch.setattr(each, "decoder", SimpleNamespace(feed=break_down))
    with failures.told_to(lambda e: events.append(f"{e.kind} {e.facts['error']} {e.facts['why']}")):
        for i in range(5):
            tee.reads([(0, i, b"x")])
    assert log.taken == [(0, i, b"x") for i in range(5)]
    assert events == ["decoder_failed RuntimeError no such form"]
    assert list(failures.counts.values()) == [5]


def test_a_run_begins_with_the_reads_kept_from_before() -> None:
    """From the moment asked for on, each once, whether or not it was decoded before; breaks are no bytes."""
    tee = Tee([chain()])
    tee.reads([(0, 0, frame(0))])
    tee.keep(True)
    for i in range(1, 20):
        tee.reads([(0, i * STEP_NS, frame(i))])
        if i == 10:
            tee.event(0, i * STEP_NS, TimedOut())
            tee.blocks()
    tee.forget(3 * STEP_NS)
    log = started(tee, [chain()], 5 * STEP_NS)
    tee.reads([(0, 20 * STEP_NS, frame(20))])
    ((_, block),) = tee.blocks()
    assert [host_ns // STEP_NS for _, host_ns, _ in log.taken] == list(range(5, 21))
    np.testing.assert_allclose(block.t, met(range(5, 21)) - 0.05, atol=1e-12)
    assert block.first == 0


class Bench:
    """One line-protocol sensor on a port whose bytes are recorded."""

    def __init__(self, address: str) -> None:
        port = SimpleNamespace(name=address, is_network="://" in address)
        sensor = OpenSensor(get_family("line-protocol"), cast(SerialPort, port), rate_hz=100.0)
        self.chains = [sensor.chain()]
        self.tee = Tee(self.chains, sensors=[sensor])
        self.log = started(self.tee, self.chains, 0)

    def send(self, at: int, data: bytes) -> None:
        """Send bytes at a time in readings."""
        self.tee.reads([(0, at * STEP_NS, data)])

    def away(self, since: int, until: int) -> None:
        """Lose the port, and let it come back."""
        self.tee.event(0, since * STEP_NS, Lost(why="cable"))
        self.tee.event(0, until * STEP_NS, Reopened(gap_s=0.01 * (until - since), sensor="assumed"))

    @property
    def kinds(self) -> list[str]:
        """Channels and kinds of the recorded events."""
        return [" ".join(event.split()[::2][:2]) for event in self.log.events]


def test_a_sensor_that_returns_begins_a_channel_with_its_own_time() -> None:
    """On a cable: what is sent afterwards is in the next channel, whose times begin anew."""
    bench = Bench("/dev/ttyUSB0")
    bench.send(0, frame(0) + frame(1))
    bench.away(2, 200)
    bench.send(201, frame(201) + frame(202))
    assert bench.kinds == ["0 lost", "0 replaced", "1 continues"]
    assert [(channel, data) for channel, _, data in bench.log.taken] == [
        (0, frame(0) + frame(1)),
        (1, frame(201) + frame(202)),
    ]
    (_, first), (channel, second) = bench.tee.blocks()
    assert (len(first), channel, bench.tee.first) == (2, 1, 1)
    np.testing.assert_allclose(second.t, met([201, 202]) - 2.01, atol=1e-12)
    assert not second.flags.any()
    assert bench.tee.absent(203 * STEP_NS) == []
    assert bench.tee.absent(400 * STEP_NS) == [0]


@pytest.mark.parametrize(("runs_on", "kinds"), [(True, ["0 lost", "0 reopened"]), (False, ["0 lost", "0 replaced"])])
def test_behind_a_break_of_the_network_the_part_goes_on_if_the_counter_does(runs_on: bool, kinds: list[str]) -> None:
    """Its first whole reading decides, and no byte before that is lost; the gap has its length."""
    bench = Bench("socket://sensor:23")
    for i in range(3):
        bench.send(i, frame(1000 + i))
    bench.away(3, 200)
    first = 1201 if runs_on else 5
    bench.send(201, frame(1200)[20:])
    bench.send(202, frame(first)[:9])
    assert len(bench.log.taken) == 3
    bench.send(203, frame(first)[9:])
    bench.send(204, frame(first + 1))
    assert bench.kinds[:2] == kinds
    assert b"".join(data for _, _, data in bench.log.taken[3:6]) == frame(1200)[20:] + frame(first)
    assert {channel for channel, _, _ in bench.log.taken[3:]} == {0 if runs_on else 1}
    block = concatenate([block for channel, block in bench.tee.blocks() if channel == bench.tee.first])
    sent = [1000, 1001, 1002, 1201, 1202] if runs_on else [5, 6]
    np.testing.assert_allclose(block.t, met(sent) - 0.01 * sent[0], atol=1e-12)
    assert block.flags.tolist() == ([0, 0, 0, Flag.GAP_BEFORE, 0] if runs_on else [0, 0])
