"""Write modules that could conflict with an installed wheel, and the tests: `python .ci/around_the_wheel.py FOLDER`.

`neighbours/NAME` is a distribution with the top-level name NAME, one for each package of that name in a checkout.
`user` is a working folder with the user's own `pipeline.py` and `storage`. `tests` contains the tests, with their
imports rewritten as in a wheel. Any import of a neighbour or of a user's module fails.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from hatch_build import MOVED, moved  # noqa: E402 - found by the line above

FOREIGN = 'raise RuntimeError("this module is not of springmass")\n'
PROJECT = """[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "{name}"
version = "1.0"
"""


def write(path: Path, text: str) -> None:
    """Write a file, and create its parent folders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def main(folder: Path) -> None:
    """Write the neighbours, the user's folder and the tests."""
    for name in MOVED:
        write(folder / "neighbours" / name / "pyproject.toml", PROJECT.format(name=name))
        write(folder / "neighbours" / name / name / "__init__.py", FOREIGN)
    write(folder / "user" / "pipeline.py", FOREIGN)
    write(folder / "user" / "storage" / "__init__.py", FOREIGN)
    shutil.copytree(ROOT / "tests", folder / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    for path in (folder / "tests").rglob("*.py"):
        path.write_text(moved(path.read_text(encoding="utf-8")), encoding="utf-8")
    shutil.copy(ROOT / "pyproject.toml", folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
