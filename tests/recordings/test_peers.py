"""Recordings of other projects, against the results that these publish or print."""

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

    The average over laws covers its rate, and is less certain than with the law stated. kafe2 prints g = 9.7809(23)
    m/s^2 for l + r = 10.052 m, from the harmonic equation that its data obey.
    """
    numbers = numbers_of(peer(recordings, "kafe2_pendulum.yml"))
    pendulum = (numbers["x_data"], numbers["y_data"])
    stated, free = sm.analyse(pendulum, law="linear", unit="rad"), sm.analyse(pendulum, unit="rad")
    for name, value, u in (("damping_rate", 0.00992, 0.00016), ("amplitude", 0.5984, 0.0026)):
        assert abs(stated[name].value - value) < u
        assert stated[name].u <= 1.1 * u
    assert abs(free["damping_rate"].value - 0.00992) < 2.0 * free["damping_rate"].u
    assert free["damping_rate"].u > stated["damping_rate"].u
    g = (stated["angular_frequency"] ** 2 + stated["damping_rate"] ** 2) * 10.052
    assert abs(g.nominal_value - 9.7809) < 2.0 * math.hypot(g.std_dev, 0.0023)
    assert g.std_dev < 1.5 * 0.0023


@pytest.mark.trials
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


def test_phyprakits_cassy_example_has_two_modes(recordings: Path) -> None:
    """PhyPraKit prints no values; the periods are those of a fit of two damped sinusoids by scipy."""
    from scipy.optimize import curve_fit

    path = peer(recordings, "Cassy.txt")
    run = sm.analyse(path, channel="Weg", unit="m")
    lines = [line.split("\t")[:2] for line in path.read_text("utf-8-sig").splitlines() if line[:1].isdigit()]
    t, y = np.array([[float(cell.replace(",", ".")) for cell in row] for row in lines if all(row)]).T

    def wave(t: np.ndarray, size: float, rate: float, period: float, phase: float) -> np.ndarray:
        return np.asarray(size * np.exp(-rate * t) * np.cos(2 * np.pi * t / period + phase))

    def two(t: np.ndarray, rest: float, *p: float) -> np.ndarray:
        return rest + wave(t, *p[:4]) + wave(t, *p[4:])

    found, _ = curve_fit(two, t, y, (0.0, 0.14, 1e-3, 1.965, 2.0, 0.05, 1e-3, 1.857, 2.0))
    for name, period in (("first_mode_period", found[3]), ("second_mode_period", found[7])):
        assert abs(run[name].value - period) < 2.0 * run[name].u


def test_nists_beam_deflections() -> None:
    """NIST prints f = 0.302596(151) for a sinusoid with a residual of 155.85; least squares goes on to 134.07.

    Its printed values reproduce its residual on these numbers, which are therefore NIST's. The least sum of squares of
    the same model lies at 0.30181(11), which agrees with ours.
    """
    from scipy.optimize import curve_fit

    y = np.loadtxt(Path(__file__).with_name("lew.txt")).ravel()
    t = np.arange(1.0, y.size + 1.0)
    assert (y.size, y.mean()) == (200, pytest.approx(-177.435))

    def sinusoid(t: np.ndarray, *p: float) -> np.ndarray:
        return np.asarray(p[0] + p[1] * np.sin(2 * np.pi * p[2] * t + p[3]))

    printed = (-178.786, -361.766, 0.302596, 1.46536)
    assert math.sqrt(np.sum((y - sinusoid(t, *printed)) ** 2) / 196) == pytest.approx(155.8484, abs=0.05)
    least, covariance = curve_fit(sinusoid, t, y, printed)
    assert math.sqrt(np.sum((y - sinusoid(t, *least)) ** 2) / 196) == pytest.approx(134.07, abs=0.01)
    run = sm.analyse((t, y), unit="1", law="none")
    assert abs(run["frequency"].value - least[2]) < 2.0 * math.hypot(run["frequency"].u, math.sqrt(covariance[2, 2]))
    assert abs(run["offset"].value - printed[0]) < 11.02
    assert abs(run["amplitude"].value - 361.766) < 26.19


@pytest.mark.parametrize(
    ("name", "mass_kg", "period_s", "within_s", "k", "within"),
    [
        # T and k that the students print, and half of their last digit; the third prints a period by eye.
        ("pankaj9um__PHY224/undamped_point_data_set2.txt", 0.2, 0.693, 5e-4, 16.44, 0.02),
        ("pankaj9um__PHY224/undamped_point_data.txt", 0.2, 0.693, 5e-4, 16.44, 0.02),
        ("AyushPandhi__Pandhi_Ayush_PHY224/position data.txt", 0.1999, 0.71, 0.015, 15.66, 0.6),
    ],
)
def test_the_toronto_benches(
    recordings: Path, name: str, mass_kg: float, period_s: float, within_s: float, k: float, within: float
) -> None:
    """Period and the k of the bob's mass alone are those that the students print."""
    path = recordings / name
    if not path.is_file():
        pytest.skip(f"needs ../shared/recordings/{name}")
    run = sm.analyse(path)
    assert abs(run["period"].value - period_s) < within_s
    assert abs(run["angular_frequency"].value ** 2 * mass_kg - k) < within
