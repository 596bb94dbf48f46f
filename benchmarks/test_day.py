"""Test a quarter of an hour of the day benchmark: the memory is constant, and log and run file are complete."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("day.py")


@pytest.mark.trials
def test_memory_is_flat_and_every_reading_is_kept() -> None:
    """A separate process records every reading; memory left behind by other tests would distort the measurement."""
    command = [sys.executable, str(SCRIPT), "--hours", "0.25", "--limit-mb", "4"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "90000 readings in the log of 90000, 0 records dropped" in done.stdout
    assert "recovered: 90000 samples" in done.stdout
