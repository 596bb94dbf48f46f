"""Carry out requests from the page before a run: zero, ruler, trigger, record.

The operator works on the session's thread and checks for requests between its waits. It cannot delay the reading of the
sensors, which has a separate thread. The page is informed of each action after it is done.
"""

from __future__ import annotations

import contextlib
import queue
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from acquisition.errors import CalibrationError
from acquisition.live.calibration import Calibration, StillPoint, against_ruler
from springmass.session.session import Session, Trigger
from storage.errors import WriteFailed
from storage.recorder import Recorder

__all__ = ["Closed", "Operator", "Page"]

LOOK_S = 0.05
PREVIEW_NS = 600_000_000_000
"""Maximum duration of a preview log; then a new log replaces it, and the old one is deleted."""
STILL_S = 3.0
U_RULER_M = 0.5e-3
SAME_M = 0.002
"""Ruler distances closer together than this count as the same distance measured again."""
LONGEST_KEEP_S = 60.0


class Page(Protocol):
    """The part of the page that the operator uses."""

    requests: queue.SimpleQueue[dict[str, Any]]

    def tell(self, phase: str, **facts: Any) -> None:
        """Report the state of the recording."""


class Closed(Exception):
    """The page was closed before anything was recorded."""


@dataclass(slots=True)
class Operator:
    """Carries out requests from the page until a run begins.

    Parameters
    ----------
    session : Session
        A listening session.
    page : Page
    log : Path
        Path of the log of the coming run.
    rest : StillPoint or None
        Rest position measured earlier.
    """

    session: Session
    page: Page
    log: Path
    rest: StillPoint | None = None
    _folder: Path | None = None
    _preview: Recorder | None = None
    _number: int = 0
    _points: list[StillPoint] = field(default_factory=list)
    _known_m: list[float] = field(default_factory=list)
    _base: Calibration | None = None
    _postponed: Mapping[str, Any] | None = None

    def begin(self) -> None:
        """Show the bench on the page before there is a run, by means of a preview log."""
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="springmass-"))
        before, self._number = self._preview, self._number + 1
        self._preview = self.session.preview(self._folder / f"{self.log.stem}-{self._number}.wire")
        self._drop(before)

    def end(self) -> None:
        """Delete the preview, since the run has begun or will not begin."""
        self._drop(self._preview)
        self._preview = None
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None

    def prepare(self) -> Trigger | None:
        """Wait until recording is requested; return the trigger to wait for, or None to start immediately.

        Raises
        ------
        Closed
            If the page was closed.
        """
        self._tell("ready")
        since_ns = self.session.now_ns()
        while True:
            self.session.poll(LOOK_S)
            if self.session.now_ns() - since_ns > PREVIEW_NS:
                self.begin()
                self._tell("ready")
                since_ns = self.session.now_ns()
            if self._postponed is not None:
                request, self._postponed = self._postponed, None
            elif not self.page.requests.empty():
                request = self.page.requests.get()
            else:
                continue
            kind = request.get("type")
            if kind == "record":
                return None
            if kind == "arm":
                return Trigger(float(request["threshold_m"]), min(float(request["keep_s"]), LONGEST_KEEP_S))
            if kind == "close":
                raise Closed
            if kind in ("zero", "ruler"):
                self._measure(request)

    def armed(self, trigger: Trigger) -> Callable[[], bool]:
        """Report that the trigger is armed, and return a function that tells whether to stop waiting for it."""
        self._tell("armed", threshold_m=trigger.threshold_m, keep_s=trigger.keep_s)

        def changed() -> bool:
            while not self.page.requests.empty():
                request = self.page.requests.get()
                kind = request.get("type")
                if kind == "close":
                    raise Closed
                if kind in ("arm", "record"):
                    self._postponed = request  # carried out by `prepare` after the wait for the trigger has ended
                if kind in ("disarm", "arm", "record"):
                    return True
            return False

        return changed

    def recording(self, log: Path) -> None:
        """Report that the run has begun, and delete the preview."""
        self._tell("recording", log=str(log))
        self.end()

    def _measure(self, request: Mapping[str, Any]) -> None:
        self._tell("still", seconds=STILL_S)
        try:
            point = self.session.still(STILL_S)
            if request["type"] == "ruler":
                point = self._against(point, float(request["known_m"]))
                self.begin()  # the preview starts anew with the new calibration
            self.rest = point
        except CalibrationError as error:
            self._tell("ready", failed=str(error))
        else:
            self._tell("ready")

    def _against(self, point: StillPoint, known_m: float) -> StillPoint:
        """Calibrate with all ruler distances so far, each converted back to the calibration before the first one."""
        now = self.session.sensors[0].calibration
        base = self._base or now
        measured = base.restated(point, now)
        kept = [(p, k) for p, k in zip(self._points, self._known_m, strict=True) if abs(k - known_m) >= SAME_M]
        if same := [k for p, k in kept if abs(p.rest_m - measured.rest_m) < SAME_M]:
            raise CalibrationError(
                f"the target at {known_m:g} m by the ruler is where {same[0]:g} m was given before; "
                "move the target, or give one distance"
            )
        points, known = (tuple(each) for each in zip(*kept, (measured, known_m), strict=True))
        calibration = against_ruler(points, known, U_RULER_M, base)
        self.session.calibrated(calibration)
        self._base, self._points, self._known_m = base, list(points), list(known)
        return calibration.restated(measured, base)

    def _tell(self, phase: str, **facts: Any) -> None:
        log = "" if self._preview is None else str(self._preview.path)
        fields: dict[str, Any] = {"log": log, "run": str(self.log.with_suffix(".h5"))}
        if self.rest is not None:
            fields |= {"rest_m": self.rest.rest_m, "noise_m": self.rest.noise_m}
        if self._known_m:
            fields |= {"ruler_m": self._known_m}
        self.page.tell(phase, **(fields | facts))

    @staticmethod
    def _drop(recorder: Recorder | None) -> None:
        if recorder is not None:
            with contextlib.suppress(WriteFailed):  # the preview is not kept anyway
                recorder.close()
