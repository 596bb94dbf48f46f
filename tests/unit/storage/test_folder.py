"""A folder of results is written as a whole, and files of others stay."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from storage.atomic import whole_folder
from storage.errors import WriteFailed

NAMES = {"page", "table", "old", "figures/a"}


def fill(folder: Path, content: str) -> None:
    """Make one result of two files."""
    (folder / "table").write_text(content)
    (folder / "page").write_text(content)


def held(folder: Path) -> dict[str, str]:
    """Return what a folder holds, hidden things beside it among them."""
    every = [*folder.rglob("*"), *folder.parent.glob(".*")]
    return {os.path.relpath(each, folder): each.read_text() for each in every if each.is_file()}


def make(folder: Path, content: str) -> None:
    """Write a result whole."""
    with whole_folder(folder, NAMES, "page") as part:
        fill(part, content)


def test_a_folder_is_replaced_whole(tmp_path: Path) -> None:
    """What the earlier one held and this one does not is gone; nothing is left beside."""
    folder = tmp_path / "a" / "run.results"
    with whole_folder(folder, NAMES, "page") as part:
        fill(part, "1")
        (part / "old").write_text("1")
        (part / "figures").mkdir()
        (part / "figures/a").write_text("1")
    make(folder, "2")
    assert held(folder) == {"page": "2", "table": "2"}


def test_a_build_that_fails_leaves_the_old_one(tmp_path: Path) -> None:
    """After an error of the body what stood there stands."""
    folder = tmp_path / "run.results"
    make(folder, "1")
    with pytest.raises(TypeError), whole_folder(folder, NAMES, "page") as part:
        (part / "table").write_text(2)  # type: ignore[arg-type]
    assert held(folder) == {"page": "1", "table": "1"}


@pytest.mark.parametrize("inside", [False, True])
def test_what_others_put_there_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, inside: bool) -> None:
    """A folder with other files, or that somebody stands in, keeps its place and its files; stale ones of ours go."""
    folder = tmp_path / "mine"
    make(folder, "1")
    (folder / "old").write_text("1")
    if inside:
        monkeypatch.chdir(folder)
        folder = Path()
    else:
        (folder / "notes.txt").write_text("mine")
    make(folder, "2")
    assert held(folder.resolve()) == {"page": "2", "table": "2"} | ({} if inside else {"notes.txt": "mine"})


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    """A file stands where a folder above should be."""
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteFailed, match="could not be written"):
        make(tmp_path / "file" / "run.results", "1")
