"""The root of every error that is written for the user; all packages import it, and it imports none of them."""

from __future__ import annotations


class Error(ValueError):
    """Something that the user can change: one line that says where, what is wrong, which value, and what to do.

    ``remedy`` is what to do.

    Examples
    --------
    >>> Error("run.csv: the rate is not stated; add rate_hz=100").remedy
    'add rate_hz=100'
    """

    remedy: str = ""

    def __init__(self, message: str = "") -> None:
        super().__init__(message)
        if not self.remedy:
            self.remedy = message.rpartition("; ")[2].rpartition(": ")[2]
