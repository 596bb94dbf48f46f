"""Tiers of accuracy: which stages each runs."""

from __future__ import annotations

from types import ModuleType

import pytest

from pipeline.accuracy import params_for
from pipeline.analyse import Motion, Params, analyse
from pipeline.damping import Params as DampingParams
from pipeline.track import Track


@pytest.mark.parametrize("law", ["friction", "linear+friction", "power"])
def test_the_fast_tier_tries_every_law_where_its_few_fail(synthetic: ModuleType, law: str) -> None:
    """A law that the fast tier leaves out for speed is found where none of those it tries holds, with its interval."""
    truth = synthetic.Truth(**synthetic.LAW_TRUTHS[law])
    t = synthetic.times(120)
    found = analyse(Track.from_arrays(t, synthetic.noisy(truth, t, 1e-4, 4)), params=params_for("fast"))
    assert isinstance(found.motion, Motion)
    assert law in found.motion.damping.admissible
    amplitude = found.estimates["amplitude"]
    assert abs(amplitude.value - truth.amplitude) < 4.0 * amplitude.u


def test_the_fast_tier_keeps_to_laws_that_were_named(synthetic: ModuleType) -> None:
    """Who asks for one law gets that one judged, and no other where it is rejected."""
    truth = synthetic.Truth(**synthetic.LAW_TRUTHS["friction"])
    t = synthetic.times(120)
    params = Params(accuracy="fast", damping=DampingParams(laws=("linear",)))
    found = analyse(Track.from_arrays(t, synthetic.noisy(truth, t, 1e-4, 4)), params=params)
    assert isinstance(found.motion, Motion)
    assert set(found.motion.damping.fits) == {"linear"}
    assert found.motion.damping.fits["linear"].rejected
