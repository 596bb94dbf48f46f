"""``springmass page``: a recording, as it happens or as it was, seen in a browser."""

from __future__ import annotations

import argparse
import json
import sys
import threading
import webbrowser
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from springmass.commands import load_for
from springmass.errors import OK, USAGE, ProgramError, tell
from springmass.page.desk import Desk
from springmass.page.feeds import view_of
from springmass.page.web.log_lines import log_to_stderr
from springmass.page.web.server import Opening, serve
from springmass.page.web.sharing import address_in_network, code_for_terminal
from springmass.runs.loading import kind_of

__all__ = ["run"]


def run(options: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C, or for a recording until its recorder has ended and nobody looks any more."""
    path = Path(options.input)
    wanted_u_s = None if options.want_us is None else options.want_us * 1e-6
    over = threading.Event()
    opening = Opening(options.page_port, network=address_in_network() if options.lan else "")
    if getattr(options, "recorder", False):
        desk = Desk(wanted_u_s, _say, name=path.with_suffix(".h5").name)
        opening = _from_recorder(opening, desk, over)
    else:
        desk = Desk(wanted_u_s)
        _look_at(desk, path, options)
    opening.opened = _ready(options, opening)
    try:
        with log_to_stderr():
            serve(desk, opening, until=over.is_set)
    except KeyboardInterrupt:
        tell("the page is closed")
    except OSError as error:
        reason = error.strerror or str(error)
        raise ProgramError(f"--page-port {opening.port}: {reason}; name another, or 0 for any", USAGE) from error
    finally:
        desk.close()
    return OK


def _look_at(desk: Desk, path: Path, options: argparse.Namespace) -> None:
    if kind_of(path) == "wire":
        desk.follow(path)
    else:
        loaded = load_for(options, path)
        desk.show(view_of(loaded), loaded.scene, loaded.path)


def _ready(options: argparse.Namespace, opening: Opening) -> Callable[[int, str | None, str], None]:
    def ready(port: int, address: str | None, network: str) -> None:
        """Say where the page is; to the recorder, too, so that one that is started again is found at the same place."""
        if opening.secret:
            _say({"type": "open", "port": port})
        if address is None:
            return  # started again: its browsers know the way
        tell(f"page: {address}")
        if network:
            tell(f"viewers in this network: {network}")
            if sys.stderr.isatty():
                print(code_for_terminal(network), file=sys.stderr)
        if not options.no_browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    return ready


def _from_recorder(opening: Opening, desk: Desk, over: threading.Event) -> Opening:
    """Take the recorder's words from stdin, the gate's first; the end of stdin is the recorder's end."""
    first = json.loads(sys.stdin.readline() or "{}").get("gate", {})
    opening.port = first.get("port") or opening.port
    opening.secret, opening.used = str(first.get("secret", "")), bool(first.get("used"))
    opening.was_used = lambda: _say({"type": "used"})

    def listen() -> None:
        for line in sys.stdin:
            desk.told(json.loads(line))
        over.set()

    threading.Thread(target=listen, name="springmass-page-recorder", daemon=True).start()
    return opening


def _say(asked: Mapping[str, Any]) -> None:
    """Speak to the recorder, a JSON line each."""
    print(json.dumps(asked), file=sys.stdout, flush=True)
