"""Measure the cost of the page during a recording: processor time, memory, and the delay from a reading to a viewer.

Prints a line for each figure. The recording is a simulated bench at 100 Hz behind a pseudo-terminal. The viewers are
sockets in this process that read everything they receive, or a browser (``--browser``) that draws the page.
``--history H`` plays H hours in a browser and prints the time between frames.
``--floor`` measures a bare server without springmass that sends the same amount to one viewer at the same rate.
``--suspend S`` makes one viewer stop reading for S seconds.
``--slip`` compares the time stamps of the sampler with and without the page.
"""

from __future__ import annotations

import argparse
import http.client
import json
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from storage.run_file.reading import open_run

SCENE = """
[bob]
mass_kg = 0.2
[spring]
constant_n_per_m = 14.0
mass_kg = 0.01
[start]
displacement_m = 0.05
"""
SETTLED_S = 6.0
"""Time for sending the history and for loading the modules of the first analysis, s."""
DRAWN = """() => {
  window.drawn = [];
  let seen = samples[0].count;
  const look = () => {
    if (samples[0].count > seen) {
      const now = (performance.timeOrigin + performance.now()) / 1e3;
      for (let i = seen; i < samples[0].count; i++) drawn.push([now, samples[0].t[i]]);
      seen = samples[0].count;
    }
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}"""

BARE = """
import asyncio, socket, sys, uvicorn

async def bare(scope, receive, send):
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.accept"})
        while True:
            await send({"type": "websocket.send", "bytes": bytes(int(sys.argv[2]))})
            await asyncio.sleep(float(sys.argv[1]))

with socket.create_server(("127.0.0.1", 0)) as listener:
    print(listener.getsockname()[1], flush=True)
    uvicorn.run(bare, fd=listener.fileno(), lifespan="off", log_level="error", ws_per_message_deflate=False)
"""

FRAMES = """(count) => new Promise((done) => {
  const each = [];
  let before = performance.now();
  const next = () => {
    const now = performance.now();
    each.push(now - before);
    before = now;
    if (each.length < count) requestAnimationFrame(next); else done(each);
  };
  requestAnimationFrame(next);
})"""


@dataclass(frozen=True)
class Bench:
    """A running recording."""

    address: str
    page: int

    def cpu_s(self, thread: str = "") -> float:
        """Return the processor time of the page, or of its serving thread, s."""
        task = f"task/{self.page}/" if thread == "serving" else ""
        fields = Path(f"/proc/{self.page}/{task}stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def memory_mb(self) -> float:
        """Return the page's resident memory, MB."""
        pages = int(Path(f"/proc/{self.page}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@contextmanager
def recording(folder: Path, *, page: bool = True, seconds: float | None = None) -> Iterator[Bench | None]:
    """Record a simulated bench, with or without its page."""
    scene = folder / "bench.toml"
    scene.write_text(SCENE)
    command = ["record", "--simulate", "--scene", str(scene), "-o", str(folder / "run.h5")]
    command += ["--page", "--no-browser"] if page else []
    command += [] if seconds is None else ["--seconds", str(seconds)]
    with subprocess.Popen(
        [sys.executable, "-m", "springmass", *command], stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True
    ) as process:
        assert process.stderr is not None
        found = None
        if page:
            address = next(m[1] for line in process.stderr if (m := re.search(r"page: (http\S+)", line)))
            listed = subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True, check=True)
            found = Bench(address, int(listed.stdout.split()[0]))
        drain = threading.Thread(target=process.stderr.read)
        drain.start()
        try:
            yield found
        finally:
            if seconds is None:
                process.send_signal(signal.SIGINT)
            drain.join()


def _sockets(bench: Bench) -> dict[str, object]:
    """Return the arguments that open a socket of the page."""
    parts = urlsplit(bench.address)
    connection = http.client.HTTPConnection(parts.netloc)
    connection.request("GET", f"/?{parts.query}")
    cookie = str(connection.getresponse().headers["Set-Cookie"]).split(";")[0]
    connection.close()
    return {
        "uri": f"ws://{parts.netloc}/v2/run",
        "origin": f"http://{parts.netloc}",
        "additional_headers": {"Cookie": cookie},
        "max_size": None,
    }


def measure(seconds: float, viewers: int, suspended_s: float = 0.0) -> dict[str, float]:
    """Return shares of a core, the lag of samples at a viewer, s, and the cost of a suspended viewer, MB and s."""
    with tempfile.TemporaryDirectory() as folder, recording(Path(folder)) as bench:
        assert bench is not None
        return _watch(bench, seconds, viewers, suspended_s)


def _watch(bench: Bench, seconds: float, viewers: int, suspended_s: float) -> dict[str, float]:
    from websockets.sync.client import connect

    opened = _sockets(bench)
    arrivals: list[tuple[float, float]] = []
    over = threading.Event()

    def view(number: int) -> None:
        with connect(**opened) as run:  # type: ignore[arg-type]
            while not over.is_set():
                message = run.recv()
                if number == 0 and isinstance(message, bytes):
                    count = struct.unpack_from("<4I", message)[3]
                    t = np.frombuffer(message, "<f8", count, 16)
                    arrivals.extend((time.perf_counter(), each) for each in t)
                elif number == 0:
                    json.loads(message)

    threads = [threading.Thread(target=view, args=(number,)) for number in range(viewers)]
    for thread in threads:
        thread.start()
    over.wait(SETTLED_S)
    before, serving, start = bench.cpu_s(), bench.cpu_s("serving"), time.perf_counter()
    seen = len(arrivals)
    over.wait(seconds)
    passed = time.perf_counter() - start
    found = {"cpu": (bench.cpu_s() - before) / passed, "serving": (bench.cpu_s("serving") - serving) / passed}
    came, taken = np.array(arrivals[seen:]).T
    if suspended_s:
        with connect(**opened) as run:  # type: ignore[arg-type]
            run.recv()
            memory = bench.memory_mb()
            over.wait(suspended_s)
            found["memory_mb"] = bench.memory_mb() - memory
            start, newest, latest = time.perf_counter(), -1.0, arrivals[-1][1]
            while newest < latest:
                message = run.recv()
                if isinstance(message, bytes):
                    newest = float(np.frombuffer(message, "<f8", struct.unpack_from("<4I", message)[3], 16)[-1])
            found["current_s"] = time.perf_counter() - start
    over.set()
    for thread in threads:
        thread.join()
    lag = came - taken
    lag -= lag.min()  # the minimum counts as zero, because the two clocks have no common origin
    return {**found, "p50_s": float(np.median(lag)), "p95_s": float(np.quantile(lag, 0.95))}


def floor(seconds: float) -> float:
    """Return the share of a core of a bare server that sends samples to one viewer at the page's rate."""
    from websockets.sync.client import connect

    from springmass.page.web.server import TURN_S

    size = 16 + 16 * round(100 * TURN_S)
    command = [sys.executable, "-c", BARE, str(TURN_S), str(size)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        bench = Bench("", process.pid)
        with connect(f"ws://127.0.0.1:{process.stdout.readline().strip()}/", compression=None) as run:
            before, start = bench.cpu_s(), time.perf_counter()
            while time.perf_counter() < start + seconds:
                assert len(run.recv()) == size
            share = (bench.cpu_s() - before) / (time.perf_counter() - start)
        process.terminate()
    return share


def screen(seconds: float) -> dict[str, float]:
    """Return the delay from a sample's host time to its frame in headless Chromium, s, and shares of a core."""
    from tests.browser import headless

    with tempfile.TemporaryDirectory() as folder:
        with recording(Path(folder)) as bench, headless() as browser:
            assert bench is not None
            page = browser.new_page(viewport={"width": 1366, "height": 900})
            page.goto(bench.address)
            page.wait_for_function("() => samples.length && samples[0].count > 600")
            before, serving, start = bench.cpu_s(), bench.cpu_s("serving"), time.perf_counter()
            page.evaluate(DRAWN)
            page.wait_for_timeout(1e3 * seconds)
            drawn = np.array(page.evaluate("drawn"))
            passed = time.perf_counter() - start
            cpu, serve = (bench.cpu_s() - before) / passed, (bench.cpu_s("serving") - serving) / passed
        with open_run(Path(folder) / "run.h5") as run:
            samples = run.samples()
    assert samples.host_ns is not None
    offset_s = time.time() - time.monotonic()  # the time stamps come from the monotonic clock
    stamped = np.interp(drawn[:, 1], samples.t, samples.host_ns * 1e-9 + offset_s)
    lag = drawn[:, 0] - stamped
    return {"cpu": cpu, "serving": serve, "p50_s": float(np.median(lag)), "p95_s": float(np.quantile(lag, 0.95))}


def history(hours: float, frames: int = 240) -> dict[str, float]:
    """Return the time between frames while ``hours`` are played, s: with all hours in view, and with one minute."""
    from tests.browser import headless

    with tempfile.TemporaryDirectory() as folder, headless() as browser:
        path, t = Path(folder) / "long.txt", np.arange(round(hours * 360_000)) / 100.0
        y = 25.0 + 5.0 * np.exp(-1e-4 * t) * np.cos(8.0 * t)
        rows = "".join(f"{a:.2f}\t{b:.4f}\t0.239\n" for a, b in zip(t, y, strict=True))
        path.write_text(
            f"Motion Sensor Data File Mar 12, 2024 2:05 PM\nTime (s)\tDistance (cm)\tDist Error (cm)\n{rows}"
        )
        command = [sys.executable, "-m", "springmass", "replay", str(path), "--page", "--no-browser"]
        with subprocess.Popen(command, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True) as process:
            assert process.stderr is not None
            address = next(m[1] for line in process.stderr if (m := re.search(r"page: (http\S+)", line)))
            page = browser.new_page(viewport={"width": 1366, "height": 900})
            page.goto(address)
            page.wait_for_function(f"() => samples.length && samples[0].count >= {t.size}", timeout=120_000)
            page.select_option("#speed", "20")
            page.locator("#time").fill("0.6")
            page.keyboard.press(" ")
            found = {}
            for window in ("all", "60 s"):
                while not page.inner_text("#window").startswith(window):
                    page.keyboard.press("w")
                each = np.array(page.evaluate(FRAMES, frames)) / 1e3
                found |= {f"{window}_p50_s": float(np.median(each)), f"{window}_p95_s": float(np.quantile(each, 0.95))}
            process.send_signal(signal.SIGINT)
            process.stderr.read()
    return found


def slip(seconds: float, *, page: bool) -> float:
    """Return the 99th percentile of the sampler's delay relative to the sensor's clock, s."""
    with tempfile.TemporaryDirectory() as folder:
        with recording(Path(folder), page=page, seconds=None if page else seconds) as bench:
            if bench is not None:
                _watch(bench, seconds, 2, 0.0)
        with open_run(Path(folder) / "run.h5") as run:
            samples = run.samples()
    assert samples.host_ns is not None
    late = samples.host_ns * 1e-9 - samples.t
    return float(np.quantile(late - late.min(), 0.99))


def _listed(found: dict[str, float]) -> str:
    return (
        f"{100 * found['serving']:.1f} % of a core to serve, {100 * found['cpu']:.1f} % with the analysis; "
        f"p50 {1e3 * found['p50_s']:.0f} ms, p95 {1e3 * found['p95_s']:.0f} ms"
    )


def main() -> None:
    """Measure, and print the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--viewers", type=int, default=1)
    parser.add_argument("--suspend", type=float, default=0.0, metavar="S")
    parser.add_argument("--browser", action="store_true")
    parser.add_argument("--floor", action="store_true")
    parser.add_argument("--slip", action="store_true")
    parser.add_argument("--history", type=float, default=0.0, metavar="HOURS")
    options = parser.parse_args()
    if options.browser:
        print(f"page in a browser, sample to screen: {_listed(screen(options.seconds))}")
    elif options.floor:
        print(
            f"a bare server that sends the same amount at the same rate: {100 * floor(options.seconds):.1f} % of a core"
        )
    elif options.history:
        intervals = ", ".join(f"{name[:-2]} {1e3 * each:.0f} ms" for name, each in history(options.history).items())
        print(f"between frames while {options.history:g} h at 100 Hz are played: {intervals}")
    elif options.slip:
        without, beside = (slip(options.seconds, page=page) for page in (False, True))
        print(f"sampler's slip, p99: {1e3 * without:.1f} ms without the page, {1e3 * beside:.1f} ms with two viewers")
    else:
        found = measure(options.seconds, options.viewers, options.suspend)
        print(f"page, {options.viewers} viewers, sample to socket: {_listed(found)}")
        if options.suspend:
            grown, current = found["memory_mb"], 1e3 * found["current_s"]
            print(f"a viewer suspended {options.suspend:g} s: {grown:+.1f} MB, current after {current:.0f} ms")


if __name__ == "__main__":
    main()
