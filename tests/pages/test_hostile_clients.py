"""Clients that break off, send what is none of the page's, or hold connections: few lines, and the page goes on."""

from __future__ import annotations

import contextlib
import http.client
import json
import resource
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

import springmass
from springmass.page.feeds import view_of
from springmass.page.state import PageState
from springmass.page.web import bounds
from springmass.page.web.server import Opening, serve
from springmass.runs.loading import load
from storage.run_file.reading import open_run
from tests.pages.conftest import LIMIT_S

TRIES = 100
MESSAGES = {
    "binary": b"\x00\x01",
    "no JSON": "stop",
    "a list": "[]",
    "no command": '{"type": "rm"}',
    "deeply nested": "[" * 4000,
    "a deep type": '{"type": ' + "[" * 900 + "]" * 900 + "}",
    "4,000 digits": '{"type": "region", "from": ' + "9" * 4000 + ', "to": 1}',
    "not finite": '{"type": "region", "from": NaN, "to": Infinity}',
    "no text": '{"type": null}',
}


def recording() -> str:
    """Return the path of a bundled recording."""
    return str(springmass.sample_data() / "damped_simulated_position.txt")


class Client:
    """A browser's cookie, and what it can do with it."""

    def __init__(self, address: str) -> None:
        parts = urlsplit(address)
        self.netloc, self.place = parts.netloc, (str(parts.hostname), int(parts.port or 0))
        answered = self.get(f"/?{parts.query}", {})
        self.cookie = str(answered.headers["Set-Cookie"]).split(";")[0]

    def get(self, path: str, headers: dict[str, str] | None = None) -> http.client.HTTPResponse:
        """Ask for something, with the cookie unless other headers are named."""
        connection = http.client.HTTPConnection(self.netloc, timeout=LIMIT_S)
        connection.request("GET", path, headers={"Cookie": self.cookie} if headers is None else headers)
        answered = connection.getresponse()
        answered.read()
        connection.close()
        return answered

    def socket(self) -> ClientConnection:
        """Open the page's socket."""
        headers = {"Cookie": self.cookie}
        origin: Any = f"http://{self.netloc}"
        return connect(
            f"ws://{self.netloc}/v1/run", origin=origin, additional_headers=headers, ping_interval=None, max_queue=None
        )

    def code_after(self, message: str | bytes) -> int | None:
        """Send a message; return the code with which the page closes the socket."""
        with self.socket() as run:
            run.send(message)
            with contextlib.suppress(ConnectionClosed):
                while True:
                    run.recv(timeout=LIMIT_S)
        return run.close_code


@pytest.fixture
def page(start: Callable[..., Any]) -> tuple[Any, Client]:
    """Return the process of an old run's page, and a client."""
    program = start("page", recording())
    return program, Client(program.address)


def lines_after(program: Any) -> list[str]:
    """End a page; return what it wrote besides its address and its end."""
    program.end()
    usual = ("page: http", "viewers in this network", "the page is closed")
    return [line for line in program.messages if not line.startswith(usual)]


@pytest.mark.trials
def test_a_browser_that_leaves_is_no_event(record: Callable[..., Any]) -> None:
    """Closed properly, broken off, or gone while it is sent or analysed what it asked for: not one line."""
    program = record()
    client = Client(program.address)
    for number in range(60):
        with client.socket() as run:
            for _ in range(number % 4):
                run.recv(timeout=LIMIT_S)
            if number % 2:
                run.send('{"type": "region", "from": 0, "to": 1}')
            if number % 3 == 0:
                run.socket.shutdown(socket.SHUT_RDWR)
            elif number % 3 == 1:
                run.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # RST at the close
                run.socket.close()
    assert client.get("/").status == 200
    program.end()
    wrong = ("springmass: ", "Traceback", "Exception", "Error", "future:", "task:", "  File")
    assert [line for line in program.messages if line.startswith(wrong)] == []


@pytest.mark.parametrize("message", MESSAGES.values(), ids=MESSAGES)
def test_a_message_that_is_none_closes_the_socket(page: tuple[Any, Client], message: str | bytes) -> None:
    """Its code is 1003, a hundred of them are one line, and whoever looks goes on seeing."""
    program, client = page
    with client.socket() as looking:
        assert {client.code_after(message) for _ in range(TRIES)} == {1003}
        looking.send('{"type": "region", "from": 1, "to": 20}')
        while not (isinstance(answer := looking.recv(timeout=LIMIT_S), str) and json.loads(answer)["type"] == "region"):
            pass
    lines = lines_after(program)
    assert 1 <= len(lines) <= 2  # once a minute
    assert all(len(line) < 300 and "1003" in line for line in lines)


def test_what_the_gate_does_not_understand_is_refused(page: tuple[Any, Client]) -> None:
    """An origin or a host that is no address, a path with a null, a long message, words that are no HTTP."""
    program, client = page
    for name, status in (("Origin", 403), ("Host", 400)):
        assert client.get("/", {"Cookie": client.cookie, name: "http://[::1"}).status == status
    assert client.get("/static/%00").status == 404
    assert client.code_after("x" * 5000) == 1009
    with socket.create_connection(client.place, LIMIT_S) as raw:
        raw.sendall(b"\x00\xff" * 100 + b"\r\n\r\n")
        assert raw.recv(1000).startswith(b"HTTP/1.1 400")
    assert client.get("/").status == 200
    assert len(lines_after(program)) <= 1


def test_idle_connections_are_bounded(page: tuple[Any, Client]) -> None:
    """Of 1,500 under a limit of 1,024 files most are closed; who was there stays, and few lines are written."""
    program, client = page
    resource.prlimit(program.process.pid, resource.RLIMIT_NOFILE, (1024, 1024))
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, before[1]), before[1]))
    try:
        with contextlib.ExitStack() as stack:
            looking = stack.enter_context(client.socket())
            held = [stack.enter_context(socket.create_connection(client.place, LIMIT_S)) for _ in range(1500)]
            closed = sum(_is_closed(each) for each in held[bounds.MOST_CONNECTIONS :])
            looking.send('{"type": "region", "from": 1, "to": 20}')
            while not (
                isinstance(answer := looking.recv(timeout=LIMIT_S), str) and json.loads(answer)["type"] == "region"
            ):
                pass
        assert closed == 1500 - bounds.MOST_CONNECTIONS
        assert client.get("/").status == 200
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    assert len(lines_after(program)) <= 3


def _is_closed(connection: socket.socket) -> bool:
    """Return whether the other side has closed a connection, or does so within the limit."""
    try:
        return connection.recv(1) == b""
    except ConnectionError:
        return True


@pytest.fixture
def served() -> Iterator[Callable[[PageState], Client]]:
    """Return a function that serves a page from a thread, and makes a client."""
    over = threading.Event()
    threads = []

    def serving(page_state: PageState) -> Client:
        opened = threading.Event()
        addresses: list[str] = []

        def ready(_port: int, address: str | None, _network: str) -> None:
            addresses.append(str(address))
            opened.set()

        thread = threading.Thread(target=serve, args=(page_state, Opening(opened=ready)), kwargs={"until": over.is_set})
        thread.start()
        threads.append(thread)
        assert opened.wait(LIMIT_S)
        return Client(addresses[0])

    yield serving
    over.set()
    for thread in threads:
        thread.join(LIMIT_S)
        assert not thread.is_alive()


def old_run(page_state: PageState) -> PageState:
    """Show an old run."""
    loaded = load(recording())
    page_state.show(view_of(loaded), loaded.scene)
    return page_state


@pytest.mark.parametrize(
    "parts",
    [
        [],
        [b"GET / HT"],
        [b"GET / HTTP/1.1\r\n", b"Host: 127.0.0.1\r\n"],
        [b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100\r\n\r\n", b"half"],
        [b"GET /v1/run HTTP/1.1\r\nUpgrade: websocket\r\n"],
    ],
    ids=["nothing", "half a line", "half a head", "half a body", "half a handshake"],
)
def test_a_half_sent_request_is_closed(
    served: Callable[[PageState], Client], monkeypatch: pytest.MonkeyPatch, parts: list[bytes]
) -> None:
    """A request that never ends holds its connection no longer than the limit; a socket that only looks stays."""
    page_state = old_run(PageState(None))
    client = served(page_state)
    with client.socket() as looking:
        # From here on, because a busy computer may need longer for the requests that are whole.
        monkeypatch.setattr(bounds, "REQUEST_WITHIN_S", 0.3)
        with (
            socket.create_connection(client.place, LIMIT_S) as half,
            contextlib.suppress(ConnectionError),  # closed before the last part was sent
        ):
            for part in parts:
                half.sendall(part)
            while half.recv(1000):
                pass  # the answer to the head of a request, if there is one; then the end
        looking.send('{"type": "region", "from": 1, "to": 20}')
        while not (isinstance(answer := looking.recv(timeout=LIMIT_S), str) and json.loads(answer)["type"] == "region"):
            pass
    page_state.close()


def test_a_second_half_request_is_closed_too(
    served: Callable[[PageState], Client], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a whole request on the same connection, the time for the next one runs from its first byte."""
    page_state = old_run(PageState(None))
    client = served(page_state)
    connection = http.client.HTTPConnection(client.netloc, timeout=LIMIT_S)
    connection.request("GET", "/static/page.css", headers={"Cookie": client.cookie})
    answered = connection.getresponse()
    assert (answered.status, len(answered.read()) > 0) == (200, True)
    monkeypatch.setattr(bounds, "REQUEST_WITHIN_S", 0.3)
    connection.sock.sendall(b"GET / HTTP/1.1\r\nHost:")
    assert connection.sock.recv(1000) == b""
    connection.close()
    page_state.close()


def test_a_defect_of_the_page_is_a_line_and_the_page_goes_on(
    served: Callable[[PageState], Client], caplog: pytest.LogCaptureFixture
) -> None:
    """What goes wrong while it is brought up to date is logged, and the next turn is as if nothing had been."""

    class Failing(PageState):
        turns = 0

        def poll(self) -> None:
            self.turns += 1
            if self.turns % 2:
                raise RuntimeError("a defect")
            super().poll()

    page_state = old_run(Failing(None))
    client = served(page_state)
    with client.socket() as run:
        kinds = {json.loads(m)["type"] for m in (run.recv(timeout=LIMIT_S) for _ in range(4)) if isinstance(m, str)}
    assert {"hello", "state"} <= kinds
    assert any(record.exc_info for record in caplog.records)
    page_state.close()


def _answers(client: Client) -> bool:
    """Return whether a client gets the page, or its connection is closed as one too many."""
    try:
        return client.get("/").status == 200
    except (ConnectionError, http.client.HTTPException):
        return False


@pytest.mark.trials
def test_no_client_disturbs_a_recording(record: Callable[..., Any]) -> None:
    """All of it during a recording that is open to viewers: every reading is there, and the terminal stays readable."""
    program = record("--lan")
    controller = Client(program.address)
    with controller.socket() as run:
        viewer = Client(json.loads(run.recv())["share"])
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(socket.create_connection(controller.place, LIMIT_S)) for _ in range(400)]
        assert all(_is_closed(connection) for connection in held[bounds.MOST_CONNECTIONS :])
    until = time.monotonic() + LIMIT_S
    while not _answers(controller):  # the page learns in its next turn that they are gone
        assert time.monotonic() < until, "the page does not answer any more"
    for message in MESSAGES.values():
        for client in (controller, viewer):
            assert client.code_after(message) == 1003
    assert {viewer.code_after('{"type": "stop"}') for _ in range(TRIES)} == {1003}
    program.process.send_signal(signal.SIGINT)
    assert program.ended() == 130
    with open_run(program.out) as run:
        samples = run.samples()
        (ended,) = [event["facts"] for event in run.provenance["events"] if event["kind"] == "ended"]
    assert len(samples) > 100
    assert np.diff(samples.t).max() < 0.015
    assert np.isfinite(samples.distance).all()
    assert "Traceback" not in "".join(program.messages)
    assert len([line for line in program.messages if line.startswith("springmass: page:")]) < 20
    assert ended["by"] != "the page"
