"""The real serial code over a pseudo-terminal, in every wire form, with everything that goes wrong on a line."""

from __future__ import annotations

import dataclasses
import errno
import fcntl
import grp
import itertools
import math
import os
import socket
import sys
import termios
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import serial

from acquisition.block import Block, Flag, concatenate
from acquisition.clock import SystemClock
from acquisition.decoders.family import Poll, Polled
from acquisition.decoders.registry import families, get_family
from acquisition.errors import PortError
from acquisition.live import reader as wired
from acquisition.live import serial_port
from acquisition.live.decoding import SensorChain
from acquisition.live.line import Line
from acquisition.live.reader import PortReader
from acquisition.live.serial_port import PortFacts, SerialPort, list_ports
from acquisition.readings import Read, Readings
from acquisition.simulated.pseudo_terminal import Faults, VirtualPort
from acquisition.simulated.rangefinder import Shot, VirtualRangefinder, VirtualSensor

WAIT_S = 60.0
QUIET_S = 0.4
NAMES = [family.name for family in families()]
STREAMING = [family.name for family in families() if family.poll is None]
POLLED = [family.name for family in families() if family.poll is not None]
CLOCK = SystemClock()


class Rangefinder(VirtualRangefinder):
    """A simulated sensor that remembers what it measured."""

    def __init__(self, rate_hz: float, position: Callable[[float], float]) -> None:
        sensor = VirtualSensor(rate_hz=rate_hz, noise_m=0.0, false_echo_rate_hz=0.0)
        super().__init__(position, sensor, np.random.default_rng(1))
        self.taken: list[Shot] = []

    def shot(self, sequence: int) -> Shot:
        """Take one reading and remember it."""
        shot = super().shot(sequence)
        self.taken.append(shot)
        return shot


class Keeper:
    """A sink that decodes what comes, as the recording's live side does."""

    def __init__(self, chain: SensorChain) -> None:
        self.chain = chain
        self.blocks: list[Block] = []
        self.readings: list[Readings] = []
        self.events: list[tuple[str, Mapping[str, Any]]] = []
        self.moments: list[int] = []
        self._came = threading.Event()
        self._events_seen = {kind: threading.Event() for kind in ("lost", "reopened", "timeout")}

    def reads(self, reads: Sequence[Read]) -> None:
        """Decode what was read."""
        for channel, host_ns, data in reads:
            assert channel == 3
            self.blocks.append(self.chain.feed(host_ns, data))
            self.readings.append(self.chain.last)
        self._came.set()

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Keep the event, and break off the frame it cut."""
        assert channel == 3
        self.chain.lost()
        self.events.append((kind, facts))
        self.moments.append(host_ns)
        self._events_seen[kind].set()

    def wait_for(self, kind: str) -> Mapping[str, Any]:
        """Wait for an event and return its facts."""
        assert self._events_seen[kind].wait(WAIT_S), f"no event {kind!r}"
        return next(facts for name, facts in self.events if name == kind)

    def until_samples(self, count: int) -> None:
        """Return once so many samples have come; the time-out fails the test, not the machine's load."""
        while len(self.samples) < count:
            self._came.clear()
            if len(self.samples) < count:
                assert self._came.wait(WAIT_S), f"{len(self.samples)} of {count} samples came"

    def until_quiet(self) -> None:
        """Return once nothing has come for a while."""
        while self._came.wait(QUIET_S):
            self._came.clear()

    @property
    def samples(self) -> Block:
        """All samples so far."""
        return concatenate(self.blocks)

    @property
    def rows(self) -> Readings:
        """All readings so far."""
        return Readings(reading for readings in self.readings for reading in readings)


@dataclass
class Result:
    """What one run gave."""

    taken: list[Shot]
    sent: int
    unsent: int
    samples: Block
    rows: Readings
    chain: SensorChain
    begun_ns: int
    events: list[tuple[str, Mapping[str, Any]]] = field(default_factory=list)
    moments: list[int] = field(default_factory=list)

    def kinds(self) -> list[str]:
        """Return the kinds of the events in their order."""
        return [kind for kind, _ in self.events]


def swing(t: float) -> float:
    """Return the position of the bob."""
    return 0.6 + 0.2 * math.sin(7.9 * t)


def run(
    name: str,
    *,
    rate_hz: float = 1000.0,
    seconds: float = 0.25,
    faults: Faults | None = None,
    options: dict[str, Any] | None = None,
    position: Callable[[float], float] = swing,
    timeout_s: float = 5.0,
    informed: bool = True,
) -> Result:
    """Read a simulated sensor of a family through a pseudo-terminal until it falls silent.

    A polled one has so long to answer that a busy machine loses no reply; where silence is the fault it has less.
    """
    family = get_family(name)
    finder = Rangefinder(rate_hz, position)
    chain = SensorChain(family, options=options, rate_hz=rate_hz)
    keeper = Keeper(chain)
    rng = np.random.default_rng(4)
    with VirtualPort(family, finder, CLOCK, seconds=seconds, faults=faults, rng=rng, options=options) as port:
        line = Line(SerialPort(port.path, family.baud), 3)
        if family.poll is not None:
            line.poll = dataclasses.replace(family.poll, interval_s=0.003, timeout_s=timeout_s)
            line.decoder = (lambda: cast(Polled, chain.decoder)) if informed else None
        reader = PortReader([line], keeper, CLOCK)
        reader.start()
        try:
            begun_ns = CLOCK.now_ns()
            port.start()
            assert port.done.wait(WAIT_S), "the simulated sensor did not come to its end"
            # A polled sensor that has fallen silent is asked on: no more data is the end of it too.
            keeper.until_quiet()
            while waiting(line):
                keeper.until_quiet()
        finally:
            reader.stop()
    recorded = (keeper.events, keeper.moments)
    return Result(finder.taken, port.sent, port.unsent, keeper.samples, keeper.rows, chain, begun_ns, *recorded)


def waiting(line: Line) -> int:
    """Return how many bytes came that the reader, on a busy machine, has not read yet."""
    descriptor = line.transport.fileno()
    if descriptor < 0:
        return 0
    return int.from_bytes(fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)), sys.byteorder)


@pytest.fixture(autouse=True)
def quick_retries(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look for a lost port every 20 ms."""
    monkeypatch.setattr(wired, "REOPEN_EVERY_NS", 20_000_000)


@pytest.mark.parametrize("name", STREAMING)
def test_every_frame_sent_is_a_sample_with_the_value_sent(name: str) -> None:
    """300 frames at 1 kHz arrive whole, in order, within half a step of what was measured."""
    result = run(name, seconds=0.3)
    lead = 1 if name == "text-lines" else 0  # nothing shows that a first line came from its beginning
    assert result.sent == 300
    assert len(result.samples) == 300 - lead
    sent = np.array([shot.distance_m for shot in result.taken[lead:300]])
    step = result.chain.family.resolution_m
    np.testing.assert_allclose(result.samples.distance, sent, atol=0.5 * step * (1 + 1e-9))
    assert not (result.samples.flags & Flag.MISSING).any()
    assert result.events == []
    assert result.samples.host_ns is not None
    assert np.all(np.diff(result.samples.host_ns) >= 0)
    faults = result.chain.decoder.faults
    assert faults.get("partial_line", 0) == lead
    assert lead or not any(faults.values())


@pytest.mark.parametrize("name", POLLED)
def test_every_reply_is_a_sample_with_the_value_sent(name: str) -> None:
    """A sensor that speaks only when asked is asked on schedule, and each of its replies is a sample."""
    result = run(name, seconds=0.3)
    assert result.sent > 2  # some eighty where the machine has time
    assert len(result.samples) == result.sent
    sent = np.array([shot.distance_m for shot in result.taken[: result.sent]])
    np.testing.assert_allclose(result.samples.distance, sent, atol=0.5 * result.chain.family.resolution_m * (1 + 1e-9))
    assert not (result.samples.flags[:-1] & Flag.MISSING).any()


@pytest.mark.parametrize("name", POLLED)
def test_a_polled_sensor_gives_its_temperature_in_between(name: str) -> None:
    """Asked for the temperature after every third distance, it answers that, and distances stay distances."""
    result = run(name, options={"temperature_every": 3})
    celsius = result.rows.temperature_c
    assert np.isfinite(celsius).sum() >= len(celsius) // 3 - 1
    np.testing.assert_allclose(celsius[np.isfinite(celsius)], 21.3, atol=0.5)
    assert np.all((result.samples.distance > 0.38) & (result.samples.distance < 0.82))


def test_device_time_comes_with_the_line_protocol() -> None:
    """Times are the device's to the microsecond, whatever the pseudo-terminal's delays."""
    result = run("line-protocol")
    np.testing.assert_allclose(result.samples.t, np.arange(250) / 1000.0, atol=1e-9)
    assert not result.samples.flags.any()
    np.testing.assert_array_equal(result.rows.sequence, np.arange(250))
    assert result.chain.info("port").clock == "device"


@pytest.mark.parametrize("name", ["line-protocol", "ffhls", "maxbotix-hr", "us100"])
def test_no_target_is_a_missing_sample(name: str) -> None:
    """Where the bob is nearer than the sensor hears, samples are missing and never distances."""
    places = itertools.cycle([0.6, 0.6, 0.1])
    result = run(name, position=lambda _: next(places))
    missing = np.isnan(result.samples.distance)
    assert 0 < missing.sum() < len(missing)
    np.testing.assert_array_equal(missing, (result.samples.flags & Flag.MISSING) != 0)
    np.testing.assert_allclose(result.samples.distance[~missing], 0.6, atol=1e-3)


LINE_FAULTS = {
    "noise": Faults(noise_rate=0.2),
    "dropped": Faults(drop_rate=0.2),
    "flipped": Faults(flip_rate=0.2),
    "all": Faults(noise_rate=0.1, drop_rate=0.1, flip_rate=0.1),
}


@pytest.mark.parametrize("fault", LINE_FAULTS)
def test_the_line_protocol_never_gives_a_wrong_value(fault: str) -> None:
    """Spoiled frames are counted faults; every reading is one that was sent, and the whole frames arrive."""
    result = run("line-protocol", rate_hz=2000.0, seconds=0.3, faults=LINE_FAULTS[fault])
    assert result.sent == 600
    sequence = result.rows.sequence
    assert np.all(np.diff(sequence) > 0)
    echo = np.array([result.taken[i].echo_us for i in sequence])
    np.testing.assert_allclose(result.rows.echo_us, echo, atol=1e-6)
    np.testing.assert_array_equal(np.array([result.taken[i].device_us for i in sequence]), result.rows.device_us)
    assert len(sequence) > 0.55 * 600
    assert sum(result.chain.decoder.faults.values()) > 0
    lost = np.diff(sequence) - 1
    assert sum(gap.lost for gap in result.chain.timebase.gaps) == lost.sum()


@pytest.mark.parametrize("name", [name for name in STREAMING if name != "line-protocol"])
def test_noise_and_dropped_bytes_cost_a_few_frames_only(name: str) -> None:
    """In every streaming form the sensor stays in step: most frames arrive, and nearly all as they were sent."""
    result = run(name, seconds=0.3, faults=Faults(noise_rate=0.05, drop_rate=0.05), position=lambda _: 0.6)
    assert 0.75 * result.sent <= len(result.samples) <= result.sent + 2
    known = result.samples.distance[np.isfinite(result.samples.distance)]
    right = np.abs(known - 0.6) <= 0.51 * result.chain.family.resolution_m
    assert right.mean() > 0.97
    assert result.chain.decoder.faults["garbage_bytes"] > 0


def test_a_short_reply_does_not_shift_those_after_it() -> None:
    """Replies without header that lose a byte are dropped by a flush, so that no value is put together of two."""
    result = run("us100", seconds=0.5, faults=Faults(drop_rate=0.2), position=lambda _: 0.6)
    assert "timeout" in result.kinds()
    assert len(result.samples) + result.kinds().count("timeout") >= result.sent - 1
    np.testing.assert_allclose(result.samples.distance, 0.6, atol=1e-9)


@pytest.mark.parametrize("name", POLLED)
def test_a_polled_sensor_that_is_silent_for_a_while_times_out(name: str) -> None:
    """Requests without a reply are told as timeouts, and distances go on after the silence."""
    faults = Faults(stall=(0.1, 0.1))
    result = run(name, seconds=0.8, faults=faults, position=lambda _: 0.6, timeout_s=0.04)
    assert "timeout" in result.kinds()
    assert result.taken[-1].true_s > 0.2
    # How many come depends on how busy the machine is; that some come after the silence does not.
    assert result.samples.host_ns is not None
    known = np.isfinite(result.samples.distance)
    assert (result.samples.host_ns[known] > result.moments[result.kinds().index("timeout")]).any()
    np.testing.assert_allclose(result.samples.distance[known], 0.6, atol=1e-9)


def test_a_stall_loses_nothing() -> None:
    """The delayed readings come together, and every sample has its correct time."""
    result = run("line-protocol", seconds=0.3, faults=Faults(stall=(0.1, 0.12)))
    assert result.sent == 300
    np.testing.assert_array_equal(result.rows.sequence, np.arange(300))
    np.testing.assert_allclose(result.samples.t, np.arange(300) / 1000.0, atol=1e-9)
    assert not result.samples.flags.any()
    assert result.samples.host_ns is not None
    assert (result.samples.host_ns[105:215] >= result.begun_ns + 215_000_000).all()


def test_a_stall_up_to_the_end_loses_nothing() -> None:
    """Bytes still held when the sensor falls silent are sent before."""
    result = run("line-protocol", seconds=0.2, faults=Faults(stall=(0.15, 1.0)))
    assert (result.sent, len(result.samples)) == (200, 200)


def test_unplugged_and_plugged_in_again_the_run_goes_on() -> None:
    """The loss and the return are told with the gap's length, the gap is flagged, and the rest arrives."""
    result = run("line-protocol", seconds=0.5, faults=Faults(unplug=(0.1, 0.15)))
    assert result.kinds() == ["lost", "reopened"]
    lost, back = (facts for _, facts in result.events)
    assert "disconnected" in lost["why"]
    assert "\n" not in lost["why"]
    assert back["gap_s"] == pytest.approx((result.moments[1] - result.moments[0]) * 1e-9)
    assert result.unsent == 150
    sequence = result.rows.sequence
    after = int(np.flatnonzero(np.diff(sequence) > 1)[0]) + 1
    assert sequence[-1] == 499
    assert np.flatnonzero(result.samples.flags).tolist() == [after]
    assert result.samples.flags[after] == Flag.GAP_BEFORE
    (gap,) = result.chain.timebase.gaps
    assert gap.index == after
    assert gap.lost == sequence[after] - sequence[after - 1] - 1
    assert gap.length_s == pytest.approx((gap.lost + 1) / 1000.0)
    assert gap.length_s > 0.14


@pytest.mark.parametrize("name", ["ffhls", "us100", "urm37"])
def test_unplugged_without_a_device_clock_the_gap_is_flagged_too(name: str) -> None:
    """A sensor that sends no time has its gap flagged by the loss of the port, polled or not."""
    # A request that the plug took with it is asked again after the timeout.
    result = run(name, seconds=1.5, faults=Faults(unplug=(0.1, 0.5)), position=lambda _: 0.6, timeout_s=0.1)
    assert result.kinds().count("lost") == result.kinds().count("reopened") == 1
    flagged = np.flatnonzero(result.samples.flags & Flag.GAP_BEFORE)
    lost_ns, back_ns = (result.moments[result.kinds().index(kind)] for kind in ("lost", "reopened"))
    assert result.samples.host_ns is not None
    before_ns, after_ns = result.samples.host_ns[flagged - 1], result.samples.host_ns[flagged]
    assert ((before_ns <= lost_ns) & (after_ns >= back_ns)).any()
    np.testing.assert_allclose(result.samples.distance, 0.6, atol=1e-9)


@pytest.mark.parametrize("name", [family.name for family in families() if family.self_framing])
def test_at_the_wrong_baud_rate_there_is_no_sample(name: str) -> None:
    """Garbled bytes are counted as faults, and no distance is made of them."""
    result = run(name, seconds=0.2, faults=Faults(wrong_baud=True))
    assert len(result.samples) == 0
    held = result.chain.decoder.pending
    assert result.sent > 0
    assert sum(result.chain.decoder.faults.values()) + held >= min(51, result.sent)  # a polled sensor sends few


def test_a_flood_costs_the_frame_it_hits() -> None:
    """20,000 random bytes in one piece cost at most two frames."""
    result = run("line-protocol", seconds=0.3, faults=Faults(flood=(0.1, 20_000)))
    assert result.sent == 300
    assert len(result.samples) >= 298
    np.testing.assert_allclose(result.rows.echo_us, [result.taken[i].echo_us for i in result.rows.sequence], atol=1e-6)
    assert result.chain.decoder.faults["garbage_bytes"] > 19_000


def test_several_ports_are_read_by_one_thread() -> None:
    """Eight sensors at 200 Hz are read by a single thread, each with all its samples."""
    family = get_family("line-protocol")
    counts = dict.fromkeys(range(8), 0)
    decoders = [family.decoder() for _ in counts]
    whole = threading.Event()

    class Counter:
        """Counts frames by channel."""

        def reads(self, reads: Sequence[Read]) -> None:
            """Count."""
            for channel, host_ns, data in reads:
                counts[channel] += len(decoders[channel].feed(host_ns, data))
            if all(count == 60 for count in counts.values()):
                whole.set()

        def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
            """Refuse: nothing is lost here."""
            raise AssertionError(kind)

    ports = [VirtualPort(family, Rangefinder(200.0, swing), CLOCK, seconds=0.3) for _ in counts]
    reader = PortReader([Line(SerialPort(p.path, 115200), i) for i, p in enumerate(ports)], Counter(), CLOCK)
    try:
        reader.start()
        assert [thread.name for thread in threading.enumerate()].count("springmass-io") == 1
        for port in ports:
            port.start()
        assert whole.wait(WAIT_S), counts
    finally:
        reader.stop()
        for port in ports:
            port.close()


def test_a_port_that_is_absent_says_which_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """One line names the address and the ports of the machine."""
    monkeypatch.setattr(serial_port, "list_ports", lambda: (PortFacts("/dev/ttyUSB7", "bridge"),))
    with pytest.raises(PortError, match=r"no such port; .*/dev/ttyUSB7") as error:
        SerialPort("/dev/there-is-no-such-port", 9600)
    assert "\n" not in str(error.value)


def test_a_machine_without_ports_says_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is no port at all, the message says so."""
    monkeypatch.setattr(serial_port, "list_ports", lambda: ())
    with pytest.raises(PortError, match="this computer: none"):
        SerialPort("/dev/there-is-no-such-port", 9600)


def test_a_port_that_another_program_holds_is_busy() -> None:
    """The second to open it is told so in one line."""
    with VirtualPort(get_family("ffhls"), Rangefinder(10.0, swing), CLOCK, seconds=0.0) as port:
        first = SerialPort(port.path, 9600)
        with pytest.raises(PortError, match="used by another program") as error:
            SerialPort(port.path, 9600)
        assert "\n" not in str(error.value)
        first.close()
        SerialPort(port.path, 9600).close()


@pytest.mark.parametrize("code", [errno.EACCES, errno.EPERM])
def test_without_permission_the_group_is_named(code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The message says which group owns the port and how to join it; it never says to join root."""

    def refuse(address: str, **_: Any) -> None:
        raise serial.SerialException(code, f"could not open port {address}: {os.strerror(code)}")

    place = tmp_path / "ttyUSB0"
    place.touch(0o660)
    place.chmod(0o660)
    monkeypatch.setattr(serial, "serial_for_url", refuse)
    if os.geteuid() == 0:
        with pytest.raises(PortError, match="belongs to root only") as error:
            SerialPort(str(place), 9600)
        assert "usermod" not in str(error.value)
        os.chown(place, -1, grp.getgrnam("tty").gr_gid)
    group = grp.getgrgid(place.stat().st_gid).gr_name
    with pytest.raises(PortError, match="no permission to open the port") as error:
        SerialPort(str(place), 9600)
    assert f"it belongs to the group {group}; join it with `sudo usermod -aG {group} $USER`" in str(error.value)
    place.chmod(0o600)
    with pytest.raises(PortError, match=f"belongs to {group} only"):
        SerialPort(str(place), 9600)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("address", ["nonsense://x", "socket://127.0.0.1:1", "socket://", "rfc2217://127.0.0.1:1"])
def test_an_address_that_leads_nowhere_is_one_line(address: str) -> None:
    """A wrong scheme and a closed network port are a PortError with a hint."""
    with pytest.raises(PortError, match="check the address") as error:
        SerialPort(address, 9600)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(address)


def test_what_is_no_port_is_refused(tmp_path: Path) -> None:
    """A plain file and a folder cannot be opened as a port."""
    (tmp_path / "file").touch()
    for place in (tmp_path / "file", tmp_path):
        with pytest.raises(PortError, match="cannot be opened"):
            SerialPort(str(place), 9600)


def test_ports_are_listed_in_order() -> None:
    """Whatever this machine has comes as facts, by name."""
    result = list_ports()
    assert [port.device for port in result] == sorted(port.device for port in result)


@contextmanager
def server(turns: list[bytes]) -> Iterator[tuple[str, threading.Event]]:
    """Serve on a local network port: each connection that asks gets its bytes, and ends once the event is set."""
    go_on = threading.Event()
    listener = socket.create_server(("127.0.0.1", 0))
    listener.settimeout(WAIT_S)

    def serve() -> None:
        for turn in turns:
            connection, _ = listener.accept()
            with connection:
                connection.recv(1)  # what comes while pyserial opens the port, it discards
                connection.sendall(turn)
                go_on.wait(WAIT_S)
                go_on.clear()

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield f"socket://127.0.0.1:{listener.getsockname()[1]}", go_on
    finally:
        go_on.set()
        thread.join(WAIT_S)
        listener.close()


def encoded(first: int, n: int) -> bytes:
    """Return line protocol frames."""
    finder = Rangefinder(100.0, swing)
    encoder = get_family("line-protocol").encoder()
    return b"".join(
        encoder.encode(**{name: value for name, value in dataclasses.asdict(shot).items() if name != "true_s"})
        for shot in map(finder.shot, range(first, first + n))
    )


def test_a_socket_is_read_and_opened_again_as_a_port_is() -> None:
    """A sensor behind a network address delivers, is lost when the other side hangs up, and comes back."""
    keeper = Keeper(SensorChain(get_family("line-protocol"), rate_hz=100.0))
    with server([encoded(0, 50), encoded(80, 50)]) as (address, go_on):
        transport = SerialPort(address, 115200)
        assert transport.fileno() >= 0
        once = Poll(request=b"?", interval_s=600.0, timeout_s=600.0)
        reader = PortReader([Line(transport, 3, once)], keeper, CLOCK)
        reader.start()
        try:
            keeper.until_samples(50)
            go_on.set()
            keeper.wait_for("lost")
            assert keeper.wait_for("reopened")["gap_s"] > 0
            keeper.until_samples(100)
        finally:
            reader.stop()
    rows = keeper.rows
    np.testing.assert_array_equal(rows.sequence, [*range(50), *range(80, 130)])
    assert np.flatnonzero(keeper.samples.flags).tolist() == [50]
    assert keeper.chain.timebase.gaps[0].lost == 30


def test_an_address_without_a_descriptor_is_read_on_a_thread_of_its_own() -> None:
    """pyserial's loop returns each request as the reply: polled on schedule, every one is a sample."""
    keeper = Keeper(SensorChain(get_family("us100"), rate_hz=100.0))
    transport = SerialPort("loop://", 9600)
    assert transport.fileno() == -1
    line = Line(transport, 3, Poll(request=b"\x07\xa1", interval_s=0.01, timeout_s=0.1))
    reader = PortReader([line], keeper, CLOCK)
    reader.start()
    keeper.until_samples(20)
    reader.stop()
    np.testing.assert_allclose(keeper.samples.distance, 1.953)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells whether a terminal is exclusive")
def test_an_open_port_is_closed_to_other_programs() -> None:
    """The device itself refuses to be opened again, lock or no lock, until the port is closed."""
    exclusive = 0x80045440  # TIOCGEXCL

    def state(slave: int) -> int:
        return int.from_bytes(fcntl.ioctl(slave, exclusive, bytes(4)), sys.byteorder)

    with VirtualPort(get_family("ffhls"), Rangefinder(10.0, swing), CLOCK, seconds=0.0) as port:
        slave = os.open(port.path, os.O_RDWR | os.O_NOCTTY)
        held = SerialPort(port.path, 9600)
        assert state(slave) == 1
        held.close()
        assert state(slave) == 0
        os.close(slave)


def test_stopping_closes_the_ports_and_may_be_done_twice() -> None:
    """After a stop the port is free for others, and a second stop does nothing."""
    with VirtualPort(get_family("ffhls"), Rangefinder(100.0, swing), CLOCK, seconds=5.0) as port:
        reader = PortReader([Line(SerialPort(port.path, 9600), 3)], Keeper(SensorChain(get_family("ffhls"))), CLOCK)
        reader.start()
        port.start()
        reader.stop()
        reader.stop()
        SerialPort(port.path, 9600).close()


def test_a_sink_that_refuses_ends_the_reading_and_is_heard_of() -> None:
    """What the sink raised is there to see while the run goes on, and is raised by stop."""

    class Refusing:
        """Takes nothing."""

        def __init__(self) -> None:
            self.called = threading.Event()

        def reads(self, reads: Sequence[Read]) -> None:
            """Refuse."""
            self.called.set()
            raise RuntimeError("no room")

        def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
            """Ignore."""

    sink = Refusing()
    with VirtualPort(get_family("ffhls"), Rangefinder(100.0, swing), CLOCK, seconds=0.1) as port:
        reader = PortReader([Line(SerialPort(port.path, 9600))], sink, CLOCK)
        reader.start()
        port.start()
        assert sink.called.wait(WAIT_S)
        with pytest.raises(RuntimeError, match="no room"):
            reader.stop()
        assert isinstance(reader.failure, RuntimeError)
