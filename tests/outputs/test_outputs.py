"""No recording ends in a traceback, in any output.

``make test`` plays one subject of each class, ``pytest -m trials`` one channel of each real recording, and with
``SPRINGMASS_TRIALS`` of 2000 (``make trials``) every channel and run of each and every kind of trouble.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from springmass.errors import INTERNAL, OK, SOME_FAILED
from tests.outputs.play import play, read_page, read_tables, run
from tests.outputs.subjects import CLASSES, RECORDINGS, Subject, recordings, samples, specials, troubles

EVERYTHING = int(os.environ.get("SPRINGMASS_TRIALS", "0")) >= 2000
PARTS = 4  # of the list of recordings, so that two processes share them evenly


@pytest.fixture(autouse=True)
def _pictures_without_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")


def _played(subjects: Iterator[Subject], tmp_path: Path) -> tuple[int, int]:
    """Play subjects; return how many, and in how many outputs."""
    wrong, count, outputs = [], 0, 0
    for count, subject in enumerate(subjects, 1):
        folder = tmp_path / f"played{count}"
        folder.mkdir()
        try:
            outputs += play(subject, folder)
        except Exception as error:  # every subject is played before the test fails
            wrong.append(f"{subject.name} {subject.options}: {type(error).__name__}: {error}"[:2000])
    assert not wrong, "\n\n".join(wrong)
    return count, outputs


def test_one_of_each_class_in_every_output(tmp_path: Path) -> None:
    """A trouble, a bundled recording, and each special motion are readable in every output."""
    for name, subjects in CLASSES.items():
        chosen = list(subjects(tmp_path))[: None if name == "special" else 1]
        if name == "recording" and not RECORDINGS.is_dir():
            continue
        folder = tmp_path / name
        folder.mkdir()
        count, outputs = _played(iter(chosen), folder)
        assert outputs >= 10 * count


@pytest.mark.trials
@pytest.mark.parametrize("part", range(PARTS))
def test_every_real_recording_in_every_output(tmp_path: Path, part: int) -> None:
    """One channel of each file, in the full trials every channel and run, gives readable outputs or one line."""
    if not RECORDINGS.is_dir():
        pytest.skip("needs ../shared/recordings")
    count, outputs = _played(itertools.islice(recordings(every=EVERYTHING), part, None, PARTS), tmp_path)
    print(f"\n{count} subjects of real recordings in {outputs} outputs")
    assert count >= 60 // PARTS


@pytest.mark.trials
def test_every_trouble_in_every_output(tmp_path: Path) -> None:
    """Records of every kind of trouble give readable outputs; of each eighth kind where trials are bounded."""
    kinds = list(troubles(tmp_path))
    count, outputs = _played(iter(kinds if EVERYTHING else kinds[::8]), tmp_path)
    print(f"\n{count} subjects with troubles in {outputs} outputs")


@pytest.mark.trials
def test_pairs_are_compared_in_a_report(tmp_path: Path) -> None:
    """Neighbours of the list, in bounded trials every fifth pair, give a report or one line that says why not."""
    subjects = _together(tmp_path)
    bench = tmp_path / "bench.toml"
    bench.write_text("[bob]\nmass_kg = { value = 0.2, u = 1e-4 }\n[spring]\nmass_kg = { value = 0.01, u = 1e-3 }\n")
    written = 0
    for number, (one, other) in enumerate(list(itertools.pairwise(subjects))[:: 1 if EVERYTHING else 5]):
        out = tmp_path / f"compared{number}"
        options = one.options if one.options == other.options else []
        done = run("compare", one.path, other.path, *options, "--scene", bench, "--out", out)
        assert done.code != INTERNAL
        for page in out.rglob("report.html"):
            read_page(page)
            written += 1 + read_tables(page.parent)
    assert written >= (20 if EVERYTHING else 4)


@pytest.mark.trials
def test_all_together_in_one_batch(tmp_path: Path) -> None:
    """One batch of everything has an index, reports and tables, and can be searched and mapped."""
    subjects = _together(tmp_path)
    table = [_ROW, *(_row(subject) for subject in subjects)]
    runs = tmp_path / "runs.csv"
    runs.write_text("\n".join(table) + "\n", encoding="utf-8")
    out = tmp_path / "course"
    paths = dict.fromkeys(str(subject.path) for subject in subjects)
    done = run("batch", *paths, "--runs", runs, "-o", out, "--reports", "1000000" if EVERYTHING else "10")
    assert done.code in (OK, SOME_FAILED), done.err
    assert "internal error" not in done.err + (out / "results.csv").read_text(encoding="utf-8")
    read_page(out / "index.html")
    reports = list((out / "reports").rglob("report.html"))
    assert len(reports) >= 10
    for page in reports:
        read_page(page)
        read_tables(page.parent)
    assert run("catalog", out).code == OK
    mapped = run("map", out)
    assert mapped.code == OK or len(mapped.err.splitlines()) == 1, mapped.err


_ROW = "path,channel,run,unit,rate_hz,time_unit"


def _together(tmp_path: Path) -> Sequence[Subject]:
    """Return a file of each class, none twice, without laws of the user's own, which files cannot state."""
    found = [*samples(), *(one for one in specials(tmp_path) if not one.laws)]
    if RECORDINGS.is_dir():
        found += recordings(every=False)
    return list({one.path: one for one in found}.values())


def _row(subject: Subject) -> str:
    answers = [str(subject.answers.get(name, "")) for name in _ROW.split(",")[1:]]
    return ",".join('"' + cell.replace('"', '""') + '"' for cell in [str(subject.path), *answers])
