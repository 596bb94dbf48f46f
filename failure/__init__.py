"""The root of every error that is written for the user; all packages import it, and it imports none of them."""

from __future__ import annotations


class Error(ValueError):
    """Something that the user can change; its text is one line with where, what is wrong, which value, what to do.

    Parameters
    ----------
    problem : str
        What is wrong; without a remedy it also says what is expected.
    remedy : str, optional
        What to do.
    where : str, optional
        The place with the punctuation after it, where ``problem`` does not begin with it.

    Examples
    --------
    >>> error = Error("run.csv: the rate is not stated", "add rate_hz=100")
    >>> str(error), error.remedy
    ('run.csv: the rate is not stated; add rate_hz=100', 'add rate_hz=100')
    """

    between = "; "
    """The punctuation before the remedy."""

    # ``args`` are what ``__new__`` was given. So a copy, also in another process, is made of these and the attributes.
    def __init__(self, problem: str, remedy: str = "", /, *, where: str = "") -> None:
        self.problem, self.remedy, self.where = problem, remedy or problem, where

    def __str__(self) -> str:
        after = "" if self.remedy == self.problem else f"{self.between}{self.remedy}"
        return f"{self.where}{self.problem}{after}"
