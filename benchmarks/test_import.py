"""What ``import springmass`` costs, beside ``import numpy`` in the same interpreter."""

from __future__ import annotations

import subprocess
import sys

ROUNDS = 5
CODE = """
import time
start = time.process_time(); import springmass
middle = time.process_time(); import numpy
print((middle - start) / (time.process_time() - middle))
"""


def test_importing_springmass_takes_no_longer_than_importing_numpy() -> None:
    """By processor time, the least of a few fresh interpreters; springmass goes first and pays for what both need."""
    ratios = []
    for _ in range(ROUNDS):
        done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
        ratios.append(float(done.stdout))
    print(f"import springmass over import numpy: {min(ratios):.3f}")
    assert min(ratios) <= 1.0
