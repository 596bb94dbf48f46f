"""What a reader needs from the user, as data.

A file may leave out what must not be guessed: a unit, a rate, which of several channels. The reader then raises
:class:`acquisition.errors.NeedsAnswer` with a :class:`Question`. It holds everything that can be answered, so that a
program can choose without reading text. How to type the answer depends on who asked, a command or a script, and is
worded there.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["Missing", "Need", "Question", "Times"]


class Missing(StrEnum):
    """What can be missing. The value is the keyword argument of ``open_recording`` that answers it."""

    RUN = "run"
    CHANNEL = "channel"
    TIME = "time"
    RATE_HZ = "rate_hz"
    TIME_UNIT = "time_unit"
    UNIT = "unit"


@dataclass(frozen=True, slots=True)
class Need:
    """One thing that is missing.

    Parameters
    ----------
    what : Missing
    choices : tuple of str
        Everything to choose from: all runs, all channels that may be meant, all units. Empty for a rate, which is any
        positive number.
    example : str or float
        One of the choices; of a rate a round number in Hz without any basis in the file.
    of : str
        The column that a unit is asked of; empty where the file does not name it.
    stated : str
        The unit that the file states and nobody knows; empty where it states none.
    instead : Need or None
        Another answer that makes this one unnecessary: of a rate the column of times.
    """

    what: Missing
    choices: tuple[str, ...]
    example: str | float
    of: str = ""
    stated: str = ""
    instead: Need | None = None

    def __str__(self) -> str:
        """Return the question without its mark: ``which channel of "x", "y"``."""
        listed = ", ".join(f'"{each}"' for each in self.choices)
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
class Times:
    """Where the times of a channel run, in the file's unit.

    Parameters
    ----------
    name : str
    first, last : float
    step : float
        The median of the first steps.
    """

    name: str
    first: float
    last: float
    step: float

    def __str__(self) -> str:
        return f'"{self.name}" ({self.first:.6g} to {self.last:.6g}, {self.step:.3g} apart)'


@dataclass(frozen=True, slots=True)
class Question:
    """Everything that a reader needs before it can read one channel of a file.

    Parameters
    ----------
    path : str
        The file.
    needs : tuple of Need
        At least one, in the order in which they depend on each other: run, channel, rate or time unit, unit. All
        examples together answer the question. Who chooses something else than the example of the first need answers
        that one alone and asks again, because the others are asked of the run and the channel of the examples.
    columns : tuple of str
        The columns of the run, with their units.
    times : Times or str
        Where the times run, or their name alone; empty where there are none.
    reason : str
        Why the question is asked where the columns do not show it, for example an answer that fits nothing.

    Examples
    --------
    >>> unit = Need(Missing.UNIT, ("m", "rad"), "rad", of="theta")
    >>> question = Question("pendulum.csv", (unit,), ("theta",), Times("t", 0.0, 31.2, 0.033))
    >>> question.sentence
    'columns "t" (0 to 31.2, 0.033 apart) and "theta": what is theta\\'s unit?'
    >>> question.examples
    {'unit': 'rad'}
    """

    path: str
    needs: tuple[Need, ...]
    columns: tuple[str, ...] = ()
    times: Times | str = ""
    reason: str = ""

    @property
    def missing(self) -> tuple[Missing, ...]:
        """What is missing."""
        return tuple(need.what for need in self.needs)

    @property
    def examples(self) -> dict[str, str | float]:
        """Keyword arguments of ``open_recording`` that answer everything."""
        return {need.what.value: need.example for need in self.needs}

    @property
    def sentence(self) -> str:
        """The question in one sentence."""
        times = f'"{self.times}"' if isinstance(self.times, str) and self.times else str(self.times)
        *others, last = [*([times] if times else []), *(f'"{each}"' for each in self.columns)] or [""]
        columns = f"columns {', '.join(others)} and {last}" if others else last and f"column {last}"
        about = ", ".join(each for each in (self.reason, columns) if each)
        asked = ", and ".join(str(need) for need in self.needs)
        return f"{about}: {asked}?" if about else f"{asked}?"

    @property
    def remedy(self) -> str:
        """What to do, for whoever shows the question without knowing how the answer is given."""
        return f"state {', and '.join(_stated(need) for need in self.needs)}"


def _stated(need: Need) -> str:
    if need.what is Missing.RATE_HZ:
        return "rate_hz, a number" + (", or time, a column" if need.instead else "")
    return f'{need.what.value}, for example "{need.example}"'
