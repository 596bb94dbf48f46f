"""Write what an installed wheel must get along with, into a folder: `python .ci/around_the_wheel.py FOLDER`.

`neighbours/NAME` is a distribution that owns the top-level name NAME, for each package that a checkout has under that
name. `user` is a working folder with the user's own `pipeline.py` and `storage`. `tests` holds the tests, with their
imports as a wheel has them. Whatever imports a neighbour or the user's own module fails.
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
    """Write a file with the folders above it."""
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
