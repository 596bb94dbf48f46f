"""Samples block by block, from a port, a recording or a simulated bench, through one interface."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any, Protocol, Self, Unpack

import numpy as np

from acquisition.block import Block, SourceInfo, concatenate
from acquisition.clock import Clock, SystemClock, VirtualClock
from acquisition.decoders.registry import get_family
from acquisition.live.serial_port import SerialPort
from acquisition.recordings.recording import Recording
from acquisition.replay import Replay
from pipeline.bench.scene import Scene
from springmass.api.analysing import AnyScene, ReadKeywords
from springmass.errors import UNREADABLE, ProgramError
from springmass.loading.load import load
from springmass.loading.loaded import Loaded
from springmass.loading.options import LoadOptions
from springmass.loading.save import made_now, save_run
from springmass.loading.scenes import scene_from
from springmass.session.detect import name_sensors
from springmass.session.file_names import demand_new
from springmass.session.sensors import OpenSensor
from springmass.session.session import Session
from springmass.simulations.bench import bench_position
from storage.recorder import Recorder
from storage.recovery.recover import recover

SIMULATED_RATE_HZ, BLOCK_SAMPLES = 100.0, 16
SIGMA_M = 8e-5  # noise of a simulated rangefinder if its scene states none
POLL_S = 0.05


class SampleSource(Protocol):
    """What :func:`springmass.source` returns: a ``with`` block that iterates blocks of samples.

    A block has ``t`` (s), ``distance`` (m, NaN if not measured) and ``flags``.
    """

    @property
    def info(self) -> SourceInfo:
        """Kind, name and rate of the source."""
        ...

    def record(self, path: str | os.PathLike[str]) -> None:
        """Keep what is delivered from now on, losslessly, in a run file that is complete after the ``with`` block."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *error: object) -> None: ...

    def __iter__(self) -> Iterator[Block]: ...


def source(
    what: str | os.PathLike[str] | Scene | Mapping[str, Any],
    *,
    speed: float = 1.0,
    scene: AnyScene | None = None,
    sensor: str | None = None,
    baud: int | None = None,
    **how: Unpack[ReadKeywords],
) -> SampleSource:
    """Open a port, a recording or a simulated bench as a source of samples.

    Parameters
    ----------
    what : path, port or Scene
        A recording, run file or wire log, which is replayed; the port of a sensor, such as ``"/dev/ttyUSB0"``,
        ``"COM3"`` or ``"socket://HOST:PORT"``; or a scene, whose bob swings over a simulated rangefinder without end.
    speed : float
        Seconds of a recording or of a simulation per second; ``math.inf`` never waits.
    scene : Scene, path or mapping, optional
        The scene to store with what is recorded.
    sensor : str, optional
        Family of the sensor on the port; default: the one that speaks.
    baud : int, optional
        Baud rate of the port.
    **how
        Options of reading a recording, as for :func:`springmass.load`.

    Raises
    ------
    springmass.Error
        If there is no such file or port, or an argument would have no effect on this source.

    Examples
    --------
    >>> from springmass import Stream, sample_data
    >>> stream = Stream()
    >>> with source(sample_data() / "undamped_simulated_position.txt", speed=math.inf) as bench:
    ...     for block in bench:
    ...         run = stream.push(block.t, block.distance)
    >>> stream.finish()["T"]
    0.758516(22) s
    """
    read = LoadOptions.of(how)
    of_port = {"sensor": sensor, "baud": baud}
    if isinstance(what, Scene | Mapping):
        _refuse("a simulated bench", {"scene": scene, **of_port, **how})
        return _bench(what if isinstance(what, Scene) else Scene.from_mapping(what), speed)
    if os.path.isfile(what):
        _refuse(os.fspath(what), of_port)
        given_scene = scene_from(scene)
        loaded = load(Path(what), read)
        loaded = loaded if given_scene is None else replace(loaded, scene=given_scene.to_mapping())
        pace = speed if math.isfinite(speed) else None
        replay = Replay(loaded.samples, _clock(speed), info=loaded.info, speed=pace)
        return _Played(replace(loaded, recording=replace(loaded.recording, info=replay.info)), replay)
    address = os.fspath(what)
    if not re.fullmatch(r"/dev/.*|.*://.*|COM\d+", address, re.IGNORECASE | re.DOTALL):
        ports = 'a port is named like "/dev/ttyUSB0", "COM3" or "socket://HOST:PORT"'
        raise ProgramError(f"{address}: there is no such file", f"check the name, {ports}", UNREADABLE)
    _refuse(address, how if speed == 1.0 else {"speed": speed, **how})
    return _Live(address, sensor, baud, scene_from(scene))


def _refuse(what: str, given: Mapping[str, Any]) -> None:
    """Refuse options that would have no effect on a source."""
    if unused := [name for name, value in given.items() if value is not None]:
        raise ProgramError(f"{what}: {', '.join(unused)} would have no effect on this source", "leave that out")


def _clock(speed: float) -> Clock:
    return SystemClock() if math.isfinite(speed) else VirtualClock()


def _bench(scene: Scene, speed: float) -> _Played:
    """Return a simulated bench, whose samples are made as they are wanted."""
    sigma_m = SIGMA_M if scene.sensor_sigma_m is None else scene.sensor_sigma_m.value
    info, nothing = SourceInfo("simulated", "scene", SIMULATED_RATE_HZ, sigma_m), concatenate(())
    loaded = Loaded(Recording("", "scene", info, "distance", nothing), "memory", scene=scene.to_mapping())
    return _Played(loaded, _swing(scene, sigma_m, _clock(speed), speed))


def _swing(scene: Scene, sigma_m: float, clock: Clock, speed: float) -> Iterator[Block]:
    """Yield the samples of a simulated rangefinder without end, each block when its last sample is due."""
    position, rng, began_ns = bench_position(scene), np.random.default_rng(0), clock.now_ns()
    for first in count(0, BLOCK_SAMPLES):
        t = np.arange(first, first + BLOCK_SAMPLES) / SIMULATED_RATE_HZ
        distance = np.array([position(each) for each in t]) + sigma_m * rng.standard_normal(BLOCK_SAMPLES)
        clock.sleep_until_ns(began_ns + int(1e9 * t[-1] / speed))
        yield Block(first, t, distance, np.zeros(BLOCK_SAMPLES, np.uint8))


class _Played:
    """A recording or a simulated bench; what is recorded is kept in memory until the end."""

    def __init__(self, loaded: Loaded, blocks: Iterable[Block]) -> None:
        self.info = loaded.info
        self._loaded, self._blocks, self._path, self._kept = loaded, blocks, Path(), list[Block]()

    def record(self, path: str | os.PathLike[str]) -> None:
        demand_new(Path(path), 1)
        self._path = Path(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self._path != Path():
            save_run(self._path, self._loaded, blocks=self._kept)

    def __iter__(self) -> Iterator[Block]:
        for block in self._blocks:
            if self._path != Path():
                self._kept.append(block)
            yield block


class _Live:
    """A sensor on a port."""

    def __init__(self, address: str, sensor: str | None, baud: int | None, scene: Scene | None) -> None:
        _, names, measured = name_sensors((address,), () if sensor is None else (sensor,), baud)
        family = get_family(names[0])
        baud = measured or family.baud
        self._port = SerialPort(address, baud)
        tables = None if scene is None else scene.to_mapping()
        self._session = Session([OpenSensor(family, self._port, baud=baud)], SystemClock(), scene=tables)
        self._recorder: Recorder | None = None
        self._path = Path()

    @property
    def info(self) -> SourceInfo:
        sensor = self._session.sensors[0]
        return sensor.chain().info(sensor.port.name)

    def record(self, path: str | os.PathLike[str]) -> None:
        demand_new(Path(path), 1)
        self._path = Path(path)
        self._recorder = self._session.preview(self._path.with_suffix(".wire"))
        if self._recorder is None:
            why = "; ".join(self._session.failures.describe())
            raise ProgramError(f"{path}: the recording cannot begin ({why})", "choose another folder")

    def __enter__(self) -> Self:
        self._session.listen()
        return self

    def __exit__(self, *error: object) -> None:
        self._session.stop()
        self._port.close()
        if self._recorder is not None:
            self._recorder.close()
            whole = not self._recorder.status.dropped_records
            recover(self._recorder.contents(), self._path, remove_log=whole, provenance=made_now())

    def __iter__(self) -> Iterator[Block]:
        while not self._session.lost:
            for _, block in self._session.poll(POLL_S):
                yield block
