"""The rules of the rooms: few entries in each, no module name for two things, and a word at every door."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("acquisition", "pipeline", "storage", "springmass")
MOST = 15
LIKE_THINGS = {"commands", "decoders", "families", "laws", "figures", "integrators", "checks"}
"""Folders of one file each for things of one kind, which may be many."""
NAMED_ALIKE = {"errors"}
"""Modules that every package may have; a command is named as what it commands."""


def modules(package: str) -> list[Path]:
    """Return the modules of a package."""
    return sorted(path for path in (ROOT / package).rglob("*.py") if "__pycache__" not in path.parts)


@pytest.mark.parametrize("package", PACKAGES)
def test_no_room_is_crowded(package: str) -> None:
    """A folder holds at most fifteen entries, unless it is one of like things."""
    crowded = {}
    for folder in sorted({path.parent for path in modules(package)}):
        entries = [
            entry.name
            for entry in folder.iterdir()
            if entry.name not in {"__init__.py", "py.typed", "__pycache__"} and not entry.name.startswith(".")
        ]
        if len(entries) > MOST and folder.name not in LIKE_THINGS:
            crowded[str(folder.relative_to(ROOT))] = len(entries)
    assert not crowded


@pytest.mark.parametrize("package", PACKAGES)
def test_no_name_stands_for_two_modules(package: str) -> None:
    """Within a package a module's name says which one is meant; commands are named as what they command."""
    found = defaultdict(list)
    for path in modules(package):
        if path.stem not in {"__init__", "__main__"} | NAMED_ALIKE and "commands" not in path.parts:
            found[path.stem].append(str(path.relative_to(ROOT)))
    assert not {name: paths for name, paths in found.items() if len(paths) > 1}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_module_says_what_it_is_for(package: str) -> None:
    """Every module begins with a docstring, a room's ``__init__`` too."""
    silent = [
        str(path.relative_to(ROOT))
        for path in modules(package)
        if path.read_text(encoding="utf-8").strip() and not ast.get_docstring(ast.parse(path.read_text("utf-8")))
    ]
    assert not silent
