"""A sample of the goldens; `make golden` compares them all."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.golden import damaged_logs
from tests.golden.golden import Places, differences, frozen, missing, outcome, unpacked

SAMPLE = list(frozen())[::16]


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Places:
    """Return the folders of the command lines."""
    return unpacked(tmp_path_factory.mktemp("golden"))


@pytest.mark.parametrize("key", SAMPLE, ids=lambda key: Path(json.loads(key)[1]).name)
def test_a_command_line_says_what_it_said(places: Places, key: str) -> None:
    """A command line gives the numbers, codes and exit code of 0.2.0, or of a change on purpose."""
    if missing(places, json.loads(key)):
        pytest.skip("the shared recordings are not here")
    changed, _, _ = differences(key, frozen()[key], outcome(places.filled(json.loads(key))))
    assert changed == []


@pytest.mark.parametrize("name", damaged_logs.names()[::20])
def test_a_damaged_log_gives_its_samples(name: str) -> None:
    """A damaged log gives the samples that 0.2.0 recovered from it."""
    assert damaged_logs.difference(name) == ""
