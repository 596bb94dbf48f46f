"""What a script that analyses arrays makes Python import."""

from __future__ import annotations

import subprocess
import sys

CODE = """
import sys
import numpy as np
import springmass as sm
t = np.arange(1000) / 100
y = 0.2 + 0.05 * np.cos(8.3 * t) + 1e-4 * np.random.default_rng(1).standard_normal(1000)
run = sm.analyse((t, y))
assert abs(run["angular_frequency"].value - 8.3) < 0.01, run
print(*sorted({name.partition(".")[0] for name in sys.modules}))
"""


def test_analysing_an_array_imports_nothing_of_the_command_line() -> None:
    """Cyclopts, which takes a tenth of the time of the imports, is only of use to a command line."""
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert "numpy" in done.stdout.split()
    assert "cyclopts" not in done.stdout.split()
