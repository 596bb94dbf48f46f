"""``springmass page``: the window, to which recordings are dropped; or one recording, as it happens or as it was."""

import contextlib
import json
import logging
import os
import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from springmass.commands.given import Given, GivenOptions
from springmass.commands.options import FileArgument, PageOptions, ReadPairs
from springmass.commands.parameters import argument, flag
from springmass.commands.questions import option_words
from springmass.errors import LOG, OK, UNREADABLE, ProgramError
from springmass.loading.inputs import kind_of
from springmass.loading.load import load
from springmass.page.feeds import view_of
from springmass.page.recorder_side import OF_RECORDER
from springmass.page.state import PageState
from springmass.page.web.server import address_in_network, code_for_terminal, serve
from springmass.stops import STOPS


def page(
    *recordings: Annotated[
        FileArgument, argument("INPUT", "recordings or folders to open in the window; or a wire log")
    ],
    play: Annotated[bool, flag("play one recording back, with cursors and selections, instead of the window")] = False,
    shortcut: Annotated[bool, flag("make an icon that opens the window, and say where it is")] = False,
    page: PageOptions = PageOptions(),
    reading: ReadPairs = ReadPairs(),
    given: GivenOptions,
) -> int:
    """Open the window, with recordings; or show one: a growing wire log, with --play, or to others with --lan."""
    recorder = os.environ.pop(OF_RECORDER, None) is not None
    shown = recorder or play or page.lan or any(kind_of(each) == "wire" for each in recordings)
    if shortcut:
        given.only("with an icon, which opens the window", "--shortcut")
        if recordings:
            raise ProgramError("--shortcut makes an icon for the window without a recording", "leave the recording out")
        from springmass.page.window.shortcut import make_shortcut

        print(make_shortcut())
        return OK
    if not shown:
        return _window(recordings, page, reading, given)
    if len(recordings) != 1:
        raise ProgramError(f"one recording is shown, got {len(recordings)}", "name one, or leave --play and --lan out")
    return _one(Path(recordings[0]), recorder, page, reading, given)


def _window(recordings: Sequence[FileArgument], page: PageOptions, reading: ReadPairs, given: Given) -> int:
    """Serve the window until nobody looks at it."""
    from springmass.page.web.window import serve_window
    from springmass.page.window.cards import Cards

    given.refuse("in the window, only with --play", "--want-us")
    if absent := [each for each in recordings if not Path(each).exists()]:
        raise ProgramError(f"{absent[0]}: expected a recording, got none", "check the name", UNREADABLE)
    stated = {"answers": {name: str(x) for name, x in reading.options.given().items()}, "law": page.law}
    if recordings == () and (page.law or stated["answers"]):
        raise ProgramError("--law and --read are about a recording", "name it")
    cards = Cards()
    with _served(page.page_port):
        serve_window(
            cards, lambda: cards.open_paths(recordings, stated), port=page.page_port, opened=_opener(page, LOG.info)
        )
    return OK


def _one(path: Path, recorder: bool, page: PageOptions, reading: ReadPairs, given: Given) -> int:
    """Serve the page until Ctrl-C; for a recording, until the recorder has ended and no browser shows the page."""
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
    line: Callable[[str], None] = LOG.info
    if recorder:
        line = _of_recorder
        threading.Thread(target=_listen, args=(state, over), name="springmass-page-recorder", daemon=True).start()
    elif kind_of(path) == "wire":
        given.refuse("on a wire log, which is shown as it grows", "--read")
        state.follow(path)
    else:
        loaded = load(path, reading.options)
        state.show(view_of(loaded), loaded.path, reading.options.given())

    try:
        with _served(page.page_port):
            serve(state, port=page.page_port, network=network, opened=_opener(page, line), over=over.is_set)
    finally:
        state.close()
    return OK


@contextlib.contextmanager
def _served(port: int) -> Iterator[None]:
    """Leave signals to a server, and word why it cannot begin."""
    try:
        STOPS.end()
        yield
    except KeyboardInterrupt:
        LOG.info("the page is closed")
    except OSError as error:
        reason = error.strerror or str(error)
        raise ProgramError(f"--page-port {port}: {reason}", "name another, or 0 for any") from error


def _opener(page: PageOptions, line: Callable[[str], None]) -> Callable[[str, str], None]:
    """Return what prints the address of a page, and that for viewers, and opens the browser."""

    def opened(address: str, share: str) -> None:
        lines = [f"page: {address}"]
        if share:
            lines.append(f"viewers in this network: {share}")
            lines += code_for_terminal(share).splitlines() if sys.stderr.isatty() else []
        for each in lines:
            line(each)
        if not page.no_browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    return opened


def _listen(state: PageState, over: threading.Event) -> None:
    """Pass on the recorder's messages from stdin; the recorder has ended when stdin ends."""
    for line in sys.stdin:
        state.recorder_states.put(json.loads(line))
    over.set()


def _of_recorder(text: str) -> None:
    """Let the recorder print a line, because its progress would overwrite it."""
    if LOG.isEnabledFor(logging.INFO):
        _to_recorder({"type": "line", "text": text})


def _to_recorder(message: Mapping[str, Any]) -> None:
    print(json.dumps(message), file=sys.stdout, flush=True)
