"""The processes that open recordings: forks of one that has imported all they need, limited in time and memory."""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import os
import signal
import sys
from asyncio.subprocess import DEVNULL, PIPE
from collections.abc import AsyncGenerator, Callable, Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

LONGEST_S, LONGEST_S_PER_MB = 20.0, 1.0
"""Processor time that a request may take; on a busy machine it may last ``SLOWEST`` times as long."""
SLOWEST = 10.0
MOST_MEMORY = 1 << 30
MEASURED_EVERY_S = 0.1
WORKING, IDLE = 2, 4
"""Processes that work at the same time, and those that keep the recording of a card in between."""
FORKS = sys.platform == "linux"
"""Elsewhere a fork may hang that is made after linear algebra, or there is none: each process imports by itself."""
CONTEXT: Any = multiprocessing.get_context("forkserver" if FORKS else "spawn")
CONTEXT.set_forkserver_preload(["springmass.page.window.child"])


class ProcessEnded(Exception):
    """A process that was ended, or that died; the message says why in one sentence, and then what to do."""


class Child:
    """One process, which may be ended at any time."""

    def __init__(self) -> None:
        self._pipe, self._theirs = CONTEXT.Pipe()
        self._process = CONTEXT.Process(target=_begin, args=(self._theirs,), daemon=True)
        self._why = ""

    @classmethod
    async def start(cls) -> Child:
        """Start a process; it imports what it needs while nobody waits for it."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # an analysis uses one; a fork is safe without others
        child = cls()
        await asyncio.to_thread(child._process.start)
        child._theirs.close()
        return child

    def end(self, why: str = "") -> None:
        """End the process; ``why`` is what a waiting request then says."""
        self._why = self._why or why
        self._process.kill()

    async def ask(self, request: Mapping[str, Any], longest_s: float) -> AsyncGenerator[dict[str, Any]]:
        """Yield the answers to a request; ProcessEnded if the process takes too long or too much, or is ended."""
        guard = asyncio.create_task(self._guard(longest_s))
        try:
            await asyncio.to_thread(self._pipe.send, {**request, "longest_s": longest_s})
            while (answer := await asyncio.to_thread(self._pipe.recv)) is not None:
                yield answer
            return
        except (OSError, EOFError):
            await asyncio.to_thread(self._process.join)
        finally:
            guard.cancel()
        if sys.platform != "win32" and self._process.exitcode == -signal.SIGPROF:
            self._why = self._why or _too_long(longest_s)
        raise ProcessEnded(
            self._why or "Reading it ended early, perhaps for want of memory; export a shorter recording"
        )

    async def _guard(self, longest_s: float) -> None:
        """End the process when it has taken far too long, or too much memory."""
        until = asyncio.get_running_loop().time() + SLOWEST * longest_s
        while asyncio.get_running_loop().time() < until:
            await asyncio.sleep(MEASURED_EVERY_S)
            if (await resident_bytes(self._process.pid or 0)) > MOST_MEMORY:
                self.end(f"It needs more than {MOST_MEMORY >> 30} GB of memory; export a shorter recording")
                return
        self.end(_too_long(longest_s))


def _begin(requests: Connection) -> None:
    from springmass.page.window.child import serve

    serve(requests)


def _too_long(longest_s: float) -> str:
    return f"It took longer than {longest_s:.0f} s; export a shorter recording, or analyse it in parts"


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
    """The processes of all cards, by what they hold, the longest unused first; of many idle ones it is ended."""

    def __init__(self) -> None:
        self._children: dict[str, Child] = {}
        self._spare: asyncio.Task[Child] | None = None
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
            if (child := self._children.pop(holder, None)) is None:
                spare, self._spare = self._spare, None  # before the wait: the next card needs a process of its own
                child = await (spare or Child.start())
            self._children[holder] = child
            try:
                async for answer in child.ask(request, LONGEST_S + LONGEST_S_PER_MB * size * 1e-6):
                    yield answer
            except BaseException:
                self.forget(holder)
                raise
        self.prepare()
        for idle in [each for each in self._children if not self._turns[each].locked()][:-IDLE]:
            self.forget(idle)

    def forget(self, holder: str, why: str = "") -> None:
        """End the process of a holder, if it has one; ``why`` is what its request then says."""
        if (child := self._children.pop(holder, None)) is not None:
            child.end(why)

    def close(self) -> None:
        """End all processes."""
        for holder in [*self._children]:
            self.forget(holder)
