"""A log is found again whatever becomes of its name."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from storage.errors import WriteFailed
from storage.log_place import LogPlace, LogPlaces

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="open files are found by name on Linux")


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a log in a folder of its own."""
    folder = tmp_path / "bench"
    folder.mkdir()
    path = folder / "run.wire"
    path.write_bytes(b"every byte")
    return path


def test_a_log_in_its_place_is_nothing_to_tell(log: Path) -> None:
    """The name leads to it."""
    place = LogPlace(log)
    place.look()
    assert place.astray == ""
    assert place.found() == log
    place.close()


def test_a_log_whose_folder_was_renamed_is_where_the_folder_is(log: Path) -> None:
    """Nothing is written."""
    place = LogPlace(log)
    after = log.parent.rename(log.parent.with_name("after"))
    place.look()
    assert "renamed" in place.astray
    assert place.found() == after / "run.wire"
    place.close()


def test_a_deleted_log_is_written_anew_under_its_name(log: Path) -> None:
    """Whole, with what was appended after it was deleted."""
    place = LogPlace(log)
    with log.open("ab") as file:
        log.unlink()
        file.write(b", also the last")
    assert place.found() == log
    assert place.astray == "the log was deleted"
    assert log.read_bytes() == b"every byte, also the last"
    place.close()


def test_a_replaced_log_is_written_anew_beside_what_took_its_name(log: Path) -> None:
    """What stands there is somebody's, and stays."""
    place = LogPlace(log)
    log.unlink()
    log.write_bytes(b"mine")
    saved = place.found()
    assert saved != log
    assert (saved.read_bytes(), log.read_bytes()) == (b"every byte", b"mine")
    place.close()


def test_a_log_deleted_with_its_folder_is_one_line(log: Path) -> None:
    """There is nowhere to write it to."""
    place = LogPlace(log)
    log.unlink()
    log.parent.rmdir()
    with pytest.raises(WriteFailed, match="cannot be written anew"):
        place.found()
    place.close()


@pytest.fixture
def further(log: Path) -> Path:
    """Return the log's further file; the name between was taken when it was made."""
    path = log.with_name("run.002.wire")
    path.write_bytes(b"its rest")
    return path


def test_further_files_in_their_places_are_left_alone(log: Path, further: Path) -> None:
    """Nothing is written beside them."""
    places = LogPlaces(log)
    places.look([log, further])
    assert (places.astray, places.found()) == ("", log)
    assert sorted(path.name for path in log.parent.iterdir()) == ["run.002.wire", "run.wire"]
    places.close()


@pytest.mark.parametrize("loss", ["deleted", "renamed", "replaced"])
def test_a_further_file_that_is_lost_is_written_anew_where_the_log_is_read_from(
    log: Path, further: Path, loss: str
) -> None:
    """Under its name, or with one digit more where somebody's file has taken that; and it is said which it was."""
    places = LogPlaces(log)
    places.look([log, further])
    if loss == "renamed":
        further.rename(log.parent.parent / "elsewhere")
    else:
        further.unlink()
    if loss == "replaced":
        further.write_bytes(b"mine")
    places.look([log, further])
    assert "run.002.wire" in places.astray
    assert places.found() == log
    written = log.with_name("run.0002.wire") if loss == "replaced" else further
    assert written.read_bytes() == b"its rest"
    places.close()


def test_further_files_go_with_a_log_that_is_written_anew_by_another_name(log: Path, further: Path) -> None:
    """Beside it, under its new name, for that is where they are looked for."""
    places = LogPlaces(log)
    places.look([log, further])
    log.unlink()
    log.write_bytes(b"mine")
    saved = places.found()
    assert saved == log.with_name("run.saved1.wire")
    assert log.with_name("run.saved1.002.wire").read_bytes() == b"its rest"
    places.close()
