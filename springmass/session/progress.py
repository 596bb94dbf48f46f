"""What a recording shows while it runs: counts, rate and the first sensor's motion."""

from __future__ import annotations

import shutil
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.block import I8, Block, Flag
from acquisition.live.decoding import SensorChain
from pipeline.accuracy import params_for
from pipeline.streaming import LiveMotion, MotionAccumulator, NotYet
from springmass.session.failures import Failures
from springmass.session.reads import Tee
from storage.recorder import Recorder, RecorderStatus

__all__ = ["Progress", "Shown", "progress_of"]

SECOND_NS = 1_000_000_000
MOTION_EVERY_NS = 1_900_000_000
"""Every second line of progress: a swing lasts about as long, and an analysis costs some milliseconds."""


@dataclass(frozen=True, slots=True)
class Progress:
    """One line of progress.

    Parameters
    ----------
    seconds : float
        Since the recording began.
    samples, missing, gaps : int
        Of all sensors.
    rate_hz : float
        Samples per second over the last second, of the first sensor.
    motion : callable
        Returns the first sensor's motion, LiveMotion or NotYet; costs milliseconds, so it is asked only to be shown,
        and is the one before for two seconds.
    status : RecorderStatus
    disk_free_bytes : int or None
        Left on the disk that the log lies on; None before there is a log.
    waiting : bool
        Whether the trigger has not come yet.
    unshown : int
        Samples that came faster than they were shown; the run file holds them.
    gone : sequence of str
        Why ports are lost that have not come back.
    silent_s : float
        How long no reading of the first sensor came, s.
    """

    seconds: float
    samples: int
    missing: int
    gaps: int
    rate_hz: float
    motion: Callable[[], LiveMotion | NotYet]
    status: RecorderStatus | None
    disk_free_bytes: int | None
    waiting: bool
    unshown: int = 0
    gone: Sequence[str] = ()
    silent_s: float = 0.0


class Shown:
    """What the samples so far amount to.

    Parameters
    ----------
    rate_hz : float
        Nominal, of the first sensor.
    """

    def __init__(self, rate_hz: float) -> None:
        self.samples = self.missing = 0
        # A third of the time of the standard tier, which the run itself is analysed with; period and amplitude agree.
        self._motion = MotionAccumulator(rate_hz, params=params_for("fast"))
        self._found: LiveMotion | NotYet = NotYet("no samples so far")
        self._found_ns = 0
        self._stamps: deque[I8] = deque()
        self._last_ns: int | None = None

    def push(self, blocks: Iterable[tuple[int, Block]]) -> None:
        """Take blocks of samples by channel."""
        for channel, block in blocks:
            self.samples += len(block)
            self.missing += int(np.count_nonzero(block.flags & np.uint8(Flag.MISSING)))
            if channel == 0:
                self._motion.push(block.t, block.distance, block.flags)
                if block.host_ns is not None and len(block):
                    self._stamps.append(block.host_ns)
                    self._last_ns = int(block.host_ns[-1])

    def motion(self, now_ns: int) -> LiveMotion | NotYet:
        """Return the first sensor's motion, found anew where the last is old enough."""
        if isinstance(self._found, NotYet) or now_ns - self._found_ns >= MOTION_EVERY_NS:
            self._found, self._found_ns = self._motion.value(), now_ns
        return self._found

    def silent_s(self, now_ns: int) -> float:
        """Return how long ago the first sensor's last reading came; 0 before there was one."""
        return 0.0 if self._last_ns is None else (now_ns - self._last_ns) * 1e-9

    def rate_hz(self, now_ns: int) -> int:
        """Return how many samples of the first sensor came within the last second."""
        since = now_ns - SECOND_NS
        while self._stamps and self._stamps[0][-1] < since:
            self._stamps.popleft()
        return sum(int(np.count_nonzero(stamps >= since)) for stamps in self._stamps)


def progress_of(
    shown: Shown,
    failures: Failures,
    chains: Sequence[SensorChain],
    tee: Tee,
    recorder: Recorder | None,
    start_ns: int,
    now_ns: int,
) -> Progress:
    """Return where a recording stands, that began at a moment; without a recorder, one that waits for its trigger."""

    def motion() -> LiveMotion | NotYet:
        """Where working it out fails, say why there is none: the rest of the line stands."""
        try:
            return shown.motion(now_ns)
        except BaseException as error:
            failures.note("analysis", error)
            return NotYet(f"no motion shown ({type(error).__name__})")

    return Progress(
        (now_ns - start_ns) * 1e-9,
        shown.samples,
        shown.missing,
        sum(len(chain.timebase.gaps) + int(chain.timebase.gaps_left_out["count"]) for chain in chains),
        shown.rate_hz(now_ns),
        motion,
        None if recorder is None else recorder.status,
        None if recorder is None else _free_bytes(recorder.path.parent),
        recorder is None,
        tee.unshown,
        tuple(tee.gone.values()),
        shown.silent_s(now_ns),
    )


def _free_bytes(folder: Path) -> int | None:
    try:
        return shutil.disk_usage(folder).free
    except OSError:  # a folder that was renamed; that is said elsewhere
        return None
