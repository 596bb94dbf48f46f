"""``springmass explain``: every finding has its meaning, cause, advice and example."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from pipeline.findings.registry import FINDINGS

Cli = Callable[..., Any]


@pytest.mark.parametrize("code", sorted(FINDINGS))
def test_a_finding_is_explained(cli: Cli, code: str) -> None:
    """Within 80 columns, with its meaning from the registry."""
    done = cli("explain", code)
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    assert lines[0].startswith(f"{code} (")
    assert max(map(len, lines)) <= 80
    assert [word for word in ("Meaning:", "Cause:", "Advice:", "Example:") if f"\n{word}" not in done.out] == []
    assert " ".join(FINDINGS[code].meaning.split()) in " ".join(done.out.split())


def test_all_findings_are_listed(cli: Cli) -> None:
    """Without a code; as JSON with the same codes."""
    listed = cli("explain").out
    assert [code for code in FINDINGS if f"  {code}: " not in listed] == []
    assert [each["code"] for each in json.loads(cli("explain", "--json").out)] == list(FINDINGS)


def test_a_code_that_does_not_exist_has_a_suggestion(cli: Cli) -> None:
    """The nearest code is named, with the exit code of a usage error."""
    done = cli("explain", "clip")
    assert (done.code, done.out) == (2, "")
    assert "clipped" in done.complaint
