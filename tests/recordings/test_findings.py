"""Every shared recording gets the findings of a table: a change of them is seen, and judged by its picture."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from acquisition.recordings.identify import open_recording
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError
from pipeline.params import STANDARD
from springmass.runs.analysing import analyse_track
from springmass.runs.tracks import to_track
from tests.sampling import sampled

TABLE: list[dict[str, Any]] = tomllib.loads(Path(__file__).with_name("findings.toml").read_text("utf-8"))["recording"]


# One of nine recordings in `make test`; the rest are trials.
ORDER = sorted(range(len(TABLE)), key=lambda number: number % 9)


@pytest.mark.parametrize(
    "row",
    sampled([TABLE[number] for number in ORDER], len(TABLE) // 9),
    ids=lambda row: f"{row['file']} {row.get('channel', '')}{row.get('run', '')}",
)
def test_findings_of_a_recording(row: dict[str, Any], recordings: Path) -> None:
    """The codes are those of the table; ``benchmarks/contact_sheet.py`` draws what it judges."""
    options = {name: value for name, value in row.items() if name not in ("file", "codes")}
    found = open_recording(recordings / row["file"], **options)
    track = to_track(found.samples, found.info, recorded_format=found.format)
    try:
        codes = sorted({each.code for each in analyse_track(track, Scene(), STANDARD, found.traps).findings})
    except PipelineError:
        codes = ["refused"]
    assert codes == row["codes"]
