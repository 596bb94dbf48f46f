"""``springmass page``: a recording, as it happens or as it was, seen in a browser."""

from __future__ import annotations

import argparse
import json
import os
import sys
import threading
import webbrowser
from pathlib import Path

from acquisition.clock import SystemClock
from springmass.commands import completions
from springmass.errors import OK, USAGE, ProgramError, tell
from springmass.page.feeds import LogFeed, view_of
from springmass.page.server import Controls, serve
from springmass.page.watching import Watcher
from springmass.runs.loading import kind_of, load

__all__ = ["run"]

WAIT_S = 0.05


def run(options: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C, or for a recording until its recorder has ended."""
    path = Path(options.input)
    recorder = getattr(options, "recorder", False)
    over = threading.Event()
    controls = _to_recorder(over) if recorder else None
    while recorder and not path.exists():  # the recording has not begun
        if over.wait(WAIT_S):
            return OK
    if kind_of(path) == "wire":
        feed = LogFeed(path)
        view, scene, poll = feed.view, feed.scene, feed.poll
    else:
        loaded = load(path, **completions(options))
        view, scene, poll = view_of(loaded), loaded.scene, lambda: None
    watcher = Watcher(view, scene, SystemClock(), options.want_us * 1e-6)

    def ready(address: str) -> None:
        tell(f"page: {address}")
        if not options.no_browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    try:
        serve(view, watcher, poll, controls, port=options.page_port, ready=ready, until=over.is_set)
    except KeyboardInterrupt:
        tell("the page is closed")
    except OSError as error:
        reason = error.strerror or str(error)
        raise ProgramError(f"--page-port {options.page_port}: {reason}; name another, or 0 for any", USAGE) from error
    finally:
        watcher.close()
    return OK


def _to_recorder(over: threading.Event) -> Controls:
    """Return controls that speak to the recorder on stdout, a JSON line each; its end is the end of our stdin."""

    def wait() -> None:
        while os.read(0, 1024):
            pass
        over.set()

    threading.Thread(target=wait, name="springmass-page-recorder", daemon=True).start()

    def say(kind: str, text: str) -> None:
        print(json.dumps({"type": kind, "text": text}), file=sys.stdout, flush=True)

    return say
