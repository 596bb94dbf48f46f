"""A motion with few parameters, a relaxation, two modes or a bob at rest, as inputs of the formulas and as results."""

from __future__ import annotations

import math
from typing import Any

from uncertainties import umath

from pipeline.motion.at_rest import Rest
from pipeline.motion.lines import TwoModes
from pipeline.motion.relaxation import Relaxation


def closed_form(
    motion: Relaxation | TwoModes | Rest, x: dict[str, Any], *, rate: Any, scale: Any
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what the formulas need of a motion, and results that no formula gives, from its parameters as variables.

    Rates of the record times ``rate`` are those in true seconds, its values times ``scale`` those in true metres.
    """
    if isinstance(motion, TwoModes):
        results: dict[str, Any] = {}
        for name in ("first", "second"):
            results[f"{name}_mode_period"] = 2.0 * math.pi / (x[f"{name}_omega"] * rate)
            results[f"{name}_mode_amplitude"] = (x[f"{name}_cosine"] ** 2 + x[f"{name}_sine"] ** 2) ** 0.5 * scale
        return {}, results
    return _relaxation(motion, x, rate) if isinstance(motion, Relaxation) else ({}, {})


def _relaxation(motion: Relaxation, x: dict[str, Any], rate: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    g = umath.exp(x["log_rate"])
    w = g**2 if motion.kind == "critical" else umath.exp(x["log_stiffness"])
    if motion.kind == "critical":
        return {"squared_natural_frequency": w * rate**2}, {"relaxation_rate": g * rate}
    if motion.kind == "overdamped":
        fast = g + umath.sqrt(g**2 - w)
        # Computing the slow rate as g - sqrt(g**2 - w) would lose digits.
        rates = {"relaxation_rate_slow": w / fast * rate, "relaxation_rate_fast": fast * rate}
        return {"squared_natural_frequency": w * rate**2}, rates
    # The oscillation is a cosine of amplitude a plus a sine of amplitude (v + g a) / omega.
    omega, a = umath.sqrt(w - g**2), x["displacement"]
    side = (x["velocity"] + g * a) / omega
    inputs = {
        "phase_slope": omega,
        "squared_rate": g**2,
        "law_start": umath.sqrt(a**2 + side**2),
        "law_rate": g,
        "start_phase": umath.atan2(-side, a),
        **dict.fromkeys(("amplitude_factor", "rate_factor", "crest"), 1.0),
        "phase_misfit": 0.0,
        "decays": True,
    }
    return inputs, {}
