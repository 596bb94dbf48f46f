"""``springmass record``: a run from the bench, kept byte by byte."""

from __future__ import annotations

import argparse
import contextlib
import os
import queue
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.clock import SystemClock
from acquisition.decoders.registry import get_family
from acquisition.errors import CalibrationError
from acquisition.live.calibration import SPEED_OF_SOUND_M_PER_S, Calibration, StillPoint
from acquisition.live.serial_port import SerialPort
from pipeline.bench.added_mass import scene_air
from pipeline.bench.air import speed_of_sound
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import format_value
from pipeline.streaming import LiveMotion
from springmass import __version__
from springmass.errors import OK, USAGE, ProgramError
from springmass.runs.analysing import now_utc
from springmass.runs.loading import read_scene
from springmass.session.session import BYTES_PER_READ, Progress, Sensor, Session, Trigger, demand_new
from storage.disk import check_disk
from storage.recover import recover

__all__ = ["run"]

U_RULER_M = 0.5e-3
# Off a terminal one line of so many is printed: working out the motion for each is a tenth of what recording costs.
UNWATCHED_LINES = 30
UNLIMITED_S = 3600.0  # how long a run without --seconds is taken to be, for the look at the disk


def run(options: argparse.Namespace) -> int:
    """Record, then build the run file from the log."""
    out = Path(options.output)
    if out.suffix.lower() != ".h5":
        raise ProgramError(f"{out}: a recording becomes a run file, whose name ends in .h5", USAGE)
    demand_new(out, len(options.port))
    _demand_sense(options)
    scene_path = options.scene or options.simulate
    scene = None if scene_path is None else read_scene(scene_path)
    with _sensors(options, scene) as (sensors, kind):
        rate = sum(sensor.rate_hz or sensor.family.rate_hz for sensor in sensors)
        check_disk(out, int(BYTES_PER_READ * rate * (options.seconds or UNLIMITED_S)) + 1_000_000)
        session = Session(
            sensors,
            SystemClock(),
            kind=kind,
            scene=None if scene is None else scene.to_mapping(),
            title=options.title,
        )
        log = out.with_suffix(".wire")
        try:
            with _signals_as_ctrl_c():
                stopped = _record(session, options, log)
        finally:
            session.stop()
    report = recover(
        log,
        out,
        remove_log=True,
        provenance={"software": "springmass", "version": __version__, "created_utc": now_utc()},
    )
    for line in report.describe():
        print(line, file=sys.stderr)
    if stopped:
        print("stopped before its end; the run is complete up to there", file=sys.stderr)
    return 130 if stopped else OK


def _demand_sense(options: argparse.Namespace) -> None:
    """Refuse options that would do nothing without another."""
    for name, needed in (("ruler", "still"), ("pre", "trigger")):
        if getattr(options, name) not in (None, []) and getattr(options, needed) is None:
            raise ProgramError(f"--{name} does nothing without --{needed}; name both or neither", USAGE)


@contextlib.contextmanager
def _signals_as_ctrl_c() -> Iterator[None]:
    """Take the end of a terminal or a service (SIGTERM, SIGHUP) for Ctrl-C, so that it closes the run as cleanly.

    What was ignored before stays ignored: under ``nohup`` a recording outlives its terminal.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the main thread's
        return
    signals = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    heard = [number for number in signals if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, signal.default_int_handler) for number in heard}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _record(session: Session, options: argparse.Namespace, log: Path) -> bool:
    """Run the session; True where Ctrl-C ended it."""
    session.listen()
    rest = None if options.still is None else _rest(session, options.still, options.ruler)
    trigger = None if options.trigger is None else Trigger(options.trigger, options.pre or 2.0)
    show = _ProgressLine()
    try:
        session.record(
            log,
            seconds=options.seconds,
            trigger=trigger,
            rest=rest,
            progress=show,
            marks=_typed_marks(),
        )
    except KeyboardInterrupt:
        if not log.exists():
            raise
        return True
    finally:
        show.end()
    return False


def _rest(session: Session, seconds: float, ruler: list[float]) -> StillPoint:
    """Measure the rest position, at the distances by the ruler first, which set offset and scale."""
    if not ruler:
        return _still(session, seconds, "let the bob hang still")
    if len(ruler) == 1:
        return session.calibrate([_still(session, seconds, "let the bob hang still")], ruler, U_RULER_M)
    points = []
    for known in ruler:
        _ask(f"bring the target to {known:g} m by the ruler, then press Enter")
        points.append(_still(session, seconds, "keep it still"))
    session.calibrate(points, ruler, U_RULER_M)
    found = session.sensors[0].calibration
    scale = format_value(found.scale, found.u_scale)
    print(f"scale {scale}, offset {format_value(found.offset_m, found.u_offset_m, 'm')}", file=sys.stderr)
    _ask("hang the bob over the sensor, then press Enter")
    return _still(session, seconds, "let it hang still")


def _still(session: Session, seconds: float, demand: str) -> StillPoint:
    print(f"{demand} for {seconds:g} s ...", file=sys.stderr)
    rest = session.still(seconds)
    print(f"rest {rest.rest_m * 1e3:.2f} mm, noise {rest.noise_m * 1e3:.3f} mm", file=sys.stderr)
    return rest


def _ask(demand: str) -> None:
    """Wait for Enter."""
    print(demand, file=sys.stderr, flush=True)
    if sys.stdin is None or not sys.stdin.readline():
        raise ProgramError(
            "several --ruler distances are measured one after the other, each begun with Enter, and the standard input "
            "is closed; name one --ruler, or run this at a terminal",
            USAGE,
        )


class _ProgressLine:
    """The progress line on stderr: rewritten in place on a terminal; elsewhere after 1, 10, 40, 70 s and so on."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._shown = 0

    def __call__(self, progress: Progress) -> None:
        self._shown += 1
        if self._terminal:
            print(f"\r\x1b[K{line_of(progress)}", end="", file=sys.stderr, flush=True)
        elif self._shown == 1 or self._shown % UNWATCHED_LINES == 10:
            print(line_of(progress), file=sys.stderr, flush=True)

    def end(self) -> None:
        """Leave the line standing."""
        if self._terminal and self._shown:
            print(file=sys.stderr)


def line_of(progress: Progress) -> str:
    """Return a progress line: time, period, amplitude, rate, drop-outs, what is safe on the disk."""
    state = "waiting for the bob" if progress.waiting else f"{progress.seconds:6.0f} s"
    found = progress.motion()
    motion = f"T {found.period}, A {found.amplitude}" if isinstance(found, LiveMotion) else found.why
    parts = [state, motion, f"{progress.rate_hz:.0f} Hz", f"{progress.missing} missing, {progress.gaps} gaps"]
    if progress.unshown:
        parts.append(f"{progress.unshown} samples recorded and not shown")
    if progress.status is not None:
        parts.append(f"{progress.status.synced_bytes / 1e3:.0f} kB safe")
        if progress.disk_free_bytes is not None:
            parts.append(f"{progress.disk_free_bytes / 1e9:.1f} GB left")
        if progress.status.error:
            parts.append(progress.status.error)
    return " | ".join(parts)


def _typed_marks() -> queue.SimpleQueue[str] | None:
    """Lines typed at the terminal become marks in the run."""
    if not sys.stdin or not sys.stdin.isatty():
        return None
    marks: queue.SimpleQueue[str] = queue.SimpleQueue()

    def read() -> None:
        for text in sys.stdin:
            marks.put(text.strip() or "mark")

    threading.Thread(target=read, name="springmass-marks", daemon=True).start()
    return marks


@contextlib.contextmanager
def _sensors(options: argparse.Namespace, scene: Scene | None) -> Iterator[tuple[list[Sensor], str]]:
    """Open what is to be recorded: the ports named, or a simulated bench behind a port of its own."""
    family_options = dict(_option(text) for text in options.option)
    for name in options.sensor:
        get_family(name).demand_options(family_options)
    calibration = _calibration(options, scene)
    if options.simulate is not None:
        with _simulated(options, family_options, calibration) as sensor:
            yield [sensor], "simulated"
        return
    if not options.port or len(options.sensor) not in (1, len(options.port)):
        raise ProgramError("--port and --sensor must be named, one sensor for each port (or one for all)", USAGE)
    names = options.sensor * len(options.port) if len(options.sensor) == 1 else options.sensor
    families = [get_family(name) for name in names]
    sensors: list[Sensor] = []
    try:
        for address, family in zip(options.port, families, strict=True):
            baud = options.baud or family.baud
            port = SerialPort(address, baud)
            sensors.append(Sensor(family, port, options.rate_hz, family_options, calibration, baud))
        yield sensors, "live"
    finally:
        for sensor in sensors:
            sensor.transport.close()


@contextlib.contextmanager
def _simulated(
    options: argparse.Namespace, family_options: dict[str, Any], calibration: Calibration
) -> Iterator[Sensor]:
    if os.name == "nt":
        raise ProgramError("--simulate needs a pseudo-terminal, which this system has not; name a --port", USAGE)
    from acquisition.simulated.pseudo_terminal import VirtualPort
    from acquisition.simulated.rangefinder import VirtualRangefinder, VirtualSensor
    from springmass.session.simulated_bench import bench_position

    family = get_family(options.sensor[0] if options.sensor else "line-protocol")
    position = bench_position(read_scene(options.simulate), where=str(options.simulate))
    rate = options.rate_hz or family.rate_hz
    model = VirtualSensor(rate_hz=rate, crystal_ppm=options.crystal_ppm)
    rng = np.random.default_rng(options.seed)
    # It must still speak while the session listens, waits and closes.
    seconds = (options.seconds or UNLIMITED_S) + (options.still or 0.0) + 60.0
    with VirtualPort(
        family,
        VirtualRangefinder(position, model, rng),
        SystemClock(),
        seconds=seconds,
        rng=rng.spawn(1)[0],
        options=family_options,
    ) as bench:
        port = SerialPort(bench.path, family.baud)
        bench.start()
        try:
            yield Sensor(family, port, options.rate_hz, family_options, calibration, family.baud)
        finally:
            port.close()


def _calibration(options: argparse.Namespace, scene: Scene | None) -> Calibration:
    """Speed of sound by option, else from the scene's air, else the usual 344 m/s."""
    if options.speed_of_sound is not None:
        speed = options.speed_of_sound
    elif scene is not None and scene.air_temperature_c is not None:
        speed = speed_of_sound(*(each.value for each in scene_air(scene)))
    else:
        speed = SPEED_OF_SOUND_M_PER_S
    try:
        return Calibration(speed_of_sound_m_per_s=speed)
    except CalibrationError as error:
        raise ProgramError(str(error), USAGE) from error


def _option(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ProgramError(f"--option takes NAME=VALUE, got {text!r}", USAGE)
    return name, int(value) if value.isdecimal() else value
