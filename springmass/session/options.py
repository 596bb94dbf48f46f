"""What a session is asked for: when its run begins and ends, and who takes part in it."""

from __future__ import annotations

import queue
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from acquisition.live.calibration import StillPoint
from springmass.session.display.progress import Progress
from springmass.session.trigger import Trigger

__all__ = ["RunLimits", "RunListeners"]


@dataclass(frozen=True, slots=True)
class RunLimits:
    """When a run begins and ends.

    Parameters
    ----------
    seconds : float or None
        How long; None: until the user ends it.
    trigger : Trigger or None
        None: it starts immediately.
    rest : StillPoint or None
        The rest position from which the trigger measures; None: the distance when it began to wait.
    """

    seconds: float | None = None
    trigger: Trigger | None = None
    rest: StillPoint | None = None


@dataclass(frozen=True, slots=True)
class RunListeners:
    """Who takes part in a run while it is recorded.

    Parameters
    ----------
    progress : callable
        Called about once a second, on a separate thread.
    marks : queue of str or None
        Marks to put into the run.
    begun : callable
        Called with the log's path once reads go there.
    changed : callable
        Returns whether to stop waiting for the trigger; called while the session waits.
    """

    progress: Callable[[Progress], None] = lambda _: None
    marks: queue.SimpleQueue[str] | None = None
    begun: Callable[[Path], None] = lambda _: None
    changed: Callable[[], bool] = lambda: False
