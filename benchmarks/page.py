"""What the page costs: processor time of its process, and the time from a reading to a viewer, while a bench records.

Prints one line. The recording is a simulated bench at 100 Hz behind a pseudo-terminal; the viewers are sockets that
read all they are sent, in this process.
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
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

SCENE = """
[bob]
mass_kg = 0.2
[spring]
constant_n_per_m = 14.0
mass_kg = 0.01
[start]
displacement_m = 0.05
"""


def measure(seconds: float, viewers: int) -> dict[str, float]:
    """Return the share of a core that the page takes, and the lag of its samples at their viewers, s."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "bench.toml"
        scene.write_text(SCENE)
        command = ["record", "--simulate", str(scene), "-o", str(Path(folder) / "run.h5"), "--page", "--no-browser"]
        with subprocess.Popen(
            [sys.executable, "-m", "springmass", *command], stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True
        ) as recording:
            assert recording.stderr is not None
            address = next(found[1] for line in recording.stderr if (found := re.search(r"page: (http\S+)", line)))
            drain = threading.Thread(target=recording.stderr.read)
            drain.start()
            page = _child(recording.pid)
            lags = _watch(address, seconds, viewers, page)
            recording.send_signal(signal.SIGINT)
            drain.join()
    return lags


def _child(parent: int) -> int:
    listed = subprocess.run(["pgrep", "-P", str(parent)], capture_output=True, text=True, check=True)
    return int(listed.stdout.split()[0])


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _watch(address: str, seconds: float, viewers: int, page: int) -> dict[str, float]:
    from websockets.sync.client import connect

    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.netloc)
    connection.request("GET", f"/?{parts.query}")
    headers = {"Cookie": str(connection.getresponse().headers["Set-Cookie"]).split(";")[0]}
    connection.close()
    url, origin = f"ws://{parts.netloc}/v1/run", f"http://{parts.netloc}"
    arrivals: list[tuple[float, float]] = []
    over = threading.Event()

    def view(number: int) -> None:
        with connect(url, origin=origin, additional_headers=headers, max_size=None) as run:  # type: ignore[arg-type]
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
    over.wait(5.0)  # the history, and what the first analysis loads
    before, start = _cpu_s(page), time.perf_counter()
    seen = len(arrivals)
    over.wait(seconds)
    share = (_cpu_s(page) - before) / (time.perf_counter() - start)
    over.set()
    for thread in threads:
        thread.join()
    came, taken = np.array(arrivals[seen:]).T
    lag = came - taken
    lag -= lag.min()  # the earliest is taken for at once: clocks of two processes have no common zero
    return {"cpu": share, "p50_s": float(np.median(lag)), "p95_s": float(np.quantile(lag, 0.95))}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--viewers", type=int, default=1)
    options = parser.parse_args()
    found = measure(options.seconds, options.viewers)
    print(
        f"page, {options.viewers} viewers: {100 * found['cpu']:.1f} % of a core with its analysis, "
        f"sample to socket p50 {1e3 * found['p50_s']:.0f} ms, p95 {1e3 * found['p95_s']:.0f} ms"
    )


if __name__ == "__main__":
    main()
