"""Check that each package has its minimum percentage of covered lines and branches, ``tool.springmass.fail_under``.

Call it after the tests have run under coverage: ``python .ci/coverage.py``.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path


def main() -> int:
    """Print a line for each package; return 1 if any package is below its limit."""
    settings = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))
    below = 0
    for package, least in settings["tool"]["springmass"]["fail_under"].items():
        command = [
            sys.executable,
            "-m",
            "coverage",
            "report",
            "--format=total",
            "--precision=1",
            f"--include={package}/*",
        ]
        percent = float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        print(f"{package:<12} {percent:5.1f} % of lines and branches, at least {least} %")
        below += percent < least
    return int(below > 0)


if __name__ == "__main__":
    raise SystemExit(main())
