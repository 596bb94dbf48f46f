"""Speed as ratios to named references, all within one run: `make bench`.

A time says nothing without the machine it was taken on; the ratio of two, taken in turn on one machine, does. Each
pair is run alternately and the minimum of each side is taken, which is what the code costs without its neighbours.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import lmfit
import numpy as np

from pipeline.accuracy import params_for
from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.track import Track
from springmass import load, sample_data
from springmass.runs.loading import read_scene

HERE = Path(__file__).resolve().parent


def main() -> int:
    """Print each ratio, its reference and its limit; exit with 1 where a limit is broken."""
    bad = 0
    for name, reference, limit, ours, theirs, rounds in cases():
        mine, other = alternate(ours, theirs, rounds)
        ratio = mine / other
        verdict = "ok" if ratio <= limit else "OVER"
        bad += ratio > limit
        print(
            f"{verdict:4}  {ratio:5.2f} x  (limit {limit:g})  {name}: {mine * 1e3:.1f} ms; "
            f"{reference}: {other * 1e3:.1f} ms"
        )
    return int(bad > 0)


def cases() -> list[tuple[str, str, float, Callable[[], object], Callable[[], object], int]]:
    """Return name, reference, limit, the two to be timed, and how often."""
    python = sys.executable
    program = str(Path(python).parent / "springmass")
    data = sample_data() / "damped_simulated_position.txt"
    track = load(data).track
    scene = read_scene(sample_data() / "damped.scene.toml")
    clean = clean_record()
    return [
        ("springmass --help", "bare python", 3.0, process(program, "--help"), process(python, "-c", "pass"), 30),
        (
            "cold springmass analyse --json, 12,000 rows",
            "import numpy",
            6.0,
            process(program, "analyse", "--json", str(data)),
            process(python, "-c", "import numpy"),
            15,
        ),
        *(
            tier(name, what, limit, one, scene)
            for name, what, limit, one in (
                ("fast", "clean", 0.2, clean),
                ("fast", "5 % false echoes", 0.5, track),
                ("standard", "clean", 1.0, clean),
                ("standard", "5 % false echoes", 1.0, track),
                ("best", "clean", 3.0, clean),
                ("best", "5 % false echoes", 3.0, track),
            )
        ),
    ]


def tier(
    name: str, what: str, limit: float, track: Track, scene: Scene
) -> tuple[str, str, float, Callable[[], object], Callable[[], object], int]:
    """Return one accuracy tier on one record, everything from track to findings, against one lmfit fit."""
    params = params_for(name)
    return (
        f"analyse(), {name}, 12,000 samples, {what}",
        "lmfit damped sine, same samples",
        limit,
        lambda: analyse(track, scene, params),
        damped_sine(track.t, track.y),
        30,
    )


def clean_record() -> Track:
    """Return a damped sine of 120 s at 100 Hz in white noise of 0.3 mm."""
    t = np.arange(12_000) / 100.0
    noise = np.random.default_rng(5).standard_normal(t.size)
    return Track.from_arrays(t, 0.22 + 0.05 * np.exp(-0.01463 * t) * np.cos(8.3 * t + 0.7) + 3e-4 * noise)


def damped_sine(t: np.ndarray, y: np.ndarray) -> Callable[[], object]:
    """Return one lmfit fit of a damped sine, started as a user would: from a look at the graph."""

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


def process(*command: str) -> Callable[[], object]:
    """Return a call that runs a command to its end."""
    return lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def alternate(ours: Callable[[], object], theirs: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Return the shortest time of each, s, taken in turn."""
    best = [float("inf"), float("inf")]
    for _ in range(rounds):
        for i, call in enumerate((ours, theirs)):
            start = time.perf_counter()
            call()
            best[i] = min(best[i], time.perf_counter() - start)
    return best[0], best[1]


if __name__ == "__main__":
    raise SystemExit(main())
