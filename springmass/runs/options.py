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
from pipeline.options import ANY_LAW, Options, options_for
from springmass.values import Finite, LawName, PartsPerMillion, Positive

HOW_READ = Group("How the recording is read", sort_key=2)


@Parameter(name="*", group=HOW_READ)
@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """What the user states about a recording beyond its name.

    Parameters
    ----------
    velocity : path or None
        The velocity file that belongs to a position file; the two are joined by time.
    channel, rate_hz, unit, run, time, time_unit : optional
        What the file leaves out or leaves open. Of a wire log of several sensors ``channel`` names one, by its number
        or its port.
    delimiter, decimal : str or None
        Separator of the cells and decimal mark of a text, which are found out unless they are stated.
    from_s, to_s : float or None
        Use samples of these seconds only; the others stay in the file.
    unverified : bool
        Whether a run file with a checksum mismatch is read. What differs is written to stderr, and a trap of the code
        "unverified" goes into everything that is made of the run.
    clock_ppm : float or None
        Largest rate error of the sensor's clock, ppm; None: what the run file or the sensor's family states.
    """

    velocity: Annotated[
        str | Path | None, Parameter(metavar="FILE", help="velocity file that belongs to the position file")
    ] = None
    channel: Annotated[
        str | None, Parameter(metavar="NAME", help="channel to use if there are several; for a wire log, the sensor")
    ] = None
    run: Annotated[str | None, Parameter(metavar="NAME", help="run to use if there are several: name or number")] = None
    rate_hz: Annotated[
        Positive | None, Parameter(metavar="R", help="samples per second if the file does not state them")
    ] = None
    unit: Annotated[
        str | None, Parameter(metavar="U", help="unit of the channel if the file does not state it: m, cm, rad, V ...")
    ] = None
    time: Annotated[
        str | None, Parameter(metavar="NAME", help="column with the times if the file does not state it")
    ] = None
    time_unit: Annotated[
        str | None, Parameter(metavar="U", help="unit of the times if the file does not state it: s, ms, us, min, h, d")
    ] = None
    delimiter: Annotated[
        str | None,
        Parameter(metavar="C", help="separator of a text's cells, else found out: comma, tab, space, ';' ..."),
    ] = None
    decimal: Annotated[str | None, Parameter(metavar="C", help="decimal mark of a text, else found out: . or ,")] = None
    unverified: Annotated[bool, Parameter(help="read a run file despite a checksum mismatch")] = False
    from_s: Annotated[Finite | None, Parameter(name="--from", metavar="S", help="use samples from this time on, s")] = (
        None
    )
    to_s: Annotated[Finite | None, Parameter(name="--to", metavar="S", help="use samples up to this time, s")] = None
    clock_ppm: Annotated[
        PartsPerMillion | None,
        Parameter(metavar="PPM", help="largest rate error of the sensor's clock (default: that of its family)"),
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


READ = ReadOptions()
"""No option given: only the file's own statements are used."""

Accuracy = Literal["fast", "standard", "best"]
_OPTIONS = Group("Options", sort_key=1)


@Parameter(name="*", group=HOW_READ)
@dataclass(frozen=True, kw_only=True)
class How(ReadOptions):
    """The options of reading, and those of the analysis: its accuracy, and what is known about the damping law.

    ``law`` is the law that the results follow, "any" to let the recording choose whatever the scene states; ``laws``
    are those to try. With ``method`` "classic" the lab report's own method is applied as well.
    """

    accuracy: Annotated[
        Accuracy,
        Parameter(metavar="TIER", group=_OPTIONS, help="how much time to spend on accuracy (default: standard)"),
    ] = "standard"
    law: Annotated[
        LawName | None,
        Parameter(
            metavar="NAME",
            group=_OPTIONS,
            help="damping law, if known: linear, quadratic ...; any: choose from the data",
        ),
    ] = None
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


HOW = How()
"""No option given."""
