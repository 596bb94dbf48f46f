"""A network that is cut without a word: no more packets, no hang-up, as when somebody pulls a cable behind a switch."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from storage.run_file.reading import open_run

RUN_S, ANSWER_S = 16.0, 100.0
FEEDER = """
import binascii, socket, sys, time
listener = socket.create_server((sys.argv[1], int(sys.argv[2])))
print("ready", flush=True)
while True:
    connection, _ = listener.accept()
    start = time.monotonic()
    for number in range(1 << 30):
        time.sleep(max(0.0, start + number * 0.01 - time.monotonic()))
        body = b"R1,%d,%d,%.2f,2000,E" % (number, number * 10_000, 1000.0 + 0.25 * number)
        try:
            connection.sendall(b"$%s*%04X\\n" % (body, binascii.crc_hqx(body, 0xFFFF)))
        except OSError:
            break
"""


def ip(*arguments: str) -> None:
    """Set up the network."""
    subprocess.run(["ip", *arguments], check=True, capture_output=True)


@pytest.fixture
def far() -> Iterator[tuple[str, str, str]]:
    """Yield the name of another host, its address, and its network card: a namespace behind a virtual cable."""
    if shutil.which("ip") is None or os.geteuid() != 0:
        pytest.skip("network namespaces need root and iproute2")
    name = f"sm{os.getpid()}"
    ours, theirs = f"{name}a", f"{name}b"
    ip("netns", "add", name)
    try:
        ip("link", "add", ours, "type", "veth", "peer", "name", theirs, "netns", name)
        ip("addr", "add", "198.18.77.1/30", "dev", ours)
        ip("link", "set", ours, "up")
        ip("-n", name, "addr", "add", "198.18.77.2/30", "dev", theirs)
        ip("-n", name, "link", "set", theirs, "up")
        yield name, "198.18.77.2", theirs
    finally:
        subprocess.run(["ip", "link", "del", ours], check=False, capture_output=True)  # takes effect immediately
        ip("netns", "del", name)


@pytest.mark.trials
def test_a_cut_network_is_a_sensor_gone(bench: Any, tmp_path: Path, far: tuple[str, str, str]) -> None:
    """The run ends with its seconds, keeps what came before, says since when nothing came, and exits with 4."""
    host, address, card = far
    port = 40_000 + os.getpid() % 20_000
    feeder = ["ip", "netns", "exec", host, sys.executable, "-c", FEEDER, address, str(port)]
    out = tmp_path / "run.h5"
    with subprocess.Popen(feeder, stdout=subprocess.PIPE) as server:
        try:
            assert server.stdout is not None
            assert server.stdout.readline() == b"ready\n"
            url = f"socket://{address}:{port}"
            recording = bench.record(url, out, "--seconds", str(RUN_S), stderr=subprocess.PIPE)
            recording.until_bytes(4_000)
            ip("-n", host, "link", "set", card, "down")
            assert recording.ended(RUN_S + ANSWER_S) == 4
            output = recording.process.stderr.read().decode()
        finally:
            server.kill()
    assert "Traceback" not in output
    assert "sensor_lost" in output
    bench.demand_whole(bench.numbers(out))
    with open_run(out) as run:
        kinds = [event["kind"] for event in run.provenance["events"]]
    assert "lost" in kinds, "the system's probes found out that nobody is there any more"
    assert "reopened" not in kinds
