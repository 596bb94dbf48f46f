"""The benchmark of courses runs with timing off and gives what it should."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest


@pytest.fixture(scope="module")
def course() -> ModuleType:
    """The benchmark."""
    spec = importlib.util.spec_from_file_location("course", Path(__file__).with_name("course.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["course"] = module  # where a dataclass looks for its module
    spec.loader.exec_module(module)
    return module


def test_the_filter_finds_what_numpy_finds(course, tmp_path):
    """A share of a tenth of an eighth of the rows."""
    _, found = course.filter_ms(tmp_path, 4000)
    assert found == pytest.approx(4000 / 80, abs=4 * np.sqrt(4000 / 80))


@pytest.mark.trials
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads what processes use from /proc")
def test_a_course_is_measured(course, tmp_path):
    """Every ratio is there, and a worker's memory is within its bound."""
    measured = course.measure(6, tmp_path)
    assert min(measured.fast, measured.standard, measured.same_answer, measured.efficiency) > 0
    assert measured.half_mb <= measured.whole_mb < 250
