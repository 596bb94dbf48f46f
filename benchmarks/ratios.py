"""Measure speed as ratios to named references, all within one run: `make bench`.

A time depends on the machine on which it was measured, so each time is compared with another one from the same
machine. The two sides of a pair alternate, and the minimum of each is used, because it is least affected by other
programs. Fits and analyses use one linear-algebra thread each. A separate case measures the analysis with the
libraries' default number of threads, on a quiet machine and next to two busy loops.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import lmfit
import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.options import options_for
from pipeline.track import Track
from springmass import load, sample_data
from springmass.loading.scenes import read_scene

RECORDINGS = Path(__file__).resolve().parents[2] / "shared" / "recordings"
REAL = {
    "a ball, two minutes": ("AyushPandhi__Pandhi_Ayush_PHY224/damped position.txt", {}),
    "a large disc, two minutes": (
        "filo0509__smorzamento/molla_durissima_discopieno_14.91945_0.2016_1.csv",
        {"channel": "position", "unit": "m"},
    ),
}
"""Real recordings, which are used if they are available, with their reading options."""
LIMITS = {"fast": 1.0, "standard": 3.0, "best": 6.0}
BUSY_LIMIT, BUSY_LOOPS = 3.0, 2
TABLE = {".txt": "sep='\\t', header=1, usecols=[0, 1]", ".csv": "sep=';', usecols=[0, 1]"}
SCRIPT = """
import lmfit, numpy as np, pandas
t, y = pandas.read_csv({path!r}, {how}).apply(pandas.to_numeric, errors="coerce").dropna().to_numpy().T
def model(t, amplitude, gamma, frequency, phase, offset):
    return offset + amplitude * np.exp(-gamma * t) * np.cos(2 * np.pi * frequency * t + phase)
frequency = np.argmax(np.abs(np.fft.rfft(y - y.mean()))) / (t[-1] - t[0])
fit = lmfit.Model(model).fit(
    y, t=t, amplitude=np.ptp(y) / 2, gamma=0.01, frequency=frequency, phase=-0.7, offset=y.mean()
)
print(len(y), fit.params["frequency"].value)
"""
"""A script that a user would write for one file: read it with pandas and fit it with lmfit."""
CHILD = """
import json, sys, time
from pipeline.analyse import analyse
from springmass import load
track = load(sys.argv[1], **json.loads(sys.argv[3])).loaded.track
analyse(track)
best = float("inf")
for _ in range(int(sys.argv[2])):
    start = time.perf_counter()
    analyse(track)
    best = min(best, time.perf_counter() - start)
print(best)
"""


@dataclass(frozen=True)
class Case:
    """A pair of calls to be timed.

    Parameters
    ----------
    name, reference : str
    limit : float
        Maximum ratio of the two times.
    times : callable
        Takes the number of rounds and returns the minimum time of each call, s.
    rounds : int
        Default number of rounds.
    """

    name: str
    reference: str
    limit: float
    times: Callable[[int], tuple[float, float]]
    rounds: int


def main() -> int:
    """Print each ratio, its reference and its limit; return 1 if a limit is exceeded."""
    bad = 0
    for case in cases():
        mine, other = case.times(case.rounds)
        ratio = mine / other
        bad += ratio > case.limit
        print(
            f"{'ok' if ratio <= case.limit else 'OVER':4}  {ratio:5.2f} x  (limit {case.limit:g})  {case.name}: "
            f"{mine * 1e3:.1f} ms; {case.reference}: {other * 1e3:.1f} ms",
            flush=True,
        )
    return int(bad > 0)


def cases() -> Iterator[Case]:
    """Yield every pair, including those of real recordings if they are available."""
    python = sys.executable
    program = str(Path(python).parent / "springmass")
    bundled = sample_data() / "damped_simulated_position.txt"
    real = {
        name: (RECORDINGS / path, options) for name, (path, options) in REAL.items() if (RECORDINGS / path).is_file()
    }
    yield pair("springmass --help", "bare python", 3.0, process(program, "--help"), process(python, "-c", "pass"), 30)
    for name, (path, options) in {"the bundled recording": (bundled, {}), **real}.items():
        script = SCRIPT.format(path=str(path), how=TABLE[path.suffix])
        flags = [part for option, value in options.items() for part in (f"--{option}", value)]
        ours, theirs = process(program, "analyse", "--json", str(path), *flags), process(python, "-c", script)
        yield pair(f"cold springmass analyse --json, {name}", "a script of pandas and lmfit", 1.0, ours, theirs, 10)
    scene = read_scene(sample_data() / "damped.scene.toml")
    tracks = {"clean": clean_record(), "5 % false echoes": load(bundled).loaded.track}
    measured = {name: load(path, **options).loaded.track for name, (path, options) in real.items()}
    for name, track in {**tracks, **measured}.items():
        known = scene if name in tracks else Scene()
        yield from (tier(accuracy, limit, name, track, known) for accuracy, limit in LIMITS.items())
    for name, (path, options) in (real or {"the bundled recording": (bundled, {})}).items():
        yield Case(
            f"analyse(), {name}, any number of threads, beside {BUSY_LOOPS} busy loops",
            "the same on the quiet machine",
            BUSY_LIMIT,
            partial(beside_busy_loops, path, options),
            10,
        )


def tier(accuracy: str, limit: float, name: str, track: Track, scene: Scene) -> Case:
    """Return the case of one accuracy on one record: the analysis from track to findings, against one lmfit fit."""
    options = options_for(accuracy)
    there = np.isfinite(track.t) & np.isfinite(track.y)
    return pair(
        f"analyse(), {accuracy}, {len(track)} samples, {name}",
        "lmfit damped sine, same samples",
        limit,
        lambda: analyse(track, scene, options),
        damped_sine(track.t[there], track.y[there]),
        20,
    )


def clean_record() -> Track:
    """Return a damped sine of 120 s at 100 Hz in white noise of 0.3 mm."""
    t = np.arange(12_000) / 100.0
    noise = np.random.default_rng(5).standard_normal(t.size)
    return Track.from_arrays(t, 0.22 + 0.05 * np.exp(-0.01463 * t) * np.cos(8.3 * t + 0.7) + 3e-4 * noise)


def damped_sine(t: np.ndarray, y: np.ndarray) -> Callable[[], object]:
    """Return a call that fits a damped sine with lmfit from start values that a user could read off a graph."""

    def model(t, amplitude, gamma, frequency, phase, offset):  # type: ignore[no-untyped-def]
        return offset + amplitude * np.exp(-gamma * t) * np.cos(2 * np.pi * frequency * t + phase)

    fitter = lmfit.Model(model)
    power = np.abs(np.fft.rfft(y - y.mean()))
    guess = {
        "amplitude": float(np.ptp(y) / 2),
        "gamma": 0.01,
        "frequency": float(np.argmax(power) / (t[-1] - t[0])),
        "phase": -0.7,
        "offset": float(y.mean()),
    }
    return lambda: fitter.fit(y, t=t, **guess)


def beside_busy_loops(path: Path, options: Mapping[str, str], rounds: int) -> tuple[float, float]:
    """Return the minimum times of an analysis in a separate process, next to busy loops and without them, s."""
    quiet = in_a_process(path, options, rounds)
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(BUSY_LOOPS)]
    try:
        return in_a_process(path, options, rounds), quiet
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def in_a_process(path: Path, options: Mapping[str, str], rounds: int) -> float:
    """Return the minimum time of an analysis in a separate process, with its libraries' number of threads, s."""
    command = [sys.executable, "-c", CHILD, str(path), str(rounds), json.dumps(options)]
    return float(subprocess.run(command, check=True, capture_output=True, env=plain()).stdout)


def plain() -> dict[str, str]:
    """Return a user's environment: the number of threads is not set, and compiled modules are kept between starts."""
    kept = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    kept.pop("PYTHONDONTWRITEBYTECODE", None)
    return kept


def process(*command: str) -> Callable[[], object]:
    """Return a call that runs a command to its end."""
    return lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=plain())


def pair(
    name: str, reference: str, limit: float, ours: Callable[[], object], theirs: Callable[[], object], rounds: int
) -> Case:
    """Return a case of two calls that are timed alternately."""
    return Case(name, reference, limit, lambda rounds: alternate(ours, theirs, rounds), rounds)


def alternate(ours: Callable[[], object], theirs: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Return the minimum time of each call, s; the two calls alternate."""
    best = [float("inf"), float("inf")]
    with threadpool_limits(1):
        for _ in range(rounds):
            for i, call in enumerate((ours, theirs)):
                start = time.perf_counter()
                call()
                best[i] = min(best[i], time.perf_counter() - start)
    return best[0], best[1]


if __name__ == "__main__":
    raise SystemExit(main())
