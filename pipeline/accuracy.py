"""Accuracy: the tiers between which a user trades time for error, and the options that each stands for."""

from __future__ import annotations

from pipeline.analyse import Params
from pipeline.damping import Params as DampingParams
from pipeline.errors import AnalysisError
from pipeline.quick_models import FAST_LAWS

__all__ = ["TIERS", "params_for"]

TIERS = ("fast", "standard", "best")


def params_for(accuracy: str) -> Params:
    """Return the options of an accuracy tier.

    Parameters
    ----------
    accuracy : {"fast", "standard", "best"}

    Raises
    ------
    AnalysisError
        If there is no such tier.

    Examples
    --------
    >>> params_for("best").accuracy
    'best'
    """
    if accuracy not in TIERS:
        raise AnalysisError(f"accuracy must be one of {', '.join(TIERS)}, got {accuracy!r}")
    if accuracy == "fast":
        return Params(accuracy=accuracy, damping=DampingParams(laws=FAST_LAWS))
    return Params(accuracy=accuracy)
