"""The simulated rangefinder on a pseudo-terminal, which the real serial code reads like a sensor.

It works on POSIX only. A pseudo-terminal ignores the baud rate, so the clock determines when bytes are sent.
"""

from __future__ import annotations

import errno
import os
import pty
import tempfile
import threading
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.clock import Clock
from acquisition.decoders.family import Family
from acquisition.simulated.rangefinder import Shot, VirtualRangefinder

__all__ = ["Faults", "VirtualPort"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """The faults of a line, at random times or at given times of the run.

    Parameters
    ----------
    noise_rate, drop_rate, flip_rate : float
        Probability, per frame, that random bytes are inserted before it, that one of its bytes is dropped, and that
        one of its bits is flipped (which makes a checksum wrong).
    stall : tuple of float
        (start, duration) of a stall, s: silence, and then all delayed bytes together.
    unplug : tuple of float
        (start, duration) of an unplugging, s: the port disappears and comes back; readings in between are lost.
    flood : tuple of float
        (start in s, number of bytes) of a flood: random bytes that are sent together.
    wrong_baud : bool
        Whether each frame is replaced by random bytes, as if the baud rate of the port were wrong.
    """

    noise_rate: float = 0.0
    drop_rate: float = 0.0
    flip_rate: float = 0.0
    stall: tuple[float, float] | None = None
    unplug: tuple[float, float] | None = None
    flood: tuple[float, int] | None = None
    wrong_baud: bool = False


class VirtualPort:
    """A simulated sensor that is available as a port, at ``path``.

    Parameters
    ----------
    family : Family
        Family of the simulated sensor. A sensor of a polled family answers requests; others send without requests.
    rangefinder : VirtualRangefinder
    clock : Clock
    seconds : float
        Time after which the sensor stops sending, s.
    faults : Faults, optional
    rng : numpy.random.Generator, optional
        Generator of the random numbers of the faults.
    options : mapping, optional
        Options of the encoder of the family.
    """

    def __init__(
        self,
        family: Family,
        rangefinder: VirtualRangefinder,
        clock: Clock,
        *,
        seconds: float,
        faults: Faults | None = None,
        rng: np.random.Generator | None = None,
        options: dict[str, object] | None = None,
    ) -> None:
        self._family = family
        self._rangefinder = rangefinder
        self._clock = clock
        self._seconds = seconds
        self._faults = faults or Faults()
        self._rng = rng or np.random.default_rng(0)
        self._encoder = family.encoder(**(options or {}))
        self._folder = tempfile.TemporaryDirectory(prefix="springmass-")
        self.path = str(Path(self._folder.name) / "port")
        self.sent = 0
        self.unsent = 0
        self._master = -1
        self._slave = -1
        self._stop = threading.Event()
        self.done = threading.Event()
        self._thread = threading.Thread(target=self._run, name="springmass-sensor", daemon=True)
        self._plug()

    def __enter__(self) -> VirtualPort:
        return self

    def start(self) -> None:
        """Start measuring and sending."""
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop sending and remove the port."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self._pull()
        self._folder.cleanup()

    def _plug(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        place = Path(self.path)
        place.unlink(missing_ok=True)
        place.symlink_to(os.ttyname(self._slave))

    def _pull(self) -> None:
        Path(self.path).unlink(missing_ok=True)
        for descriptor in (self._slave, self._master):
            if descriptor >= 0:
                os.close(descriptor)
        self._slave = self._master = -1

    def _run(self) -> None:
        start_ns = self._clock.now_ns()
        frames = self._answers(start_ns) if self._family.poll is not None else self._stream(start_ns)
        try:
            self._send_frames(frames)
        finally:
            self.done.set()

    def _send_frames(self, frames: Iterator[tuple[Shot, bytes]]) -> None:
        held: list[bytes] = []
        flooded = False
        for shot, frame in frames:
            if not self._plugged(shot.true_s):
                self.unsent += 1
                continue
            if self._faults.flood is not None and not flooded and shot.true_s >= self._faults.flood[0]:
                flooded = True
                self._send(self._rng.bytes(int(self._faults.flood[1])))
            spoiled = self._spoiled(frame)
            if self._within(self._faults.stall, shot.true_s):
                held.append(spoiled)
                continue
            self._send(b"".join([*held, spoiled]))
            self.sent += len(held) + 1
            held.clear()
        self._send(b"".join(held))
        self.sent += len(held)

    def _plugged(self, t: float) -> bool:
        """Plug or unplug the port according to the faults at time ``t``; return whether it is plugged in."""
        out = self._within(self._faults.unplug, t)
        if out and self._master >= 0:
            self._pull()
        elif not out and self._master < 0:
            self._plug()
        return not out

    def _stream(self, start_ns: int) -> Iterator[tuple[Shot, bytes]]:
        for shot in self._rangefinder.shots():
            if shot.true_s >= self._seconds or self._stop.is_set():
                return
            self._clock.sleep_until_ns(start_ns + round(shot.true_s * 1e9))
            yield shot, self._frame(shot)

    def _answers(self, start_ns: int) -> Iterator[tuple[Shot, bytes]]:
        """Yield one shot and its reply for each request, taken when the request arrives."""
        assert self._family.poll is not None
        waiting = b""
        sequence = 0
        while not self._stop.is_set():
            now_s = (self._clock.now_ns() - start_ns) * 1e-9
            if now_s >= self._seconds:
                return
            waiting = waiting + self._received() if self._plugged(now_s) else b""
            if not waiting:
                self._clock.sleep_until_ns(self._clock.now_ns() + 500_000)
                continue
            request, waiting = waiting[: len(self._family.poll.request)], waiting[len(self._family.poll.request) :]
            sequence = int(now_s * self._rangefinder.sensor.rate_hz)
            shot = self._rangefinder.shot(sequence)
            yield shot, self._answer(request, shot)

    def _received(self) -> bytes:
        if self._master < 0:
            return b""
        try:
            return os.read(self._master, 4096)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno == errno.EIO:  # no program has the other end open
                return b""
            raise

    def _answer(self, request: bytes, shot: Shot) -> bytes:
        # Some encoders distinguish requests for the distance from requests for the temperature.
        reply = getattr(self._encoder, "reply", None)
        if reply is None:
            return self._frame(shot)
        return bytes(reply(request, distance_m=shot.distance_m, temperature_c=shot.temperature_c))

    def _frame(self, shot: Shot) -> bytes:
        return self._encoder.encode(
            sequence=shot.sequence,
            device_us=shot.device_us,
            echo_us=shot.echo_us,
            distance_m=shot.distance_m,
            temperature_c=shot.temperature_c,
        )

    def _spoiled(self, frame: bytes) -> bytes:
        faults, rng = self._faults, self._rng
        data = bytearray(frame)
        if faults.noise_rate and rng.random() < faults.noise_rate:
            data = bytearray(rng.bytes(int(rng.integers(1, 8)))) + data
        if faults.drop_rate and rng.random() < faults.drop_rate and data:
            del data[int(rng.integers(len(data)))]
        if faults.flip_rate and rng.random() < faults.flip_rate and data:
            data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
        if faults.wrong_baud:
            data = bytearray(rng.bytes(max(len(data) // 2, 1)))
        return bytes(data)

    def _send(self, data: bytes) -> None:
        """Write all bytes; wait for a slow reader, with which a real sensor would lose bytes."""
        remaining = memoryview(data)
        while remaining and not self._stop.is_set():
            try:
                remaining = remaining[os.write(self._master, remaining) :]
            except BlockingIOError:
                self._clock.sleep_until_ns(self._clock.now_ns() + 1_000_000)

    @staticmethod
    def _within(span: tuple[float, float] | None, t: float) -> bool:
        return span is not None and span[0] <= t < span[0] + span[1]
