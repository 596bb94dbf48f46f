"""Options of an analysis, and the accuracy tiers: sets of options that trade computing time for accuracy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pipeline.bench.law_names import ANY_LAW
from pipeline.damping.laws import LAWS, Law
from pipeline.damping.select import FEW_LAWS
from pipeline.errors import AnalysisError


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Options of an analysis."""

    # The damping laws to try: names in :data:`springmass.LAWS`, or laws of :func:`springmass.make_law`. After the four
    # laws of the tier "fast" all are tried, if none of the four fits or linear and quadratic drag are both needed.
    laws: tuple[str | Law, ...] = tuple(LAWS)
    # The law that the damping follows, if it is known; results are stated by it alone. None takes the law of the scene,
    # if it has one, and "any" leaves the choice to the recording.
    stated: str | Law | None = None
    modes: bool = True  # whether to search for other oscillations beside the main one
    rows: Literal["windows", "samples"] = "windows"  # whether periods' amplitudes and phases, or all samples are fitted

    @property
    def known_law(self) -> str | Law | None:
        """The law by which the results are stated; None if the recording chooses."""
        return None if self.stated == ANY_LAW else self.stated


TIERS = {"fast": Options(laws=FEW_LAWS, modes=False), "standard": Options(), "best": Options(rows="samples")}


def options_for(accuracy: str) -> Options:
    """Return the options of an accuracy tier: "fast", "standard" or "best".

    >>> options_for("fast").laws
    ('none', 'linear', 'quadratic', 'linear+quadratic')
    """
    if accuracy not in TIERS:
        raise AnalysisError(f"accuracy must be one of {', '.join(TIERS)}, got {accuracy!r}")
    return TIERS[accuracy]
