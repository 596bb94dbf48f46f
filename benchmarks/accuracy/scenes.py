"""Where each tier of accuracy pays: errors and times of the tiers on records that are not so simple.

`python benchmarks/accuracy/scenes.py --seeds 40` prints, for each kind of record, the root mean square errors of
frequency, first amplitude and damping rate of every tier over the least of them, and its time over that of `fast`.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from trials import synthetic

from pipeline.accuracy import TIERS, params_for
from pipeline.analyse import Motion, analyse
from pipeline.track import Track

OMEGA, START, REST = 8.3, 0.05, 0.22
Spoil = Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray]


def unspoilt(t: np.ndarray, y: np.ndarray, rng: np.random.Generator) -> np.ndarray:  # noqa: ARG001 - as the others
    """Leave the record as it is."""
    return y


def echoes(share: float) -> Spoil:
    """Put a share of the samples anywhere within 2 m."""
    return lambda _t, y, rng: np.where(rng.random(y.size) < share, rng.uniform(0.0, 2.0, y.size), y)


@dataclass(frozen=True)
class Scene:
    """One kind of record."""

    name: str
    seconds: float = 60.0
    noise_m: float = 3e-4
    truth: dict[str, float] = field(default_factory=lambda: {"gamma": 0.01463})
    spoil: Spoil = unspoilt


SCENES = (
    Scene("clean, one exponential"),
    Scene("1.6 periods", seconds=1.2),
    Scene("3 periods", seconds=2.3),
    Scene("10 s", seconds=10.0),
    Scene("-10 dB", noise_m=0.05 / math.sqrt(2.0) * 10**0.5),
    Scene("20 % false echoes", spoil=echoes(0.2)),
    Scene("crests clipped at 80 %", spoil=lambda _t, y, _rng: np.minimum(y, REST + 0.8 * START)),
    Scene("quantised to 1 mm", spoil=lambda _t, y, _rng: np.round(y, 3)),
    Scene("rest drifts by 2 mm", spoil=lambda t, y, _rng: y + 2e-3 * np.sin(0.5 * np.pi * t / t[-1])),
    Scene("sideways mode of 1 mm", spoil=lambda t, y, rng: y + 1e-3 * np.cos(5.0 * t + rng.uniform(-3.0, 3.0))),
    Scene("friction", truth={"mu": 4e-4}),
    Scene("linear and quadratic drag", truth={"gamma": 0.0073, "beta": 0.235}),
)


def measured(scene: Scene, seeds: int) -> dict[str, tuple[np.ndarray, float]]:
    """Return each tier's root mean square errors of frequency, amplitude and damping rate, and its seconds a record."""
    t = synthetic.times(scene.seconds)
    errors: dict[str, list[list[float]]] = {tier: [] for tier in TIERS}
    spent: dict[str, list[float]] = {tier: [] for tier in TIERS}
    for seed in range(seeds):
        rng = np.random.default_rng((seed, 21))
        truth = synthetic.Truth(amplitude=START, omega=OMEGA, offset=REST, phase=rng.uniform(-3.0, 3.0), **scene.truth)
        y = scene.spoil(t, truth.position(t) + scene.noise_m * rng.standard_normal(t.size), rng)
        rate = (truth.mu + truth.gamma * START + truth.beta * START**2) / START
        for tier in TIERS:
            begun = time.process_time()
            result = analyse(Track.from_arrays(t, y), params=params_for(tier))
            spent[tier].append(time.process_time() - begun)
            if isinstance(result.motion, Motion):
                e = result.estimates
                errors[tier].append(
                    [
                        e["angular_frequency"].value - OMEGA,
                        e["amplitude"].value - START,
                        e["damping_rate"].value - rate if "damping_rate" in e else math.nan,
                    ]
                )
    return {
        tier: (np.sqrt(np.nanmean(np.square(errors[tier]), axis=0)), float(np.median(spent[tier]))) for tier in TIERS
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="benchmarks/accuracy/scenes.py", description=__doc__)
    parser.add_argument("--seeds", type=int, default=40, metavar="N", help="records of each kind (default 40)")
    options = parser.parse_args()
    print(f"| record | {' | '.join(f'`{tier}`' for tier in TIERS)} |\n|{' --- |' * (len(TIERS) + 1)}")
    for scene in SCENES:
        found = measured(scene, options.seeds)
        least = np.min([rms for rms, _ in found.values()], axis=0)
        cells = [
            ", ".join(f"{ratio:.2f}" for ratio in rms / least) + f"; {seconds / found[TIERS[0]][1]:.1f}"
            for rms, seconds in found.values()
        ]
        print(f"| {scene.name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
