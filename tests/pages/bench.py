"""What tests do on a page: wait for a state, press keys, answer questions, and be a client without a browser."""

import contextlib
import http.client
import json
import signal
import subprocess
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from playwright.sync_api import BrowserContext, Page
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

import springmass
from acquisition.block import Block
from storage.run_file.reading import open_run

LIMIT_S = 180.0
OLD_RUN = springmass.sample_data() / "damped_simulated_position.txt"
SEEN = "() => samples.length && samples[0].count > {count}"
MOVES = "() => motion && motion.estimates && motion.estimates.period"
FITTED = f"{MOVES} && motion.estimates.period.u"
PHASE = "() => bench().phase === '{phase}'"


def opened(context: BrowserContext, address: str, until: str) -> Page:
    """Open a page, and wait until something holds on it."""
    page = context.new_page()
    page.goto(address)
    page.wait_for_function(until)
    return page


def answer(page: Page, *texts: str) -> None:
    """Answer the page's question."""
    page.wait_for_selector("#ask[open]")
    for field, text in zip(page.locator("#ask input").all(), texts, strict=True):
        field.fill(text)
    page.keyboard.press("Enter")


def press(page: Page, key: str) -> None:
    """Press a key once its button is there."""
    page.wait_for_selector(f"#actions button[data-key='{key}']:not([hidden])")
    page.keyboard.press(key)


@dataclass
class Program:
    """A process of the program with a page."""

    process: subprocess.Popen[str]
    address: str
    messages: list[str]
    out: Path
    reader: threading.Thread

    def whole_run(self) -> Block:
        """Return the samples of the run file, of which none is missing."""
        with open_run(self.out) as run:
            samples = run.samples()
        assert np.isfinite(samples.distance).all()
        assert np.diff(samples.t).max() < 0.015
        return samples

    def ended(self) -> int:
        """Wait for its end and its last message; return the exit code."""
        code = self.process.wait(LIMIT_S)
        self.reader.join(LIMIT_S)
        return code

    def end(self) -> int:
        """End it as Ctrl-C does; return the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.ended()


class Client:
    """A program that has the cookie of a page."""

    def __init__(self, address: str) -> None:
        parts = urlsplit(address)
        self.netloc, self.place = parts.netloc, (str(parts.hostname), int(parts.port or 0))
        answered = self.get(f"/?{parts.query}", {})
        assert answered.status == 303
        self.cookie = str(answered.headers["Set-Cookie"]).split(";")[0]

    def get(self, path: str, headers: dict[str, str] | None = None) -> http.client.HTTPResponse:
        """Ask for something, with the cookie unless other headers are named."""
        connection = http.client.HTTPConnection(self.netloc, timeout=LIMIT_S)
        connection.request("GET", path, headers={"Cookie": self.cookie} if headers is None else headers)
        answered = connection.getresponse()
        answered.read()
        connection.close()
        return answered

    def socket(self, path: str = "/v2/run") -> ClientConnection:
        """Open a socket of the page."""
        origin: Any = f"http://{self.netloc}"
        return connect(
            f"ws://{self.netloc}{path}",
            origin=origin,
            additional_headers={"Cookie": self.cookie},
            ping_interval=None,
            max_queue=None,
            max_size=None,
        )

    def code_after(self, message: str | bytes) -> int | None:
        """Send a message; return the code with which the page closes the socket."""
        with self.socket() as run:
            run.send(message)
            with contextlib.suppress(ConnectionClosed):
                while True:
                    run.recv(timeout=LIMIT_S)
        return run.close_code


def fit_of(run: ClientConnection) -> dict[str, Any]:
    """Ask for the fit of a selection; return the answer."""
    run.send('{"type": "region", "from": 1, "to": 20}')
    while True:
        message = run.recv(timeout=LIMIT_S)
        if isinstance(message, str) and (found := json.loads(message))["type"] == "region":
            return dict(found)
