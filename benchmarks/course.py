"""Measure a course of runs: speed against loops of pandas and lmfit, second passes, memory, efficiency, a search.

Run ``python benchmarks/course.py [--runs N] [--searched N]``; the full benchmark is ``--runs 10000``. Both sides of a
ratio are measured by one call. The script makes its recordings: simulated records of 12,000 samples and, if real
recordings are available, variations of them (another clock, another scale, added noise; written as tables).

- speed of ``batch --jobs 1``, in runs per second and core, relative to a loop of ``pandas.read_csv`` and one lmfit
  damped sine; the two alternate;
- the same speed relative to a loop of lmfit that gives the same answer: a fit of every law of one closed form, the
  selection of a law, and its covariance;
- time of a second pass over unchanged inputs relative to the first pass;
- speed of one pass by two processes relative to two simultaneous passes by one process each over half of the runs, so
  that both sides keep both cores busy. Only the used and idle time of these processes counts, not other load;
- maximum resident memory of a worker, MB.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import lmfit
import numpy as np
import pandas
from threadpoolctl import threadpool_limits

from springmass import load
from springmass.cli import main

SAMPLES = 12_000
PART = 500  # number of runs in a pass; the loop is timed after each pass
SHARE = 2500  # number of runs in a pass by two processes, which alternates with two passes side by side
REAL = (
    ("AyushPandhi__Pandhi_Ayush_PHY224/damped position.txt", {}),
    ("filo0509__smorzamento/molla_durissima_discopieno_14.91945_0.2016_1.csv", {"channel": "position", "unit": "m"}),
)
RECORDINGS = Path(__file__).resolve().parents[2] / "shared" / "recordings"
HEAD = "Motion Sensor Data File Mar 12, 2024 2:05 PM\r\nTime (s)\tDistance (cm)\tDist Error (cm)\r\n"
WORKER = """
import json, sys
from springmass.course.plan import plan
from springmass.commands.questions import for_course
from springmass.course.worker import analyse_one
jobs = plan([sys.argv[1]]).tasks
peaks = []
for part in (jobs[: len(jobs) // 2], jobs[len(jobs) // 2 :]):
    for job in part:
        analyse_one(job, for_course)
    # getrusage would give the memory of the parent process where that is larger.
    line = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
    peaks.append(int(line.split()[1]) / 1024)
print(json.dumps(peaks))
"""
CHILDREN = (resource.RUSAGE_CHILDREN,)
EVERY_S = 0.02  # interval between two readings of the processor time of a pass, s


@dataclass(frozen=True, slots=True)
class Measured:
    """The results of the benchmark.

    Parameters
    ----------
    runs : int
    fast, standard : float
        Speed of each tier relative to read_csv and one lmfit fit.
    same_answer : float
        Speed of the standard tier relative to lmfit with every law.
    second_pass : float
        Time of a second pass relative to the first.
    efficiency : float
        Efficiency of two processes, including the idle time that :func:`idle_of_two` returns.
    half_mb, whole_mb : float
        Maximum memory of a worker after half of the runs and after all of them, MB.
    """

    runs: int
    fast: float
    standard: float
    same_answer: float
    second_pass: float
    efficiency: float
    half_mb: float
    whole_mb: float


def recordings(folder: Path, runs: int) -> None:
    """Write ``runs`` recordings; if real recordings are available, one in 34 is a variation of a real one."""
    t = np.arange(SAMPLES) / 100.0
    real = list(_real())
    for i in range(runs):
        rng = np.random.default_rng(i)
        if real and i % 34 == 33:
            times, y = real[(i // 34) % len(real)]
            times, y = times * (1.0 + 1e-3 * rng.standard_normal()), y * rng.uniform(0.9, 1.1)
            y = y + 1e-4 * rng.standard_normal(y.size)
        else:
            times = t
            y = 0.2 + 0.05 * np.exp(-0.01 * t) * np.cos(8.0 * (1.0 + 0.002 * (i % 50)) * t + i)
            y = y + 3e-4 * rng.standard_normal(t.size)
        rows = "\r\n".join(f"{a:.3f}\t{b:.4f}\t0.239" for a, b in zip(times, 100.0 * y, strict=True))
        (folder / f"run{i:05d}.txt").write_bytes(f"{HEAD}{rows}\r\n".encode())


def _real() -> Iterator[tuple[np.ndarray, np.ndarray]]:
    for name, options in REAL:
        if (RECORDINGS / name).is_file():
            track = load(RECORDINGS / name, **options).loaded.track
            there = np.isfinite(track.t) & np.isfinite(track.y)
            yield track.t[there], track.y[there]


def measure(runs: int, folder: Path) -> Measured:
    """Measure with ``runs`` recordings; the reference loop uses a tenth of them, but at least 20."""
    inputs = folder / "runs"
    inputs.mkdir()
    recordings(inputs, runs)
    files = sorted(inputs.iterdir())
    parts = _split(files, max(2, runs // PART))
    every = max(1, runs // max(20, runs // 10))
    _passed(parts[0], folder / "warm", "fast")  # loads the modules and fills the disk's cache
    loop, took, again = 0.0, {"fast": 0.0, "standard": 0.0}, 0.0
    for i, part in enumerate(parts):  # alternate, so that a slower machine slows both sides
        for tier in took:
            took[tier] += _passed(part, folder / f"{tier}{i}", tier)
            loop += 0.5 * _looped(part[::every]) * len(part)
        again += _passed(part, folder / f"standard{i}", "standard")
    with threadpool_limits(1):
        few = files[: max(1, min(5, runs // 10))]
        every_law = _processor(lambda: [all_laws(*_read(file)) for file in few]) / len(few)
    done = subprocess.run([sys.executable, "-c", WORKER, str(inputs)], check=True, capture_output=True)
    half_mb, whole_mb = json.loads(done.stdout)
    return Measured(
        runs,
        loop / took["fast"],
        loop / took["standard"],
        every_law * runs / took["standard"],
        again / took["standard"],
        _efficiency(files, folder),
        half_mb,
        whole_mb,
    )


def _split(files: Sequence[Path], count: int) -> list[Sequence[Path]]:
    """Split files into ``count`` parts with similar content."""
    return [files[i::count] for i in range(count)]


def _looped(files: Sequence[Path]) -> float:
    """Read files and fit a damped sine to each; return the processor time per file, s."""
    with threadpool_limits(1):
        return _processor(lambda: [damped_sine(*_read(file)) for file in files]) / len(files)


def _passed(files: Sequence[Path], out: Path, tier: str) -> float:
    """Run a pass by one process; return its processor time, s."""
    options = ["-o", str(out), "--reports", "0", "--jobs", "1", "--accuracy", tier]

    def call() -> None:
        with contextlib.redirect_stderr(io.StringIO()):
            if code := main(["batch", *map(str, files), *options]):
                raise RuntimeError(f"batch ended with {code}")

    return _processor(call)


def _processor(call: Callable[[], object], *of: int) -> float:
    """Return the processor time of a call, s; other load on the machine does not count."""

    def used() -> float:
        each = [resource.getrusage(who) for who in of or (resource.RUSAGE_SELF, *CHILDREN)]
        return sum(one.ru_utime + one.ru_stime for one in each)

    before = used()
    call()
    return used() - before


def _started(files: Sequence[Path], out: Path, *options: str) -> subprocess.Popen[bytes]:
    named = [str(file) for file in files]
    command = [sys.executable, "-m", "springmass", "batch", *named, "-o", str(out), "--reports", "0", *options]
    return subprocess.Popen(command, stderr=subprocess.DEVNULL)


def _two_halves(files: Sequence[Path], out: Path) -> None:
    """Run two simultaneous passes by one process each, each over half of the runs."""
    halves = [_started(files[i::2], Path(f"{out}-{i}"), "--jobs", "1") for i in (0, 1)]
    for half in halves:
        _whole(half)


def _whole(process: subprocess.Popen[bytes]) -> None:
    if code := process.wait():
        raise RuntimeError(f"batch ended with {code}")


def _efficiency(files: Sequence[Path], folder: Path) -> float:
    """Return the cost of two passes side by side relative to one pass by two processes, over all runs in parts."""
    apart = two = 0.0
    for i, share in enumerate(_split(files, max(1, len(files) // SHARE))):
        for side_by_side in (True, False) if i % 2 == 0 else (False, True):  # the order alternates
            if side_by_side:
                apart += _processor(partial(_two_halves, share, folder / f"halves{i}"), *CHILDREN)
            else:
                two += _by_two(share, folder / f"both{i}")
    return apart / two


def _by_two(files: Sequence[Path], out: Path) -> float:
    """Run a pass by two processes; return the sum of its processor time and the idle time of the cores, s."""
    idle: list[float] = []
    used = _processor(lambda: idle.append(idle_of_two(files, out)), *CHILDREN)
    return used + sum(idle)


def idle_of_two(files: Sequence[Path], out: Path) -> float:
    """Run a pass by two processes; return how long they leave one of two cores idle, s, read from Linux's ``/proc``.

    The idle time is the time in which the two workers wait for work, and the processor time of the parent process
    while it runs without workers. Time in which a process was ready but other load used the core does not count.
    """
    process = _started(files, out, "--jobs", "2")
    seen: dict[int, tuple[float, float, float]] = {}  # by worker: times of the first and last reading, busy time, s
    alone, mine = 0.0, 0.0
    while process.poll() is None:
        now = time.monotonic()
        workers = {pid: usage for pid in _below(process.pid) if (usage := _busy(pid))}
        for pid, (used, queued) in workers.items():
            seen[pid] = (seen[pid][0] if pid in seen else now, now, used + queued)
        if usage := _busy(process.pid):
            alone += 0.0 if workers else usage[0] - mine
            mine = usage[0]
        time.sleep(EVERY_S)
    _whole(process)
    return alone + sum(max(last - first - busy, 0.0) for first, last, busy in seen.values())


def _below(pid: int) -> list[int]:
    """Return the process numbers of a pass's workers."""
    with contextlib.suppress(OSError):
        below = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return [int(one) for one in below if b"spawn_main" in Path(f"/proc/{one}/cmdline").read_bytes()]
    return []


def _busy(pid: int) -> tuple[float, float] | None:
    """Return how long a process has run and how long it has waited for a core, s; None if it has ended."""
    try:
        used, queued, _ = Path(f"/proc/{pid}/schedstat").read_text().split()
    except OSError:
        return None
    return 1e-9 * int(used), 1e-9 * int(queued)


def _read(file: Path) -> tuple[np.ndarray, np.ndarray]:
    table = pandas.read_csv(file, sep="\t", header=1, usecols=[0, 1])
    return tuple(table.apply(pandas.to_numeric, errors="coerce").dropna().to_numpy().T)  # type: ignore[return-value]


def damped_sine(t: np.ndarray, y: np.ndarray) -> object:
    """Fit a damped sine as a user would, with start values from the spectrum."""

    def model(t, amplitude, gamma, frequency, phase, offset):  # type: ignore[no-untyped-def]
        return offset + amplitude * np.exp(-gamma * t) * np.cos(2 * np.pi * frequency * t + phase)

    return lmfit.Model(model).fit(y, t=t, gamma=0.01, **_guess(t, y))


def all_laws(t: np.ndarray, y: np.ndarray) -> object:
    """Fit every damping law to the samples with lmfit; return the covariance of the fit with the minimum BIC."""

    def amplitude(t, a, mu, gamma, beta):  # type: ignore[no-untyped-def]
        # Integrate dA/dt = -(mu + gamma A + beta A^2) in small steps; this form includes every law.
        grid = np.linspace(t[0], t[-1], 400)
        values, step = np.empty_like(grid), grid[1] - grid[0]
        values[0] = a
        for i in range(1, grid.size):
            half = max(values[i - 1] - 0.5 * step * (mu + gamma * values[i - 1] + beta * values[i - 1] ** 2), 0.0)
            values[i] = max(values[i - 1] - step * (mu + gamma * half + beta * half**2), 0.0)
        return np.interp(t, grid, values)

    def model(t, amplitude_, mu, gamma, beta, frequency, phase, offset):  # type: ignore[no-untyped-def]
        return offset + amplitude(t, amplitude_, mu, gamma, beta) * np.cos(2 * np.pi * frequency * t + phase)

    found = []
    for free in (
        (),
        ("gamma",),
        ("beta",),
        ("mu",),
        ("gamma", "beta"),
        ("gamma", "mu"),
        ("beta", "mu"),
        ("mu", "gamma", "beta"),
    ):
        guess = _guess(t, y)
        parameters = lmfit.create_params(  # the coefficients below are bounded: negative ones diverge
            amplitude_=guess.pop("amplitude"), **guess, mu=0.0, gamma=0.0, beta=0.0
        )
        for name, start in (("mu", 1e-4), ("gamma", 0.01), ("beta", 0.1)):
            parameters[name].set(value=start if name in free else 0.0, vary=name in free, min=0.0)
        found.append(lmfit.Model(model).fit(y, parameters, t=t))
    return min(found, key=lambda fit: fit.bic).covar


def _guess(t: np.ndarray, y: np.ndarray) -> dict[str, float]:
    power = np.abs(np.fft.rfft(y - y.mean()))
    frequency = float(np.argmax(power) / (t[-1] - t[0]))
    return {"amplitude": float(np.ptp(y) / 2), "frequency": frequency, "phase": -0.7, "offset": float(y.mean())}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=200)
    options = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory() as name:
        for what, value in asdict(measure(options.runs, Path(name))).items():
            print(f"{what:12} {value:.4g}")
