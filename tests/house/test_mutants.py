"""Planted faults whose code is gone are counted, so that the table does not empty unseen."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import mutants


@pytest.mark.parametrize(("stale", "code"), [(mutants.MOST_STALE, 0), (mutants.MOST_STALE + 1, 1)])
def test_more_stale_faults_than_allowed_fail(
    stale: int, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each is named with its file, and the exit code is 1 from the first that is too many."""
    fault = '[[fault]]\nname = "gone"\nfile = "pipeline/gone.py"\nold = "code that is gone"\nnew = ""\n'
    (tmp_path / "mutants.toml").write_text(stale * fault)
    monkeypatch.setattr(mutants, "TABLE", tmp_path / "mutants.toml")
    assert mutants.main([]) == code
    assert capsys.readouterr().out.count("pipeline/gone.py") == stale
