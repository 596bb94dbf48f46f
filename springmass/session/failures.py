"""What failed during the recording without ending it: counted, written into the run once, and reported at its end."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from storage.errors import one_line

__all__ = ["Failures", "raised_at"]

KINDS = 20
"""So many different failures are counted by kind; of those beyond only the number is kept."""
OTHERS = "others"


class Failures:
    """Counts failures by what failed, the error and the line that raised it; any thread may note one.

    Attributes
    ----------
    tell : callable or None
        Takes ``(kind, facts)`` of the first failure of each kind: an event for the run.
    """

    def __init__(self) -> None:
        self.tell: Callable[[str, Mapping[str, Any]], None] | None = None
        self._lock = threading.Lock()
        self._counts: dict[str, int] = {}

    def note(self, what: str, error: BaseException) -> None:
        """Count a failure of the display, a decoder, the reader or the like."""
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
        """How often each kind came."""
        with self._lock:
            return dict(self._counts)

    def describe(self) -> Iterator[str]:
        """Yield a line for people on each kind."""
        for name, count in self.counts.items():
            yield f"during the recording, which went on, {count} time{'s' * (count > 1)}: {name}"


def raised_at(error: BaseException) -> str:
    """Return file and line that raised an error, with no folder of this machine."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "nowhere"
