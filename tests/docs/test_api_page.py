"""The reference of the Python API names everything that the package exports."""

from __future__ import annotations

import re
from pathlib import Path

import springmass

PAGE = Path(__file__).resolve().parents[2] / "docs" / "api.rst"


def test_every_exported_name_is_in_the_reference() -> None:
    """Each by the module that it comes from, so that sphinx shows its docstring."""
    documented = set(re.findall(r"^\.\. auto\w+:: (\S+)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE))
    exported = {f"{module}.{name}" for name, module in springmass._WHERE.items()}
    assert exported - documented == set()
    assert set(springmass._WHERE) == set(springmass.__all__) - {"__version__"}
