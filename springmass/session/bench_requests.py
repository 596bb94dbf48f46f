"""Carry out requests from the page before a run: zero, arm, disarm, record.

The operator works on the session's thread and checks for requests between its waits. It cannot delay the reading of the
sensors, which has a separate thread. The page is informed of each action after it is done.
"""

import contextlib
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol

from acquisition.errors import CalibrationError
from acquisition.live.calibration import StillPoint
from springmass.session.session import Session
from springmass.session.trigger import Trigger
from storage.errors import WriteFailed
from storage.recorder import Recorder

LOOK_S = 0.05
PREVIEW_NS = 600_000_000_000
"""Maximum duration of a preview log; then a new log replaces it, and the old one is deleted."""
STILL_S = 3.0


class Closed(Exception):
    """The page was closed before anything was recorded."""


class BenchPage(Protocol):
    """The page of a session, as far as an operator needs it."""

    @property
    def requests(self) -> SimpleQueue[dict[str, Any]]:
        """What viewers ask for."""

    @property
    def failed(self) -> bool:
        """Whether the page died, so that nobody can ask for anything any more."""

    def tell(self, phase: str, **facts: Any) -> None:
        """Tell viewers the phase of the recording."""


@dataclass(slots=True)
class Operator:
    """Carries out requests from the page until a run begins in ``log``, at a listening session."""

    session: Session
    page: BenchPage
    log: Path
    rest: StillPoint | None = None
    _folder: Path | None = None
    _preview: Recorder | None = None
    _number: int = 0

    def begin(self) -> None:
        """Show the bench on the page before there is a run, by means of a preview log."""
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="springmass-"))
        before, self._number = self._preview, self._number + 1
        self._preview = self.session.preview(self._folder / f"{self.log.stem}-{self._number}.wire")
        _close(before)

    def end(self) -> None:
        """Delete the preview, since the run has begun or will not begin."""
        _close(self._preview)
        self._preview = None
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None

    def prepare(self) -> Trigger | None:
        """Wait until recording is requested; return the trigger to wait for, or None to start immediately.

        Closed is raised if the page was closed or died.
        """
        self._tell("ready")
        since_ns = self.session.now_ns()
        while True:
            self.session.poll(LOOK_S)
            if self.page.failed:  # nobody can ask for a recording any more
                raise Closed
            if self.session.now_ns() - since_ns > PREVIEW_NS:
                self.begin()
                self._tell("ready")
                since_ns = self.session.now_ns()
            if self.page.requests.empty():
                continue
            request = self.page.requests.get()
            match request.get("type"):
                case "record":
                    return None
                case "arm":
                    return Trigger(float(request["threshold_m"]), float(request["keep_s"]))
                case "close":
                    raise Closed
                case "zero":
                    self._zero()

    def armed(self, trigger: Trigger) -> Callable[[], bool]:
        """Report that the trigger is armed, and return a function that tells whether to stop waiting for it."""
        self._tell("armed", threshold_m=trigger.threshold_m, keep_s=trigger.keep_s)

        def changed() -> bool:
            while not self.page.requests.empty():
                request = self.page.requests.get()
                match request.get("type"):
                    case "close":
                        raise Closed
                    case "arm" | "record":
                        self.page.requests.put(request)  # `prepare` carries it out after the wait has ended
                        return True
                    case "disarm":
                        return True
            return False

        return changed

    def recording(self, log: Path) -> None:
        """Report that the run has begun, and delete the preview."""
        self._tell("recording", log=str(log))
        self.end()

    def _zero(self) -> None:
        self._tell("still", seconds=STILL_S)
        try:
            self.rest = self.session.still(STILL_S)
        except CalibrationError as error:
            self._tell("ready", failed=str(error))
        else:
            self._tell("ready")

    def _tell(self, phase: str, **facts: Any) -> None:
        log = "" if self._preview is None else str(self._preview.path)
        fields: dict[str, Any] = {"log": log, "run": str(self.log.with_suffix(".h5"))}
        if self.rest is not None:
            fields |= {"rest_m": self.rest.rest_m, "noise_m": self.rest.noise_m}
        self.page.tell(phase, **(fields | facts))


def _close(recorder: Recorder | None) -> None:
    if recorder is not None:
        with contextlib.suppress(WriteFailed):  # the preview is not kept anyway
            recorder.close()
