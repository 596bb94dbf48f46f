"""Every kind of trouble, and the records without any."""

import itertools

import numpy as np

from tests.trials.troubles import moving, rows, sensing
from tests.trials.troubles.record import Bench, Kind, Record, kind


def _plain(seed: int, sigma_mm: float, *, echoes: float, mixed: bool) -> Record:
    """A record without trouble, but for single false echoes, of a quarter of a minute, half a one or a whole."""
    drag = {"gamma": 0.0073, "beta": 0.235} if mixed else {"beta": 0.0}
    seconds = (15.0, 30.0, 60.0)[seed % 3]
    b = Bench(seed, f"plain {sigma_mm} {echoes} {mixed}", seconds=seconds, sigma_m=sigma_mm * 1e-3, **drag)
    y = b.distance() + b.noise()
    wrong = b.rng.random(b.t.size) < echoes
    return b.record(np.where(wrong, b.rng.uniform(0.16, 1.5, b.t.size), y))


PLAIN = tuple(
    kind(
        f"plain: {sigma_mm:g} mm, {'mixed' if mixed else 'linear'} drag" + ", 5 % echoes" * bool(echoes),
        "nothing",
        _plain,
        sigma_mm,
        echoes=echoes,
        mixed=mixed,
        plain=True,
    )
    for sigma_mm, echoes, mixed in itertools.product((0.3, 2.39), (0.0, 0.05), (False, True))
)
"""Records without trouble, on which a warning is a false alarm."""

TROUBLES: tuple[Kind, ...] = (*sensing.KINDS, *moving.KINDS, *rows.KINDS)
KINDS: tuple[Kind, ...] = (*TROUBLES, *PLAIN)
