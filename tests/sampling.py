"""A few of many cases in `make test`, the others among the trials."""

from collections.abc import Iterable
from typing import Any

import pytest


def sampled(cases: Iterable[Any], count: int = 2) -> list[Any]:
    """Return the cases for ``parametrize``: the first ``count`` as they are, the others marked as trials."""
    return [case if number < count else _as_trial(case) for number, case in enumerate(cases)]


def _as_trial(case: Any) -> Any:
    if isinstance(case, type(pytest.param())):
        return pytest.param(*case.values, id=case.id, marks=[*case.marks, pytest.mark.trials])
    values = case if isinstance(case, tuple) else (case,)
    return pytest.param(*values, marks=pytest.mark.trials)
