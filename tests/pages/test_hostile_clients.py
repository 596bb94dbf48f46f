"""Clients that break off, send what is none of the page's, or hold connections: few lines, and the page goes on."""

import contextlib
import http.client
import json
import socket
from collections.abc import Callable
from typing import Any

import pytest

from storage.run_file.reading import open_run
from tests.pages.bench import LIMIT_S, OLD_RUN, Client, fit_of

MESSAGES = {
    "binary": b"\x00\x01",
    "no JSON": "stop",
    "a list": "[]",
    "no command": '{"type": "rm"}',
    "deeply nested": "[" * 4000,
    "a deep type": '{"type": ' + "[" * 900 + "]" * 900 + "}",
    "4,000 digits": '{"type": "region", "from": ' + "9" * 4000 + ', "to": 1}',
    "not finite": '{"type": "region", "from": NaN, "to": Infinity}',
    "no type": '{"type": null}',
    "no text": '{"type": "mark"}',
    "a mark that is no string": '{"type": "mark", "text": {"a": 1}}',
}


def lines_after(program: Any) -> list[str]:
    """End a page; return what it wrote besides its address and its end."""
    program.end()
    usual = ("page: http", "viewers in this network", "the page is closed")
    return [line for line in program.messages if not line.startswith(usual)]


def test_what_means_nothing_is_refused_and_the_page_goes_on(start: Callable[..., Any]) -> None:
    """A message closes its socket with 1003, a request gets its status; a few short lines, and viewers go on seeing."""
    program = start("page", "--play", str(OLD_RUN))
    client = Client(program.address)
    with client.socket() as looking:
        for name, message in MESSAGES.items():
            assert {client.code_after(message) for _ in range(10)} == {1003}, name
        assert client.code_after("x" * 5000) == 1009
        for name, status in (("Origin", 403), ("Host", 400)):
            assert client.get("/", {"Cookie": client.cookie, name: "http://[::1"}).status == status
        assert client.get("/static/%00").status == 404
        with socket.create_connection(client.place, LIMIT_S) as raw:
            raw.sendall(b"\x00\xff" * 100 + b"\r\n\r\n")
            assert raw.recv(1000).startswith(b"HTTP/1.1 400")
        assert fit_of(looking)["estimates"]
    assert client.get("/").status == 200
    lines = lines_after(program)
    assert 1 <= len(lines) == len({line.partition(" sent ")[2] or line for line in lines}) <= 3
    assert all(len(line) < 300 for line in lines)
    assert "Traceback" not in "".join(lines)


@pytest.mark.trials
def test_no_client_disturbs_a_recording(record: Callable[..., Any]) -> None:
    """All of it during a recording that is open to viewers: every reading is there, and the terminal stays readable."""
    program = record("--lan")
    controller = Client(program.address)
    with controller.socket() as run:
        viewer = Client(json.loads(run.recv())["share"])
    with contextlib.ExitStack() as stack:
        for _ in range(400):
            stack.enter_context(socket.create_connection(controller.place, LIMIT_S))
    while not answers(controller):  # the page learns in its next turn that they are gone
        assert program.process.poll() is None
    for message in MESSAGES.values():
        assert [client.code_after(message) for client in (controller, viewer)] == [1003, 1003]
    assert {viewer.code_after('{"type": "stop"}') for _ in range(20)} == {1003}
    log = program.out.with_suffix(".wire")
    while log.stat().st_size < 20_000:
        assert viewer.code_after('{"type": "stop"}') == 1003
    assert program.end() == 130
    assert len(program.whole_run()) > 100
    with open_run(program.out) as run:
        (ended,) = [event["facts"] for event in run.provenance["events"] if event["kind"] == "ended"]
    assert "Traceback" not in "".join(program.messages)
    assert len([line for line in program.messages if line.startswith("springmass: page:")]) <= 2
    assert ended["by"] != "the page"


def answers(client: Client) -> bool:
    """Return whether a client gets the page, and is not closed as one too many."""
    try:
        return client.get("/").status == 200
    except (OSError, http.client.HTTPException):
        return False
