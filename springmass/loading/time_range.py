"""Cut a recording to the seconds between ``--from`` and ``--to``, and state the rate error of its clock."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.track import Track
from springmass.errors import ProgramError
from springmass.loading.loaded import Loaded
from springmass.loading.options import AnalysisOptions


def within(loaded: Loaded, options: AnalysisOptions) -> Loaded:
    """Return an input with its track cut to the chosen seconds, and with the stated error of its clock."""
    track = cut(loaded.track, options.from_s, options.to_s, where=loaded.path)
    if options.clock_ppm is not None:
        track = replace(track, clock_limit=options.clock_ppm * 1e-6)
    return replace(loaded, track=track)


def cut(track: Track, from_s: float | None, to_s: float | None, *, where: object) -> Track:
    """Return the samples between two times, s, both included; ``where`` is named in the error if there are none."""
    low = -np.inf if from_s is None else from_s
    high = np.inf if to_s is None else to_s
    part = between(track, low, high)
    if not len(part) and (from_s, to_s) != (None, None):
        times = track.t[np.isfinite(track.t)]
        span = f"spans {times.min():g} to {times.max():g} s" if times.size else "holds no sample"
        raise ProgramError(f"{where}: no sample lies between {low:g} and {high:g} s; the record {span}")
    return part


def between(track: Track, low_s: float, high_s: float) -> Track:
    """Return the samples between two times, both included; all samples if neither time is finite."""
    if math.isinf(low_s) and math.isinf(high_s):
        return track
    keep = (track.t >= low_s) & (track.t <= high_s)
    velocity = None if track.velocity is None else track.velocity[keep]
    return replace(track, t=track.t[keep], y=track.y[keep], flags=track.flags[keep], velocity=velocity)
