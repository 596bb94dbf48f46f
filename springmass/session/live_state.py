"""The state of a recording shown while it runs: counts, rate and the first sensor's motion."""

from __future__ import annotations

import enum
import functools
import math
import mmap
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from acquisition.block import Block, Flag
from acquisition.decoders.sensor import Sensor
from acquisition.live.decoding import SensorChain
from springmass.runs.rolling import NotYet, Rolling
from storage.recorder import RecorderStatus
from storage.wire_log.wire_samples import Origin

if TYPE_CHECKING:
    from springmass.runs.run import Run

SECOND_NS = 1_000_000_000
USELESS_S = 0.8
"""Time in s after which a lack of targets or of changes is a trouble; the display's first turn can report it."""
ROOM_BYTES = 512 << 20
"""Address space for the analysis: 230 MiB was measured on two cores, and each further core takes about 40 MiB."""


class TroubleKind(enum.Enum):
    """The kind of fault that makes readings useless."""

    NO_TARGET = enum.auto()
    UNCHANGED = enum.auto()
    SENSOR_FAULT = enum.auto()


@dataclass(frozen=True, slots=True)
class Trouble:
    """Why a sensor's readings are useless, and what to check."""

    kind: TroubleKind
    text: str


@dataclass(frozen=True, slots=True)
class Progress:
    """The state of a recording for one line of progress."""

    seconds: float
    missing: int  # of all sensors, as are the gaps
    gaps: int
    rate_hz: float  # samples from the first sensor in the last second
    motion: Callable[[], Run | NotYet]  # of the first sensor's last seconds; it takes milliseconds
    status: RecorderStatus | None  # None: it waits for its trigger
    disk_free_bytes: int | None
    unshown: int  # samples that arrived too fast to be shown; they are in the run file
    gone: Sequence[str]  # why ports were lost that have not come back
    silent_s: float  # since the first sensor's last reading
    trouble: Trouble | None
    marks: Sequence[tuple[float, str]]  # on the run's time scale, as in the run file and on the page
    tick: bool = True  # whether this is the regular update, and not the start or a new mark


class Usefulness:
    """Checks whether a sensor's readings are usable, for the most common faults at a bench."""

    def __init__(self) -> None:
        self.usable = 0
        self._last = math.nan
        self._end = self._target = self._change = math.nan  # times of the last sample, distance and change of it

    def push(self, block: Block) -> None:
        """Take samples."""
        if not len(block):
            return
        if math.isnan(self._end):
            self._target = self._change = float(block.t[0])
        self._end = float(block.t[-1])
        if (measured := np.isfinite(block.distance)).any():
            t, distance = block.t[measured], block.distance[measured]
            self.usable += t.size
            self._target = float(t[-1])
            changed = np.flatnonzero(np.diff(distance, prepend=self._last))  # the first differs from NaN
            if changed.size:
                self._change = float(t[changed[-1]])
            self._last = float(distance[-1])

    def trouble(self, family: Sensor) -> Trouble | None:
        """Return the trouble and what to check; None if there is no trouble."""
        (near, far), missing_s, same_s = family.range_m, self._end - self._target, self._end - self._change
        if missing_s >= USELESS_S:
            return Trouble(
                TroubleKind.NO_TARGET,
                f"no target for {missing_s:.0f} s: check that the bob hangs over the sensor, "
                f"{near:g} to {far:g} m away, and that the sensor points at it",
            )
        if same_s >= USELESS_S:
            return Trouble(
                TroubleKind.UNCHANGED,
                f"{self._last * 1e3:.1f} mm unchanged for {same_s:.0f} s: "
                "does the bob hang still, or does something fixed stand in the beam?",
            )
        return None


class LiveState:
    """The state derived from the samples so far; ``origin`` is the host time at the run's t = 0.

    ``rolling`` makes the rolling analysis of a channel.
    """

    def __init__(self, rolling: Callable[[int], Rolling]) -> None:
        self.missing = 0
        self.useful: dict[int, Usefulness] = {}
        self.origin = Origin()
        self._rolling, self._channel, self._motion = rolling, 0, rolling(0)

    def follow(self, channel: int) -> None:
        """Show the motion of a different channel from now on: that of the sensor that came back on the first port."""
        if channel != self._channel:
            self.useful.pop(self._channel, None)
            self._channel, self._motion = channel, self._rolling(channel)

    def push(self, blocks: Iterable[tuple[int, Block]]) -> None:
        """Take blocks of samples by channel."""
        for channel, block in blocks:
            self.missing += int(np.count_nonzero(block.flags & np.uint8(Flag.MISSING)))
            self.useful.setdefault(channel, Usefulness()).push(block)
            if channel != self._channel or not len(block):
                continue
            self._motion.push(block)
            if channel == 0:
                self.origin.push(block)

    def motion(self) -> Run | NotYet:
        """Return the run of the first sensor's last seconds, or why there is none yet."""
        demand_room()
        return self._motion.latest()

    def silent_s(self, now_ns: int) -> float:
        """Return the time since the first sensor's last reading, s; 0 before the first reading."""
        host_ns = self._motion.host_ns
        return (now_ns - int(host_ns[-1])) * 1e-9 if host_ns.size else 0.0

    def rate_hz(self, now_ns: int) -> int:
        """Return the number of samples received from the first sensor in the last second."""
        return int(np.count_nonzero(self._motion.host_ns >= now_ns - SECOND_NS))


@functools.cache
def demand_room() -> None:
    """Raise MemoryError if the libraries of the analysis would not find memory, which would block or end the process.

    Under ``ulimit -v`` of 500, 600 and 800 MiB a recording without this check hangs when the libraries are loaded, and
    with it ends with its run file. The memory is requested as one private block, because a limit on a program's data
    ignores shared memory, and released untouched.
    """
    private = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS} if hasattr(mmap, "MAP_PRIVATE") else {}
    try:
        mmap.mmap(-1, ROOM_BYTES, **private).close()
    except OSError as error:
        raise MemoryError(f"{ROOM_BYTES >> 20} MiB are not available") from error


def trouble_of(shown: LiveState, chains: Sequence[SensorChain], *, waiting: bool) -> Trouble | None:
    """Return the trouble of the first sensor in channel order that has one."""
    for channel, useful in sorted(shown.useful.items()):
        trouble = useful.trouble(chains[channel].family)
        if trouble is not None and (complaint := chains[channel].status.complaint):
            trouble = Trouble(TroubleKind.SENSOR_FAULT, complaint)
        # While the trigger waits, the bob is expected to hang still.
        if trouble is not None and not (waiting and trouble.kind is TroubleKind.UNCHANGED):
            return trouble if len(chains) == 1 else replace(trouble, text=f"sensor {channel}: {trouble.text}")
    return None


def free_bytes(folder: Path) -> int | None:
    """Return the free space of a folder's disk; None if the folder was renamed, which is reported elsewhere."""
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return None
