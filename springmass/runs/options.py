"""The options for reading a recording, declared once for the command line, courses, the page and Python."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Self

from cyclopts import Group, Parameter

from springmass.values import Finite, PartsPerMillion, Positive

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
        """Return the values of all given options by name."""
        return {each.name: value for each in fields(self) if (value := getattr(self, each.name)) not in (None, False)}

    @classmethod
    def of(cls, answers: Mapping[str, Any]) -> Self:
        """Return the options given as keyword arguments.

        Raises
        ------
        TypeError
            If one of the names is not an option; the message lists the options.
        """
        known = [each.name for each in fields(cls)]
        if unknown := [name for name in answers if name not in known]:
            raise TypeError(f"{unknown[0]!r} is no option of reading; the options are {', '.join(known)}")
        return cls(**answers)


READ = ReadOptions()
"""No option given: only the file's own statements are used."""
