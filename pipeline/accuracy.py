"""Accuracy: tiers that trade computing time for accuracy, each a set of options of the same analysis."""

from __future__ import annotations

from dataclasses import replace

from pipeline.analyse import STANDARD, Params
from pipeline.damping.select import Params as DampingParams
from pipeline.errors import AnalysisError
from pipeline.motion.waveform_fit import Params as WaveformParams
from pipeline.windows.disturbances import Params as DisturbancesParams

__all__ = ["PRESETS", "TIERS", "params_for"]

FAST_LAWS = ("none", "linear", "quadratic", "linear+quadratic")
PRESETS = {
    "fast": replace(
        STANDARD,
        damping=DampingParams(laws=FAST_LAWS, otherwise=DampingParams().laws),
        disturbances=DisturbancesParams(modes=False),
    ),
    "standard": STANDARD,
    "best": replace(STANDARD, full=WaveformParams()),
}
TIERS = tuple(PRESETS)


def params_for(accuracy: str) -> Params:
    """Return the options of an accuracy tier.

    Parameters
    ----------
    accuracy : {"fast", "standard", "best"}

    Raises
    ------
    AnalysisError
        If no tier has this name.

    Examples
    --------
    >>> params_for("fast").damping.laws
    ('none', 'linear', 'quadratic', 'linear+quadratic')
    """
    if accuracy not in PRESETS:
        raise AnalysisError(f"accuracy must be one of {', '.join(TIERS)}, got {accuracy!r}")
    return PRESETS[accuracy]
