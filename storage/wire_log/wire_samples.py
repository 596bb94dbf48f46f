"""Decode the records of a wire log into samples, with the same chains as the live view."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from acquisition.block import Block, concatenate
from acquisition.decoders.registry import get_family
from acquisition.events import Dropped, Lost, Reopened, StoredEvent, TimedOut
from acquisition.live.calibration import Calibration
from acquisition.live.decoding import SensorChain
from storage.wire_log.records import Record, RecordKind, SensorEntry, event_of
from storage.wire_log.survey import Part, Parts

BREAKS = (Lost, Reopened, TimedOut, Dropped)
"""Events that interrupt the bytes of a channel."""
HELD_READS = 4096
"""Number of reads decoded at a time; more would take more memory, fewer would give many small arrays."""
HELD_BYTES = 1 << 18
"""Number of bytes at which fewer reads are decoded, because a read may contain many readings."""
FIRST_SAMPLES = 1000
"""Number of initial samples that determine the host time of t = 0; later ones would add the sensor's clock error."""


class Origin:
    """The host time of a part's t = 0; ``ns`` is None before its first sample."""

    def __init__(self) -> None:
        self.ns: int | None = None
        self._needed = FIRST_SAMPLES

    def push(self, block: Block) -> None:
        """Take the part's next samples."""
        if self._needed > 0 and block.host_ns is not None and len(block):
            early = slice(self._needed)
            # A host time may be late but never early, so the earliest estimate is the best.
            origin_ns = int((block.host_ns[early] - np.rint(1e9 * block.t[early]).astype(np.int64)).min())
            self.ns = origin_ns if self.ns is None else min(origin_ns, self.ns)
            self._needed -= len(block)


def chain_of(sensor: SensorEntry) -> SensorChain:
    """Return the decoding chain of a sensor. Raises AcquisitionError for an unknown family or option."""
    family = get_family(sensor.family)
    return SensorChain(
        family,
        options={**family.past_defaults, **sensor.options},
        rate_hz=sensor.rate_hz,
        calibration=Calibration.from_mapping(sensor.calibration) if sensor.calibration else None,
        clock_ppm=sensor.clock_ppm,
    )


class LogDecoder:
    """Decodes the records of a log into the samples of each part, piece by piece.

    If records are missing or a port was lost, no frame spans the gap, and the first sample after it is flagged.
    ``channels`` are those of the sensors. ``chain_for`` returns the chain of a part that begins, or None if the part is
    not decoded. ``noted`` is called with every record that is not data, and with its event. ``chains`` has the chain of
    each part so far, and ``reads`` the number of its reads. With ``whole`` the records are those of a whole log. Then
    samples without a clock of their own get their final times, and are yielded at the end.
    """

    def __init__(
        self,
        channels: Iterable[int],
        chain_for: Callable[[Part], SensorChain | None],
        noted: Callable[[Record, StoredEvent | None], object] = lambda *_: None,
        *,
        whole: bool = False,
    ) -> None:
        self._chain_for, self._noted = chain_for, noted
        self._parts = Parts(channels)
        self._held: dict[Part, list[tuple[int, bytes]]] = {}
        self._unsettled: dict[Part, list[Block]] | None = {} if whole else None
        self.chains: dict[Part, SensorChain] = {}
        self.reads: dict[Part, int] = {}
        for part in self._parts.now.values():
            self._begin(part)

    def blocks(self, log: Iterable[Record]) -> Iterator[tuple[Part, Block]]:
        """Yield parts and their samples, as they are decoded; a later call may pass the further records of a log."""
        size, now = 0, self._parts.now
        for record in log:
            _, _, mono_ns, kind, channel, payload, lost_before = record
            if lost_before:
                for part in list(now.values()):
                    self._break(part)
            if kind is not RecordKind.DATA:
                self._note(record)
                continue
            held = self._held.get(now[channel]) if channel in now else self._begin(self._parts.unknown(channel))
            if held is None:
                continue
            held.append((mono_ns, payload))
            size += len(payload)
            if len(held) >= HELD_READS or size >= HELD_BYTES:
                size = 0
                yield from self._samples()
        yield from self._samples()
        for part, blocks in (self._unsettled or {}).items():
            yield part, self.chains[part].settle(concatenate(blocks))

    def _note(self, record: Record) -> None:
        event = event_of(record.payload) if record.kind is RecordKind.EVENT else None
        if event is not None:
            typed = event.typed
            if isinstance(typed, BREAKS) and record.channel in self._parts.now:
                self._break(self._parts.now[record.channel])
            self._begin(self._parts.event(record.channel, typed))
        self._noted(record, event)

    def _begin(self, part: Part | None) -> list[tuple[int, bytes]] | None:
        """Begin a part, and return the list of its held reads; None if it is not decoded."""
        chain = None if part is None else self._chain_for(part)
        if part is None or chain is None:
            return None
        self.chains[part], self._held[part], self.reads[part] = chain, [], 0
        return self._held[part]

    def _break(self, part: Part) -> None:
        if part in self.chains:
            self._hand_over(part)
            self.chains[part].lost()

    def _hand_over(self, part: Part) -> None:
        held = self._held[part]
        for host_ns, data in held:
            self.chains[part].take(host_ns, data)
        self.reads[part] += len(held)
        held.clear()

    def _samples(self) -> Iterator[tuple[Part, Block]]:
        for part, chain in self.chains.items():
            self._hand_over(part)
            if not len(chain):
                continue
            block = chain.block()
            if self._unsettled is not None and chain.awaits_end:
                self._unsettled.setdefault(part, []).append(block)
            else:
                yield part, block
