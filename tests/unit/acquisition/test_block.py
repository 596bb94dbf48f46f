"""Blocks: slices, joins, and flags that never change."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.block import Block, Flag, concatenate


def test_flag_values_are_those_of_the_run_file() -> None:
    """The bits are written to files and may not move."""
    assert {flag.name: flag.value for flag in Flag} == {
        "MISSING": 1,
        "FALSE_ECHO": 2,
        "CLIPPED": 4,
        "DUPLICATE_TIME": 8,
        "NON_MONOTONIC_TIME": 16,
        "MALFORMED": 32,
        "GAP_BEFORE": 64,
    }


def test_slices_and_joins_keep_the_quantity_and_two_are_not_joined() -> None:
    """Volts stay volts, and do not follow metres."""
    volts = Block(0, np.zeros(4), np.zeros(4), np.zeros(4, np.uint8), quantity="voltage", unit="V")
    joined = concatenate([volts[:1], volts[1:]])
    assert (joined.quantity, joined.unit) == ("voltage", "V")
    with pytest.raises(ValueError, match="one quantity, got length, voltage"):
        concatenate([volts, Block(4, np.zeros(1), np.zeros(1), np.zeros(1, np.uint8))])
