"""Motions that the models describe: numbers lie within four u, and no right fit is refused.

``SPRINGMASS_TRIALS=20 pytest -m trials tests/trials/troubles/test_described.py`` for twenty records of each kind.
"""

import math
import os

import numpy as np
import pytest

from tests.trials.troubles.described import KINDS
from tests.trials.troubles.judge import LIMIT, try_one
from tests.trials.troubles.record import Kind

SEEDS = int(os.environ.get("SPRINGMASS_TROUBLES") or min(20, int(os.environ.get("SPRINGMASS_TRIALS", "2"))))
NOISES = min(40, 16 * SEEDS)  # records whose noise is compared with the truth
# Root mean square error of the noise in its u: 1, and four standard deviations of so many records.
MOST_SPREAD = 1.0 + 4.0 / math.sqrt(2.0 * NOISES)

pytestmark = pytest.mark.trials


NAMED = {kind.name: kind for kind in KINDS}


@pytest.mark.parametrize("kind", [pytest.param(kind, id=name) for name, kind in NAMED.items()])
def test_what_is_stated_is_right_and_no_fit_is_refused(kind: Kind) -> None:
    """Estimates and the coefficients that may be quoted lie within four u, and no equation is said to have failed."""
    verdicts = {seed: try_one(kind, seed, "standard") for seed in range(SEEDS)}
    off = {
        seed: {name: round(given.z, 1) for name, given in one.given.items() if given.z > LIMIT} or one.word
        for seed, one in verdicts.items()
        if one.word != "right"
    }
    assert not off
    assert not [seed for seed, one in verdicts.items() if "not_converged" in one.warnings]


NOISY = ("damped: ratio 0.02", "relaxation: ratio 1.6", "two modes: ratio 1.5", "still bob")


@pytest.mark.parametrize("kind", [pytest.param(NAMED[name], id=name) for name in NOISY])
def test_the_noise_scatters_by_its_u(kind: Kind) -> None:
    """Over many records the error of the noise is about as large as its u says."""
    given = [try_one(kind, seed, "standard").given["noise"] for seed in range(NOISES)]
    spread = float(np.sqrt(np.mean([(one.error / one.u) ** 2 for one in given])))
    assert spread <= MOST_SPREAD
