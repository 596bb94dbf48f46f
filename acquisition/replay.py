"""Replay a recording through the interface of a live source.

Timing works as in rosbag2: the clock is an argument, and a new snapshot (clock time, recording time) is taken
whenever the replay pauses or jumps. Between snapshots every deadline is absolute, so the timing does not drift.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Self

import numpy as np

from acquisition.block import Block, Flag, concatenate
from acquisition.clock import Clock
from acquisition.source import SourceInfo

__all__ = ["Replay"]

_LONGEST_SLEEP_NS = 50_000_000  # maximum delay until a jump or a pause takes effect


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

    Notes
    -----
    A block is due when its last sample is due, as with a port. At any speed, ``t``, ``distance`` and ``velocity`` are
    bit for bit as recorded, and so are the ``flags`` of the first segment.

    A seek during the replay begins a new *segment*, and so does each repetition of a loop. ``segment`` numbers the
    segments, and ``first`` continues to count delivered samples. ``t`` is the time of the recording, so it may jump
    back. The first sample of a new segment has the flag ``GAP_BEFORE``; a stateful consumer must reset its state there.

    Control methods may be called from any thread, even while another thread iterates. Only one thread may iterate at
    a time; a second iteration continues where the first stopped. Entering the ``with`` again after a close rewinds.

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
        self._changed = threading.Condition()
        self._paused = False
        self._rewind()

    def _rewind(self) -> None:
        self._next = 0
        self._delivered = 0
        self._segment = 0
        self._cut = False
        self._steps = 0
        self._closed = False
        self._reference: tuple[int, float] | None = None  # (clock ns, recording s); None before the replay begins

    def __enter__(self) -> Self:
        """Open the replay; rewind it if it was closed."""
        with self._changed:
            if self._closed:
                self._rewind()
        return self

    def __exit__(self, *_: object) -> None:
        """Close the replay."""
        self.close()

    def close(self) -> None:
        """End the iteration, even while paused; further calls do nothing."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def segment(self) -> int:
        """Number, from 0, of the segment of the block that was delivered last."""
        return self._segment

    @property
    def paused(self) -> bool:
        """Whether the replay is paused."""
        return self._paused

    @property
    def position_s(self) -> float:
        """Current position in the recording, s."""
        with self._changed:
            return self._position()

    def pause(self) -> None:
        """Pause until :meth:`resume` is called."""
        with self._changed:
            if not self._paused:
                self._move_reference(self._position())
                self._paused = True

    def resume(self) -> None:
        """Continue after a pause."""
        with self._changed:
            if self._paused:
                self._move_reference(self._position())
                self._paused, self._steps = False, 0
                self._changed.notify_all()

    def step(self, n: int = 1) -> None:
        """Deliver the next ``n`` samples of a paused replay immediately, and stay paused.

        Raises
        ------
        ValueError
            If ``n`` is less than 1, or the replay is not paused.
        """
        with self._changed:
            if n < 1 or not self._paused:
                raise ValueError(f"step needs n of at least 1 and a paused replay, got n={n}, paused={self._paused}")
            self._steps += n
            self._changed.notify_all()

    def seek(self, t_s: float) -> None:
        """Seek to the first sample at or after the recording time ``t_s`` in s, or to the end if there is none.

        Raises
        ------
        ValueError
            If ``t_s`` is not finite.
        """
        if not math.isfinite(t_s):
            raise ValueError(f"t_s must be a finite time in seconds, got {t_s!r}")
        with self._changed:
            self._next = int(np.searchsorted(self._due, t_s))
            self._cut = self._cut or self._delivered > 0
            self._steps = 0
            start, end = (self._due[0], self._due[-1]) if len(self._run) else (0.0, 0.0)
            self._move_reference(float(min(max(t_s, start), end)))

    def __iter__(self) -> Iterator[Block]:
        """Yield each remaining block when it is due; the replay begins with the first ``next``."""
        with self._changed:
            self._reference = None
        while (block := self._take()) is not None:
            yield block

    def _take(self) -> Block | None:
        """Wait for the next block and return it; return None at the end."""
        while True:
            with self._changed:
                while self._paused and not self._steps and not self._closed:
                    self._changed.wait()
                if self._closed or not self._find_next():
                    return None
                stop = min(self._next + self._block_samples, len(self._run))
                if self._paused:
                    stop = min(stop, self._next + self._steps)
                    self._steps -= stop - self._next
                    self._take_reference(float(self._due[stop - 1]))
                    return self._deliver(stop)
                deadline_ns, now_ns = self._deadline_ns(stop - 1), self._clock.now_ns()
                if now_ns >= deadline_ns:
                    return self._deliver(stop)
            # Wait in short slices, so that a control call takes effect soon.
            self._clock.sleep_until_ns(min(deadline_ns, now_ns + _LONGEST_SLEEP_NS))

    def _find_next(self) -> bool:
        """Return whether a sample remains; a loop continues with the first sample, in a new segment."""
        size = len(self._run)
        if self._next < size:
            return True
        if not self._loop or size == 0:
            return False
        self._next = 0
        self._cut = self._delivered > 0
        if self._reference is not None and not self._paused:
            # The first sample is due one period after the last was due, not one period after the last was consumed.
            reference_ns, reference_s = self._reference
            lasted = self._due[-1] - reference_s + 1.0 / self.info.rate_hz
            self._reference = reference_ns + round(lasted / self._speed * 1e9), float(self._due[0])
        else:
            self._take_reference(float(self._due[0]))
        return True

    def _deliver(self, stop: int) -> Block:
        part = self._run[self._next : stop]
        flags = part.flags
        if self._cut:
            self._cut = False
            self._segment += 1
            flags = flags.copy()
            flags[0] |= Flag.GAP_BEFORE.value
        block = replace(part, first=self._delivered, flags=flags)
        self._delivered += len(part)
        self._next = stop
        return block

    def _deadline_ns(self, row: int) -> int:
        """Return the clock time at which a sample is due; at infinite speed this is the time of the snapshot."""
        reference_ns, reference_s = self._reference or self._take_reference(float(self._due[self._next]))
        return reference_ns + round((float(self._due[row]) - reference_s) / self._speed * 1e9)

    def _position(self) -> float:
        if self._reference is None or not math.isfinite(self._speed):
            if self._next < len(self._run):
                return float(self._due[self._next])
            return float(self._due[-1]) if len(self._run) else 0.0
        reference_ns, reference_s = self._reference
        if self._paused:
            return reference_s
        played = (self._clock.now_ns() - reference_ns) * 1e-9 * self._speed
        # The position never runs ahead of the end of the next block to deliver.
        ahead = self._due[min(self._next, len(self._run) - 1)] + 1.0 / self.info.rate_hz * self._block_samples
        return float(min(reference_s + played, ahead, self._due[-1]))

    def _move_reference(self, position_s: float) -> None:
        if self._reference is not None:  # None before the replay begins
            self._take_reference(position_s)

    def _take_reference(self, position_s: float) -> tuple[int, float]:
        self._reference = (self._clock.now_ns(), position_s)
        return self._reference
