"""Findings on damping: which laws a run supports, which it contradicts, and which it cannot distinguish."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import pytest

from pipeline.analyse import Analysis, Oscillation, analyse
from pipeline.findings.damping import damping_findings
from pipeline.findings.finding import Finding
from pipeline.track import Track


def analysed(synthetic: ModuleType, seconds: float, sigma_m: float = 1e-4, **truth: float) -> Analysis:
    """Return the analysis of a run, timed by its device."""
    t = synthetic.times(seconds)
    track = Track.from_arrays(t, synthetic.noisy(synthetic.Truth(**truth), t, sigma_m, 1))
    return analyse(replace(track, clock="device"))


def by_code(result: Analysis) -> dict[str, Finding]:
    """Return the findings by code; each comes once."""
    found = {finding.code: finding for finding in result.findings}
    assert len(found) == len(result.findings)
    return found


def test_rejected_laws_are_counted_and_named(synthetic: ModuleType) -> None:
    """Linear drag rejects other laws: a note has their number, and details with every one of them."""
    result = analysed(synthetic, 60.0, gamma=0.01463)
    assert isinstance(result.motion, Oscillation)
    fits = result.motion.damping.fits
    rejected = [fit for fit in fits.values() if fit.rejected]
    finding = by_code(result)["law_rejected"]
    assert finding.severity == "info"
    assert dict(finding.values) == {"rejected": len(rejected), "tried": len(fits)}
    assert all(fit.law.words in finding.details for fit in rejected)


def test_no_law_for_an_amplitude_that_grows(synthetic: ModuleType) -> None:
    """An amplitude that grows is no damping: a warning has how badly the nearest law fits."""
    result = analysed(synthetic, 60.0, amplitude=0.01, gamma=-0.02)
    assert isinstance(result.motion, Oscillation)
    finding = by_code(result)["no_law_fits"]
    assert finding.severity == "warning"
    assert finding.values["reduced_chi2"] == result.motion.damping.best.reduced_chi2
    assert result.findings[0].severity == "warning"


def test_mixed_drag_has_both_coefficients(synthetic: ModuleType) -> None:
    """Two kinds of drag together are a note with both coefficients, as the results give them."""
    result = analysed(synthetic, 120.0, gamma=0.0073, beta=0.235)
    assert isinstance(result.motion, Oscillation)
    finding = by_code(result)["mixed_drag"]
    assert finding.severity == "info"
    given = result.motion.derived.coefficients
    assert dict(finding.values) == {name: given[name].value for name in ("gamma", "beta")}
    assert finding.values == {"gamma": pytest.approx(0.0073, rel=0.1), "beta": pytest.approx(0.235, rel=0.1)}
    assert all(str(given[name]) in finding.details for name in ("gamma", "beta"))


def test_laws_that_a_short_run_cannot_distinguish(synthetic: ModuleType) -> None:
    """Ten seconds of weak damping admit several laws: a note has their number."""
    result = analysed(synthetic, 10.0, gamma=0.003)
    assert isinstance(result.motion, Oscillation)
    finding = by_code(result)["laws_not_separable"]
    assert finding.severity == "info"
    assert dict(finding.values) == {"laws": len(result.motion.damping.admissible)}
    assert finding.values["laws"] > 1


def test_the_findings_are_those_of_the_fit_alone(synthetic: ModuleType) -> None:
    """From the same fits come the same findings."""
    result = analysed(synthetic, 60.0, gamma=0.01463)
    assert isinstance(result.motion, Oscillation)
    found = list(damping_findings(result.motion.damping, result.motion.derived.coefficients))
    assert found
    assert set(map(id, found)).isdisjoint(map(id, result.findings))
    assert all(finding in result.findings for finding in found)
