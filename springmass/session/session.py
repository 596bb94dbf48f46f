"""Run a recording session: listen to the sensors on open ports, and record their bytes until the end.

The reading thread passes bytes unchanged to the recorder, and then through the decoders. The session's own thread waits
for the end and puts marks into the run. The displayed values are calculated on a separate thread, which
takes samples once a second. It cannot delay or end the other two threads, not even by an exception.
"""

from __future__ import annotations

import contextlib
import math
import queue
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.block import Block
from acquisition.clock import Clock
from acquisition.decoders.registry import is_text
from acquisition.events import Noted, RunEnded, Triggered, Zeroed
from acquisition.live.calibration import StillPoint, against_ruler, from_still
from acquisition.live.reader import PortLine, PortReader
from springmass import __version__
from springmass.errors import SENSOR, ProgramError
from springmass.loading.options import AnalysisOptions
from springmass.runs.rolling import FEWEST, NotYet, Rolling, live_run
from springmass.session.failures import Failures, Worker
from springmass.session.live_state import SECOND_NS, LiveState, Progress, free_bytes, trouble_of
from springmass.session.reads import Tee
from springmass.session.sensors import ANSWERED, OpenSensor, meeting
from springmass.session.trigger import Disarmed, Trigger, Watch
from springmass.stops import EndReason, Stops
from storage.errors import StorageError, WriteFailed
from storage.recorder import Recorder, RecorderStatus
from storage.schema import plain
from storage.wire_log.records import LogHeader
from storage.wire_log.scanning import LogContents

if TYPE_CHECKING:
    from springmass.runs.run import Run

U_RULER_M = 0.5e-3  # of a distance by a ruler
HEAR_S = 3.0  # silence before a run after which the sensor counts as absent
START_S = 12.0  # time that a board may take to start: Wi-Fi, calibration, a banner
HEARD = 3  # number of readings after which a sensor counts as heard
LOOK_FOR_MARKS_S, LOOK_FOR_TRIGGER_S = 0.2, 0.05
HELD_BLOCKS = 1000  # maximum number of blocks kept for the display before the run begins
BYTES_PER_READ = 64  # log bytes per reading, for the check of the disk space
SHOWN_S = 10.0  # duration of the samples whose period and amplitude the progress line shows
LIVE = AnalysisOptions(accuracy="fast")
"""The fast tier takes four fifths of the time of the standard tier, with which the run is analysed."""
MOTION_SHARE = 0.01
"""Share of a core for the shown motion, a new one every other second; a recording may take 3 % with all else."""

PortBlocks = Sequence[tuple[int, Block]]
Marks = queue.SimpleQueue[str | Noted]
"""Marks to put into a run, and notes about it."""


@dataclass(frozen=True, slots=True)
class RunLimits:
    """When a run starts and ends: by default at once, and by the user."""

    seconds: float | None = None
    trigger: Trigger | None = None
    rest: StillPoint | None = None  # from which the trigger measures; None: from the first distance


@dataclass(frozen=True, slots=True)
class RunListeners:
    """What is called during the recording of a run, and the queue of marks to put into it."""

    progress: Callable[[Progress], None] = lambda _: None  # about once a second, on a separate thread
    marks: Marks | None = None
    begun: Callable[[Path], None] = lambda _: None  # once reads are recorded in this log
    changed: Callable[[], bool] = lambda: False  # whether to stop waiting for the trigger


@dataclass(frozen=True, slots=True)
class Ended:
    """How a recording ended."""

    by: EndReason
    status: RecorderStatus
    log: LogContents  # available even if its path no longer leads to it
    absent: list[int]  # ports whose sensor was lost or silent at the end


class Session:
    """Records one run.

    ``failures`` has the failures that did not end the recording, ``recorder`` the recorder of the run once it has
    begun, and ``shown`` the state derived from the samples shown so far.
    """

    def __init__(
        self,
        sensors: Sequence[OpenSensor],
        clock: Clock,
        *,
        kind: str = "live",
        scene: Mapping[str, Any] | None = None,
        title: str = "",
        stops: Stops | None = None,
    ) -> None:
        self.failures = Failures()
        self.sensors = list(sensors)
        self.stops = stops or Stops()
        self.shown: LiveState | None = None
        self.recorder: Recorder | None = None
        self._clock, self._kind, self._scene, self._title = clock, kind, scene, title
        self._chains = [sensor.chain() for sensor in self.sensors]
        self._tee = Tee(self._chains, self.failures, self.sensors)
        self._reader: PortReader | None = None
        self._reader_failure: BaseException | None = None
        self._marks: list[tuple[int, str]] = []

    def listen(
        self, say: Callable[[str], None] = lambda _: None, wait_s: float | None = None, send: bytes = b""
    ) -> None:
        """Start reading, and wait until every sensor has been heard; ``say`` gets lines about what they are.

        A sensor that is not heard after 3 s, or after five periods of a slow sensor, raises a ProgramError that
        describes what was received instead. A board that sent nothing, or text, has 12 s to start up. With ``wait_s``
        every sensor has this time. ``send`` is sent each second until all are heard.
        """
        lines = [PortLine(x.port, port, x.family.poll, x.family.identify) for port, x in enumerate(self.sensors)]
        for each in lines:
            if each.greeting:
                each.port.write(each.greeting)
        self._reader = PortReader(lines, self._tee, self._clock)
        self._reader.start()
        # A slow sensor can be distinguished from silence only after several of its periods.
        slowest = min(chain.timebase.rate_hz for chain in self._chains)
        start_ns = send_ns = self._clock.now_ns()
        deadline = start_ns + int((wait_s or max(HEAR_S, 5.0 / slowest)) * 1e9)
        longest = deadline if wait_s else max(deadline, start_ns + int(START_S * 1e9))
        while self._waits_for_word() or any(chain.decoder.undecided for chain in self._chains):
            if send and self._clock.now_ns() >= send_ns and not all(self._tee.readings):
                send_ns += SECOND_NS
                for sensor in self.sensors:
                    sensor.port.write(send)
            if self._clock.now_ns() > deadline:
                if deadline < longest and (starting := self._starting()):
                    deadline = longest
                    say(f"{', '.join(starting)}: no reading yet; a board may need {START_S:g} s to start")
                    continue
                if (mute := next((i for i, count in enumerate(self._tee.readings) if count < HEARD), None)) is None:
                    break
                self._end_unheard(mute)
            self._wait_until(self._clock.now_ns() + 50_000_000)
        for channel, chain in enumerate(self._chains):
            if chain.decoder.refused:
                self._end_unheard(channel)
            if unit := chain.decoder.assumed_unit:
                port = self.sensors[channel].port.name
                say(f"{port}: no unit is printed, so the numbers are read as {unit}; add --option unit=mm if not")
            if (identity := chain.status.identity) is not None:
                sensor = self.sensors[channel]
                for line in meeting(sensor, identity):
                    say(line)
                self.sensors[channel] = replace(sensor, rate_hz=sensor.rate_hz or identity.settings.get("rate_hz"))

    def _waits_for_word(self) -> bool:
        """Return whether a sensor has not been heard yet, or may still report its identity."""
        return any(
            count < HEARD or (count < ANSWERED and sensor.family.identify and chain.status.identity is None)
            for count, sensor, chain in zip(self._tee.readings, self.sensors, self._chains, strict=True)
        )

    def _starting(self) -> list[str]:
        """Return the ports of sensors without a reading, if all of these may start up: they send nothing, or text."""
        mute = [port for port, count in enumerate(self._tee.readings) if count < HEARD]
        if any(port in self._tee.gone or self.sensors[port].family.poll is not None for port in mute):
            return []
        starts = all(not heard or is_text(heard) for heard in map(self._tee.heard, mute))
        return [self.sensors[port].port.name for port in mute if starts]

    def _end_unheard(self, channel: int) -> None:
        self.stop()
        if channel in self._tee.gone:
            raise ProgramError(self._tee.gone[channel], "is a sensor connected, and is this its port?", SENSOR)
        if channel in self._tee.shared:
            problem = f"{self.sensors[channel].port.name}: another program reads this port"
            raise ProgramError(problem, "close that program", SENSOR)
        raise self.sensors[channel].not_heard(self._tee.heard(channel))

    def still(self, seconds: float) -> StillPoint:
        """Return rest position and noise from the first sensor's next seconds, during which the bob must hang still."""
        self.poll(0.0)  # discard earlier samples, which belong to another rest position or to a motion
        distances: list[np.ndarray[Any, Any]] = []
        end = self._clock.now_ns() + int(seconds * 1e9)
        while self._clock.now_ns() < end:
            distances += [block.distance for channel, block in self.poll(0.05) if channel == 0]
        return from_still(np.concatenate(distances) if distances else np.empty(0))

    def calibrate(self, points: Sequence[StillPoint], known_m: Sequence[float]) -> StillPoint:
        """Calibrate the first sensor with distances by a ruler; return the last still point in the new calibration.

        One distance sets the offset; two or more also set the scale.
        """
        before = self.sensors[0].calibration
        calibration = against_ruler(tuple(points), tuple(known_m), U_RULER_M, before)
        self.sensors[0] = replace(self.sensors[0], calibration=calibration)
        self._chains[0].calibration = calibration
        self.poll(0.0)  # discard samples decoded with the earlier calibration
        return calibration.restated(points[-1], before)

    @property
    def lost(self) -> bool:
        """Whether every port is gone."""
        return len(self._tee.gone) == len(self.sensors)

    def now_ns(self) -> int:
        """Return the time of the clock in ns."""
        return self._clock.now_ns()

    def preview(self, log: Path) -> Recorder | None:
        """Write further reads to a preview log; if it cannot be created, record a failure and return None.

        The next preview, or the recording, replaces this log.
        """
        chains = [sensor.chain() for sensor in self.sensors]
        try:
            recorder = Recorder(log, self._header(), self._clock)
        except StorageError as error:
            self.failures.note("preview", error)
            return None
        self._chains = chains
        self._tee.start(recorder, chains, self._clock.now_ns(), preview=True)
        return recorder

    def record(self, log: Path, limits: RunLimits, listeners: RunListeners) -> Ended:
        """Record until the time is over, the user ends the recording, or the disk fails.

        Disarmed is raised if ``listeners.changed`` returned true during the wait for the trigger; a StorageError, if
        the log cannot be created, or cannot be read at the end.
        """
        trigger, rest = limits.trigger, limits.rest
        moment_ns = self._clock.now_ns() if trigger is None else self._wait_for(trigger, rest, listeners)
        since_ns = moment_ns if trigger is None else moment_ns - int(trigger.keep_s * 1e9)
        # New chains make indices and times count from the run's first byte, as in recovery.
        self._chains = [sensor.chain() for sensor in self.sensors]
        with self.stops.raising(False):
            recorder = self.recorder = Recorder(log, self._header(), self._clock)
            start_ns = self._clock.now_ns()
            telling = self.failures.told_to(lambda event: recorder.event(0, self._clock.now_ns(), event))
            with telling, self._display(listeners, start_ns, recorder) as show:
                try:
                    self._tee.start(recorder, self._chains, since_ns)
                    listeners.begun(recorder.path)
                    if rest is not None:
                        recorder.event(0, start_ns, Zeroed(rest_m=rest.rest_m, noise_m=rest.noise_m))
                    if trigger is not None:
                        event = Triggered(threshold_m=trigger.threshold_m, keep_s=trigger.keep_s)
                        # The time of the sample itself, because an analysis leaves out the rest before it.
                        recorder.event(0, moment_ns, event)
                    by = self._loop(recorder, show, start_ns, limits.seconds, listeners.marks)
                finally:
                    self._tee.stop()
                    end_ns = self._clock.now_ns()
            recorder.event(0, end_ns, RunEnded(by=by, failures=self.failures.counts or None))
            with contextlib.suppress(WriteFailed):  # the status states the error
                recorder.close()
        status = recorder.status
        return Ended(EndReason.DISK if status.error else by, status, recorder.contents(), self._tee.absent(end_ns))

    def poll(self, wait_s: float) -> list[tuple[int, Block]]:
        """Wait for the given time, then return the blocks received since the last call."""
        self._wait_until(self._clock.now_ns() + int(wait_s * 1e9))
        return self._tee.blocks()

    def stop(self) -> None:
        """Stop reading and close the ports."""
        if self._reader is not None:
            reader, self._reader = self._reader, None
            try:
                reader.stop()
            except Exception as error:
                if error is not self._reader_failure:
                    self.failures.note("reader", error)

    def _loop(
        self,
        recorder: Recorder,
        show: Callable[..., None],
        start_ns: int,
        seconds: float | None,
        marks: Marks | None,
    ) -> EndReason:
        """Wait for the end of the recording, and return the reason for it."""
        end_ns = None if seconds is None else start_ns + int(seconds * 1e9)
        # Without marks, one turn per second suffices: samples are shown once a second, and a disk error persists.
        wait_ns, tick_ns = int((1.0 if marks is None else LOOK_FOR_MARKS_S) * 1e9), start_ns + SECOND_NS
        show(self._tee.blocks, tick=False)
        while end_ns is None or self._clock.now_ns() < end_ns:
            turn_ns = min(self._clock.now_ns() + wait_ns, tick_ns, tick_ns if end_ns is None else end_ns)
            try:
                self._wait_until(turn_ns)
            except KeyboardInterrupt:
                return self.stops.by or EndReason.CTRL_C
            if recorder.status.error:
                return EndReason.DISK
            while marks is not None and not marks.empty():
                now_ns, mark = self._clock.now_ns(), marks.get()
                if isinstance(mark, Noted):
                    recorder.event(0, now_ns, mark)
                    continue
                recorder.mark(mark, host_ns=now_ns)
                self._marks.append((now_ns, mark))
                show(self._tee.blocks, tick=False)
            if turn_ns == end_ns:
                break
            if turn_ns == tick_ns:
                show(self._tee.blocks)
                tick_ns += SECOND_NS
        self._tee.stop()  # data received while the last line is shown are not part of the run
        show(self._tee.blocks)
        return EndReason.SECONDS

    def _wait_for(self, trigger: Trigger, rest: StillPoint | None, listeners: RunListeners) -> int:
        """Wait until the bob moves, and return the host time of the first sample that shows the motion."""
        watch = Watch(trigger, math.nan if rest is None else rest.rest_m)
        keep_ns, start_ns = int(trigger.keep_s * 1e9), self._clock.now_ns()
        self._tee.keep(True)
        tick_ns = start_ns + SECOND_NS
        seen: deque[tuple[int, Block]] = deque(maxlen=HELD_BLOCKS)
        with self._display(listeners, start_ns, None) as show:
            while True:
                for channel, block in self.poll(LOOK_FOR_TRIGGER_S):
                    seen.append((channel, block))
                    moment_ns = watch.moment_ns(block) if channel == 0 else None
                    if moment_ns is not None:
                        return moment_ns
                if listeners.changed():
                    self._tee.keep(False)
                    raise Disarmed
                # One second more than needed, because samples may wait for a moment before they are examined.
                self._tee.forget(self._clock.now_ns() - keep_ns - SECOND_NS)
                if self._clock.now_ns() >= tick_ns:
                    show(lambda: [seen.popleft() for _ in range(len(seen))])
                    tick_ns += SECOND_NS

    def _wait_until(self, deadline_ns: int) -> None:
        """Wait until a deadline or a request to end, and record a failure of the reader, if any."""
        with self.stops.raising(True):
            self._clock.sleep_until_ns(deadline_ns)
        failure = None if self._reader is None else self._reader.failure
        if failure is not None and failure is not self._reader_failure:
            self._reader_failure = failure
            self.failures.note("reader", failure)

    @contextlib.contextmanager
    def _display(
        self, listeners: RunListeners, start_ns: int, recorder: Recorder | None
    ) -> Iterator[Callable[..., None]]:
        """Yield a function that takes samples and shows the state, on a thread that cannot delay or end the recording.

        A display that is still busy skips a turn, and shows the latest state at its next one.
        """
        self.shown = shown = LiveState(self._rolling)
        worker = Worker("display", lambda error: self.failures.note("display", error))

        def show(take: Callable[[], PortBlocks], *, tick: bool = True) -> None:
            now_ns = self._clock.now_ns()

            def turn() -> None:
                shown.push(take())
                listeners.progress(self._progress(shown, start_ns, now_ns, recorder, tick=tick))

            if worker.idle:
                worker.put(turn)

        try:
            yield show
        finally:
            worker.close("the last turn has not ended")

    def _rolling(self, channel: int) -> Rolling:
        """Return the analysis of the last seconds of a channel of the first port."""
        chain, entry = self._chains[channel], self.sensors[0].entry(0)
        return Rolling(
            lambda block: live_run(block, chain.info(entry.port), self._scene, {"sensor": plain(entry)}, LIVE),
            share=MOTION_SHARE,
            most=max(int(chain.timebase.rate_hz * SHOWN_S), FEWEST),
            now=lambda: self._clock.now_ns() * 1e-9,
        )

    def _progress(
        self, shown: LiveState, start_ns: int, now_ns: int, recorder: Recorder | None, *, tick: bool
    ) -> Progress:
        """Return the progress of the recording; without a recorder, it is waiting for its trigger."""

        def motion() -> Run | NotYet:
            """Return the motion, or the reason why its calculation failed; the rest of the line is not affected."""
            try:
                return shown.motion()
            except BaseException as error:
                self.failures.note("analysis", error)
                return NotYet(f"no motion shown ({type(error).__name__})")

        tee, chains = self._tee, self._chains
        shown.follow(tee.first)
        zero_ns = start_ns if shown.origin.ns is None else shown.origin.ns
        return Progress(
            seconds=(now_ns - start_ns) * 1e-9,
            missing=shown.missing,
            gaps=sum(len(chain.timebase.gaps) + int(chain.timebase.gaps_left_out["count"]) for chain in chains),
            rate_hz=shown.rate_hz(now_ns),
            motion=motion,
            status=None if recorder is None else recorder.status,
            disk_free_bytes=None if recorder is None else free_bytes(recorder.path.parent),
            unshown=tee.unshown,
            gone=tuple(tee.gone.values()),
            silent_s=shown.silent_s(now_ns),
            trouble=trouble_of(shown, chains, waiting=recorder is None),
            marks=[((host_ns - zero_ns) * 1e-9, text) for host_ns, text in self._marks],
            tick=tick,
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
