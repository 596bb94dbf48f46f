"""``springmass record``: a run from the bench, kept byte by byte."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from acquisition.clock import SystemClock
from acquisition.decoders.registry import get_family
from acquisition.decoders.sensor import Sensor
from acquisition.live.calibration import Calibration, StillPoint
from acquisition.live.serial_port import SerialPort
from acquisition.simulated import VirtualPort, VirtualRangefinder, VirtualSensor
from pipeline.bench.air import speed_of_sound
from pipeline.bench.disc import scene_air
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from springmass.commands.given import GivenOptions
from springmass.commands.options import ClockPpm, DecoderOptions, FileArgument, PageOptions
from springmass.commands.parameters import (
    Positive,
    ReadingsPerSecond,
    SpeedOfSound,
    Whole,
    flag,
    option,
    output,
)
from springmass.commands.questions import option_words
from springmass.errors import INTERNAL, INTERRUPTED, OK, SENSOR, UNREADABLE, ProgramError
from springmass.loading.save import made_now
from springmass.loading.scenes import ask_about, read_scene
from springmass.page.recorder_side import PageProcess
from springmass.session.bench_requests import Closed, Operator
from springmass.session.detect import name_sensors
from springmass.session.file_names import default_name, demand_new
from springmass.session.sensors import OpenSensor
from springmass.session.session import BYTES_PER_READ, Ended, Marks, RunLimits, RunListeners, Session
from springmass.session.trigger import Disarmed, Trigger
from springmass.simulations.bench import EXAMPLE, REST_M, Release, bench_position
from springmass.stops import STOPS, EndReason
from springmass.terminal.console import Console
from springmass.terminal.keys import marks_by_keys
from springmass.terminal.printing import option_of
from springmass.terminal.progress_line import ProgressLine
from springmass.terminal.style import style_of, watched
from storage.errors import WriteFailed, one_line
from storage.recorder import check_disk
from storage.recovery.recover import recover
from storage.recovery.report import RecoveredRun, RecoverReport
from storage.run_file.reading import open_run

SIMULATED_FAMILY = "line-protocol"
UNLIMITED_S = 3600.0  # assumed duration of a run without --seconds, for the check of disk space


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RecordOptions:
    """The options of ``springmass record``."""

    port: Annotated[
        tuple[str, ...], option("P", "port of a sensor; may be repeated (default: the port on which a sensor answers)")
    ] = ()
    sensor: Annotated[tuple[str, ...], option("NAME", "family of the sensor, from the list of `springmass ports`")] = ()
    simulate: Annotated[bool, flag("record a simulated bench instead of a port; --scene says which")] = False
    output: Annotated[
        FileArgument | None, output("RUN.h5", "run file to create, never overwritten (default: date, time and title)")
    ] = None
    seconds: Annotated[Positive | None, option("N", "length of the recording, s (default: until Ctrl-C)")] = None
    page: Annotated[bool, flag("show the recording in a browser, with buttons for marks and stop")] = False
    ready: Annotated[bool, flag("set zero, arm and record from the page; needs --page")] = False
    scene: Annotated[
        FileArgument | None, option("FILE", "scene file to store with the run; its air sets the speed of sound")
    ] = None
    title: Annotated[str, option("TEXT", "title of the run")] = ""
    baud: Annotated[Whole | None, option("B", "baud rate of the ports (default: that of the sensor family)")] = None
    rate_hz: Annotated[ReadingsPerSecond | None, option("R", "rate that the sensor is set to, readings per second")] = (
        None
    )
    framing: Annotated[str, option("7E1", "data bits, parity and stop bits of the ports (default: 8N1)")] = "8N1"
    wait: Annotated[
        Positive | None, option("S", "seconds for a board to begin (default: 3, or 12 if it starts up)")
    ] = None
    send: Annotated[str, option("TEXT", "text that makes a board begin, sent each second until it does")] = ""
    option: DecoderOptions = ()
    still: Annotated[Positive | None, option("S", "first measure rest position and noise for S seconds")] = None
    ruler: Annotated[
        tuple[Positive, ...], option("M", "ruler distance of the bob at rest, m; may be repeated; needs --still")
    ] = ()
    speed_of_sound: Annotated[SpeedOfSound | None, option("C", "speed of sound for echo times, m/s")] = None
    clock_ppm: ClockPpm = None
    trigger: Annotated[Positive | None, option("M", "start when the bob is M metres from its rest position")] = None
    pre: Annotated[Positive | None, option("S", "seconds to keep before the trigger (default: 2)")] = None
    seed: Annotated[Whole, option("N", "with --simulate: seed of the noise (default: 0)")] = 0


def record(
    *, options: RecordOptions = RecordOptions(), page_options: PageOptions = PageOptions(), given: GivenOptions
) -> int:
    """Record, then build the run file from the log."""
    what = "simulated" if options.simulate else "run"
    if options.scene is not None:
        what = Path(options.scene).name.removesuffix(".toml").removesuffix(".scene")
    out = default_name(options.title or what, datetime.now()) if options.output is None else Path(options.output)
    if out.suffix.lower() != ".h5":
        raise ProgramError(f"{out}: a recording becomes a run file, whose name ends in .h5")
    for use, off, names in (
        ("with --simulate", options.simulate, ("--port", "--framing", "--wait", "--send")),
        ("without --simulate", not options.simulate, ("--seed",)),
        ("without --still", options.still is None, ("--ruler",)),
        ("without --trigger", options.trigger is None, ("--pre",)),
        ("without --page", not options.page, ("--ready", *map(option_of, vars(page_options)))),
    ):
        if off:
            given.refuse(use, *names)
    _fill_standard_streams()
    if not options.simulate:
        ports, names, baud = name_sensors(
            options.port, options.sensor, options.baud, options.framing, options.wait or 0.0, options.send.encode()
        )
        options = replace(options, port=ports, sensor=names, baud=baud)
    demand_new(out, len(options.port))
    scene = EXAMPLE if options.simulate else None
    if options.scene is not None:
        scene = read_scene(options.scene)
        ask_about(scene, options.scene)
    log, clock = out.with_suffix(".wire"), SystemClock()
    release = Release(clock)
    with _sensors(options, scene, release) as sensors, contextlib.ExitStack() as beside:
        rate = sum(sensor.rate_hz or sensor.family.rate_hz for sensor in sensors)
        check_disk(out, int(BYTES_PER_READ * rate * (options.seconds or UNLIMITED_S)) + 1_000_000)
        session = Session(
            sensors,
            clock,
            kind="simulated" if options.simulate else "live",
            scene=None if scene is None else scene.to_mapping(),
            title=options.title,
            stops=STOPS,
        )
        console = Console(lambda error: session.failures.note("stderr", error))
        beside.callback(console.close)
        page, marks = None, Marks()
        try:
            if options.page:
                words = option_words(vars(page_options))
                page = beside.enter_context(PageProcess(words, log, marks, STOPS, session.failures, console.line))
            with STOPS.leaving(lambda: _stopped(session, log)):
                ended = _Bench(session, options, log, console, release, page, marks).record()
                session.stop()
                failed, status = session.failures.describe(), ended.status
                if status.error:
                    failed.append(f"springmass: {status.error}")
                    failed.append(f"springmass: {status.dropped_records} records that came later were not kept")
                for line in failed:
                    console.line(line)
                code, run_file, sentences = _built(ended, out, session)
            for line in sentences:
                console.line(line)
            if run_file is not None and watched(sys.stderr):
                console.line(f"next: springmass analyse {shlex.quote(str(run_file))}")
            if page is not None and run_file is not None and ended.by is EndReason.PAGE:
                page.tell("built", run=str(run_file))
                page.attend()
            return code
        except Closed:
            if page is not None and page.failed:
                return INTERNAL
            console.line("nothing was recorded: the page was closed first")
            return OK
        except KeyboardInterrupt:
            if not os.path.lexists(log):
                raise
            console.line(f"springmass: {_stopped(session, log)}")
            return INTERRUPTED
        finally:
            session.stop()


def _built(ended: Ended, out: Path, session: Session) -> tuple[int, Path | None, list[str]]:
    """Build the run file; return exit code, file of the first run, and the sentences about the end."""
    log, status = ended.log.path, ended.status
    whole = not status.error and not status.dropped_records
    try:
        out.parent.mkdir(parents=True, exist_ok=True)  # the folder may have been moved with the log
        report = recover(ended.log, out, remove_log=whole, provenance=made_now())
    except Exception as error:
        code = SENSOR if status.error or isinstance(error, WriteFailed) else UNREADABLE
        return code, None, [f"springmass: the run file was not built ({one_line(error)}); {_what_to_do(log)}"]
    lines = [line for run in report.runs for line in _how_read(run)] + list(report.describe())
    if not report.log_removed and log.exists():
        lines.append(f"{log}: the log stays")
    first = [run for run in report.runs if run.part == 1]
    if useless := [run.path for run in first if not _usable(run.sensor.channel, report, session)]:
        named = ", ".join(map(str, useless))
        lines.append(f"springmass: {named}: no usable distance was recorded; check aim, distance and wiring")
        code = SENSOR
    elif ended.by is EndReason.DISK:
        lines.append("springmass: the disk is full or broken and ended the recording; the run has all before that")
        code = SENSOR
    elif ended.absent:
        code = SENSOR
    elif ended.by in (EndReason.SECONDS, EndReason.PAGE):
        code = OK
    else:
        lines.append(f"stopped by {ended.by}; everything up to then is saved")
        code = INTERRUPTED
    return code, report.main.path, lines


def _how_read(run: RecoveredRun) -> Iterator[str]:
    """Yield how often lines without a clock of their own came, and what would give them better times."""
    lines = run.decoding.get("clock", {}).get("lines")
    if not lines or lines["u_rate_ppm"] is None or run.existed:
        return
    how = {
        "even": "their times are whole steps of an even rate",
        "echo": "their times are steps of a wait and the time of the echo",
        "reads": "they come at no even rate, so their times are spread between the reads",
    }[lines["steps"]]
    u = f"known to {lines['u_rate_ppm']:.2g} ppm"
    if lines["misplaced_s"]:
        u += f", and between lost lines to {1e3 * lines['misplaced_s']:.3g} ms"
    yield (
        f"{run.sensor.port}: {lines['rate_hz']:.4g} lines per second without a time, read every "
        f"{1e3 * lines['read_s']:.3g} ms, {lines['lost']} lost; {how} ({u})"
    )
    usb = Path(os.path.realpath(run.sensor.port)).name
    if lines["read_s"] * lines["rate_hz"] > 1.2 and usb.startswith("ttyUSB"):
        setting = f"/sys/bus/usb-serial/devices/{usb}/latency_timer"
        yield f"{run.sensor.port}: the adapter collects lines; `echo 1 | sudo tee {setting}` makes it send at once"
    elif lines["read_s"] * lines["rate_hz"] > 1.2 and usb.upper().startswith("COM"):
        yield f"{run.sensor.port}: the adapter collects lines; set its latency timer to 1 ms in the Device Manager"


def _usable(channel: int, report: RecoverReport, session: Session) -> bool:
    """Whether a sensor's parts contain a distance: one that was displayed, or any in the files."""
    shown = session.shown
    if shown is not None and channel in shown.useful and shown.useful[channel].usable:
        return True
    for part in report.parts_of(channel):
        with open_run(part.path) as run:
            if np.isfinite(run.samples().distance).any():
                return True
    return False


def _what_to_do(log: Path) -> str:
    return f"the log stays: {log}; `springmass recover {shlex.quote(str(log))}` makes the run file"


def _stopped(session: Session, log: Path) -> str:
    """Return what is said if a signal ends the program before the run file is built; the log stays as it is."""
    if session.recorder is None:
        return "stopped immediately"
    reads, size = session.recorder.unwritten()
    lost = f"; the disk did not take {reads} reads ({size} bytes)" if reads else ""
    return f"stopped immediately{lost}; {_what_to_do(log)}"


def _fill_standard_streams() -> None:
    """Put nothing in place of standard streams that are closed, so that no log gets their number."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


@dataclass(frozen=True, slots=True)
class _Bench:
    """A bench that is ready: the session, the user's options, and the receivers of messages."""

    session: Session
    options: RecordOptions
    log: Path
    console: Console
    release: Release
    page: PageProcess | None
    marks: Marks

    def record(self) -> Ended:
        """Run the session, with a page from before its beginning to its end."""
        options = self.options
        self.session.listen(self.console.line, options.wait, options.send.encode())
        operator = None if self.page is None else Operator(self.session, self.page, self.log)
        try:
            if operator is not None:
                operator.begin()
            rest = None if options.still is None else self._rest(options.still)
            trigger = None if options.trigger is None else Trigger(options.trigger, options.pre or 2.0)
            if not options.ready:
                self._release(trigger)
            ended = self._recorded(RunLimits(options.seconds, trigger, rest), operator)
        finally:
            if operator is not None:
                operator.end()
        if self.page is not None:
            self.page.tell("ended", by=ended.by)
            if ended.by is not EndReason.PAGE:
                self.page.ended()
        return ended

    def _release(self, trigger: Trigger | None) -> None:
        self.release.after(0.0 if trigger is None else trigger.keep_s + 0.5)

    def _recorded(self, limits: RunLimits, operator: Operator | None) -> Ended:
        style = style_of(sys.stderr)
        with marks_by_keys(self.marks, watched=style.terminal) as typed:
            marks = self.marks if typed or self.page is not None else None
            show = ProgressLine(self.console, style, keys=typed)
            listeners = RunListeners(progress=show, marks=marks)
            try:
                if operator is None:
                    return self.session.record(self.log, limits, listeners)
                return self._operated(limits, listeners, operator)
            finally:
                self.console.settle()

    def _operated(self, limits: RunLimits, listeners: RunListeners, operator: Operator) -> Ended:
        """Record immediately, or when the page asks for it."""
        operator.rest = limits.rest
        ready = self.options.ready
        if ready:
            self.console.line("ready: the recording begins on the page")
        while True:
            if ready:
                limits = replace(limits, trigger=operator.prepare())
                self._release(limits.trigger)
            changed = listeners.changed if limits.trigger is None else operator.armed(limits.trigger)
            try:
                return self.session.record(
                    self.log,
                    replace(limits, rest=operator.rest),
                    replace(listeners, begun=operator.recording, changed=changed),
                )
            except Disarmed:
                ready = True  # the page can also disarm a trigger from the command line

    def _rest(self, seconds: float) -> StillPoint:
        """Measure the rest position, at the distances by the ruler first, which set offset and scale."""
        ruler = self.options.ruler
        if len(ruler) < 2:
            rest = self._still(seconds, "let the bob hang still")
            return self.session.calibrate([rest], ruler) if ruler else rest
        points = []
        for distance_m in ruler:
            self._ask(f"bring the target to {distance_m:g} m by the ruler, then press Enter")
            points.append(self._still(seconds, "keep it still"))
        self.session.calibrate(points, ruler)
        calibration = self.session.sensors[0].calibration
        scale = Estimate(calibration.scale, calibration.u_scale)
        offset = Estimate(calibration.offset_m, calibration.u_offset_m, "m")
        self.console.line(f"scale {scale}, offset {offset}")
        self._ask("hang the bob over the sensor, then press Enter")
        return self._still(seconds, "let it hang still")

    def _still(self, seconds: float, demand: str) -> StillPoint:
        self.console.line(f"{demand} for {seconds:g} s ...")
        rest = self.session.still(seconds)
        self.console.line(f"rest {rest.rest_m * 1e3:.2f} mm, noise {rest.noise_m * 1e3:.3f} mm")
        return rest

    def _ask(self, demand: str) -> None:
        """Wait for Enter."""
        self.console.line(demand)
        if sys.stdin is None or not sys.stdin.readline():
            raise ProgramError(
                "several --ruler distances are measured one after the other, each begun with Enter, and the standard "
                "input is closed",
                "name one --ruler, or run this at a terminal",
            )


@contextlib.contextmanager
def _sensors(options: RecordOptions, scene: Scene | None, release: Release) -> Iterator[list[OpenSensor]]:
    """Open the source of the recording: the named ports, or a simulated bench on a simulated port."""
    given, names = dict(options.option), options.sensor or ((SIMULATED_FAMILY,) if options.simulate else ())
    families = [get_family(name) for name in names]
    for family in families:
        family.demand_options(given)
    calibration = _calibration(options, scene)
    with contextlib.ExitStack() as opened:
        virtual = opened.enter_context(_virtual(options, families[0], scene, release)) if options.simulate else None
        addresses = options.port if virtual is None else (virtual.path,)
        if len(families) not in (1, len(addresses)):
            raise ProgramError("--sensor must be named once for all ports, or once for each in their order")
        sensors = []
        for address, family in zip(addresses, families * (len(addresses) // len(families)), strict=True):
            baud = options.baud or family.baud
            port = SerialPort(address, baud, options.framing)
            opened.callback(port.close)
            sensors.append(OpenSensor(family, port, options.rate_hz, given, calibration, baud, options.clock_ppm))
        if virtual is not None:
            virtual.start()
            release.begin()
        yield sensors


def _virtual(options: RecordOptions, family: Sensor, scene: Scene | None, release: Release) -> VirtualPort:
    """Return a simulated port, on which a sensor of the family sends what it sees of the bench."""
    assert scene is not None
    if os.name == "nt":
        raise ProgramError("--simulate needs a pseudo-terminal, which this system has not", "name a --port")
    if len(options.ruler) > 1 or any(abs(distance_m - REST_M) > 0.05 for distance_m in options.ruler):
        got = ", ".join(f"{each:g}" for each in options.ruler)
        raise ProgramError(f"--ruler {got}: the simulated bob hangs at {REST_M:g} m", "name one --ruler near that")
    waits = options.still is not None or options.ready
    where = "the example bench" if options.scene is None else options.scene
    seconds = options.seconds or UNLIMITED_S
    position = bench_position(scene, seconds, where=where, release=release if waits else None)
    model = VirtualSensor(rate_hz=options.rate_hz or family.rate_hz)
    finder = VirtualRangefinder(position, model, np.random.default_rng(options.seed))
    # The simulated sensor must keep sending while the session listens, waits and closes.
    seconds += (options.still or 0.0) + 60.0
    return VirtualPort(family, finder, SystemClock(), seconds=seconds, options=dict(options.option))


def _calibration(options: RecordOptions, scene: Scene | None) -> Calibration:
    """Speed of sound by option, else from the scene's air, else the usual 344 m/s."""
    speed = options.speed_of_sound
    if speed is None and scene is not None and scene.air_temperature_c is not None:
        speed = speed_of_sound(*(each.value for each in scene_air(scene)))
    return Calibration() if speed is None else Calibration(speed_of_sound_m_per_s=speed)
