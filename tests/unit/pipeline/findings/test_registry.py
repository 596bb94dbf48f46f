"""Every code has a meaning, a cause and advice, and findings on all kinds of runs keep to their form."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.findings.finding import Finding, by_severity
from pipeline.findings.registry import FINDINGS, Symptom
from pipeline.track import F8, Track

LONGEST = 110  # characters of a message
FIGURES = {"", "position", "amplitude", "frequency", "spectrum"}
T: F8 = np.arange(3000) / 100.0


@pytest.mark.parametrize("code", FINDINGS)
def test_every_code_has_meaning_cause_and_advice(code: str) -> None:
    """Meaning and cause are sentences; what can be a warning or an error has advice, and a figure is one there is."""
    kind = FINDINGS[code]
    assert kind.severities
    assert kind.figure in FIGURES
    for sentence in (kind.meaning, kind.cause, *([kind.advice] if kind.advice else [])):
        assert sentence[0].isupper()
        assert sentence.endswith(".")
        assert len(sentence.split()) <= 35
    assert kind.advice or set(kind.severities) == {"info"}


def test_every_symptom_has_findings() -> None:
    """A reader finds something under each heading."""
    assert {kind.symptom for kind in FINDINGS.values()} == set(Symptom)


@pytest.mark.parametrize("code", FINDINGS)
def test_warnings_and_errors_have_the_advice_of_the_registry(code: str) -> None:
    """A warning or error without advice takes the registry's; a note has none; given advice stays."""
    for severity in FINDINGS[code].severities:
        assert Finding(code, severity, "text").advice == ("" if severity == "info" else FINDINGS[code].advice)
        assert Finding(code, severity, "text", advice="Do this.").advice == "Do this."


@pytest.mark.parametrize(("code", "severity"), [("a_new_code", "info"), ("at_rest", "error"), ("clipped", "info")])
def test_what_is_not_registered_is_refused_where_it_is_made(code: str, severity: str) -> None:
    """A code or a severity that the registry does not have fails at its producer."""
    with pytest.raises(ValueError, match="registered"):
        Finding(code, severity, "text")  # type: ignore[arg-type]


def test_the_gravest_come_first() -> None:
    """Errors, then warnings, then notes, each in the order they were made."""
    one, two = Finding("at_rest", "info", "1"), Finding("touched", "warning", "2")
    three, four = Finding("no_oscillation", "error", "3"), Finding("handled", "warning", "4")
    assert by_severity([one, two], (), [three, four]) == (three, two, four, one)


def free(amplitude: float = 0.05, rate: float = 0.012, since: float = 0.0) -> F8:
    """Return a free oscillation that begins at a moment."""
    return amplitude * np.exp(-rate * np.maximum(T - since, 0.0)) * np.cos(8.3 * (T - since))


def narrow_band() -> F8:
    """Return noise about 1.3 Hz: a line whose phase does not last."""
    frequency = np.fft.rfftfreq(T.size, 0.01)
    spectrum = np.fft.rfft(np.random.default_rng(4).standard_normal(T.size))
    x = np.fft.irfft(spectrum * np.exp(-0.5 * ((frequency - 1.32) / 0.2) ** 2), T.size)
    return np.asarray(0.02 * x / np.std(x))


def touched_often() -> F8:
    """Return a motion whose amplitude changes every six seconds."""
    return free() * np.repeat([1.0, 0.7, 1.1, 0.6, 1.0], T.size // 5)


def missing(x: F8) -> F8:
    """Return displacements with holes of all sizes."""
    x = x.copy()
    x[::7] = np.nan
    x[1000:1400] = np.nan
    return x


MOTIONS: dict[str, Callable[[], F8]] = {
    "plain": free,
    "growing": lambda: free(0.01, -0.03),
    "tiny": lambda: free(1e-3),
    "noise": lambda: np.zeros(T.size),
    "step": lambda: 0.05 * (T > 15.0),
    "ramp": lambda: 1e-3 * T,
    "exponential": lambda: 0.05 * np.exp(-0.4 * T),
    "narrow band": narrow_band,
    "overdamped": lambda: 0.05 * (1.3 * np.exp(-2.0 * T) - 0.3 * np.exp(-8.7 * T)),
    "strongly damped": lambda: free(0.05, 0.6),
    "stops early": lambda: 0.05 * np.maximum(1.0 - T / 5.0, 0.0) * np.cos(8.3 * T),
    "two modes": lambda: free(0.02, 0.0) + 0.018 * np.cos(7.4 * T),
    "beating": lambda: free() + 2e-3 * np.cos(5.0 * T) + 1e-3 * np.cos(20.0 * T),
    "slow beat": lambda: free() + 2e-3 * np.cos(8.4 * T),
    "restarted": lambda: np.where(T < 8.0, free(), np.where(T < 11.5, 0.03, free(0.05, 0.012, 11.5))),
    "touched": touched_often,
    "held by hand": lambda: np.where(T < 4.0, 0.045, free(0.045, 0.012, 4.0)),
    "clipped": lambda: np.minimum(free(), 0.035),
    "clipped twice": lambda: np.clip(free(), -0.04, 0.035),
    "far echo": lambda: np.where(free() > 0.035, 0.07 - free(), free()),
    "echoes": lambda: free() + 0.1 * (np.random.default_rng(1).random(T.size) < 0.2),
    "clusters": lambda: free() + 0.02 * (np.arange(T.size) % 76 < 12),
    "bent": lambda: free() + 0.05 * free() ** 2 / 0.05,
    "levelled off": lambda: 0.05 * np.tanh(free() / 0.05),
    "drifting": lambda: free() + 4e-4 * T + 2e-3 * (T > 10.0) - 3e-3 * (T > 20.0),
    "held": lambda: free()[np.arange(T.size) // 5 * 5],
    "alternating": lambda: free() + 2e-3 * (np.arange(T.size) % 2),
    "fast": lambda: 0.05 * np.cos(2.0 * math.pi * 40.0 * T),
    "slow": lambda: 0.05 * np.cos(2.0 * math.pi * 0.07 * T),
    "bending": lambda: 0.05 * np.exp(-0.05 * T) * np.cos(8.3 * T + 0.6 * np.exp(-0.1 * T)),
    "missing": lambda: missing(free()),
}
FORMS = {
    "m": lambda t, x: Track.from_arrays(t, 0.3 + x),
    "nominal, in other units": lambda t, x: replace(
        Track.from_arrays(1e3 * t, 1e3 * (0.3 + x)), clock="nominal", stated_error_m=100.0
    ),
    "rad/s": lambda t, x: Track.from_arrays(t, -1234.5 + 1e3 * x, quantity="angular_velocity", unit="rad/s"),
    "coarse": lambda t, x: replace(
        Track.from_arrays(t, np.round((0.3 + x) / 0.0127) * 0.0127),
        quantum_m=0.0127,
        clock="device",
        held_samples=123456,
        longest_stall_s=12345.678,
    ),
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("motion", MOTIONS)
def test_findings_keep_to_their_form(motion: str, form: str) -> None:
    """A message is one short sentence, values are plain finite numbers, warnings have advice, errors come first."""
    x = MOTIONS[motion]() + 3e-4 * np.random.default_rng(3).standard_normal(T.size)
    bench = Scene.from_mapping({"bob": {"mass_kg": 0.2}, "disc": {"diameter_m": 0.1}})
    findings = analyse(FORMS[form](T, x), bench if form != "rad/s" else None).findings
    assert findings == by_severity(findings)
    for finding in findings:
        assert len(finding.message) <= LONGEST, finding.message
        assert "\n" not in finding.message + finding.details + finding.advice
        assert not finding.message[0].islower()
        assert finding.message.endswith(".")
        assert bool(finding.advice) or finding.severity == "info"
        for name, value in finding.values.items():
            assert type(value) in (int, float), name
            assert math.isfinite(value), name
