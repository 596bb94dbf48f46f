"""The processes that open recordings, and their limits of time and memory, which this process measures."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncGenerator, Callable, Mapping
from pathlib import Path
from typing import Any

LONGEST_S, LONGEST_S_PER_MB = 20.0, 1.0
MOST_MEMORY = 1 << 30
MEASURED_EVERY_S = 0.1
WORKING, IDLE = 2, 4
"""Processes that work at the same time, and those that keep the recording of a card in between."""
LONGEST_ANSWER = 1 << 26


class ProcessEnded(Exception):
    """A process that was ended, or that died; the message says why in one sentence, and then what to do."""


class Child:
    """One process, which may be ended at any time."""

    def __init__(self, process: Process) -> None:
        self._process = process
        self._why = ""

    @classmethod
    async def start(cls) -> Child:
        """Start a process; it imports what it needs while nobody waits for it."""
        command = (sys.executable, "-m", "springmass.page.window.child")
        return cls(
            await asyncio.create_subprocess_exec(
                *command, stdin=PIPE, stdout=PIPE, stderr=DEVNULL, limit=LONGEST_ANSWER
            )
        )

    def end(self, why: str = "") -> None:
        """End the process; ``why`` is what a waiting request then says."""
        self._why = self._why or why
        with contextlib.suppress(ProcessLookupError):
            self._process.kill()

    async def close(self) -> None:
        """End the process, and wait until it is gone with its pipes."""
        self.end()
        await self._process.communicate()

    async def ask(self, request: Mapping[str, Any], longest_s: float) -> AsyncGenerator[dict[str, Any]]:
        """Yield the answers to a request; ProcessEnded if the process takes too long or too much, or is ended."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        guard = asyncio.create_task(self._guard(longest_s))
        try:
            stdin.write(json.dumps(request).encode() + b"\n")
            await stdin.drain()
            while line := await stdout.readline():
                answer = json.loads(line)
                if "done" in answer:
                    return
                yield answer
        except (ConnectionError, ValueError):  # it died, or wrote a line that is too long
            self.end()
        finally:
            guard.cancel()
        raise ProcessEnded(
            self._why or "Reading it ended early, perhaps for want of memory; export a shorter recording"
        )

    async def _guard(self, longest_s: float) -> None:
        """End the process when it has taken too long, or too much memory."""
        until = asyncio.get_running_loop().time() + longest_s
        while asyncio.get_running_loop().time() < until:
            await asyncio.sleep(MEASURED_EVERY_S)
            if (await resident_bytes(self._process.pid)) > MOST_MEMORY:
                self.end(f"It needs more than {MOST_MEMORY >> 30} GB of memory; export a shorter recording")
                return
        self.end(f"It took longer than {longest_s:.0f} s; export a shorter recording, or analyse it in parts")


async def resident_bytes(pid: int) -> int:
    """Return the memory that a process has; 0 if it has ended."""
    if Path("/proc/self/statm").is_file():
        with contextlib.suppress(OSError):
            return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
        return 0
    windows = os.name == "nt"
    of_windows = ("tasklist", "/nh", "/fi", f"pid eq {pid}")
    command = of_windows if windows else ("ps", "-o", "rss=", "-p", f"{pid}")
    process = await asyncio.create_subprocess_exec(*command, stdout=PIPE, stderr=DEVNULL)
    text = (await process.communicate())[0].decode(errors="replace")
    numbers = [word for word in text.strip().removesuffix(" K").split(" ") if word]  # of Windows "... 1   12.345 K"
    return int("".join(filter(str.isdigit, numbers[-1] if numbers else "")) or 0) * 1024


class Children:
    """The processes of all cards, by what they hold: the longest unused of many idle ones is ended."""

    def __init__(self) -> None:
        self._spare: asyncio.Task[Child] | None = None
        self._idle: dict[str, Child] = {}
        self._busy: dict[str, Child] = {}
        self._free = asyncio.Semaphore(WORKING)
        self._turns: dict[str, asyncio.Lock] = {}

    def prepare(self) -> None:
        """Have a process ready for the next recording."""
        if self._spare is None:
            self._spare = asyncio.create_task(Child.start())

    async def ask(
        self, holder: str, request: Mapping[str, Any], size: int, begun: Callable[[], None] = lambda: None
    ) -> AsyncGenerator[dict[str, Any]]:
        """Yield the answers of the holder's process to a request about files of so many bytes, when it is its turn."""
        async with self._turns.setdefault(holder, asyncio.Lock()), self._free:
            begun()
            child = self._idle.pop(holder, None)
            if child is None:
                spare, self._spare = self._spare, None  # before the wait: the next card needs a process of its own
                child = await (spare or Child.start())
            self._busy[holder] = child
            try:
                async for answer in child.ask(request, LONGEST_S + LONGEST_S_PER_MB * size * 1e-6):
                    yield answer
            except BaseException:
                child.end()
                raise
            else:
                self._idle[holder] = child
                while len(self._idle) > IDLE:
                    self._idle.pop(next(iter(self._idle))).end()
            finally:
                del self._busy[holder]
                self.prepare()

    def forget(self, holder: str, why: str) -> None:
        """End the process of a holder."""
        for children in (self._busy, self._idle):
            if holder in children:
                children[holder].end(why)
        self._idle.pop(holder, None)

    async def close(self) -> None:
        """End all processes."""
        spare = [] if self._spare is None else [await self._spare]
        for child in self._busy.values():
            child.end()  # its request waits for it
        for child in (*self._idle.values(), *spare):
            await child.close()
