"""The options of a session: when its run begins and ends, and which functions are called during it."""

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
    """The start and end of a run.

    Parameters
    ----------
    seconds : float or None
        Duration of the run, s; None: until the user ends it.
    trigger : Trigger or None
        Trigger that starts the run; None: the run starts immediately.
    rest : StillPoint or None
        Rest position from which the trigger measures; None: the first distance after the wait begins.
    """

    seconds: float | None = None
    trigger: Trigger | None = None
    rest: StillPoint | None = None


@dataclass(frozen=True, slots=True)
class RunListeners:
    """Callbacks and mark queue used during the recording of a run.

    Parameters
    ----------
    progress : callable
        Called with the progress about once a second, on a separate thread.
    marks : queue of str or None
        Marks to put into the run.
    begun : callable
        Called with the log's path once reads are recorded there.
    changed : callable
        Returns whether to stop waiting for the trigger; called while the session waits.
    """

    progress: Callable[[Progress], None] = lambda _: None
    marks: queue.SimpleQueue[str] | None = None
    begun: Callable[[Path], None] = lambda _: None
    changed: Callable[[], bool] = lambda: False
