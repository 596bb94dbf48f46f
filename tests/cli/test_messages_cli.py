"""Messages on stderr: problems always, what was done unless ``-q``, details with ``-v``, hints on a terminal alone."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest

from springmass.cli import main
from tests.cli.conftest import Cli


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return True


@pytest.mark.parametrize(("options", "lines"), [((), 1), (("-q",), 0), (("-v",), 2)])
def test_quiet_and_verbose_choose_what_is_printed(
    cli: Cli, recording: Path, tmp_path: Path, options: tuple[str, ...], lines: int
) -> None:
    """The file that was written; before it, with ``-v``, the file that was read."""
    done = cli("convert", recording, tmp_path / "copy.h5", *options)
    assert len(done.err.splitlines()) == lines
    assert ("copy.h5" in done.err) == (lines > 0)


@pytest.mark.parametrize("options", [(), ("-q",)])
def test_only_a_terminal_shows_the_next_command(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...]
) -> None:
    """Not a pipe, whose lines another program reads; and not if only problems are wanted."""
    shown = []
    for number, stream in enumerate((io.StringIO(), Terminal())):
        monkeypatch.setattr(sys, "stderr", stream)
        assert main(["convert", str(recording), str(tmp_path / f"{number}.h5"), *options]) == 0
        shown.append("springmass analyse" in stream.getvalue())
    assert shown == [False, not options]
