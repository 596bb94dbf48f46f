"""A value that is called sound is right where one model does not describe the motion, and stays sound where it does."""

import os
from collections.abc import Iterable

import pytest

from tests.golden.inputs import RECORDINGS
from tests.trials.grades import cases, clean, disc, kinds, recordings

WRONG = 4.0
SEEDS = 4
RECORDS = min(clean.RECORDS, int(os.environ.get("SPRINGMASS_TRIALS", "48")))

# The phase of one coordinate of an ellipse runs ahead by b/a of the rate at which the axes turn, and not even the whole
# record shows by how much: T would need the other coordinate.
ONE_COORDINATE = {"ellipse"}

pytestmark = pytest.mark.trials


def _known(names: Iterable[str]) -> list[object]:
    mark = pytest.mark.xfail(reason="one coordinate of an ellipse", strict=True)
    return [pytest.param(name, marks=[mark] if name in ONE_COORDINATE else []) for name in names]


@pytest.mark.parametrize("kind", _known(kinds.KINDS))
def test_no_sound_value_of_a_trouble_is_wrong(kind: str) -> None:
    """No value that is called sound lies more than four of its u from the truth."""
    troubles = [kinds.trouble(kind, seed) for seed in range(SEEDS)]
    assert [wrong for each in troubles if (wrong := each.said().wrong(each.truth, WRONG))] == []


@pytest.mark.parametrize("name", _known(cases.FILES))
def test_no_sound_value_of_a_case_is_wrong(name: str) -> None:
    """The files of the cases give no value that is called sound and lies more than four of its u from the truth."""
    if not cases.CASES.is_dir():
        pytest.skip("needs ../shared/cases")
    case = cases.FILES[name]
    assert case.said().wrong(case.truth, WRONG) == {}


def test_clean_records_stay_sound() -> None:
    """On clean records the bars of what stays sound, of u, of its coverage and of new warnings are met."""
    seeds = range(RECORDS)
    found = list(clean.bars(seeds, map(clean.said_of_record, seeds)))
    assert [str(bar) for bar in found if not bar.met] == []


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="needs ../shared/recordings")
def test_values_of_real_recordings_stay_sound() -> None:
    """Of the periods, amplitudes and spring constants that 0.3.0 calls sound, 95 % of those that were right stay sound.

    Three were not: k of a fluid, whose u is larger than it; k of a step up and down that is no relaxation; T and k of a
    pendulum of two lines that beat, whose period was an average.
    """
    wrong = ("fluids__SebastienPsarianos", "lvm__spikelucky__hyd_stp_2", "plasduino__Giosue-tanz")
    was = sum(len(symbols) for symbols in recordings.released().values())
    lost = [each for each in recordings.lost() if not any(name in each[1] for name in wrong)]
    assert len(lost) <= (1.0 - recordings.STAY) * was


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="needs ../shared/recordings")
def test_the_drag_of_a_disc_does_not_depend_on_the_start() -> None:
    """Coefficients and the damping rate at 25 mm, and T_s where it is sound, agree within two of the larger u."""
    apart = list(disc.apart())
    assert apart
    apart += disc.small_swings_apart()
    assert max(abs(z) for *_, z in apart) <= 2.0
