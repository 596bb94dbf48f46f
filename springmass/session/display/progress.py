"""The state of a recording shown while it runs: counts, rate and the first sensor's motion."""

from __future__ import annotations

import enum
import math
import shutil
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquisition.block import I8, Block, Flag
from acquisition.decoders.family import Family
from acquisition.live.decoding import SensorChain
from pipeline.options import options_for
from pipeline.streaming import LiveMotion, MotionAccumulator, NotYet
from pipeline.track import F8
from springmass.session.display.memory import demand_room
from springmass.session.failures import Failures
from springmass.session.reads import Tee
from storage.recorder import Recorder, RecorderStatus

__all__ = ["LiveState", "Progress", "Trouble", "TroubleKind", "progress_of"]

SECOND_NS = 1_000_000_000
USELESS_S = 0.8
"""Time in s after which a lack of targets or of changes is a trouble; the display's first turn can report it."""
RECENT_S = 10.0
FIRST_SAMPLES = 1000
"""Number of samples whose timestamps define t = 0, as in the run file; later ones would add the clocks' difference."""
MOTION_EVERY_NS = 1_900_000_000
"""Interval between analyses of the motion, about two progress lines or one swing; each takes a few milliseconds."""


class TroubleKind(enum.Enum):
    """The kind of fault that makes readings useless."""

    NO_TARGET = enum.auto()
    """The sensor hears no echo."""
    UNCHANGED = enum.auto()
    """The distance does not change."""
    SENSOR_FAULT = enum.auto()
    """The sensor itself reports a fault."""


@dataclass(frozen=True, slots=True)
class Trouble:
    """The reason why a sensor's readings are useless.

    Parameters
    ----------
    kind : TroubleKind
    text : str
        Message for the user: what is wrong, and what to check.
    channel : int or None
        Channel of the sensor if there are several.
    """

    kind: TroubleKind
    text: str
    channel: int | None = None


@dataclass(frozen=True, slots=True)
class Progress:
    """The state of a recording for one line of progress.

    Parameters
    ----------
    seconds : float
        Time since the recording began, s.
    samples, missing, gaps : int
        Numbers of samples, missing values and gaps of all sensors.
    rate_hz : float
        Number of samples from the first sensor in the last second.
    motion : callable
        Returns the first sensor's motion, LiveMotion or NotYet. A call takes milliseconds, so it is made only for
        display, and its result is reused for about two seconds.
    status : RecorderStatus
    disk_free_bytes : int or None
        Free space on the disk with the log; None before there is a log.
    waiting : bool
        Whether the recording is still waiting for its trigger.
    unshown : int
        Number of samples that arrived too fast to be shown; they are in the run file.
    gone : sequence of str
        Reasons for lost ports that have not come back.
    silent_s : float
        Time since the first sensor's last reading, s.
    missing_share : float
        Fraction of missing values in the first sensor's latest block.
    trouble : Trouble or None
        Trouble of the first sensor in channel order that has one.
    latest : callable
        Returns times in s and distances in m, each (n,), of the first sensor's last ten seconds.
    marks : sequence of (float, str)
        Times of the marks so far, in s on the run's time scale, and their texts, as in the run file and on the page.
    tick : bool
        Whether this is the regular update once a second; otherwise it shows the start or a new mark.
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
    missing_share: float = 0.0
    trouble: Trouble | None = None
    latest: Callable[[], tuple[F8, F8]] = lambda: (np.empty(0), np.empty(0))
    marks: Sequence[tuple[float, str]] = ()
    tick: bool = True


class Usefulness:
    """Checks whether a sensor's readings are usable, for the most common faults at a bench."""

    def __init__(self) -> None:
        self.usable = 0
        self._last = math.nan
        self._end = self._missing_since = self._same_since = math.nan

    def push(self, block: Block) -> None:
        """Take samples."""
        if not len(block):
            return
        known = np.isfinite(block.distance)
        self.usable += int(np.count_nonzero(known))
        self._end = float(block.t[-1])
        if known.any():
            behind = int(np.flatnonzero(known)[-1]) + 1
            self._missing_since = float(block.t[behind]) if behind < len(block) else math.nan
            distance = block.distance[known]
            changed = np.flatnonzero(np.diff(distance, prepend=self._last) != 0.0)  # the first differs from NaN
            if changed.size:
                self._same_since = float(block.t[known][changed[-1]])
            self._last = float(distance[-1])
        elif math.isnan(self._missing_since):
            self._missing_since = float(block.t[0])

    def trouble(self, family: Family) -> Trouble | None:
        """Return the trouble and what to check; None if there is no trouble."""
        near, far = family.range_m
        if self._end - self._missing_since >= USELESS_S:
            return Trouble(
                TroubleKind.NO_TARGET,
                f"no target for {self._end - self._missing_since:.0f} s: check that the bob hangs over the sensor, "
                f"{near:g} to {far:g} m away, and that the sensor points at it",
            )
        if self._end - self._same_since >= USELESS_S:
            return Trouble(
                TroubleKind.UNCHANGED,
                f"{self._last * 1e3:.1f} mm unchanged for {self._end - self._same_since:.0f} s: "
                "does the bob hang still, or does something fixed stand in the beam?",
            )
        return None


class LiveState:
    """The state derived from the samples so far.

    Parameters
    ----------
    rate_hz : float
        Nominal rate of the first sensor.

    Attributes
    ----------
    zero_ns : int or None
        Host time at the run's t = 0, ns; None before the first sample.
    """

    def __init__(self, rate_hz: float) -> None:
        self.samples = self.missing = 0
        self._rate_hz = rate_hz
        self._has_room = False
        self.useful: dict[int, Usefulness] = {}
        self.zero_ns: int | None = None
        self._early = 0
        self._begin(0)

    def _begin(self, channel: int) -> None:
        self._channel = channel
        # The fast tier takes a third of the time of the standard tier used for the run; period and amplitude agree.
        self._motion = MotionAccumulator(self._rate_hz, options=options_for("fast"))
        self._found: LiveMotion | NotYet = NotYet("no samples so far")
        self._found_ns = 0
        self._recent: deque[tuple[F8, F8]] = deque()
        self._missing_share = 0.0
        self._stamps: deque[I8] = deque()
        self._last_ns: int | None = None

    def follow(self, channel: int) -> None:
        """Show the motion of a different channel from now on: that of the sensor that came back on the first port."""
        if channel != self._channel:
            self.useful.pop(self._channel, None)
            self._begin(channel)

    def push(self, blocks: Iterable[tuple[int, Block]]) -> None:
        """Take blocks of samples by channel."""
        for channel, block in blocks:
            self.samples += len(block)
            missing = int(np.count_nonzero(block.flags & np.uint8(Flag.MISSING)))
            self.missing += missing
            self.useful.setdefault(channel, Usefulness()).push(block)
            if channel == self._channel and len(block):
                self._missing_share = missing / len(block)
                self._recent.append((block.t, block.distance))
                while self._recent[0][0][-1] < block.t[-1] - RECENT_S:
                    self._recent.popleft()
                self._motion.push(block.t, block.distance, block.flags)
                if block.host_ns is not None and len(block):
                    if channel == 0 and self._early < FIRST_SAMPLES:
                        # A timestamp may be late but never early.
                        zero_ns = int((block.host_ns - 1e9 * block.t)[: FIRST_SAMPLES - self._early].min())
                        self.zero_ns = zero_ns if self.zero_ns is None else min(zero_ns, self.zero_ns)
                        self._early += len(block)
                    self._stamps.append(block.host_ns)
                    self._last_ns = int(block.host_ns[-1])

    def motion(self, now_ns: int) -> LiveMotion | NotYet:
        """Return the first sensor's motion, calculated again if the last result is old enough."""
        if not self._has_room:
            demand_room()
            self._has_room = True
        if isinstance(self._found, NotYet) or now_ns - self._found_ns >= MOTION_EVERY_NS:
            self._found, self._found_ns = self._motion.value(), now_ns
        return self._found

    @property
    def missing_share(self) -> float:
        """Fraction of missing values in the first sensor's latest block."""
        return self._missing_share

    def latest(self) -> tuple[F8, F8]:
        """Return times in s and distances in m, each (n,), of the first sensor's last ten seconds."""
        if not self._recent:
            return np.empty(0), np.empty(0)
        t, distance = zip(*self._recent, strict=True)
        return np.concatenate(t), np.concatenate(distance)

    def silent_s(self, now_ns: int) -> float:
        """Return the time since the first sensor's last reading, s; 0 before the first reading."""
        return 0.0 if self._last_ns is None else (now_ns - self._last_ns) * 1e-9

    def rate_hz(self, now_ns: int) -> int:
        """Return the number of samples received from the first sensor in the last second."""
        since = now_ns - SECOND_NS
        while self._stamps and self._stamps[0][-1] < since:
            self._stamps.popleft()
        return sum(int(np.count_nonzero(stamps >= since)) for stamps in self._stamps)


def progress_of(
    shown: LiveState,
    failures: Failures,
    chains: Sequence[SensorChain],
    tee: Tee,
    recorder: Recorder | None,
    start_ns: int,
    now_ns: int,
    marks: Sequence[tuple[int, str]] = (),
    *,
    tick: bool = True,
) -> Progress:
    """Return the progress of a recording; without a recorder, the recording is waiting for its trigger."""

    def motion() -> LiveMotion | NotYet:
        """Return the motion, or the reason why its calculation failed; the rest of the line is not affected."""
        try:
            return shown.motion(now_ns)
        except BaseException as error:
            failures.note("analysis", error)
            return NotYet(f"no motion shown ({type(error).__name__})")

    shown.follow(tee.first)
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
        shown.missing_share,
        _trouble(shown, chains, waiting=recorder is None),
        shown.latest,
        [((host_ns - (start_ns if shown.zero_ns is None else shown.zero_ns)) * 1e-9, text) for host_ns, text in marks],
        tick,
    )


def _trouble(shown: LiveState, chains: Sequence[SensorChain], *, waiting: bool) -> Trouble | None:
    """Return the trouble of the first sensor in channel order that has one."""
    for channel, useful in sorted(shown.useful.items()):
        trouble = useful.trouble(chains[channel].family)
        if trouble is not None and (complaint := chains[channel].status.complaint):
            trouble = Trouble(TroubleKind.SENSOR_FAULT, complaint)
        # While the trigger waits, the bob is expected to hang still.
        if trouble is not None and not (waiting and trouble.kind is TroubleKind.UNCHANGED):
            return trouble if len(chains) == 1 else replace(trouble, channel=channel)
    return None


def _free_bytes(folder: Path) -> int | None:
    try:
        return shutil.disk_usage(folder).free
    except OSError:  # the folder was renamed, which is reported elsewhere
        return None
