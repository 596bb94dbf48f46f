"""The options of reading and of analysing a recording, for the command line, courses, the page and Python alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import EllipsisType
from typing import Any, Literal, Self

from pipeline.damping.laws import LAWS, Law, find_law
from pipeline.errors import AnalysisError
from pipeline.options import Options, options_for
from pipeline.registry.laws import ANY_LAW

Accuracy = Literal["fast", "standard", "best"]


@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """What the user states about a recording beyond its name: what the file leaves out or open, and the part to use.

    ``springmass.commands.options`` says for each of them what the command line calls it and what its help says.
    """

    velocity: str | Path | None = None
    channel: str | None = None
    run: str | None = None
    rate_hz: float | None = None
    unit: str | None = None
    time: str | None = None
    time_unit: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    unverified: bool = False
    from_s: float | None = None
    to_s: float | None = None
    clock_ppm: float | None = None

    def given(self) -> dict[str, Any]:
        """Return the values of all options that are not the default, by name."""
        return {each.name: value for each in fields(self) if (value := getattr(self, each.name)) != each.default}

    @classmethod
    def of(cls, answers: Mapping[str, Any]) -> Self:
        """Return the options given as keyword arguments."""
        names = [each.name for each in fields(cls)]
        if unknown := [name for name in answers if name not in names]:
            raise TypeError(f"{unknown[0]!r} is no option of reading; the options are {', '.join(names)}")
        return cls(**answers)


READ_DEFAULTS = ReadOptions()
"""No option given: only the file's own statements are used."""


@dataclass(frozen=True, kw_only=True)
class AnalysisOptions(ReadOptions):
    """The options of reading, and those of the analysis: its accuracy, and what is known about the damping law.

    ``law`` is the law that the results follow, "any" to let the recording choose whatever the scene states; ``laws``
    are those to try. With ``method`` "classic" the lab report's own method is applied as well.
    """

    accuracy: Accuracy = "standard"
    law: str | None = None
    laws: Sequence[str | Law | EllipsisType] | None = None
    method: Literal["classic"] | None = None

    @property
    def options(self) -> Options:
        """The options of the pipeline."""
        chosen = options_for(self.accuracy)
        if self.laws is not None:
            chosen = replace(chosen, laws=_laws(self.laws))
        if self.law is not None:
            if self.law != ANY_LAW:
                find_law(self.law)
            chosen = replace(chosen, stated=self.law)
        return chosen

    @property
    def parameters(self) -> dict[str, Any]:
        """Every option, as JSON has them."""
        every_option = {each.name: getattr(self, each.name) for each in fields(self)}
        laws = None if self.laws is None else [getattr(law, "name", law) for law in _laws(self.laws)]
        return {**every_option, "law": getattr(self.law, "name", self.law), "laws": laws}


def _laws(wanted: Sequence[str | Law | EllipsisType]) -> tuple[str | Law, ...]:
    """Return the requested laws, with ``...`` replaced by all built-in laws that are not named."""
    if isinstance(wanted, str):
        raise AnalysisError(f"laws must be a list of names and laws, got the text {wanted!r}")
    named = [law for law in wanted if not isinstance(law, EllipsisType)]
    for law in named:
        find_law(law)
    others = [name for name in LAWS if name not in named]
    laws: list[str | Law] = []
    for each in wanted:
        laws += others if isinstance(each, EllipsisType) else [each]
    return tuple(laws)


ANALYSIS_DEFAULTS = AnalysisOptions()
"""No option given."""
