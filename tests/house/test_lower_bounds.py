"""The versions that one step of .ci/nightly installs are the smallest that pyproject.toml declares."""

import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
DECLARED = [
    *PROJECT["project"]["dependencies"],
    *(each for extra in PROJECT["project"]["optional-dependencies"].values() for each in extra),
    *(each for each in PROJECT["dependency-groups"]["test-core"] if isinstance(each, str)),
]
PINS = [line.split("==") for line in (ROOT / "constraints-lowest.txt").read_text().splitlines() if "==" in line]
INSTALLED = {canonicalize_name(name): Version(version) for name, version in PINS}


@pytest.mark.parametrize("declared", DECLARED)
def test_the_smallest_version_declared_is_the_one_that_is_tested(declared: str) -> None:
    """Each requirement has one lower bound, and the constraints hold it."""
    requirement = Requirement(declared)
    (bound,) = (each.version for each in requirement.specifier if each.operator == ">=")
    assert INSTALLED[canonicalize_name(requirement.name)] == Version(bound)
