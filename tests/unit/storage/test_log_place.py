"""A log is found again whatever becomes of its name."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from storage.errors import WriteFailed
from storage.log_place import LogPlace

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
