"""A recording session: ports opened, sensors heard, bytes kept, and the run file built at the end.

The reading thread brings bytes; they go to the recorder as they are, and then through the decoders. The session's own
thread looks for marks five times a second, where they can be typed, and at the samples once.
"""

from __future__ import annotations

import math
import queue
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.block import Block
from acquisition.clock import Clock
from acquisition.live.calibration import StillPoint, against_ruler, from_still
from acquisition.live.reader import PortReader
from springmass import __version__
from springmass.errors import SENSOR, USAGE, ProgramError
from springmass.session.progress import SECOND_NS, Progress, Shown
from springmass.session.reads import Tee
from springmass.session.sensors import Sensor
from springmass.session.trigger import Trigger, Watch
from storage.recorder import Recorder, RecorderStatus
from storage.recover import run_paths
from storage.wire_log.records import LogHeader

__all__ = ["Progress", "Sensor", "Session", "Trigger"]

HEAR_S = 3.0  # silence longer than this before a run is no sensor
LOOK_FOR_MARKS_S, LOOK_FOR_TRIGGER_S = 0.2, 0.05
BYTES_PER_READ = 64  # log bytes a reading takes, for the look at the disk


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
        self._chains = [sensor.chain() for sensor in self.sensors]
        self._tee = Tee(self._chains)
        self._reader: PortReader | None = None
        self._shown = Shown(self._chains[0].timebase.rate_hz)

    def listen(self) -> None:
        """Start reading, and return when every sensor has been heard.

        Raises
        ------
        ProgramError
            With exit code 4 after three seconds: silence, or bytes of another kind (it says what they look like).
        """
        lines = [self._tee.line(channel, sensor) for channel, sensor in enumerate(self.sensors)]
        self._reader = PortReader(lines, self._tee, self._clock)
        self._reader.start()
        heard = [0] * len(self.sensors)
        # A slow sensor takes several of its own periods to be distinguished from silence.
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
        self.poll(0.0)  # what was decoded with the calibration before
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
        since_ns = self._clock.now_ns() if trigger is None else self._wait_for(trigger, rest, progress)
        # Chains start anew, so that indices and times count from the run's first byte as recovery will count them.
        self._chains = [sensor.chain() for sensor in self.sensors]
        self._shown.clear()
        recorder = Recorder(log, self._header(), self._clock)
        start_ns = self._clock.now_ns()
        try:
            self._tee.start(recorder, self._chains, since_ns)
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
        self._wait_until(self._clock.now_ns() + int(wait_s * 1e9))
        return self._look()

    def _look(self) -> list[tuple[int, Block]]:
        blocks = self._tee.blocks()
        self._shown.push(blocks)
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
        # Without marks a turn a second will do: the samples are shown once a second, and an error of the disk stands.
        turn_s = 1.0 if marks is None else LOOK_FOR_MARKS_S
        for _ in self._turns(turn_s, progress, recorder, start_ns, end_ns):
            if recorder.status.error:
                return  # close() raises it; what was recorded stands
            while marks is not None and not marks.empty():
                recorder.mark(marks.get())

    def _wait_for(self, trigger: Trigger, rest: StillPoint | None, progress: Callable[[Progress], None]) -> int:
        """Wait until the bob moves; return the host's time from which on reads belong to the run."""
        watch = Watch(trigger, math.nan if rest is None else rest.rest_m)
        keep_ns = int(trigger.keep_s * 1e9)
        self._tee.keep()
        turns = self._turns(LOOK_FOR_TRIGGER_S, progress, None, self._clock.now_ns(), None)
        while True:
            for channel, block in next(turns):
                moment_ns = watch.moment_ns(block) if channel == 0 else None
                if moment_ns is not None:
                    return moment_ns - keep_ns
            # A second more than asked for: samples may lie a moment before they are looked at.
            self._tee.forget(self._clock.now_ns() - keep_ns - SECOND_NS)

    def _wait_until(self, deadline_ns: int) -> None:
        """Wait; raise what ended the reading, if anything did."""
        self._clock.sleep_until_ns(deadline_ns)
        if self._reader is not None and self._reader.failure is not None:
            raise self._reader.failure

    def _turns(
        self,
        wait_s: float,
        progress: Callable[[Progress], None],
        recorder: Recorder | None,
        start_ns: int,
        end_ns: int | None,
    ) -> Iterator[list[tuple[int, Block]]]:
        """Wait in turns until the end, if there is one, and show the progress once a second.

        Gives the samples of each turn; while recording those of each second, for nobody needs them before.
        """
        wait_ns, tick_ns = int(wait_s * 1e9), start_ns + SECOND_NS
        while end_ns is None or self._clock.now_ns() < end_ns:
            turn_ns = min(self._clock.now_ns() + wait_ns, tick_ns, tick_ns if end_ns is None else end_ns)
            self._wait_until(turn_ns)
            if turn_ns == end_ns:
                self._tee.stop()  # what comes while the last line is worked out is no part of the run
            yield self._look() if recorder is None or turn_ns == tick_ns else []
            if turn_ns == tick_ns:
                progress(self._progress((self._clock.now_ns() - start_ns) * 1e-9, recorder))
                tick_ns += SECOND_NS

    def _progress(self, seconds: float, recorder: Recorder | None) -> Progress:
        shown = self._shown
        return Progress(
            seconds,
            shown.samples,
            shown.missing,
            sum(len(chain.timebase.gaps) for chain in self._chains),
            shown.rate_hz(self._clock.now_ns()),
            partial(shown.motion, self._clock.now_ns()),
            None if recorder is None else recorder.status,
            None if recorder is None else shutil.disk_usage(recorder.path.parent).free,
            recorder is None,
            self._tee.unshown,
        )

    def _header(self) -> LogHeader:
        return LogHeader(
            sensors=tuple(sensor.entry(i) for i, sensor in enumerate(self.sensors)),
            mono_ns=self._clock.now_ns(),
            unix_ns=int(datetime.now(UTC).timestamp() * 1e9),
            kind=self._kind,  # type: ignore[arg-type]
            scene=self._scene,
            title=self._title,
            version=__version__,
        )

    def _not_heard(self, channel: int) -> str:
        if channel in self._tee.gone:
            return f"{self._tee.gone[channel]}; is a sensor connected, and is this its port?"
        return self.sensors[channel].not_heard(self._tee.heard(channel))


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
