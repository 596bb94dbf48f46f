"""The options of reading and of analysing a recording, for the command line, courses, the page and Python alike."""

from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass, field, fields, replace
from types import EllipsisType
from typing import Any, Literal

from acquisition.recordings.reading import ReadOptions, ValueKind, words_of
from pipeline.bench.law_names import ANY_LAW
from pipeline.damping.laws import LAWS, Law, find_law
from pipeline.errors import AnalysisError
from pipeline.options import Options, options_for

Accuracy = Literal["fast", "standard", "best"]


@dataclass(frozen=True, kw_only=True)
class LoadOptions(ReadOptions):
    """The options of reading, and whether a run file is read despite a checksum mismatch, which no notes can state."""

    unverified: bool = field(
        default=False, metadata=words_of("yes", "read a run file despite a checksum mismatch", ValueKind.YES)
    )


LOAD_FIELDS: Mapping[str, Field[Any]] = {each.name: each for each in fields(LoadOptions)}
"""The options by name, with what the user reads of them."""
LOAD_DEFAULTS = LoadOptions()
"""No option given: only the file's own statements, and the notes next to it, are used."""


@dataclass(frozen=True, kw_only=True)
class AnalysisOptions(LoadOptions):
    """The options of reading, and those of the analysis: its part of the recording, its accuracy, the damping law.

    ``clock_ppm`` is the largest rate error of the sensor's clock.
    ``law`` is the law that the results follow, "any" to let the recording choose whatever the scene states; ``laws``
    are those to try. With ``method`` "classic" the lab report's own method is applied as well.
    """

    from_s: float | None = None
    to_s: float | None = None
    clock_ppm: float | None = None
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
