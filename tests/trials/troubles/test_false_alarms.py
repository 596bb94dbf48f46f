"""A record without trouble gets no warning."""

from __future__ import annotations

import os

import pytest

from tests.trials.troubles.judge import try_one
from tests.trials.troubles.kinds import PLAIN
from tests.trials.troubles.table import beyond, summed, total

TRIALS = int(os.environ.get("SPRINGMASS_TRIALS", "80"))
ALARMS = 0.005

pytestmark = pytest.mark.trials


def test_plain_records_hardly_ever_get_a_warning() -> None:
    """Of records without trouble, in thirds of 15, 30 and 60 s, one in two hundred at most gets a warning."""
    verdicts = [try_one(kind, 1000 + seed, "standard") for kind in PLAIN for seed in range(TRIALS // len(PLAIN))]
    lines = summed(PLAIN, verdicts)
    print(f"\n{beyond(lines)}\n{total(lines)}")
    assert sum(bool(one.warnings) for one in verdicts) <= ALARMS * len(verdicts)
