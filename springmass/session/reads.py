"""Pass reads from the port to the recorder unchanged, and then through the decoders.

Both happen on the reading thread, in this order, so that a defect of a decoder cannot lose bytes. Exceptions of a
decoder are counted and go no further. A second thread for decoding would be woken by every read, which costs more than
decoding a reading.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, cast

from acquisition.block import Block
from acquisition.decoders.family import Polled
from acquisition.live.decoding import SensorChain
from acquisition.live.line import Line
from acquisition.readings import Read, Reading
from springmass.session.failures import Failures
from springmass.session.sensors import Back, Proof, Sensor
from storage.recorder import Recorder
from storage.wire_log.records import HIGHEST_CHANNEL

__all__ = ["Tee"]

HEARD_BYTES = 4096
"""Number of first bytes kept per sensor, enough to identify its kind."""
HELD_SAMPLES = 1 << 15
"""Maximum samples per sensor waiting for the display: five minutes at 100 Hz if a display hangs, in 8 MB."""


class Tee:
    """Passes every read to the recorder, if there is one, and to its sensor's chain.

    Parameters
    ----------
    chains : list of SensorChain
        Chains by channel. During a recording, another sensor that comes back on a port gets an additional chain.
    failures : Failures, optional
        Counts the exceptions of decoders.

    Attributes
    ----------
    gone : dict of int to str
        Reasons for lost ports, by channel; a port that came back is removed.
    readings : list of int
        Number of readings by channel.
    unshown : int
        Number of samples not fetched in time. They are recorded and in the run file, but not shown.
    """

    def __init__(self, chains: list[SensorChain], failures: Failures | None = None) -> None:
        self._chains = chains
        self._failures = failures or Failures()
        self._lock = threading.Lock()
        self._recorder: Recorder | None = None
        self._preview = False
        self._kept: deque[Read] | None = None
        self._heard = [bytearray() for _ in chains]
        self._sensors: Sequence[Sensor] = ()
        # Channel for each port's bytes: its own, or an additional one if another sensor came back on the port.
        self._channels = list(range(len(chains)))
        self._last: list[Reading | None] = [None for _ in chains]
        self.gone: dict[int, str] = {}
        self.readings = [0 for _ in chains]
        self.unshown = 0

    def line(self, channel: int, sensors: Sequence[Sensor]) -> Line:
        """Return how the reader talks to a sensor; a polled sensor is polled as its chain's decoder requires.

        The proof required of a sensor that comes back is made from the state of the sensors at that time.
        """
        self._sensors = sensors
        family = sensors[channel].family
        decoder = None if family.poll is None else partial(self._polled, channel)
        transport = sensors[channel].transport
        return Line(transport, channel, family.poll, decoder, partial(self._proof, channel), family.identify)

    def _polled(self, channel: int) -> Polled:
        return cast(Polled, self._chains[self._channels[channel]].decoder)

    def _proof(self, channel: int) -> Proof | None:
        """Return the proof required on a port that came back, based on the last sensor on that port."""
        sensor, now = self._sensors[channel], self._channels[channel]
        identity = self._chains[now].status.identity or (sensor.identity if now == channel else None)
        return replace(sensor, identity=identity).proof(self._last[now])

    def reads(self, reads: Sequence[Read]) -> None:
        """Take the reads of one wake-up; called on the reading thread."""
        with self._lock:
            if len(self._chains) > len(self._channels):
                reads = [(self._channels[port], host_ns, data) for port, host_ns, data in reads]
            if self._recorder is not None:
                self._recorder.reads(reads)
            if self._kept is not None:
                self._kept += reads
            for channel, host_ns, data in reads:
                if len(heard := self._heard[channel]) < HEARD_BYTES:
                    heard += data[: HEARD_BYTES - len(heard)]
                self._decode(channel, host_ns, data)

    def _decode(self, channel: int, host_ns: int, data: bytes) -> None:
        chain = self._chains[channel]
        try:
            chain.take(host_ns, data)
            self.readings[channel] += len(chain.last)
            if chain.last:
                self._last[channel] = chain.last[-1]
            if len(chain) > HELD_SAMPLES:
                self.unshown += len(chain.block())
        except Exception as error:  # the bytes are recorded, and a display error must not end the run
            self._failures.note("decoder", error)

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Take an event; called on the reading thread."""
        with self._lock:
            if kind == "lost":
                self.gone[channel] = str(facts.get("why", ""))
            elif kind == "reopened":
                self.gone.pop(channel, None)
                if self._kept is not None:
                    # The coming run must not contain earlier reads, for they may be from another sensor.
                    self._kept = deque(read for read in self._kept if read[0] != self._channels[channel])
                if self._sensors and "sensor" not in facts:
                    facts = {**facts, "sensor": self._sensors[channel].judged(None, None)}
                more = self._recorder is not None and not self._preview and len(self._chains) <= HIGHEST_CHANNEL
                if facts.get("sensor") == Back.ANOTHER and self._recorder is not None and more:
                    self._go_on(self._recorder, channel, host_ns, facts)
                    return
            channel = self._channels[channel]
            if self._recorder is not None:
                self._recorder.event(channel, host_ns, kind, facts)
            try:
                chain = self._chains[channel]
                (chain.returned if kind == "reopened" else chain.lost)()
            except Exception as error:
                self._failures.note("decoder", error)

    def _go_on(self, recorder: Recorder, port: int, host_ns: int, facts: Mapping[str, Any]) -> None:
        """Record a port's further data as another sensor, in the next free channel."""
        before, channel = self._channels[port], len(self._chains)
        recorder.event(before, host_ns, "replaced", {**facts, "channel": channel})
        recorder.event(channel, host_ns, "continues", {**facts, "of": before})
        self._channels[port] = channel
        self._chains.append(self._sensors[port].chain())
        self._heard.append(bytearray())
        self._last.append(None)
        self.readings.append(0)

    @property
    def first(self) -> int:
        """Channel of the sensor now on the first port."""
        return self._channels[0]

    def blocks(self) -> list[tuple[int, Block]]:
        """Return the samples received since the last call, by channel, for sensors that have any."""
        with self._lock:
            return [(channel, chain.block()) for channel, chain in enumerate(self._chains) if len(chain)]

    def heard(self, channel: int) -> bytes:
        """Return the first bytes sent by a sensor."""
        with self._lock:
            return bytes(self._heard[channel])

    def keep(self) -> None:
        """Keep all reads from now on, because a run may include data from before its trigger."""
        with self._lock:
            self._kept = deque()

    def let_go(self) -> None:
        """Stop keeping reads, and discard those kept."""
        with self._lock:
            self._kept = None

    def forget(self, before_ns: int) -> None:
        """Discard kept reads that are older than a given time."""
        with self._lock:
            while self._kept and self._kept[0][1] < before_ns:
                self._kept.popleft()

    def start(self, recorder: Recorder, chains: list[SensorChain], since_ns: int, *, preview: bool = False) -> None:
        """Record all further reads and the kept reads since a given time, each exactly once.

        Polling and decoding start anew with the given chains, like the recorded bytes. In a preview, another sensor
        that comes back on a port gets no additional channel.
        """
        with self._lock:
            kept = [read for read in self._kept or () if read[1] >= since_ns]
            self._kept = None
            self._recorder, self._chains, self._preview = recorder, chains, preview
            self._channels = list(range(len(chains)))
            recorder.reads(kept)
            for channel, host_ns, data in kept:
                self._decode(channel, host_ns, data)

    def stop(self) -> None:
        """Stop recording."""
        with self._lock:
            self._recorder = None
