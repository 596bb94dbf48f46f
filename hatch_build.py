"""Build hook that gives the wheel only one top-level name.

In a checkout `acquisition`, `pipeline` and `storage` are next to `springmass`. The wheel contains them inside
`springmass`, where a user's own `pipeline.py` or another distribution's `storage` cannot replace them.
docs/decisions/0022-one-name-in-the-wheel.md explains why.
"""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

MOVED = ("acquisition", "failure", "pipeline", "storage")
RECORDINGS = "sample_data"  # except for the program that generates them

_NAMES = "|".join(MOVED)
# An import of a whole package, and a dotted name anywhere: in an import, a lazy registry's string, a docstring.
_IMPORT = re.compile(rf"^(\s*(?:>>> |\.\.\. )?from )({_NAMES})(?= import\b)", re.MULTILINE)
_DOTTED = re.compile(rf"(?<![\w./])({_NAMES})(?=\.[A-Za-z_{{])")


def moved(source: str) -> str:
    """Return a module's source with the package names that it needs inside the wheel."""
    return _DOTTED.sub(r"springmass.\1", _IMPORT.sub(r"\1springmass.\2", source))


class WheelHook(BuildHookInterface):
    """Puts the rewritten files of all four packages and the recordings into a wheel, unless the wheel is editable."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Write the files into a temporary folder and include them in the wheel."""
        if version == "editable":
            return
        self._folder = TemporaryDirectory(prefix="springmass-wheel-")
        root = Path(self.root)
        for name in (*MOVED, "springmass", RECORDINGS):
            for path in sorted((root / name).rglob("*")):
                if path.is_dir() or "__pycache__" in path.parts or (name == RECORDINGS and path.suffix == ".py"):
                    continue
                inside = path.relative_to(root).as_posix()
                target = inside if name == "springmass" else f"springmass/{inside}"
                copy = Path(self._folder.name, target)
                copy.parent.mkdir(parents=True, exist_ok=True)
                content = path.read_bytes()
                copy.write_bytes(moved(content.decode()).encode() if path.suffix == ".py" else content)
                build_data["force_include"][str(copy)] = target

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002 - hatch's
        """Remove the temporary folder."""
        if version != "editable":
            self._folder.cleanup()
