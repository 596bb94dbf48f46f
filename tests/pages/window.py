"""What tests of the window drop, and how they speak to its server without a browser."""

import http.client
import json
import os
import time
from collections.abc import Iterator, Mapping
from typing import Any
from urllib.parse import urlencode

import numpy as np

import springmass
from tests.conformance.test_formats import packed, workbook
from tests.pages.bench import LIMIT_S, Client

T = np.arange(900) / 30.0
X_M = 0.02 + 0.05 * np.exp(-0.01 * T) * np.cos(8.0 * T) + np.random.default_rng(3).normal(0.0, 2e-4, T.size)
MASS_G = 217.6
SETTLED_S = 600.0 if os.environ.get("SPRINGMASS_EXAMPLES") == "nightly" else 60.0


def excel() -> bytes:
    """Return an Excel file whose cells are texts with decimal commas, and whose positions have no unit."""
    rows = [
        ("t (s)", "Auslenkung"),
        *((f"{t:.4f}".replace(".", ","), f"{100 * x:.4f}".replace(".", ",")) for t, x in zip(T, X_M, strict=True)),
    ]
    cells = "".join(
        "<row>" + "".join(f'<c t="inlineStr"><is><t>{cell}</t></is></c>' for cell in row) + "</row>" for row in rows
    )
    return workbook({"Lauf": cells})


def tracker() -> str:
    """Return a table as Tracker copies it, in metres, with two coordinates."""
    rows = "".join(f"{t:.6E}\t{0.3 + 0.001 * x:.6E}\t{x:.6E}\n" for t, x in zip(T, X_M, strict=True))
    return f"mass_A\n\t\t\nt\tx\ty\n{rows}"


def phyphox() -> bytes:
    """Return the archive that phyphox exports of an acceleration."""
    a = -64.0 * (X_M - 0.02)
    rows = "".join(f"{t:.9E},{0.01 * x:.9E},{x:.9E},{9.8 + 0.01 * x:.9E}\n" for t, x in zip(T, a, strict=True))
    names = ",".join(f'"Linear Acceleration {axis} (m/s^2)"' for axis in "xyz")
    return packed(
        {"Raw Data.csv": f'"Time (s)",{names}\n{rows}', "meta/device.csv": '"property","value"\n"deviceModel","A"\n'}
    )


def pair() -> dict[str, bytes]:
    """Return the files of MotionSensor.vi: positions and velocities."""
    data = springmass.sample_data()
    return {
        name: (data / name).read_bytes()
        for name in (f"damped_simulated_{each}.txt" for each in ("position", "velocity"))
    }


class WindowClient(Client):
    """A program that has the cookie of a window."""

    def post(self, path: str, body: bytes | Iterator[bytes], **headers: str | None) -> tuple[int, dict[str, Any] | str]:
        """Send something with cookie, origin and header, unless others are named; None leaves one out."""
        own = {"Cookie": self.cookie, "Origin": f"http://{self.netloc}", "X-Springmass": "window"}
        sent = {
            name: text for name, text in (own | {k.replace("_", "-"): v for k, v in headers.items()}).items() if text
        }
        connection = http.client.HTTPConnection(self.netloc, timeout=LIMIT_S)
        connection.request("POST", path, body=body, headers=sent)
        answered = connection.getresponse()
        text = answered.read().decode()
        connection.close()
        kind = answered.headers.get_content_type()
        return answered.status, json.loads(text) if kind == "application/json" else text

    def do(self, what: str, **more: Any) -> tuple[int, Any]:
        """Ask the window to do something."""
        return self.post("/window/do", json.dumps({"do": what, **more}).encode())

    def drop(self, files: Mapping[str, bytes | str], drop: str = "d") -> tuple[int, Any]:
        """Drop files together."""
        for name, content in files.items():
            where = urlencode({"drop": drop, "folder": "", "name": name})
            status = self.post(f"/window/files?{where}", content.encode() if isinstance(content, str) else content)
            if status[0] != 200:
                return status
        return self.do("open", drop=drop)

    def cards(self, settled: bool = True) -> list[dict[str, Any]]:
        """Return all cards as a page sees them, once none of them waits any more."""
        until = time.monotonic() + SETTLED_S
        with self.socket("/window/events") as events:
            order, cards = None, dict[str, dict[str, Any]]()
            while time.monotonic() < until:
                message = json.loads(events.recv(timeout=SETTLED_S))
                if message["type"] == "cards":
                    order, self.earlier = message["order"], message["earlier"]
                elif message["type"] == "card":
                    cards[message["id"]] = message
                found = [cards[each] for each in order or () if each in cards]
                done = all(card["stage"] in ("done", "question", "failed") for card in found)
                if order is not None and len(found) == len(order) and (done or not settled):
                    return found
        raise TimeoutError
