"""The digest of the program, by which a course knows whether a row is still what the program would give."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from springmass.batch import plan
from springmass.layout import PACKAGES, part


@pytest.mark.parametrize("package", PACKAGES)
def test_a_change_of_any_package_changes_the_digest(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a checkout and in a wheel alike; a digest of nothing would keep rows that are out of date."""
    before = plan.code_sha256.__wrapped__()
    changed = shutil.copytree(part(package), tmp_path / package)
    monkeypatch.setattr(plan, "part", lambda name: changed if name == package else part(name))
    assert plan.code_sha256.__wrapped__() == before
    (changed / "errors.py").write_text("")
    assert plan.code_sha256.__wrapped__() != before
