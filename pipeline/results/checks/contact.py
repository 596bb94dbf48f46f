"""Contact: a bob that hits something at one end in every period, until it does not reach there any more."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from pipeline.numerics.quantity import amount
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.segments import Segments
from pipeline.results.checks.finding import Finding
from pipeline.track import F8, UNUSABLE, Quality

__all__ = ["Contact", "find_contact"]

FEWEST, MOST = 5, 100  # periods
LEAST = 20  # samples of a period
STANDS = 0.35  # of what the one end moves by, that the other may
SEEN, SHARPER = 6.0, 1.4  # times the noise, and the other end, that a turning point must be sharper


@dataclass(frozen=True, slots=True)
class Contact:
    """What a bob hits.

    Parameters
    ----------
    first_s, last_s : float
        Of the part in which it does, s.
    at_m : float
        Where it turns there, m.
    end : {"far", "near"}
    unit : str
    """

    first_s: float
    last_s: float
    at_m: float
    end: str
    unit: str

    def finding(self, part: str) -> Finding:
        """Return what is said of it; ``part`` are the words on which part was analysed."""
        end = self.end if self.unit == "m" else {"far": "upper", "near": "lower"}[self.end]
        return Finding(
            "contact",
            "warning",
            f"from {self.first_s:.2f} to {self.last_s:.2f} s the bob turns at {amount(self.at_m, self.unit, '.4g')} at "
            f"the {end} end in every period, while the other end comes nearer: it hits something there, which makes "
            f"the period too short; the longest part was analysed{part}",
        )


def find_contact(conditioned: Conditioned, segments: Segments | None, frequency_hz: float) -> Contact | None:
    """Return what the bob hits beside a break of its motion; None where both ends do as they should, or are cut.

    Parameters
    ----------
    conditioned : Conditioned
    segments : Segments or None
        None: the motion does not break.
    frequency_hz : float
        Of the oscillation.

    Notes
    -----
    A free bob's turning points come nearer from both sides. Of one that hits something, those on its side stand, and
    are sharp: the 2 % of a period that go farthest there lie farther beyond the 10 % than at the smooth end; of a
    plateau they do not.
    """
    if segments is None or not segments.breaks or conditioned.cuts:
        return None
    track, noise_m = conditioned.track, conditioned.noise_m
    sound = (conditioned.flags & np.uint8(int(UNUSABLE) & ~int(Quality.OUTSIDE))) == 0
    t, y = track.t[sound], track.y[sound]
    moments = [float(t[0]), *(one.time_s for one in segments.breaks), float(t[-1])]
    for first_s, last_s in itertools.pairwise(moments):
        inside = (t >= first_s) & (t <= last_s)
        low, high = (
            _turns(t[inside] - first_s, y[inside], frequency_hz),
            _turns(t[inside] - first_s, -y[inside], frequency_hz),
        )
        if len(low) < FEWEST:
            continue
        for end, here, there in (("near", low, high), ("far", high, low)):
            moved, stands = (abs(_slope(x[:, 0])) for x in (there, here))
            sharp, smooth = (float(np.median(x[:, 1])) for x in (here, there))
            if sharp < max(SHARPER * smooth, SEEN * noise_m):
                continue
            if moved * len(here) > SEEN * noise_m and stands < STANDS * moved:
                at_m = float(np.median(here[:, 0]))
                return Contact(first_s, last_s, at_m if end == "near" else -at_m, end, track.unit)
    return None


def _turns(t: F8, y: F8, frequency_hz: float) -> F8:
    """(periods, 2): where each of the first hundred periods turns at its lower end, and its 10 % quantile less 2 %."""
    if not t.size:
        return np.empty((0, 2))
    periods = min(int(t[-1] * frequency_hz), MOST)
    edges = np.searchsorted(t, np.arange(periods + 1) / frequency_hz)
    parts = [np.quantile(y[a:b], (0.02, 0.1)) for a, b in itertools.pairwise(edges) if b - a >= LEAST]
    # Distances fall on a stop along straight lines: what lies below no share at all is where these meet.
    return np.array([(low - 0.25 * (high - low), high - low) for low, high in parts]).reshape(-1, 2)


def _slope(values: F8) -> float:
    """What values change by from one to the next: the median of the last third less that of the first."""
    third = values.size // 3
    return float(np.median(values[-third:]) - np.median(values[:third])) / (values.size - third)
