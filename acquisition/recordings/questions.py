"""Questions that a reader asks the user, as data, so that a program can choose an answer without parsing text.

A file may lack information that must not be guessed: a unit, a rate, the choice of a channel. The caller words how to
answer, because a command line and a script give answers in different ways.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

_MOST_LISTED = 8


class Missing(StrEnum):
    """The kinds of missing items. The value is the name of the option of reading that gives the answer."""

    RUN = "run"
    CHANNEL = "channel"
    TIME = "time"
    RATE_HZ = "rate_hz"
    TIME_UNIT = "time_unit"
    UNIT = "unit"


@dataclass(frozen=True, slots=True)
class MissingItem:
    """One missing item of information.

    Parameters
    ----------
    what : Missing
    choices : tuple of str
        All choices: runs, possible channels, or units. Empty for a rate, which may be any positive number.
    example : str or float
        One of the choices. For a rate, it is a round number in Hz that does not come from the file.
    of : str
        The column whose unit is missing; empty if the file does not name it.
    stated : str
        The unknown unit that the file states; empty if it states none.
    instead : MissingItem or None
        Another item that can be given in its place, such as the column of times in place of a rate.
    """

    what: Missing
    choices: tuple[str, ...]
    example: str | float
    of: str = ""
    stated: str = ""
    instead: MissingItem | None = None

    def __str__(self) -> str:
        """Return the question without its question mark: ``which channel of "x", "y" (x is an example)``."""
        example = f"{self.example:g}" if isinstance(self.example, float) else self.example
        return f"{self._question} ({example} is an example)"

    @property
    def _question(self) -> str:
        listed = _listed(self.choices)
        match self.what:
            case Missing.RUN:
                return f"which of the {len(self.choices)} runs {listed}"
            case Missing.CHANNEL:
                return f"which channel of {listed}"
            case Missing.TIME:
                return f"which column is the time, of {listed}"
            case Missing.RATE_HZ:
                return "what is the rate" + (", or which column is the time" if self.instead else "")
            case Missing.TIME_UNIT if self.stated:
                return f"what does one {self.stated} of {self.of or 'the time'} count as"
            case Missing.TIME_UNIT:
                return f"what is {self.of or 'the time'}'s unit"
            case Missing.UNIT if self.stated:
                return f"what does one {self.stated} of {self.of} count as (1: a plain number)"
            case Missing.UNIT:
                return f"what is {self.of}'s unit"


@dataclass(frozen=True, slots=True)
class Question:
    """Everything that a reader needs before it can read one channel of a file.

    Parameters
    ----------
    path : str
        The file.
    needs : tuple of MissingItem
        At least one missing item. The order is run, channel, rate or time unit, unit, because each item may depend on
        the items before it. All examples together answer the question. To choose another answer than the first example,
        answer only that item and read again, because the later items refer to the run and channel of the examples.
    columns : tuple of str
        The columns of the run, with their units.
    times : str
        The name of the times in quotes, with their range and median step if known; empty if there are no times.
    reason : str
        The reason for the question, if the columns do not show it, for example an answer that does not fit.
    rows : tuple of tuple of str
        The names of the first columns and the numbers of the first rows; empty if no table could be chosen.
    """

    path: str
    needs: tuple[MissingItem, ...]
    columns: tuple[str, ...] = ()
    times: str = ""
    reason: str = ""
    rows: tuple[tuple[str, ...], ...] = ()

    @property
    def missing(self) -> tuple[Missing, ...]:
        """The kinds of the missing items."""
        return tuple(need.what for need in self.needs)

    @property
    def examples(self) -> dict[str, str | float]:
        """Options of reading, by name, that answer the whole question."""
        return {need.what.value: need.example for need in self.needs}

    @property
    def sentence(self) -> str:
        """The question in one sentence."""
        # The question lists the channels itself if it asks for one.
        shown = () if Missing.CHANNEL in self.missing else self.columns[:_MOST_LISTED]
        more = f"{len(self.columns) - len(shown)} more" if shown and len(self.columns) > len(shown) else ""
        *others, last = [name for name in (self.times, *(f'"{each}"' for each in shown), more) if name] or [""]
        columns = f"columns {', '.join(others)} and {last}" if others else last and f"column {last}"
        about = ", ".join(each for each in (self.reason, columns) if each)
        questions = ", and ".join(str(need) for need in self.needs)
        return f"{about}: {questions}?" if about else f"{questions}?"

    @property
    def remedy(self) -> str:
        """The instruction to the user, in words that do not depend on the interface."""
        return f"state {', and '.join(_stated(need) for need in self.needs)}"


def _listed(names: Sequence[str]) -> str:
    """Return at most eight names in quotes, and how many there are besides."""
    more = len(names) - _MOST_LISTED
    shown = ", ".join(f'"{each}"' for each in names[:_MOST_LISTED])
    return f"{shown} and {more} more" if more > 0 else shown


def _stated(need: MissingItem) -> str:
    if need.what is Missing.RATE_HZ:
        return "rate_hz, a number" + (", or time, a column" if need.instead else "")
    return f'{need.what.value}, for example "{need.example}"'
