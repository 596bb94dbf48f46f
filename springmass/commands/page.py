"""``springmass page``: a recording, as it happens or as it was, seen in a browser."""

from __future__ import annotations

import json
import sys
import threading
import webbrowser
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

from springmass.commands.options import PART, PageOptions, Recording, flag, refuse
from springmass.errors import OK, USAGE, ProgramError, manner, tell
from springmass.page.feeds import view_of
from springmass.page.state import PageState
from springmass.page.web.log_lines import log_to_stderr
from springmass.page.web.server import Opening, serve
from springmass.page.web.sharing import address_in_network, code_for_terminal
from springmass.runs.loading import kind_of, load
from springmass.runs.options import ReadOptions
from springmass.stops import STOPS


def page(
    recording: Recording,
    /,
    *,
    page: PageOptions = PageOptions(),
    read: ReadOptions = ReadOptions(),
    recorder: Annotated[bool, flag("used internally by `record --page`")] = False,
) -> int:
    """Serve the page until Ctrl-C; for a recording, until the recorder has ended and no browser shows the page."""
    refuse("page", read, *PART)
    path = Path(recording)
    wanted_u_s = None if page.want_us is None else page.want_us * 1e-6
    over = threading.Event()
    opening = Opening(page.page_port, network=address_in_network() if page.lan else "")
    if recorder:
        page_state = PageState(wanted_u_s, _say, name=path.with_suffix(".h5").name, law=page.law)
        opening = _from_recorder(opening, page_state, over)
    else:
        page_state = PageState(wanted_u_s, law=page.law)
        _look_at(page_state, path, read)
    opening.opened = _ready(page, opening)
    try:
        STOPS.end()  # the server handles signals itself
        with log_to_stderr():
            serve(page_state, opening, until=over.is_set)
    except KeyboardInterrupt:
        tell("the page is closed")
    except OSError as error:
        reason = error.strerror or str(error)
        raise ProgramError(f"--page-port {opening.port}: {reason}; name another, or 0 for any", USAGE) from error
    finally:
        page_state.close()
    return OK


def _look_at(page_state: PageState, path: Path, read: ReadOptions) -> None:
    if kind_of(path) == "wire":
        page_state.follow(path)
    else:
        loaded = load(path, read)
        page_state.show(view_of(loaded), loaded.scene, loaded.path)


def _ready(options: PageOptions, opening: Opening) -> Callable[[int, str | None, str], None]:
    def ready(port: int, address: str | None, network: str) -> None:
        """Say where the page is; to the recorder, too, so that one that is started again is found at the same place."""
        if opening.secret:
            _say({"type": "open", "port": port})
        if address is None:
            return  # a restarted page: its browsers know the address
        # For the page of a recording, the recorder prints these lines, because its progress would overwrite them here.
        say = _say_line if opening.secret else tell
        say(f"page: {address}")
        if network:
            say(f"viewers in this network: {network}")
            if sys.stderr.isatty():
                for line in code_for_terminal(network).splitlines():
                    say(line)
        if not options.no_browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    return ready


def _from_recorder(opening: Opening, page_state: PageState, over: threading.Event) -> Opening:
    """Read the recorder's messages from stdin, that of the gate first; the recorder has ended when stdin ends."""
    first = json.loads(sys.stdin.readline() or "{}").get("gate", {})
    opening.port = first.get("port") or opening.port
    opening.secret, opening.used = str(first.get("secret", "")), bool(first.get("used"))
    opening.was_used = lambda: _say({"type": "used"})

    def listen() -> None:
        for line in sys.stdin:
            page_state.put_recorder_state(json.loads(line))
        over.set()

    threading.Thread(target=listen, name="springmass-page-recorder", daemon=True).start()
    return opening


def _say_line(text: str) -> None:
    if not manner()[0]:
        _say({"type": "line", "text": text})


def _say(message: Mapping[str, Any]) -> None:
    """Send messages to the recorder, one JSON line each."""
    print(json.dumps(message), file=sys.stdout, flush=True)
