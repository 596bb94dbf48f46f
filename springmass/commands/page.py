"""``springmass page``: a recording, as it happens or as it was, seen in a browser."""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
import webbrowser
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from springmass.commands.given import GivenOptions
from springmass.commands.options import PageOptions, ReadPairs, RecordingArgument
from springmass.commands.questions import option_words
from springmass.errors import LOG, OK, ProgramError
from springmass.loading.inputs import kind_of
from springmass.loading.load import load
from springmass.page.feeds import view_of
from springmass.page.recorder_side import OF_RECORDER
from springmass.page.state import PageState
from springmass.page.web.server import address_in_network, code_for_terminal, serve
from springmass.stops import STOPS


def page(
    recording: RecordingArgument,
    /,
    *,
    page: PageOptions = PageOptions(),
    reading: ReadPairs = ReadPairs(),
    given: GivenOptions,
) -> int:
    """Serve the page until Ctrl-C; for a recording, until the recorder has ended and no browser shows the page."""
    path, recorder = Path(recording), os.environ.pop(OF_RECORDER, None) is not None
    over = threading.Event()
    network = address_in_network() if page.lan else ""
    wanted_u_s = None if page.want_us is None else page.want_us * 1e-6
    state = PageState(
        wanted_u_s,
        _to_recorder if recorder else None,
        words_of=option_words,
        name=path.with_suffix(".h5").name if recorder else "",
        law=page.law,
    )
    if recorder:
        threading.Thread(target=_listen, args=(state, over), name="springmass-page-recorder", daemon=True).start()
    elif kind_of(path) == "wire":
        given.refuse("on a wire log, which is shown as it grows", "--read")
        state.follow(path)
    else:
        loaded = load(path, reading.options)
        state.show(view_of(loaded), loaded.path, reading.options.given())

    def opened(address: str, share: str) -> None:
        lines = [f"page: {address}"]
        if share:
            lines.append(f"viewers in this network: {share}")
            lines += code_for_terminal(share).splitlines() if sys.stderr.isatty() else []
        for line in lines:
            # For the page of a recording, the recorder prints these lines, because its progress would overwrite them.
            if not recorder:
                LOG.info(line)
            elif LOG.isEnabledFor(logging.INFO):
                _to_recorder({"type": "line", "text": line})
        if not page.no_browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    try:
        STOPS.end()  # the server handles signals itself
        serve(state, port=page.page_port, network=network, opened=opened, over=over.is_set)
    except KeyboardInterrupt:
        LOG.info("the page is closed")
    except OSError as error:
        reason = error.strerror or str(error)
        raise ProgramError(f"--page-port {page.page_port}: {reason}", "name another, or 0 for any") from error
    finally:
        state.close()
    return OK


def _listen(state: PageState, over: threading.Event) -> None:
    """Pass on the recorder's messages from stdin; the recorder has ended when stdin ends."""
    for line in sys.stdin:
        state.recorder_states.put(json.loads(line))
    over.set()


def _to_recorder(message: Mapping[str, Any]) -> None:
    print(json.dumps(message), file=sys.stdout, flush=True)
