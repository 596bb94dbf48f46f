"""Measure the analysis of twenty records of two minutes: one joint table and one report.

Run ``python benchmarks/many.py``. It prints the wall and processor time of ``springmass analyse`` over twenty files,
warm (after a first call in this process), without the report and with it.
"""

from __future__ import annotations

import contextlib
import io
import resource
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from springmass.cli import main

RUNS = 20
SECONDS = 120


@dataclass(frozen=True, slots=True)
class Taken:
    """The cost and output of a call.

    Parameters
    ----------
    wall_s, processor_s : float
        Wall time, and processor time of this process and its children, s.
    table : str
        The printed text.
    """

    wall_s: float
    processor_s: float
    table: str


def recordings(folder: Path, runs: int = RUNS, seconds: int = SECONDS) -> list[Path]:
    """Write damped records at 100 Hz in the form of MotionSensor.vi; return their paths."""
    t = np.arange(100 * seconds) / 100.0
    paths = []
    for i in range(runs):
        noise = 0.03 * np.random.default_rng(i).standard_normal(t.size)
        y = 20.0 + 5.0 * np.exp(-0.01 * t) * np.cos(8.0 * (1.0 + 0.002 * i) * t + i) + noise
        rows = "\r\n".join(f"{a:.3f}\t{b:.3f}\t0.239" for a, b in zip(t, y, strict=True))
        head = "Motion Sensor Data File Mar 12, 2024 2:05 PM\r\nTime (s)\tDistance (cm)\tDist Error (cm)\r\n"
        paths.append(folder / f"run{i:02d}.txt")
        paths[-1].write_bytes(f"{head}{rows}\r\n".encode())
    return paths


def analysed(paths: list[Path], out: Path, *options: str) -> Taken:
    """Run the command in this process and measure its times."""
    printed = io.StringIO()
    before, start = _processor_s(), time.perf_counter()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
        code = main(["analyse", *map(str, paths), "-o", str(out), *options])
    if code:
        raise RuntimeError(f"analyse ended with {code}")
    return Taken(time.perf_counter() - start, _processor_s() - before, printed.getvalue())


def _processor_s() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        files = recordings(Path(name))
        analysed(files[:1], Path(name))
        for what, options in (("one table", ["--no-report"]), ("and one report", [])):
            taken = min((analysed(files, Path(name), *options) for _ in range(3)), key=lambda each: each.wall_s)
            print(f"{RUNS} runs, {what}: {taken.wall_s:.2f} s, {taken.processor_s:.2f} s of processor")
