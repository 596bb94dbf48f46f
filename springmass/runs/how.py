"""How a recording is read and analysed, declared once for the command line, courses, the page and Python."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from types import EllipsisType
from typing import Any, Literal

from pipeline.damping.laws import LAWS, Law, find_law
from pipeline.errors import AnalysisError
from pipeline.options import ANY_LAW, Options, options_for
from springmass.runs.options import ReadOptions

Accuracy = Literal["fast", "standard", "best"]


@dataclass(frozen=True, kw_only=True)
class How(ReadOptions):
    """The options of reading, and those of the analysis: its accuracy, and what is known about the damping law.

    ``law`` is the law that the results follow, "any" to let the recording choose whatever the scene states; ``laws``
    are those to try. With ``method`` "classic" the lab report's own method is applied as well.
    """

    accuracy: Accuracy = "standard"
    law: str | Law | None = None
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

    def stated(self) -> dict[str, Any]:
        """Return every option that is not the default."""
        return {each.name: value for each in fields(self) if (value := getattr(self, each.name)) != each.default}

    @property
    def parameters(self) -> dict[str, Any]:
        """Every option that was given, and the accuracy, as JSON has them."""
        names = [each.name for each in fields(self) if each.name != "laws"]
        stated = {name: getattr(self, name) for name in names}
        laws = None if self.laws is None else [getattr(law, "name", law) for law in _laws(self.laws)]
        return {**stated, "law": getattr(self.law, "name", self.law), "laws": laws}


def _laws(wanted: Sequence[str | Law | EllipsisType]) -> tuple[str | Law, ...]:
    """Return the requested laws, with ``...`` replaced by all built-in laws that are not named."""
    if isinstance(wanted, str):
        raise AnalysisError(f"laws must be a list of names and laws, got the text {wanted!r}")
    named = [law for law in wanted if not isinstance(law, EllipsisType)]
    for law in named:
        find_law(law)
    others = [name for name in LAWS if name not in named]
    found: list[str | Law] = []
    for each in wanted:
        found += others if isinstance(each, EllipsisType) else [each]
    return tuple(found)
