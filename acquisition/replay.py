"""Replay the samples of a recording in blocks, each when it is due, as a live source delivers them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Self

import numpy as np

from acquisition.block import Block, Flag, SourceInfo
from acquisition.clock import Clock

READ_SAMPLES = 16


class Replay:
    """Delivers the samples of a recording in blocks, at the recorded speed or another one.

    ``speed`` is in seconds of the recording per second of the clock; with None the replay never waits. It begins with
    the first sample at or after ``from_s``; with ``loop`` it starts again after the end. The kind of ``info`` becomes
    "replay", except that simulated data stay "simulated".

    A block is due when its last sample is due, as with a port. Every deadline is absolute, so the timing does not
    drift. At any speed the samples are bit for bit as recorded. ``first`` counts the delivered ones. The first sample
    of each repetition has the flag ``GAP_BEFORE``, because ``t`` jumps back there.

    >>> from acquisition.clock import VirtualClock
    >>> t = np.arange(20) / 100
    >>> run = Block(0, t, 0.2 + t, np.zeros(20, np.uint8))
    >>> info = SourceInfo("replay", "run", 100.0)
    >>> with Replay(run, VirtualClock(), info=info) as source:
    ...     [len(block) for block in source]
    [16, 4]
    """

    def __init__(
        self,
        run: Block,
        clock: Clock,
        *,
        info: SourceInfo,
        speed: float | None = 1.0,
        from_s: float = -math.inf,
        loop: bool = False,
    ) -> None:
        if speed is not None and not speed > 0:
            raise ValueError(f"speed must be positive, or None to never wait, got {speed!r}")
        self.info = info if info.kind == "simulated" else replace(info, kind="replay")
        self._run = run
        # Samples whose time is unknown or jumps back are due immediately.
        finite = self._run.t[np.isfinite(self._run.t)]
        self._due = np.fmax.accumulate(np.concatenate([finite[:1], self._run.t]))[finite[:1].size :]
        if not finite.size:
            self._due = np.zeros(len(self._run))
        self._clock = clock
        self._speed = math.inf if speed is None else float(speed)
        self._first = int(np.searchsorted(self._due, from_s))
        self._loop = loop
        self._closed = False

    def __enter__(self) -> Self:
        self._closed = False
        return self

    def __exit__(self, *_: object) -> None:
        """End the iteration."""
        self._closed = True

    def __iter__(self) -> Iterator[Block]:
        """Yield each block when it is due; the replay begins with the first ``next``."""
        size, delivered = len(self._run), 0
        first = 0 if self._loop and self._first == size else self._first
        if first == size:
            return
        begin_ns, begin_s = self._clock.now_ns(), float(self._due[first])
        while True:
            for start in range(first, size, READ_SAMPLES):
                block = self._run[start : start + READ_SAMPLES]
                if self._closed:
                    return
                due_s = float(self._due[start + len(block) - 1]) - begin_s
                self._clock.sleep_until_ns(begin_ns + round(due_s / self._speed * 1e9))
                flags = block.flags.copy()
                if start == 0 and delivered:
                    flags[0] |= Flag.GAP_BEFORE.value
                yield replace(block, first=delivered, flags=flags)
                delivered += len(block)
            if not self._loop:
                return
            # The first sample is due one period after the last was due, not one period after the last was consumed.
            lasted_s = float(self._due[-1]) - begin_s + 1.0 / self.info.rate_hz
            begin_ns, begin_s, first = begin_ns + round(lasted_s / self._speed * 1e9), float(self._due[0]), 0
