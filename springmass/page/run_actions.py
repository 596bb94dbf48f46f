"""Actions on a recorded run: make its report, add notes, or discard it. Nothing is deleted."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

from springmass.runs.scenes import about_of, write_about

ASIDE = "discarded"
"""Folder next to the runs for discarded runs."""


class RunActions:
    """Works on one run; its path comes from the recorder or the command line, never from the network.

    ``ours`` is whether the run was recorded just now; no other run can be discarded. ``report`` is the path of the
    report; None until it is made.
    """

    def __init__(self, run: Path, *, ours: bool, law: str | None = None) -> None:
        self._run, self.ours, self._law = run, ours, law
        self.report: Path | None = None
        self._making = False
        self._notes: list[str] = []
        self._aside = self._failed = ""

    def state(self) -> dict[str, Any]:
        """Return the state of the actions for the page."""
        report = "making" if self._making else "" if self.report is None else "ready"
        return {"report": report, "noted": self._notes, "discarded": self._aside, "failed": self._failed}

    def note(self, text: str) -> None:
        """Add a note to the file next to the run."""
        try:
            write_about(about_of(self._run).with_more(None, (text,), ()))
            self._notes = [*self._notes, text]
        except Exception as error:
            self._failed = f"not noted ({error})"

    def discard(self) -> None:
        """Move the run and its notes to the folder of discarded runs, without replacing any file there."""
        if self._making or self._aside:
            return
        folder = self._run.parent / ASIDE
        try:
            folder.mkdir(exist_ok=True)
            number, name = 1, self._run.name
            while (folder / name).exists():
                number += 1
                name = f"{self._run.stem}-{number}{self._run.suffix}"
            notes, aside = about_of(self._run).path, folder / name
            self._run.rename(aside)
            if notes.exists():
                notes.rename(folder / f"{aside.stem}.about.toml")
            self._run, self._aside = aside, f"{ASIDE}/{name}"
        except OSError as error:
            self._failed = f"not set aside ({error.strerror or error})"

    def make_report(self) -> None:
        """Start a process that analyses the run, unless one is already running."""
        if not self._making:
            self._making, self._failed, self.report = True, "", None
            threading.Thread(target=self._analyse, name="springmass-page-report", daemon=True).start()

    def _analyse(self) -> None:
        command = [sys.executable, "-m", "springmass", "-q", "analyse", str(self._run), "-o", str(self._run.parent)]
        command += [] if self._law is None else ["--law", self._law]
        try:
            done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, errors="replace")
            page = self._run.parent / f"{self._run.stem}.results" / "report.html"
            if done.returncode == 0 and page.is_file():
                self.report = page
            else:
                lines = done.stderr.strip().splitlines()
                self._failed = f"no report ({lines[-1] if lines else f'exit code {done.returncode}'})"
        except OSError as error:
            self._failed = f"no report ({error})"
        finally:
            self._making = False
