"""How a recording is read and analysed, declared once for the command line, courses, the page and Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import EllipsisType
from typing import Annotated, Any, Literal, Self

from cyclopts import Group, Parameter

from pipeline.damping.laws import LAWS, Law, find_law
from pipeline.errors import AnalysisError
from pipeline.options import Options, options_for
from pipeline.registry.laws import ANY_LAW
from springmass.commands.parameters import Finite, LawName, PartsPerMillion, Positive, flag, option

HOW_READ = Group("How the recording is read", sort_key=2)


@Parameter(name="*", group=HOW_READ)
@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """What the user states about a recording beyond its name: what the file leaves out or open, and the part to use."""

    velocity: Annotated[str | Path | None, option("FILE", "velocity file that belongs to the position file")] = None
    channel: Annotated[
        str | None, option("NAME", "channel to use if there are several; for a wire log, the sensor")
    ] = None
    run: Annotated[str | None, option("NAME", "run to use if there are several: name or number")] = None
    rate_hz: Annotated[Positive | None, option("R", "samples per second if the file does not state them")] = None
    unit: Annotated[str | None, option("U", "unit of the channel if the file does not state it: m, cm, rad, V ...")] = (
        None
    )
    time: Annotated[str | None, option("NAME", "column with the times if the file does not state it")] = None
    time_unit: Annotated[
        str | None, option("U", "unit of the times if the file does not state it: s, ms, us, min, h, d")
    ] = None
    delimiter: Annotated[
        str | None, option("C", "separator of a text's cells, else found out: comma, tab, space, ';' ...")
    ] = None
    decimal: Annotated[str | None, option("C", "decimal mark of a text, else found out: . or ,")] = None
    unverified: Annotated[bool, flag("read a run file despite a checksum mismatch")] = False
    from_s: Annotated[Finite | None, option("S", "use samples from this time on, s", "--from")] = None
    to_s: Annotated[Finite | None, option("S", "use samples up to this time, s", "--to")] = None
    clock_ppm: Annotated[
        PartsPerMillion | None, option("PPM", "largest rate error of the sensor's clock (default: that of its family)")
    ] = None

    def given(self) -> dict[str, Any]:
        """Return the values of all options that are not the default, by name."""
        return {each.name: value for each in fields(self) if (value := getattr(self, each.name)) != each.default}

    @classmethod
    def of(cls, answers: Mapping[str, Any]) -> Self:
        """Return the options given as keyword arguments."""
        known = [each.name for each in fields(cls)]
        if unknown := [name for name in answers if name not in known]:
            raise TypeError(f"{unknown[0]!r} is no option of reading; the options are {', '.join(known)}")
        return cls(**answers)


READ_DEFAULTS = ReadOptions()
"""No option given: only the file's own statements are used."""

Accuracy = Literal["fast", "standard", "best"]
_OPTIONS = Parameter(group=Group("Options", sort_key=1))


@Parameter(name="*", group=HOW_READ)
@dataclass(frozen=True, kw_only=True)
class AnalysisOptions(ReadOptions):
    """The options of reading, and those of the analysis: its accuracy, and what is known about the damping law.

    ``law`` is the law that the results follow, "any" to let the recording choose whatever the scene states; ``laws``
    are those to try. With ``method`` "classic" the lab report's own method is applied as well.
    """

    accuracy: Annotated[
        Accuracy, option("TIER", "how much time to spend on accuracy (default: standard)"), _OPTIONS
    ] = "standard"
    law: Annotated[LawName, _OPTIONS] = None
    laws: Annotated[Sequence[str | Law | EllipsisType] | None, Parameter(parse=False)] = None
    method: Annotated[Literal["classic"] | None, Parameter(parse=False)] = None

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
        stated = {each.name: getattr(self, each.name) for each in fields(self)}
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


ANALYSIS_DEFAULTS = AnalysisOptions()
"""No option given."""
