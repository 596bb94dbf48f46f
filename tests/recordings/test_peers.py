"""Recordings of other projects, against the results that these publish or print."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import springmass as sm

FOLDER = "peers"


def peer(recordings: Path, name: str) -> Path:
    """Return a recording of another project; the test is skipped where it is absent."""
    path = recordings / FOLDER / name
    if not path.is_file():
        pytest.skip(f"needs ../shared/recordings/{FOLDER}/{name}")
    return path


def numbers_of(path: Path) -> dict[str, list[float]]:
    """Return the lists of numbers of a YAML file whose top level has keys and lists alone."""
    lists: dict[str, list[float]] = {}
    key = ""
    for line in path.read_text().splitlines():
        head, colon, _ = line.partition(":")
        if colon and not head.startswith((" ", "-")):
            key = head
        elif line.startswith("- ") and ":" not in line:
            lists.setdefault(key, []).append(float(line[2:]))
    return lists


def test_kafe2s_pendulum(recordings: Path) -> None:
    """kafe2 fits a linear law, c = 0.00992(16) 1/s from 0.5984(26) rad on: ours agrees within its u, and is no wider.

    The average over laws covers its rate, and is less certain than with the law stated.
    """
    numbers = numbers_of(peer(recordings, "kafe2_pendulum.yml"))
    pendulum = (numbers["x_data"], numbers["y_data"])
    stated, free = sm.analyse(pendulum, law="linear", unit="rad"), sm.analyse(pendulum, unit="rad")
    for name, value, u in (("damping_rate", 0.00992, 0.00016), ("amplitude", 0.5984, 0.0026)):
        assert abs(stated[name].value - value) < u
        assert stated[name].u <= 1.1 * u
    assert abs(free["damping_rate"].value - 0.00992) < 2.0 * free["damping_rate"].u
    assert free["damping_rate"].u > stated["damping_rate"].u


def test_phypraks_torsion_pendulum(recordings: Path) -> None:
    """PhyPraKit prints f = 0.5583 Hz and decay times of 102(10) s and 101(3) s: the times agree within their u.

    The frequency grows from 0.5571 to 0.560 Hz as the amplitude falls, so that two means differ by more than their u.
    """
    analysis = sm.analyse(peer(recordings, "Drehpendel.labx"), channel="Winkel phi", unit="rad")
    assert np.isclose(analysis["frequency"].value, 0.5583, rtol=0.0, atol=1e-3)
    rate = analysis["damping_rate"]
    decay_s, u_s = 1.0 / rate.value, rate.u / rate.value**2
    for printed, u_printed in ((102.0, 10.0), (101.0, 3.0)):
        assert abs(decay_s - printed) < math.hypot(u_printed, u_s)
