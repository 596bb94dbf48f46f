"""What real recordings leave out: every run and channel that a question lists can be chosen, and nothing else asks."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.identify import open_recording
from acquisition.recordings.questions import Missing
from tests.sampling import sampled

WORKBOOK = "xlsx__michele98__schwing1.xlsx"
"""A table of results."""


def walk(path: Path, answers: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    """Answer one question after the other, with all runs and channels; yield the answers, and why they are refused."""
    try:
        open_recording(path, **answers)
    except NeedsAnswer as unanswered:
        need = unanswered.question.needs[0]
        if need.what.value in answers or len(set(need.choices)) < len(need.choices):
            pytest.fail(f"cannot be answered: {unanswered}")
        for choice in need.choices if need.what in (Missing.RUN, Missing.CHANNEL) else (need.example,):
            yield from walk(path, {**answers, need.what.value: choice})
    except FormatError as error:
        yield answers, str(error)
    else:
        yield answers, ""


@pytest.mark.parametrize("most_bytes", sampled([12_000, 10**9], 1))
def test_every_channel_of_every_real_recording_can_be_chosen(recordings: Path, most_bytes: int) -> None:
    """All are read by the names that the question lists; only channels of NaN are refused, and files that are none."""
    read, refused = 0, {}
    for path in sorted(each for each in recordings.rglob("*") if each.is_file() and each.suffix != ".md"):
        if path.stat().st_size > most_bytes:
            continue
        for answers, why in walk(path, {}):
            read += not why
            if why:
                refused[path.name, answers.get("channel")] = why
    assert read > (100 if most_bytes > 12_000 else 20)
    empty = {key: why for key, why in refused.items() if "got NaN" in why}
    assert {name for name, _ in refused.keys() - empty.keys()} - {WORKBOOK} == {"kafe2_pendulum.yml"}
