"""A recorder started from the window: a process of its own, which goes on when window and server have ended."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import subprocess
import sys
from asyncio.subprocess import DEVNULL, PIPE
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from platformdirs import user_documents_path

from springmass.errors import ProgramError
from springmass.session.file_names import default_name
from storage.atomic import write_whole

SIMULATED = "simulate"


class RecorderProcess:
    """The last recorder that a window of this user started, found again by what it wrote."""

    def __init__(self, folder: Path) -> None:
        self._kept, self._log = folder / "recorder.json", folder / "recorder.log"
        kept = json.loads(self._kept.read_text("utf-8")) if self._kept.is_file() else {}
        self.folder: str = kept.get("folder") or str(user_documents_path() / "springmass")
        self.run: str = kept.get("run", "")
        self._pid: int = kept.get("pid", 0)
        self._process: subprocess.Popen[bytes] | None = None
        self._shown = not self.running

    @property
    def running(self) -> bool:
        """Whether its process runs."""
        if self._process is not None:
            return self._process.poll() is None
        if not self._pid or not Path("/proc/self").exists():
            return False
        try:
            return b"record" in Path(f"/proc/{self._pid}/cmdline").read_bytes()
        except OSError:
            return False

    def message(self) -> dict[str, Any]:
        """Return what the page shows of it."""
        lines = self._log.read_text("utf-8", "replace").splitlines() if self._log.is_file() and self.run else []
        addresses = [found[1] for line in lines if (found := re.fullmatch(r"page: (http\S+)", line))]
        said = [line for line in lines if not line.startswith(("page: ", "next: "))]
        return {
            "type": "recorder",
            "folder": self.folder,
            "run": self.run,
            "running": self.running,
            "address": addresses[-1] if addresses and self.running else "",
            "said": said[-1] if said and not self.running and not self._shown else "",
        }

    def finished(self) -> Path | None:
        """Return a run file that has been made since the last call."""
        if self._shown or not Path(self.run).is_file():
            return None
        self._shown = True
        return Path(self.run)

    def start(self, asked: Mapping[str, Any]) -> None:
        """Start a recorder, whose page sets zero, arms the trigger and begins the run."""
        if self.running:
            raise ProgramError("a recorder is running", "show its live page, or end it first")
        port, sensor, title, folder = (
            str(asked.get(name, "")).strip() for name in ("port", "sensor", "title", "folder")
        )
        where = Path(folder or self.folder).expanduser()
        where.mkdir(parents=True, exist_ok=True)
        run = default_name(title or "recording", datetime.now(), where)
        command = [sys.executable, "-m", "springmass", "record", "--page", "--ready", "--no-browser", f"--output={run}"]
        command += ["--simulate"] if port == SIMULATED else [f"--port={port}"] if port else []
        command += [f"--sensor={sensor}"] if sensor else []
        command += [f"--title={title}"] if title else []
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=log, start_new_session=True
            )
        self.folder, self.run, self._pid, self._shown = str(where), str(run), self._process.pid, False
        write_whole(self._kept, json.dumps({"folder": self.folder, "run": self.run, "pid": self._pid}))

    def end(self) -> None:
        """End it as Ctrl-C does: what was recorded becomes a run file."""
        if self.running:
            os.kill(self._pid, signal.SIGTERM if os.name == "nt" else signal.SIGINT)


async def ports() -> dict[str, Any]:
    """Return the ports of this computer with what speaks on them, and the sensors that are known."""
    command = (sys.executable, "-m", "springmass", "ports", "--json")
    process = await asyncio.create_subprocess_exec(*command, stdout=PIPE, stderr=DEVNULL)
    found: dict[str, Any] = json.loads((await process.communicate())[0] or b'{"ports": [], "sensors": []}')
    return found
