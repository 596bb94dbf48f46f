"""Reads on their way from the port: to the recorder as they are, then through the decoders.

Both happen on the reading thread, and in this order: first every port that has something is read and all bytes are
given to the recorder, then what came is decoded, a bounded piece at a time, and last the thread that appends what the
recorder has queued is woken. Woken before, it would contend with the decoding for the interpreter. A second thread for
the decoding would be woken by each read, and would hold the interpreter while the ports wait.

Whoever asks for samples several times a second finds them decoded when they have come. For one that asks less often
they are decoded when it asks, or when a piece of them waits: decoding a hundred readings at once takes a tenth of what
it takes to decode each when it comes and the processor has turned to other things in between.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from acquisition.block import Block
from acquisition.decoders.base import Polled
from acquisition.live.decoding import Chains
from acquisition.readings import Read
from storage.recorder import Recorder

__all__ = ["Tee"]

ROUND_BYTES = 8192
"""So many bytes are decoded before the ports are looked at again: a few milliseconds of the slowest decoder."""
HEARD_BYTES = 4096
"""So many bytes tell what sensor it is."""
SELDOM_NS = 250_000_000
"""Where samples are asked for less often than this, they are decoded many at a time."""
HELD_BYTES = 4 << 20
"""So many bytes may wait for the decoders; a flood that is more than they can do is recorded and not shown."""


class Tee:
    """Hands every read to the recorder, once there is one, and to the decoders.

    Parameters
    ----------
    chains : Chains
    askers : mapping of int to Polled
        By channel: decoders fed at once, that say what a polled sensor is asked next.
    """

    def __init__(self, chains: Chains, askers: Mapping[int, Polled]) -> None:
        self._chains = chains
        self._askers = askers
        self._lock = threading.Lock()
        self._recorder: Recorder | None = None
        self._waiting: deque[Read] = deque()
        self._waiting_bytes = 0
        self._kept: deque[Read] | None = None
        self._heard: list[bytearray] | None = [bytearray() for _ in chains.each]
        self._latest_ns = self._asked_ns = 0
        self._asked_often = True
        self.gone: dict[int, str] = {}
        self.skipped_bytes = 0

    def reads(self, reads: Sequence[Read]) -> None:
        """Take what one wake-up read; called on the reading thread."""
        with self._lock:
            if self._recorder is not None:
                self._recorder.take(reads)
            if self._askers:
                for channel, host_ns, data in reads:
                    if channel in self._askers:
                        self._askers[channel].feed(host_ns, data)
            self._waiting += reads
            size = self._waiting_bytes
            for _, _, data in reads:
                size += len(data)
            self._waiting_bytes = size
            self._latest_ns = reads[-1][1]
            if self._kept is not None:
                self._kept += reads
            if self._waiting_bytes > HELD_BYTES:
                self._skip()

    def event(self, channel: int, host_ns: int, kind: str, facts: Mapping[str, Any]) -> None:
        """Take an event; called on the reading thread."""
        with self._lock:
            if self._recorder is not None:
                self._recorder.event(channel, host_ns, kind, facts)
            if channel in self._askers:
                self._askers[channel].flush()
            self._waiting.append((channel, host_ns, b""))
            if kind == "lost":
                self.gone[channel] = str(facts.get("why", ""))

    def decode(self) -> bool:
        """Decode a piece of what waits, have the recorder append, and tell whether more is to be decoded at once.

        Called on the reading thread whenever it has read, so no read waits for the appending longer than a piece takes.
        """
        if self._asked_often or self._waiting_bytes >= ROUND_BYTES:
            with self._lock:
                self._decode_piece()
        if (recorder := self._recorder) is not None:
            recorder.wake()
        return self._waiting_bytes >= ROUND_BYTES or (self._asked_often and bool(self._waiting))

    def blocks(self) -> list[tuple[int, Block]]:
        """Return the samples that came since the last call, by channel."""
        with self._lock:
            if not self._asked_often:
                self._decode_piece()
            self._asked_often = self._latest_ns - self._asked_ns < SELDOM_NS
            self._asked_ns = self._latest_ns
            return self._chains.blocks()

    def _decode_piece(self) -> None:
        if self._waiting_bytes <= ROUND_BYTES:
            piece = list(self._waiting)
            self._waiting.clear()
            self._waiting_bytes = 0
        else:
            piece, size = [], 0
            while self._waiting and size < ROUND_BYTES:
                piece.append(self._waiting.popleft())
                size += len(piece[-1][2])
            self._waiting_bytes -= size
        if self._heard is not None:
            for channel, _, data in piece:
                self._heard[channel] += data[: HEARD_BYTES - len(self._heard[channel])]
        self._chains.take(piece)

    def heard(self, channel: int) -> bytes:
        """Return the first bytes that a sensor sent."""
        with self._lock:
            return b"" if self._heard is None else bytes(self._heard[channel])

    def heard_enough(self) -> None:
        """Keep no first bytes any more: every sensor is known."""
        with self._lock:
            self._heard = None

    def keep(self) -> None:
        """Keep reads from here on, for a run that may begin before the moment that starts it."""
        with self._lock:
            self._kept = deque()

    def forget(self, before_ns: int) -> None:
        """Keep no reads that are older."""
        with self._lock:
            while self._kept and self._kept[0][1] < before_ns:
                self._kept.popleft()

    def start(self, recorder: Recorder, chains: Chains, since_ns: int) -> None:
        """Record from here on, and the kept reads since a moment, no read twice and none left out.

        What a polled sensor is asked, and what is decoded, begins anew, as the recorded bytes do.
        """
        with self._lock:
            kept = deque(read for read in self._kept or () if read[1] >= since_ns)
            recorder.reads(kept)
            self._recorder = recorder
            self._chains = chains
            self._waiting, self._waiting_bytes = deque(kept), sum(len(data) for _, _, data in kept)
            self._kept = None
            for asker in self._askers.values():
                asker.flush()

    def stop(self) -> None:
        """Record no more."""
        with self._lock:
            self._recorder = None

    def _skip(self) -> None:
        """Let the oldest reads go undecoded, and no frame be put together across them."""
        channels = set()
        while self._waiting_bytes > HELD_BYTES // 2:
            channel, _, data = self._waiting.popleft()
            channels.add(channel)
            self._waiting_bytes -= len(data)
            self.skipped_bytes += len(data)
        for channel in channels:
            self._chains.lost(channel)
