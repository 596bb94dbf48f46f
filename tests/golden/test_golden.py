"""What counts as a move of a golden; `make golden` compares them all."""

import pytest

from tests.golden.commands import Table, Value
from tests.golden.golden import moves


@pytest.mark.parametrize(
    ("quantity", "before", "after", "moved"),
    [
        ("estimates.period", (0.79, 2e-5, "s"), (0.79 + 1.6e-7, 2e-5, "s"), False),
        ("estimates.period", (0.79, 2e-5, "s"), (0.79 + 3e-7, 2e-5, "s"), True),
        ("estimates.period", (0.79, 2e-5, "s"), (0.79, 2.03e-5, "s"), True),
        ("estimates.period", (0.79, 2e-5, "s"), (0.79, 2e-5, "ms"), True),
        ("estimates.period", (0.79, 2e-5, "s"), "absent", True),
        ("budget.period.share clock_rate", 0.98, 0.97, False),
        ("budget.period.share clock_rate", 0.5, "absent", True),
        ("findings.clipped", "warning", "info", True),
        ("input.rate_hz", 100.0, 100.1, True),
        ("exit", 0, 3, True),
    ],
)
def test_a_move_beyond_its_tolerance_is_listed(quantity: str, before: Value, after: Value, moved: bool) -> None:
    """A hundredth of u for a value, of itself for a u; units, texts and counts are exact."""
    tables: list[Table] = [{} if value == "absent" else {quantity: value} for value in (before, after)]
    assert bool(list(moves("analyse", *tables))) is moved
