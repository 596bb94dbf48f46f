"""The table of damping laws of a run or of several: goodness of fit, status and coefficients of each law."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pipeline.analyse import Analysis
from pipeline.damping.select import Damping
from pipeline.numerics.estimate import Estimate
from pipeline.several.joint import JointDamping
from springmass.typeset import equation, law_status, pretty_number, typeset


def laws_of(analysis: Analysis) -> dict[str, Any]:
    """Return the rows of all laws fitted to one run, and the reasons why other laws were not fitted."""
    damping = analysis.damping
    fitted = {law: analysis.derived.parameters_of(fit) for law, fit in damping.fits.items()}
    return {"rows": _rows(damping, fitted), "unfitted": [(law, typeset(why)) for law, why in damping.unfitted.items()]}


def laws_across(joint: JointDamping) -> dict[str, Any]:
    """Return the rows of all laws fitted to several runs with shared coefficients, and the conclusion in words."""
    fitted = {law: fit.coefficients for law, fit in joint.fits.items()}
    return {"message": typeset(joint.message), "rows": _rows(joint, fitted), "unfitted": []}


def _rows(damping: Damping | JointDamping, fitted: Mapping[str, Mapping[str, Estimate]]) -> list[dict[str, Any]]:
    """Return one row per fitted law: goodness of fit, status and coefficients."""
    return [
        {
            "name": law,
            "status": law_status(damping, law),
            "look": "rejected" if fit.rejected else "selected" if law == damping.selected else "",
            "fit": fit,
            "chi2": _difference(fit.reduced_chi2 * fit.dof - damping.best.reduced_chi2 * damping.best.dof),
            "bic": _difference(fit.bic - damping.best.bic),
            "coefficients": [equation(name, x) for name, x in fitted[law].items()],
        }
        for law, fit in damping.fits.items()
    ]


def _difference(value: float) -> str:
    if not math.isfinite(value):  # chi-square of a law with as many parameters as there are windows
        return pretty_number(None)
    return pretty_number(value) if abs(value) >= 1000.0 else f"{value:.1f}".replace("-", "−")
