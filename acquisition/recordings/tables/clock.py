"""Times of day in cells."""

from __future__ import annotations

import re

CLOCK = re.compile(
    r"(?P<date>\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ,]*)?"
    r"(?:(?P<h>\d{1,2}):(?P<m>\d\d)(?::(?P<s>\d\d(?:[.,]\d{1,9})?))?|(?P<m2>\d{1,2}):(?P<s2>\d\d[.,]\d{1,9}))"
    r"\s*(?P<half>[aApP]\.?[mM]\.?)?(?:Z|[+-]\d\d:?\d\d)?",
    re.ASCII,
)


def clock_s(cell: str) -> tuple[str, float, int] | None:
    """Return the printed date, the second of the day and the number of decimals; None for any other text.

    >>> clock_s("10:04:59.812"), clock_s("01/08/2024 1:00:36 pm"), clock_s("0.5")
    (('', 36299.812, 3), ('01/08/2024', 46836.0, 0), None)
    """
    match = CLOCK.fullmatch(cell)
    if match is None:
        return None
    hour = int(match["h"] or 0)
    hour = hour % 12 + 12 * (match["half"][0] in "pP") if match["half"] else hour
    seconds = (match["s"] or match["s2"] or "0").replace(",", ".")
    decimals = len(seconds.partition(".")[2])
    at = hour * 3600 + int(match["m"] or match["m2"]) * 60 + float(seconds)
    return (match["date"] or "").strip(" ,T"), round(at, decimals), decimals
