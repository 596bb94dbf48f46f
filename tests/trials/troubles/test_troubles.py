"""Records that benches really give: a number is right within its uncertainty, or a warning names what is wrong."""

import os

import pytest

from pipeline.options import TIERS
from tests.trials.troubles.judge import try_one
from tests.trials.troubles.kinds import PLAIN, TROUBLES
from tests.trials.troubles.table import beyond, summed, total

# Two records of each kind by default, so that the three tiers take a few minutes; SPRINGMASS_TRIALS=20 for the whole.
SEEDS = int(os.environ.get("SPRINGMASS_TROUBLES") or min(20, int(os.environ.get("SPRINGMASS_TRIALS", "2"))))
WRONG, ANY_KIND, RIGHT_OR_NAMED = 0.01, 0.1, 0.95

pytestmark = pytest.mark.trials


@pytest.mark.parametrize("tier", TIERS)
def test_no_number_is_confidently_wrong(tier: str) -> None:
    """One record in a hundred at most is wrong by four uncertainties and not named, and one in ten of any kind."""
    verdicts = [try_one(kind, seed, tier) for kind in TROUBLES for seed in range(SEEDS)]
    lines = summed(TROUBLES, verdicts)
    print(f"\n{beyond(lines)}\n{tier}: {total(lines)}")
    wrong, refused = (sum(line.count(word) for line in lines) for word in ("confident wrong", "refused"))
    assert wrong <= WRONG * len(verdicts)
    assert not [line.kind.name for line in lines if line.count("confident wrong") > max(ANY_KIND * line.n, 1)]
    assert len(verdicts) - wrong - refused >= RIGHT_OR_NAMED * len(verdicts)
    # The fast tier searches for no second mode, and states a wide u instead.
    assert tier == "fast" or not [line.kind.name for line in lines if line.too_wide]


def test_plain_records_hardly_ever_get_a_warning() -> None:
    """Of records without trouble, in thirds of 15, 30 and 60 s, one in two hundred at most gets a warning."""
    seeds = range(1000, 1000 + max(int(os.environ.get("SPRINGMASS_TRIALS", "80")) // len(PLAIN), 1))
    verdicts = [try_one(kind, seed, "standard") for kind in PLAIN for seed in seeds]
    warned = [(one.kind, one.warnings) for one in verdicts if one.warnings]
    assert len(warned) <= 0.005 * len(verdicts), warned
