"""The day benchmark as a test: a quarter of an hour, whose memory is flat and whose log and run file are whole."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("day.py")


@pytest.mark.trials
def test_memory_is_flat_and_every_reading_is_kept() -> None:
    """In a process of its own, since what other tests left behind moves the memory in use."""
    done = subprocess.run([sys.executable, str(SCRIPT), "--hours", "0.25"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "90000 readings in the log of 90000, 0 records dropped" in done.stdout
    assert "recovered: 90000 samples" in done.stdout
