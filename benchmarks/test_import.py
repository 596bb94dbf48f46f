"""Compare the cost of ``import springmass`` with that of ``import numpy`` in the same interpreter."""

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
    """The minimum ratio of processor times is at most 1; springmass is first and also loads the shared modules."""
    ratios = []
    for _ in range(ROUNDS):
        done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
        ratios.append(float(done.stdout))
    print(f"import springmass over import numpy: {min(ratios):.3f}")
    assert min(ratios) <= 1.0
