"""Replay a recording through the interface of a live source."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Self

import numpy as np

from acquisition.block import Block, Flag, concatenate
from acquisition.clock import Clock
from acquisition.source import SourceInfo

_LONGEST_SLEEP_NS = 50_000_000  # maximum delay until a jump or the end of the ``with`` takes effect


class Replay:
    """Delivers the blocks of a recording at the recorded speed or at another speed.

    Parameters
    ----------
    blocks : iterable of Block
        All blocks of a run, in order.
    clock : Clock
        Clock that waits between blocks; a :class:`acquisition.clock.VirtualClock` does not wait.
    info : SourceInfo
        Description of the recording; ``kind`` becomes "replay", except that simulated data stay "simulated".
    speed : float or None
        Seconds of the recording per second of the clock; with None or infinity the replay never waits.
    block_samples : int
        Maximum number of samples in a block.
    loop : bool
        Whether to start again after the end.

    Raises
    ------
    ValueError
        If ``block_samples`` is less than 1, or the speed is not positive.

    Notes
    -----
    A block is due when its last sample is due, as with a port. At any speed, ``t``, ``distance`` and ``velocity`` are
    bit for bit as recorded. ``first`` counts the delivered samples.

    After a seek during the replay, and at each repetition of a loop, ``t`` jumps to another time of the recording. The
    first sample after a jump has the flag ``GAP_BEFORE``; a stateful consumer must reset its state there. Between jumps
    every deadline is absolute, so the timing does not drift. Entering the ``with`` again rewinds.

    Examples
    --------
    >>> from acquisition.clock import VirtualClock
    >>> t = np.arange(5) / 100
    >>> run = Block(0, t, 0.2 + t, np.zeros(5, np.uint8))
    >>> info = SourceInfo("replay", "run", 100.0)
    >>> with Replay([run], VirtualClock(), info=info, block_samples=2) as source:
    ...     [len(block) for block in source]
    [2, 2, 1]
    """

    def __init__(
        self,
        blocks: Iterable[Block],
        clock: Clock,
        *,
        info: SourceInfo,
        speed: float | None = 1.0,
        block_samples: int = 16,
        loop: bool = False,
    ) -> None:
        if block_samples < 1:
            raise ValueError(f"block_samples must be at least 1, got {block_samples}")
        if speed is not None and not speed > 0:
            raise ValueError(f"speed must be positive, or None to never wait, got {speed!r}")
        self.info = info if info.kind == "simulated" else replace(info, kind="replay")
        self._run = concatenate(blocks)
        # Samples whose time is unknown or jumps back are due immediately.
        known = self._run.t[np.isfinite(self._run.t)]
        self._due = np.fmax.accumulate(np.concatenate([known[:1], self._run.t]))[known[:1].size :]
        if not known.size:
            self._due = np.zeros(len(self._run))
        self._clock = clock
        self._speed = math.inf if speed is None else float(speed)
        self._block_samples = block_samples
        self._loop = loop
        self._rewind()

    def _rewind(self) -> None:
        self._next = self._delivered = 0
        self._jumped = self._closed = False
        self._reference: tuple[int, float] | None = None  # (clock ns, recording s); None before the replay begins

    def __enter__(self) -> Self:
        """Open the replay; rewind it if it was closed."""
        if self._closed:
            self._rewind()
        return self

    def __exit__(self, *_: object) -> None:
        """Close the replay."""
        self.close()

    def close(self) -> None:
        """End the iteration; further calls do nothing."""
        self._closed = True

    def seek(self, t_s: float) -> None:
        """Seek to the first sample at or after the recording time ``t_s`` in s, or to the end if there is none."""
        if not math.isfinite(t_s):
            raise ValueError(f"t_s must be a finite time in seconds, got {t_s!r}")
        self._next = int(np.searchsorted(self._due, t_s))
        self._jumped = self._delivered > 0
        if self._reference is not None and len(self._run):
            self._reference = self._clock.now_ns(), float(min(max(t_s, self._due[0]), self._due[-1]))

    def __iter__(self) -> Iterator[Block]:
        """Yield each remaining block when it is due; the replay begins with the first ``next``."""
        self._reference = None
        while not self._closed and self._more():
            stop = min(self._next + self._block_samples, len(self._run))
            deadline_ns, now_ns = self._deadline_ns(stop - 1), self._clock.now_ns()
            if now_ns >= deadline_ns:
                yield self._deliver(stop)
            else:  # wait in short slices, so that a jump takes effect soon
                self._clock.sleep_until_ns(min(deadline_ns, now_ns + _LONGEST_SLEEP_NS))

    def _more(self) -> bool:
        """Return whether a sample remains; a loop continues with the first sample."""
        if self._next < len(self._run):
            return True
        if not self._loop or not len(self._run):
            return False
        if self._reference is not None:
            # The first sample is due one period after the last was due, not one period after the last was consumed.
            reference_ns, reference_s = self._reference
            lasted_s = self._due[-1] - reference_s + 1.0 / self.info.rate_hz
            self._reference = reference_ns + round(lasted_s / self._speed * 1e9), float(self._due[0])
        self._next, self._jumped = 0, self._delivered > 0
        return True

    def _deliver(self, stop: int) -> Block:
        part = self._run[self._next : stop]
        flags = part.flags
        if self._jumped:
            flags = flags.copy()
            flags[0] |= Flag.GAP_BEFORE.value
        block = replace(part, first=self._delivered, flags=flags)
        self._delivered += len(part)
        self._next, self._jumped = stop, False
        return block

    def _deadline_ns(self, row: int) -> int:
        """Return the clock time at which a sample is due, at the recording's pace since the last jump."""
        if self._reference is None:
            self._reference = self._clock.now_ns(), float(self._due[self._next])
        reference_ns, reference_s = self._reference
        return reference_ns + round((float(self._due[row]) - reference_s) / self._speed * 1e9)
