"""Pass reads to the recorder unchanged, then to the decoders; decide whether a sensor that returned continues its run.

Both happen on the reading threads, in this order, so that a defect of a decoder cannot lose bytes. Exceptions of a
decoder are counted and go no further. A separate thread for decoding would be woken by every read, which costs more
than decoding a reading.
"""

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from msgspec.structs import replace

from acquisition.block import Block
from acquisition.decoders.decoder import Decoder
from acquisition.events import Continued, Event, Lost, Reopened, Replaced, Shared
from acquisition.live.decoding import SensorChain
from acquisition.readings import NO_READINGS, Read, Reading
from springmass.session.failures import Failures
from springmass.session.sensors import OpenSensor
from storage.recorder import Recorder
from storage.recovery.report import SILENCE_S, SILENT_PERIODS
from storage.wire_log.records import HIGHEST_CHANNEL

HEARD_BYTES = 4096
"""Number of first bytes kept per sensor, enough to identify its kind."""
HELD_SAMPLES = 1 << 15
"""Maximum samples per sensor waiting for the display: five minutes at 100 Hz if a display hangs, in 8 MB."""
UNDECIDED_BYTES = 4096
"""Number of bytes from a network port without a reading after which its sensor counts as another part."""


@dataclass(slots=True)
class Return:
    """A port that came back and has not sent enough to decide where its bytes go, with those bytes."""

    host_ns: int
    event: Reopened
    decoder: Decoder
    reads: list[Read] = field(default_factory=list)


class Tee:
    """Passes every read to the recorder, if there is one, and to its sensor's chain.

    A channel is a part of what one port sends: the ports have the first channels, and a sensor that comes back during
    a recording begins another one. ``gone`` has the reasons for lost ports, ``readings`` the number of readings by
    channel, and ``unshown`` the number of samples that were not fetched in time; they are recorded but not shown.
    """

    def __init__(
        self, chains: list[SensorChain], failures: Failures | None = None, sensors: Sequence[OpenSensor] = ()
    ) -> None:
        self._sensors = sensors
        self._chains = chains
        self._failures = failures or Failures()
        self._lock = threading.Lock()
        self._recorder: Recorder | None = None
        self._parts = False  # whether a port that comes back begins another channel
        self._kept: deque[Read] | None = None
        self._heard = [bytearray() for _ in chains]
        self._channels = list(range(len(chains)))  # current channel of each port
        self._begun: set[int] = set()  # ports that sent something in the current run
        self._returns: dict[int, Return] = {}
        self._last: list[Reading | None] = [None for _ in chains]  # of each port
        self.gone: dict[int, str] = {}
        self.shared: set[int] = set()  # ports that another program reads too
        self.readings = [0 for _ in chains]
        self.unshown = 0

    def reads(self, reads: Sequence[Read]) -> None:
        """Take reads of one port; called on its reading thread."""
        with self._lock:
            for read in reads:
                port = read[0]
                if port not in self._returns:
                    self._take(port, [read])
                elif self._decided(port, self._returns[port], read):
                    self._take(port, self._returns.pop(port).reads)

    def _take(self, port: int, reads: Sequence[Read]) -> None:
        if self._kept is not None:
            self._kept += reads
        channel = self._channels[port]
        self._begun.add(port)
        reads = [(channel, host_ns, data) for _, host_ns, data in reads]
        if self._recorder is not None:
            self._recorder.reads(reads)
        for read in reads:
            self._decode(port, read)

    def _decode(self, port: int, read: Read) -> None:
        channel, host_ns, data = read
        if len(heard := self._heard[port]) < HEARD_BYTES:
            heard += data[: HEARD_BYTES - len(heard)]
        chain = self._chains[channel]
        try:
            chain.take(host_ns, data)
            self.readings[channel] += len(chain.last)
            if chain.last:
                self._last[port] = chain.last[-1]
            if len(chain) > HELD_SAMPLES:
                self.unshown += len(chain.block())
        except Exception as error:  # the bytes are recorded, and a display error must not end the run
            self._failures.note("decoder", error)

    def event(self, port: int, host_ns: int, event: Event) -> None:
        """Take an event; called on the reading thread."""
        with self._lock:
            if isinstance(event, Lost):
                self._settle(port)
                self.gone[port] = event.why or ""
            elif isinstance(event, Shared):
                self.shared.add(port)
            elif isinstance(event, Reopened):
                self.gone.pop(port, None)
                if self._kept is not None:
                    # The coming run must not contain earlier reads, for they may be from another sensor.
                    self._kept = deque(read for read in self._kept if read[0] != port)
                if self._parts:
                    if port in self._begun:  # else what it sends is the first part
                        sensor = self._sensors[port]
                        self._returns[port] = Return(host_ns, event, sensor.family.decoder(**sensor.options))
                    return
            self._interrupt(port, host_ns, event)

    def _interrupt(self, port: int, host_ns: int, event: Event) -> None:
        channel = self._channels[port]
        if self._recorder is not None:
            self._recorder.event(channel, host_ns, event)
        try:
            self._chains[channel].lost()
        except Exception as error:
            self._failures.note("decoder", error)

    def _decided(self, port: int, back: Return, read: Read) -> bool:
        """Keep a read of a port that came back; return whether the channel of its bytes is known now.

        On a network port, the part goes on if the counter of the device runs on, which its first reading shows.
        """
        back.reads.append(read)
        sensor, last = self._sensors[port], self._last[port]
        if sensor.port.is_network and last is not None:
            try:
                readings = back.decoder.feed(*read[1:])
            except Exception as error:
                self._failures.note("decoder", error)
                readings = NO_READINGS
            if not readings and sum(len(data) for _, _, data in back.reads) < UNDECIDED_BYTES:
                return False
            if readings and sensor.runs_on(last, readings[0]):
                self._interrupt(port, back.host_ns, replace(back.event, sensor="continued"))
                return True
        self._begin_part(port, back)
        return True

    def _settle(self, port: int) -> None:
        """Record in the channel before what a port sent that came back and went, or the recording ended, undecided."""
        back = self._returns.pop(port, None)
        if back is not None and back.reads:
            self._take(port, back.reads)

    def _begin_part(self, port: int, back: Return) -> None:
        """Record a port's further data in the next free channel; without one, in the same channel after an event."""
        before, channel = self._channels[port], len(self._chains)
        if self._recorder is None or channel > HIGHEST_CHANNEL:
            self._interrupt(port, back.host_ns, back.event)
            return
        self._recorder.event(before, back.host_ns, Replaced(**back.event.facts, channel=channel))
        self._recorder.event(channel, back.host_ns, Continued(**back.event.facts, of=before))
        self._channels[port] = channel
        self._chains.append(self._sensors[port].chain())
        self.readings.append(0)

    @property
    def first(self) -> int:
        """Channel of the sensor now on the first port."""
        return self._channels[0]

    def absent(self, now_ns: int) -> list[int]:
        """Return the ports that are lost or whose sensor is silent."""
        absent = []
        with self._lock:
            for port, (sensor, last) in enumerate(zip(self._sensors, self._last, strict=False)):
                longest_s = max(SILENCE_S, SILENT_PERIODS / (sensor.rate_hz or sensor.family.rate_hz))
                if port in self.gone or last is None or (now_ns - last.host_ns) * 1e-9 > longest_s:
                    absent.append(port)
        return absent

    def blocks(self) -> list[tuple[int, Block]]:
        """Return the samples received since the last call, by channel, for sensors that have any."""
        with self._lock:
            return [(channel, chain.block()) for channel, chain in enumerate(self._chains) if len(chain)]

    def heard(self, port: int) -> bytes:
        """Return the first bytes sent by a sensor."""
        with self._lock:
            return bytes(self._heard[port])

    def keep(self, wanted: bool) -> None:
        """Keep all reads from now on, because a run may include data from before its trigger; or keep none."""
        with self._lock:
            self._kept = deque() if wanted else None

    def forget(self, before_ns: int) -> None:
        """Discard kept reads that are older than a given time."""
        with self._lock:
            while self._kept and self._kept[0][1] < before_ns:
                self._kept.popleft()

    def start(self, recorder: Recorder, chains: list[SensorChain], since_ns: int, *, preview: bool = False) -> None:
        """Record all further reads and the kept reads since a given time, each exactly once.

        Decoding starts anew with the given chains, like the recorded bytes. In a preview, a sensor that comes back gets
        no additional channel.
        """
        with self._lock:
            kept = [read for read in self._kept or () if read[1] >= since_ns]
            self._kept = None
            self._recorder, self._chains, self._parts = recorder, chains, not preview
            self._channels, self._begun = list(range(len(chains))), {port for port, _, _ in kept}
            for port in sorted(self.shared):  # it was noticed before the run began
                recorder.event(port, since_ns, Shared(port=self._sensors[port].port.name))
            recorder.reads(kept)
            for read in kept:
                self._decode(read[0], read)

    def stop(self) -> None:
        """Stop recording."""
        with self._lock:
            for port in list(self._returns):
                self._settle(port)
            self._recorder, self._parts = None, False
