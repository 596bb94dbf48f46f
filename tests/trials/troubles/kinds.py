"""Every kind of trouble, and the records without any."""

from __future__ import annotations

import numpy as np

from tests.trials.troubles import moving, rows, sensing
from tests.trials.troubles.record import Bench, Kind, Make, Record

__all__ = ["KINDS", "PLAIN", "TROUBLES"]


def _plain(key: str, *, seconds: float, sigma_m: float, echoes: float, mixed: bool) -> Make:
    """A record without trouble, but for single false echoes."""

    def make(seed: int) -> Record:
        drag = {"gamma": 0.0073, "beta": 0.235} if mixed else {"beta": 0.0}
        b = Bench(seed, key, seconds=seconds, sigma_m=sigma_m, **drag)
        y = b.distance() + b.noise()
        wrong = b.rng.random(b.t.size) < echoes
        return b.record(np.where(wrong, b.rng.uniform(0.16, 1.5, b.t.size), y))

    return make


PLAIN = tuple(
    Kind(
        name=f"plain: {seconds:g} s, {sigma_mm:g} mm" + ", 5 % echoes" * bool(echoes) + ", mixed drag" * mixed,
        cause="nothing",
        make=_plain(
            f"plain {seconds} {sigma_mm} {echoes} {mixed}",
            seconds=seconds,
            sigma_m=sigma_mm * 1e-3,
            echoes=echoes,
            mixed=mixed,
        ),
        cure=True,
        plain=True,
    )
    for seconds, sigma_mm, echoes, mixed in (
        (20.0, 0.3, 0.0, False),
        (60.0, 0.3, 0.0, True),
        (20.0, 2.39, 0.0, False),
        (60.0, 2.39, 0.0, True),
        (20.0, 0.3, 0.05, False),
        (60.0, 0.3, 0.05, True),
        (20.0, 2.39, 0.05, True),
        (60.0, 2.39, 0.05, False),
    )
)
"""Records without trouble, on which a warning is a false alarm."""

TROUBLES: tuple[Kind, ...] = (*sensing.KINDS, *moving.KINDS, *rows.KINDS)
KINDS: tuple[Kind, ...] = (*TROUBLES, *PLAIN)
