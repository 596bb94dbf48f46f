"""Measure speed and memory of reading old recordings, as ratios to named readers within one run: `make bench`.

The two sides of a pair alternate, each call runs in a separate process, and the minima of both sides are compared. For
cold starts this is the processor time of the whole process; for files it is that of the call alone, or the peak
resident memory. Processor time (user and system, of all threads) does not depend on other programs on the machine.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

REPO_ROOT = Path(__file__).resolve().parents[1]
COLD_ROWS, LONG_ROWS, LVM_ROWS = 12_000, 1_000_000, 51_200
TIMES = 20

OPEN = (
    "from acquisition.recordings.identify import open_recording as f; "
    "import acquisition.recordings.families.motion_sensor"
)
LOAD = (
    "from springmass.loading.load import load as f; "
    "import storage.run_file.reading, acquisition.recordings.families.motion_sensor"
)
AGAIN = f"; g = f; f = lambda p: [g(p) for _ in range({TIMES})]"  # a short file is read repeatedly, warm
PANDAS = "import pandas; f = lambda p: pandas.read_csv(p, sep='\\t', skiprows=1, engine='c')"
LVM = "import acquisition.recordings.families.motion_sensor, acquisition.recordings.families.lvm; "
LVM += "from acquisition.recordings.identify import open_recording; "
LVM += "from acquisition.recordings.reading import ReadOptions; "
LVM += "f = lambda p: open_recording(p, ReadOptions(channel='Acceleration_0', unit='m'))"
LVM_READ = "from lvm_read import read; f = lambda p: read(p, read_from_pickle=False, dump_file=False)"

TIMED = """
import json, resource, sys, time
{setup}
start = time.process_time()
kept = f(sys.argv[1])
seconds = time.process_time() - start
print(json.dumps([seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss]))
"""
COLD = "import sys\n{setup}\nkept = f(sys.argv[1])"


@dataclass(frozen=True)
class Ratio:
    """One ratio of our cost to that of another reader, with its limit."""

    name: str
    limit: float
    ours: Callable[[], float]
    theirs: Callable[[], float]
    rounds: int = 5
    calls: int = 1
    """Number of calls of each side per process; if there are several, the time of one call is printed in ms."""

    def take(self, rounds: int | None = None) -> tuple[float, float]:
        """Return the minimum of each side; the two sides alternate."""
        best = [float("inf"), float("inf")]
        for _ in range(rounds or self.rounds):
            for side, call in enumerate((self.ours, self.theirs)):
                best[side] = min(best[side], call())
        return best[0], best[1]


def write_motion_sensor(path: Path, rows: int, seed: int = 0) -> Path:
    """Write a MotionSensor.vi position file with ``rows`` rows at 100 Hz."""
    rng = np.random.default_rng(seed)
    with path.open("w", newline="") as file:
        file.write("Motion Sensor Data File Sep 20, 2018 1:40 PM\r\nTime (s)\tDistance (cm)\tDist Error (cm)\r\n")
        for start in range(0, rows, 100_000):
            i = np.arange(start, min(start + 100_000, rows))
            x = 25 + 5 * np.sin(i / 12.7) + 0.01 * rng.standard_normal(i.size)
            file.writelines(f"{t:.3f}\t{y:.3f}\t0.239\r\n" for t, y in zip(i / 100, x, strict=True))
    return path


def write_lvm(path: Path, rows: int, seed: int = 0) -> Path:
    """Write an LVM file like that of an impact test: commas, two channels, one column of times."""
    rng = np.random.default_rng(seed)
    head = (
        "LabVIEW Measurement,\nWriter_Version,2\nSeparator,Comma\nDecimal_Separator,.\nMulti_Headings,No\n"
        "X_Columns,One\n***End_of_Header***,\n,\nChannels,2,,\n"
        f"Samples,{rows},{rows},\nDate,2023/05/05,2023/05/05,\nTime,13:40:37.7,13:40:37.7,\n"
        "Y_Unit_Label,m/s^2,m/s^2,\nX_Dimension,Time,Time,\nX0,0.0,0.0,\nDelta_X,1.953125E-5,1.953125E-5,\n"
        "***End_of_Header***,,,\nX_Value,Acceleration_0,Acceleration_1,Comment\n"
    )
    t, values = np.arange(rows) * 1.953125e-5, 2 * rng.standard_normal((rows, 2))
    body = (f"{a:.6f},{b:.6f},{c:.6f},\n" for a, (b, c) in zip(t, values, strict=True))
    path.write_text(head + "".join(body))
    return path


def timed(setup: str, path: Path, what: int) -> Callable[[], float]:
    """Return a call that reads a file in a separate process and returns its time, s (0), or peak memory, KiB (1)."""

    def call() -> float:
        code = TIMED.format(setup=setup)
        done = subprocess.run(
            [sys.executable, "-c", code, str(path)], check=True, stdout=subprocess.PIPE, cwd=REPO_ROOT
        )
        return float(json.loads(done.stdout)[what])

    return call


def cold(setup: str, path: Path) -> Callable[[], float]:
    """Return a call that times a whole process; both sides use compiled modules, as after an installation."""
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(path.parent / "compiled"), "PYTHONDONTWRITEBYTECODE": ""}

    def call() -> float:
        command = [sys.executable, "-c", COLD.format(setup=setup), str(path)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)  # os.times() counts in hundredths of a second
        subprocess.run(command, check=True, cwd=REPO_ROOT, env=environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    return call


def ratios(folder: Path, cold_rows: int, long_rows: int, lvm_rows: int) -> Iterator[Ratio]:
    """Yield every ratio, to be measured on files written into a folder."""
    from springmass.loading.load import load
    from storage.run_file.writing import write_run

    short = write_motion_sensor(folder / "short.txt", cold_rows)
    long = write_motion_sensor(folder / "long.txt", long_rows)
    lvm = write_lvm(folder / "run.lvm", lvm_rows)
    loaded = load(long)
    run = write_run(folder / "long.h5", [loaded.samples], loaded.info, originals=loaded.originals)
    del loaded
    yield Ratio(f"cold, {cold_rows} rows: ours / pandas.read_csv", 0.45, cold(OPEN, short), cold(PANDAS, short), 9)
    name = f"{cold_rows} rows, twenty times: ours / pandas.read_csv (C)"
    yield Ratio(f"{name}, seconds", 15.0, timed(OPEN + AGAIN, short, 0), timed(PANDAS + AGAIN, short, 0), calls=TIMES)
    name = f"{long_rows} rows: ours / pandas.read_csv (C)"
    yield Ratio(f"{name}, seconds", 30.0, timed(OPEN, long, 0), timed(PANDAS, long, 0))
    yield Ratio(f"{name}, peak memory", 2.0, timed(OPEN, long, 1), timed(PANDAS, long, 1), 1)
    yield Ratio(f"LVM, {lvm_rows} rows: ours / lvm_read", 2.0, timed(LVM, lvm, 0), timed(LVM_READ, lvm, 0))
    # A run file is verified at every load: unpacking and hashing the original's bytes take three fifths of the time.
    yield Ratio(f"{long_rows} rows: run file / its text", 1 / 2, timed(LOAD, run, 0), timed(LOAD, long, 0), 9)


def main() -> int:
    """Print each ratio with its limit; return 1 if a limit is exceeded."""
    over = 0
    with tempfile.TemporaryDirectory(prefix="springmass-bench-") as folder:
        for each in ratios(Path(folder), COLD_ROWS, LONG_ROWS, LVM_ROWS):
            ours, theirs = each.take()
            ratio = ours / theirs
            over += ratio > each.limit
            verdict = "ok" if ratio <= each.limit else "OVER"
            one = (
                f", {1e3 * ours / each.calls:.2f} / {1e3 * theirs / each.calls:.2f} ms a call" if each.calls > 1 else ""
            )
            print(
                f"{verdict:4} {ratio:6.3f}  (limit {each.limit:.3f})  {each.name}: {ours:.4g} / {theirs:.4g}{one}",
                flush=True,
            )
    return int(over > 0)


if __name__ == "__main__":
    raise SystemExit(main())
