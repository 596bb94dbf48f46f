"""Dialects that a user declares in TOML."""

from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.errors import AcquisitionError, UnknownFormat
from acquisition.recordings.identify import dialect_folder, formats, get_format, open_recording
from acquisition.recordings.reading import ReadOptions

LOG = """
title = "height log of bench 12"
begins = "Height log"
separator = "tab"
heading = 2
rate_hz = 50

[[column]]
name = "n"
aside = true

[[column]]
name = "height"
unit = "mm"
"""
DATA = "Height log 12\nn\th\n" + "".join(f"{i}\t{200 + i % 7},5\n" for i in range(30))


@pytest.fixture
def declare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], Path]:
    """Return what writes a dialect into the user's folder."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    folder = tmp_path / "config" / "springmass" / "dialects"

    def write(name: str, text: str) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
        return folder / name

    return write


def test_a_declared_dialect_is_a_family(declare: Callable[[str, str], Path], tmp_path: Path) -> None:
    """It is listed, found by its name, and asked before all others; its files open with what it says."""
    path = declare("height-log.toml", LOG)
    assert path.parent == dialect_folder()
    assert formats()[0].name == get_format("height-log").name == "height-log"
    with pytest.raises(UnknownFormat, match="nonsense"):
        get_format("nonsense")
    (tmp_path / "run.txt").write_text(DATA, encoding="utf-8")
    recording = open_recording(tmp_path / "run.txt")
    assert (recording.format, recording.channel, recording.info.rate_hz) == ("height-log", "height", 50.0)
    assert recording.samples.distance[:2].tolist() == [0.2005, 0.2015]
    assert open_recording(tmp_path / "run.txt", ReadOptions(channel="n", unit="mm")).samples.distance[3] == 0.003


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('begins = "Height log"', 'begins = " "', "begins"),
        ("rate_hz = 50", "rate = 50", "rate"),
        ("rate_hz = 50", "rate_hz = 0", "rate_hz"),
        ("rate_hz = 50", "rate_hz = true", "rate_hz"),
        ('"tab"', '"x"', "separator"),
        ("heading = 2", "heading = -1", "heading"),
        ('name = "n"', "name = 3", "name"),
        ("aside = true", 'time = true\nunit = "m"', "unit"),
        ("[[column]]", "[column", "TOML"),
    ],
)
def test_what_no_dialect_can_say_is_refused_by_name(
    declare: Callable[[str, str], Path], old: str, new: str, named: str
) -> None:
    """One line names the file and the key."""
    declare("height-log.toml", LOG.replace(old, new))
    with pytest.raises(AcquisitionError, match=rf"height-log\.toml.*{named}") as caught:
        formats()
    assert "\n" not in str(caught.value)


def test_a_family_s_name_cannot_be_taken(declare: Callable[[str, str], Path], tmp_path: Path) -> None:
    """A dialect called as a family of the package would hide it."""
    declare("lvm.toml", LOG)
    with pytest.raises(AcquisitionError, match='"lvm"'):
        formats()
