"""A recording session: ports opened, sensors heard, bytes kept, and the run file built at the end.

The reading thread brings bytes; they go to the recorder as they are and into a queue, from which the session's own
thread decodes them for the progress line. What the session shows is what the recorder has acknowledged.
"""

from __future__ import annotations

import queue
import shutil
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

import numpy as np

from acquisition.block import Block, Flag
from acquisition.calibration import Calibration, StillPoint, against_ruler, from_still
from acquisition.chain import SensorChain
from acquisition.clock import Clock
from acquisition.decoders.base import Family, Polled
from acquisition.decoders.registry import describe_bytes
from acquisition.wired import Line, PortReader, Transport
from pipeline.streaming import LiveMotion, MotionAccumulator, NotYet
from springmass import __version__
from springmass.errors import SENSOR, USAGE, ProgramError
from springmass.reads import Read, Tee, drained, joined_reads
from storage.recorder import Recorder, RecorderStatus
from storage.recover import run_paths
from storage.wire_layout import LogHeader, SensorEntry

__all__ = ["Progress", "Sensor", "Session", "Trigger"]

HEAR_S = 3.0  # silence longer than this before a run is no sensor
BYTES_PER_READ = 64  # log bytes a reading takes, for the look at the disk


@dataclass(frozen=True, slots=True)
class Sensor:
    """One sensor of a session.

    Parameters
    ----------
    family : Family
    transport : Transport
        Open.
    rate_hz : float or None
        Readings per second it is set to; None: the family's.
    options : mapping
        Of the decoder.
    calibration : Calibration
    baud : int
    """

    family: Family
    transport: Transport
    rate_hz: float | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    calibration: Calibration = field(default_factory=Calibration)
    baud: int = 0


@dataclass(frozen=True, slots=True)
class Trigger:
    """When to start recording.

    Parameters
    ----------
    threshold_m : float
        The first sensor's distance must leave its rest position by more than this, m.
    keep_s : float
        Seconds from before that moment that belong to the run.
    """

    threshold_m: float
    keep_s: float = 2.0


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
        Returns the first sensor's motion, LiveMotion or NotYet; costs milliseconds, so it is asked only to be shown.
    status : RecorderStatus
    disk_free_bytes : int or None
        Left on the disk that the log lies on; None before there is a log.
    waiting : bool
        Whether the trigger has not come yet.
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


class Session:
    """Records one run.

    Parameters
    ----------
    sensors : sequence of Sensor
    clock : Clock
        The system's.
    kind : {"live", "simulated"}
    scene : mapping, optional
        Tables, stored with the run.
    title : str
    """

    def __init__(
        self,
        sensors: Sequence[Sensor],
        clock: Clock,
        *,
        kind: str = "live",
        scene: Mapping[str, Any] | None = None,
        title: str = "",
    ) -> None:
        self.sensors = list(sensors)
        self._clock = clock
        self._kind = kind
        self._scene = scene
        self._title = title
        self._askers = {
            i: cast(Polled, sensor.family.decoder(**sensor.options))
            for i, sensor in enumerate(self.sensors)
            if sensor.family.poll is not None
        }
        self._tee = Tee(self._askers)
        self._chains = [self._chain(sensor) for sensor in self.sensors]
        self._reader: PortReader | None = None
        self._heard = [bytearray() for _ in self.sensors]
        self._gone: dict[int, str] = {}
        self._samples = self._missing = 0
        self._recent: deque[int] = deque(maxlen=4096)
        first = self._chains[0]
        self._live = MotionAccumulator(first.timebase.rate_hz)

    def listen(self) -> None:
        """Start reading, and return when every sensor has been heard.

        Raises
        ------
        ProgramError
            With exit code 4 after three seconds: silence, or bytes of another kind (it says what they look like).
        """
        lines = [
            Line(sensor.transport, i, sensor.family.poll, self._askers.get(i)) for i, sensor in enumerate(self.sensors)
        ]
        self._reader = PortReader(lines, self._tee, self._clock)
        self._reader.start()
        heard = [0] * len(self.sensors)
        # A slow sensor takes several of its own periods to be told from silence.
        slowest = min(chain.timebase.rate_hz for chain in self._chains)
        deadline = self._clock.now_ns() + int(max(HEAR_S, 5.0 / slowest) * 1e9)
        while not all(count >= 3 for count in heard):
            if self._clock.now_ns() > deadline:
                mute = next(i for i, count in enumerate(heard) if count < 3)
                self.stop()
                raise ProgramError(self._not_heard(mute), SENSOR)
            for channel, block in self.poll(0.05):
                heard[channel] += len(block)

    def still(self, seconds: float = 3.0) -> StillPoint:
        """Return rest position and noise of the first sensor's next seconds, the bob hanging still."""
        self.poll(0.0)  # what came before is another rest, or none
        distances: list[np.ndarray[Any, Any]] = []
        end = self._clock.now_ns() + int(seconds * 1e9)
        while self._clock.now_ns() < end:
            distances += [block.distance for channel, block in self.poll(0.05) if channel == 0]
        return from_still(np.concatenate(distances) if distances else np.empty(0))

    def calibrate(self, points: Sequence[StillPoint], known_m: Sequence[float], u_known_m: float) -> StillPoint:
        """Carry still distances of the first sensor to known ones; return the last of them as it is now stated.

        One known distance sets the offset, two or more the scale as well.
        """
        before = self.sensors[0].calibration
        calibration = against_ruler(tuple(points), tuple(known_m), u_known_m, before)
        self.sensors[0] = replace(self.sensors[0], calibration=calibration)
        self._chains[0].calibration = calibration
        return calibration.restated(points[-1], before)

    def record(
        self,
        log: Path,
        *,
        seconds: float | None,
        trigger: Trigger | None = None,
        rest: StillPoint | None = None,
        progress: Callable[[Progress], None] = lambda _: None,
        marks: queue.SimpleQueue[str] | None = None,
    ) -> RecorderStatus:
        """Record until the seconds are over or Ctrl-C; the log is closed cleanly either way.

        Parameters
        ----------
        log : Path
            The wire log to make.
        seconds : float or None
            How long; None: until Ctrl-C.
        trigger : Trigger, optional
            Left out, it starts at once.
        rest : StillPoint, optional
            What the trigger measures from; left out, the distance when it began to wait.
        progress : callable
            Called about once a second.
        marks : queue of str, optional
            Marks to put into the run.

        Raises
        ------
        storage.errors.WriteFailed
            If the disk refused; the log holds what came before.
        """
        if trigger is not None and any(sensor.options.get("temperature_every") for sensor in self.sensors):
            raise ProgramError(
                "--trigger keeps replies from before, which cannot be told from temperatures; "
                "leave --option temperature_every out",
                USAGE,
            )
        before = None if trigger is None else self._wait_for(trigger, rest, progress)
        # Chains start anew, so that indices and times count from the run's first byte as recovery will count them.
        self._chains = [self._chain(sensor) for sensor in self.sensors]
        self._samples = self._missing = 0
        self._live.clear()
        recorder = Recorder(log, self._header(), self._clock)
        start_ns = self._clock.now_ns()
        try:
            for item in self._tee.start(recorder, before):
                self._decode(item)
            if rest is not None:
                recorder.event(0, start_ns, "still", {"rest_m": rest.rest_m, "noise_m": rest.noise_m})
            if trigger is not None:
                recorder.event(0, start_ns, "trigger", {"threshold_m": trigger.threshold_m, "keep_s": trigger.keep_s})
            self._loop(recorder, start_ns, seconds, progress, marks)
        finally:
            self._tee.stop()
            recorder.close()
        return recorder.status

    def poll(self, wait_s: float) -> list[tuple[int, Block]]:
        """Wait so long, then return the blocks that came since the last call."""
        blocks: list[tuple[int, Block]] = []
        for item in self._items(wait_s):
            block = self._decode(item)
            if block is not None and len(block):
                blocks.append((item.channel, block))
        return blocks

    def stop(self) -> None:
        """Stop reading and close the ports."""
        if self._reader is not None:
            reader, self._reader = self._reader, None
            reader.stop()

    def _loop(
        self,
        recorder: Recorder,
        start_ns: int,
        seconds: float | None,
        progress: Callable[[Progress], None],
        marks: queue.SimpleQueue[str] | None,
    ) -> None:
        end_ns = None if seconds is None else start_ns + int(seconds * 1e9)
        next_ns = start_ns + 1_000_000_000
        while end_ns is None or self._clock.now_ns() < end_ns:
            self.poll(0.1)
            if recorder.status.error:
                return  # close() raises it; what was recorded stands
            while marks is not None and not marks.empty():
                recorder.mark(marks.get())
            now = self._clock.now_ns()
            if now >= next_ns:
                next_ns += 1_000_000_000
                free = shutil.disk_usage(recorder.path.parent).free
                progress(self._progress((now - start_ns) * 1e-9, recorder.status, free))

    def _wait_for(self, trigger: Trigger, rest: StillPoint | None, progress: Callable[[Progress], None]) -> list[Read]:
        """Wait until the bob moves; return the reads of the seconds before that."""
        kept: deque[Read] = deque()
        middle = rest.rest_m if rest is not None else None
        start_ns = next_ns = self._clock.now_ns()
        while True:
            self._clock.sleep_until_ns(self._clock.now_ns() + 50_000_000)
            items = self._reads()
            for number, item in enumerate(items):
                if item.data:
                    kept.append(item)
                while kept and item.host_ns - kept[0].host_ns > trigger.keep_s * 1e9:
                    kept.popleft()
                block = self._decode(item)
                known = block.distance[np.isfinite(block.distance)] if block is not None and item.channel == 0 else ()
                for distance in known:
                    middle = float(distance) if middle is None else middle
                    if abs(distance - middle) > trigger.threshold_m:
                        return [*kept, *items[number + 1 :]]
            now = self._clock.now_ns()
            if now >= next_ns:
                next_ns += 1_000_000_000
                progress(self._progress((now - start_ns) * 1e-9, None, None))

    def _items(self, wait_s: float) -> list[Read]:
        # Not woken by every read: a hundred wake-ups a second would cost more than all the rest.
        self._clock.sleep_until_ns(self._clock.now_ns() + int(wait_s * 1e9))
        return joined_reads(self._reads(), [chain.family.has_device_time for chain in self._chains])

    def _reads(self) -> list[Read]:
        """What came since the last call; raises what ended the reading, if anything did."""
        if self._reader is not None and self._reader.failure is not None:
            raise self._reader.failure
        return drained(self._tee.items)

    def _decode(self, item: Read) -> Block | None:
        chain = self._chains[item.channel]
        if item.event:
            chain.lost()
            if item.event == "lost":
                self._gone[item.channel] = str(item.facts.get("why", ""))
            return None
        heard = self._heard[item.channel]
        if len(heard) < 4096:
            heard += item.data
        block = chain.feed(item.host_ns, item.data)
        self._samples += len(block)
        self._missing += int(np.count_nonzero(block.flags & np.uint8(Flag.MISSING)))
        if item.channel == 0 and len(block):
            self._live.push(block.t, block.distance, block.flags)
            self._recent.extend([item.host_ns] * len(block))
        return block

    def _progress(self, seconds: float, status: RecorderStatus | None, free: int | None) -> Progress:
        now = self._clock.now_ns()
        rate = sum(1 for stamp in self._recent if now - stamp <= 1_000_000_000)
        gaps = sum(len(chain.timebase.gaps) for chain in self._chains)
        motion = self._live.value
        return Progress(seconds, self._samples, self._missing, gaps, rate, motion, status, free, status is None)

    def _chain(self, sensor: Sensor) -> SensorChain:
        return SensorChain(
            sensor.family, options=sensor.options, rate_hz=sensor.rate_hz, calibration=sensor.calibration
        )

    def _header(self) -> LogHeader:
        entries = tuple(
            SensorEntry(
                i,
                sensor.family.name,
                sensor.transport.name,
                sensor.baud,
                sensor.rate_hz,
                dict(sensor.options),
                sensor.calibration.to_mapping(),
            )
            for i, sensor in enumerate(self.sensors)
        )
        return LogHeader(
            sensors=entries,
            mono_ns=self._clock.now_ns(),
            unix_ns=int(datetime.now(UTC).timestamp() * 1e9),
            kind=self._kind,  # type: ignore[arg-type]
            scene=self._scene,
            title=self._title,
            version=__version__,
        )

    def _not_heard(self, channel: int) -> str:
        if channel in self._gone:
            return f"{self._gone[channel]}; is a sensor connected, and is this its port?"
        sensor, heard = self.sensors[channel], bytes(self._heard[channel])
        what = describe_bytes(heard) if heard else "not a byte came; is the sensor powered, its line on the right pin?"
        return (
            f"{sensor.transport.name}: a {sensor.family.name} sensor at {sensor.baud} baud was expected, {what}; "
            "see `springmass sensors` for --sensor and --baud"
        )


def demand_new(path: Path, sensors: int) -> None:
    """Refuse to record over anything: the log, and the run file or those of several sensors.

    Raises
    ------
    ProgramError
        With exit code 2 if the run file or its log exists.
    """
    for there in dict.fromkeys((path, path.with_suffix(".wire"), *run_paths(path, range(sensors)))):
        if there.exists():
            raise ProgramError(
                f"{there}: exists already, and a recording never replaces one; choose another name", USAGE
            )
