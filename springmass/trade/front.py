"""The Pareto front of cost and error: what nothing else beats in both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["EQUAL", "Point", "front"]

EQUAL = 0.01


@dataclass(frozen=True, slots=True)
class Point:
    """One way to do something.

    Parameters
    ----------
    name : str
    cost : float
        Time, s.
    error : float
        In whatever unit all points share.
    group : str
        What the drawing tells apart by colour: "tier" or "reference", say.
    """

    name: str
    cost: float
    error: float
    group: str = ""


def front(points: Sequence[Point]) -> list[Point]:
    """Return the points that none beats in both, cheapest first; a cheaper one beats an equal one.

    Parameters
    ----------
    points : sequence of Point
        Errors that differ by less than :data:`EQUAL` of themselves are equal.

    Examples
    --------
    >>> [point.name for point in front([Point("b", 2, 1), Point("a", 1, 3), Point("c", 3, 2), Point("d", 4, 0.999)])]
    ['a', 'b']
    """
    kept: list[Point] = []
    for point in sorted(points, key=lambda each: (each.cost, each.error)):
        if not kept or point.error * (1.0 + EQUAL) < kept[-1].error:
            kept.append(point)
    return kept
