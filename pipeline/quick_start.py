"""Quick start: whether a record is clean in a few sweeps, and its frequency from means of neighbouring samples."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.condition import FOURTH_DIFFERENCE_GAIN, MAD_TO_SIGMA, Conditioned, coarsest_step, condition
from pipeline.condition import Params as ConditionParams
from pipeline.cycles import Cycles, NoOscillation, find_cycles
from pipeline.cycles import Params as CyclesParams
from pipeline.median import median_size
from pipeline.track import F8, Track

SMOOTH = 8.0  # greatest over median second difference: 1.4 for curvature, 6.3 for the noise of 12,000 samples

__all__ = ["bridged", "condition_quickly", "find_cycles_quickly"]


def condition_quickly(track: Track, params: ConditionParams) -> Conditioned:
    """Pass a clean track in a few sweeps; hand any other to :func:`pipeline.condition.condition`.

    Parameters
    ----------
    track : Track
    params : pipeline.condition.Params

    Notes
    -----
    Clean means: no flag, all finite, time strictly increasing, no second difference beyond eight times their median
    (a spike of seven standard deviations makes one), and at neither end of the range a band with three times as many
    samples as the next one or eight that are equal.
    """
    y, t = track.y, track.t
    if len(track) < 64 or track.flags.any():
        return condition(track, params)
    # Extremes are no numbers where one value is none, and a time that is none makes steps that are none.
    low, high = float(y.min()), float(y.max())
    if not (math.isfinite(low) and math.isfinite(high) and math.isfinite(t[0]) and math.isfinite(t[-1])):
        return condition(track, params)
    second = -2.0 * y[1:-1]
    second += y[2:]
    second += y[:-2]
    typical = median_size(second[:: max(second.size // 2000, 1)])
    extreme = max(float(second.max()), -float(second.min()))
    if not ((t[1:] - t[:-1]).min() > 0.0 and 0.0 < extreme <= SMOOTH * typical):
        return condition(track, params)
    some = max((second.size - 2) // 4000, 1)
    fourth = second[2::some] - 2.0 * second[1:-1:some] + second[:-2:some]
    noise_m = float(MAD_TO_SIGMA * median_size(fourth) / FOURTH_DIFFERENCE_GAIN)
    width = 8.0 * max(noise_m, 0.5 * (track.quantum_m or 0.0))
    if max(np.count_nonzero(y == low), np.count_nonzero(y == high)) >= 8:
        return condition(track, params)
    for inside, both in (
        (np.count_nonzero(y <= low + width), np.count_nonzero(y <= low + 2.0 * width)),
        (np.count_nonzero(y >= high - width), np.count_nonzero(y >= high - 2.0 * width)),
    ):
        if inside > max(0.02 * y.size, 8) and inside > 3.0 * (both - inside):
            return condition(track, params)
    ordered = np.sort(y[:1000])
    return Conditioned(track, track.flags.copy(), noise_m, (), coarsest_step(ordered, track.quantum_m))


def find_cycles_quickly(conditioned: Conditioned, params: CyclesParams) -> Cycles | NoOscillation:
    """Find the frequency on means of neighbouring samples, where a period has plenty of them."""
    track = conditioned.track
    block = len(track) // 2000
    bad = conditioned.flags != 0
    if block >= 2 and np.count_nonzero(bad) < 0.2 * bad.size and np.isfinite(track.t).all():
        whole = len(track) // block * block
        equal = np.full(block, 1.0 / block)
        few = replace(
            track,
            t=track.t[:whole].reshape(-1, block) @ equal,
            y=bridged(track.y[:whole], bad[:whole]).reshape(-1, block) @ equal,
            flags=np.zeros(whole // block, np.uint8),
            rate_hz=track.rate_hz / block,
        )
        noise_m = conditioned.noise_m / math.sqrt(block)
        found = find_cycles(replace(conditioned, track=few, flags=few.flags, noise_m=noise_m), params)
        if isinstance(found, Cycles) and found.frequency_hz < few.rate_hz / 8.0:
            return replace(found, bounds=found.bounds * block)
    return find_cycles(conditioned, params)


def bridged(y: F8, bad: NDArray[np.bool_]) -> F8:
    """Return distances (n,) with straight lines across the bad ones (n,)."""
    if not bad.any():
        return y
    good, lost = np.flatnonzero(~bad), np.flatnonzero(bad)
    whole = y.copy()
    whole[lost] = np.interp(lost, good, y[good])
    return whole
