"""The JSON of a result: one schema for the command line, the report's results.json and scripts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pipeline.analyse import Analysis, Oscillation
from pipeline.damping.select import LawFit
from pipeline.numerics.estimate import Estimate
from pipeline.results.budget import Contribution
from pipeline.results.classic import Classic
from pipeline.results.findings import Finding, by_severity
from springmass import __version__
from springmass.runs.loading import Loaded

__all__ = ["SCHEMA", "all_findings", "estimate_json", "finding_json", "finite", "input_of", "result_of"]

SCHEMA = 1
# How grave it is that a reader saw this; what is not named here is for information.
_SEVERITY = {
    "malformed_rows": "warning",
    "offset_unknown_after_gap": "warning",
    "pair_mismatch": "warning",
    "zero_filled_tail": "warning",
    "truncated_row": "warning",
    "duplicate_time": "warning",
    "non_monotonic_time": "warning",
    "rate_assumed": "warning",
    "unit_assumed": "warning",
    "stale_header": "warning",
    "lost_target": "warning",
    "quantised": "warning",
}


def result_of(
    loaded: Loaded,
    analysis: Analysis,
    *,
    time_utc: str,
    accuracy: str,
    parameters: Mapping[str, Any],
    classic: Classic | None = None,
) -> dict[str, Any]:
    """Return the result as JSON-able mapping; numbers that are not finite are None.

    Parameters
    ----------
    loaded : Loaded
    analysis : Analysis
    time_utc : str
        ISO 8601, of the analysis.
    accuracy : str
        Tier, or "classic".
    parameters : mapping
        Options as resolved.
    classic : Classic, optional
        If given, its estimates stand in place of the analysis's.
    """
    estimates = classic.estimates if classic is not None else analysis.estimates
    return {
        "schema": SCHEMA,
        "input": input_of(loaded),
        "quality": _quality(loaded, analysis),
        "estimates": {name: estimate_json(e) for name, e in estimates.items()},
        "budget": _budgets(analysis) if classic is None else {},
        "damping": _damping(analysis) if classic is None else _no_damping(),
        "effects": [
            {
                "name": e.name,
                "predicted": finite(e.predicted),
                "measured": finite(e.measured),
                "unit": e.unit,
                "included": e.included,
                "why": e.why,
            }
            for e in analysis.effects
        ],
        "findings": [finding_json(f) for f in all_findings(loaded, analysis)],
        "provenance": {
            "version": __version__,
            "accuracy": accuracy,
            "parameters": dict(parameters),
            "time_utc": time_utc,
        },
    }


def input_of(loaded: Loaded) -> dict[str, Any]:
    """Return the ``input`` object: what was analysed."""
    track = loaded.track
    return {
        "path": str(loaded.path),
        "format": loaded.format,
        "sha256": loaded.sha256,
        "kind": loaded.info.kind,
        "channel": loaded.channel,
        "samples": len(track),
        "rate_hz": track.rate_hz,
        "duration_s": finite(float(track.t[-1] - track.t[0])) if len(track) else 0.0,
    }


def all_findings(loaded: Loaded, analysis: Analysis) -> tuple[Finding, ...]:
    """Return the analysis's findings and those that reading the file gave, the gravest first."""
    findings = list(analysis.findings)
    known = {f.code for f in findings}
    for trap in loaded.traps:
        if trap.code not in known:
            severity = _SEVERITY.get(trap.code, "info")
            findings.append(Finding(trap.code, severity, trap.message))  # type: ignore[arg-type]
    return by_severity(findings)


def _quality(loaded: Loaded, analysis: Analysis) -> dict[str, int]:
    quality = analysis.quality
    used = quality.pop("used")
    return {**quality, "malformed_rows": loaded.malformed_rows, "used": used}


def _budgets(analysis: Analysis) -> dict[str, Any]:
    if not isinstance(analysis.motion, Oscillation):
        return {}
    return {
        name: {**estimate_json(budget.estimate), "inputs": [_contribution(c) for c in budget.contributions]}
        for name, budget in analysis.motion.derived.budgets.items()
    }


def _contribution(c: Contribution) -> dict[str, Any]:
    given = c.input
    return {
        "name": c.name,
        "type": c.kind,
        "value": None if given is None else finite(given.value),
        "u": None if given is None else finite(given.u),
        "unit": "" if given is None else given.unit,
        "sensitivity": finite(c.sensitivity),
        "contribution": finite(c.u),
        "share": finite(c.share),
    }


def _damping(analysis: Analysis) -> dict[str, Any]:
    if not isinstance(analysis.motion, Oscillation):
        return _no_damping()
    damping = analysis.motion.damping
    return {
        "selected": damping.selected,
        "admissible": list(damping.admissible),
        "laws": {name: _law(fit) for name, fit in damping.fits.items()},
    }


def _no_damping() -> dict[str, Any]:
    return {"selected": None, "admissible": [], "laws": {}}


def _law(fit: LawFit) -> dict[str, Any]:
    return {
        "parameters": {name: estimate_json(e) for name, e in fit.joint.estimates().items()},
        "reduced_chi2": finite(fit.reduced_chi2),
        "dof": finite(fit.dof),
        "bic": finite(fit.bic),
        "rejected": fit.rejected,
    }


def finding_json(finding: Finding) -> dict[str, str]:
    """Return a finding as the JSON holds it."""
    return {"code": finding.code, "severity": finding.severity, "message": finding.message}


def estimate_json(estimate: Estimate) -> dict[str, Any]:
    """Return an estimate as the JSON holds it."""
    return {"value": finite(estimate.value), "u": finite(estimate.u), "unit": estimate.unit}


def finite(value: float | None) -> float | None:
    """Return a number as the JSON holds it: None for what is no number."""
    return None if value is None or not math.isfinite(value) else float(value)
