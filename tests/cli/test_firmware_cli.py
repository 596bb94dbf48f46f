"""`springmass firmware`: wiring, the lines for avrdude, and which speed of a bootloader is taken."""

from __future__ import annotations

import os
import pty
import tty
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.live.firmware import HEX

FAKE = """#!/bin/sh
echo "$@" >> {log}
case "$*" in *"-b {baud}"*) exit 0;; esac
echo "avrdude: error: programmer is not responding" >&2
exit 1
"""


def avrdude(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, baud: int) -> Path:
    """Put an avrdude on the path that finds a bootloader at one speed; return where it writes its words."""
    log, program = tmp_path / "words", tmp_path / "avrdude"
    program.write_text(FAKE.format(log=log, baud=baud), encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    return log


@pytest.fixture
def silent() -> object:
    """Return a port on which nothing ever speaks."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield os.ttyname(slave)
    os.close(slave)
    os.close(master)


def test_wiring_and_both_speeds_are_shown(cli: Callable) -> None:
    """With the path of the firmware, which is there."""
    done = cli("firmware")
    assert done.code == 0
    for words in ("D9", "TRIG", "D8", "ECHO", "-b 115200", "-b 57600", str(HEX)):
        assert words in done.out
    assert HEX.read_text(encoding="ascii").splitlines()[-1] == ":00000001FF"


def test_flashing_without_a_port_names_what_lists_them(cli: Callable) -> None:
    """Exit code 2."""
    done = cli("firmware", "--flash")
    assert done.code == 2
    assert "springmass ports" in done.err


def test_a_board_without_a_bootloader_is_tried_at_both_speeds(
    cli: Callable, silent: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Then one line says what avrdude said, with exit code 4."""
    log = avrdude(tmp_path, monkeypatch, 9600)
    done = cli("firmware", "--port", silent, "--flash")
    assert done.code == 4
    assert "programmer is not responding" in done.err
    words = log.read_text(encoding="utf-8").splitlines()
    assert [line.split("-b ")[1].split()[0] for line in words] == ["115200", "57600"]
    assert all(f"-P {silent}" in line and f"flash:w:{HEX}:i" in line for line in words)


def test_an_old_bootloader_is_found_at_its_speed(
    cli: Callable, silent: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the board is then asked what it is, which this one does not say."""
    avrdude(tmp_path, monkeypatch, 57600)
    monkeypatch.setattr("springmass.commands.firmware.ANSWER_S", 0.2)
    done = cli("firmware", "--port", silent, "--flash")
    assert "written and verified" in done.err
    assert done.code == 4
    assert "is it the right port?" in done.err
