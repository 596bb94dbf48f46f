"""A pseudo-terminal to run the program on, and the screen that a reader of it sees."""

import fcntl
import os
import re
import select
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Self

_CONTROL = re.compile(r"\x1b\[(?P<digits>[?\d;]*)(?P<final>[A-Za-z])|\x1b[=>78]")


class Screen:
    """The lines that a terminal of some columns shows, as far as this program's control sequences go."""

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.lines: list[list[str]] = [[]]
        self.row = self.column = 0
        self.wrapped = 0
        self.raw = ""

    def feed(self, text: str) -> None:
        """Take what the program wrote."""
        self.raw += text
        at = 0
        while at < len(text):
            if found := _CONTROL.match(text, at):
                self._control(found["digits"] or "", found["final"] or "")
                at = found.end()
                continue
            self._character(text[at])
            at += 1

    def _character(self, character: str) -> None:
        if character == "\r":
            self.column = 0
        elif character == "\n":
            self._down()
        elif character >= " ":
            if self.column >= self.columns:
                self.wrapped += 1
                self.column = 0
                self._down()
            line = self.lines[self.row]
            line += " " * (self.column + 1 - len(line))
            line[self.column] = character
            self.column += 1

    def _down(self) -> None:
        self.row += 1
        while len(self.lines) <= self.row:
            self.lines.append([])

    def _control(self, digits: str, final: str) -> None:
        count = int(digits) if digits.isdecimal() else 0
        if final == "A":
            self.row = max(self.row - max(count, 1), 0)
        elif final == "B":
            self.row = min(self.row + max(count, 1), len(self.lines) - 1)
        elif final == "K":
            line = self.lines[self.row]
            self.lines[self.row] = [] if count == 2 else line[: self.column]
        elif final == "J":
            self.lines[self.row] = self.lines[self.row][: self.column]
            del self.lines[self.row + 1 :]

    @property
    def text(self) -> str:
        """What stands on the screen."""
        return "\n".join("".join(line).rstrip() for line in self.lines)


class OnTerminal:
    """The program on a pseudo-terminal; used in a ``with``."""

    def __init__(
        self, arguments: list[str], folder: Path, columns: int = 80, environment: Mapping[str, str] | None = None
    ) -> None:
        self.screen = Screen(columns)
        master, slave = os.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        kept = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES", "NO_COLOR")}
        given = {**kept, "TERM": "xterm-256color", "PYTHONIOENCODING": "utf-8", **(environment or {})}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "springmass", *arguments],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            cwd=folder,
            env=given,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(slave)
        self._master = master

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self._master)

    def type(self, keys: str) -> None:
        """Press keys."""
        os.write(self._master, keys.encode())

    def until(self, words: str, limit_s: float = 120.0) -> None:
        """Read until the screen shows these words."""
        end = time.monotonic() + limit_s
        while words not in self.screen.text:
            assert self._read(end - time.monotonic()), f"{words!r} never came:\n{self.screen.text}"

    def end(self, limit_s: float = 120.0) -> int:
        """Read until the program ends; return its exit code."""
        end = time.monotonic() + limit_s
        while self._read(end - time.monotonic()):
            pass
        return self.process.wait(max(end - time.monotonic(), 1.0))

    def _read(self, wait_s: float) -> bool:
        ready, _, _ = select.select([self._master], [], [], max(wait_s, 0.0))
        if not ready:
            return False
        try:
            data = os.read(self._master, 65536)
        except OSError:  # the program has closed its end
            return False
        self.screen.feed(data.decode("utf-8", "replace"))
        return bool(data)
