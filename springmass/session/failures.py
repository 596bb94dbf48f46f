"""Failures that do not end a recording: counted, written into the run once, and reported at its end."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from storage.errors import one_line

KINDS = 20
"""Maximum number of kinds of failure counted separately; all further kinds are counted together."""
OTHERS = "others"


class Failures:
    """Counts failures by component, error and the line that raised it; any thread may report a failure.

    During a recording, ``tell`` makes an event of the first failure of each kind.
    """

    def __init__(self) -> None:
        self.tell: Callable[[str, Mapping[str, Any]], None] | None = None
        self._lock = threading.Lock()
        self._counts: dict[str, int] = {}

    def note(self, what: str, error: BaseException) -> None:
        """Count a failure of a component, such as the display, a decoder or the reader."""
        where = raised_at(error)
        name = f"{what}: {type(error).__name__} at {where}"
        with self._lock:
            known = name in self._counts
            if not known and len(self._counts) >= KINDS:
                name, known = OTHERS, True
            self._counts[name] = self._counts.get(name, 0) + 1
            tell = None if known else self.tell
        if tell is not None:
            tell(f"{what}_failed", {"error": type(error).__name__, "why": one_line(error), "where": where})

    @property
    def counts(self) -> Mapping[str, int]:
        """Number of failures of each kind."""
        with self._lock:
            return dict(self._counts)

    def describe(self) -> list[str]:
        """Return a readable line for each kind of failure."""
        return [
            f"during the recording, which went on, {count} time{'s' * (count > 1)}: {name}"
            for name, count in self.counts.items()
        ]


def raised_at(error: BaseException) -> str:
    """Return the file name, without its folder, and the line that raised an error."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "nowhere"
