"""Columns that one formula gives bit for bit: a reader need not fetch them.

A nominal clock's times are row numbers over a rate, and the quality of a run in which nothing was odd is zero
throughout. The arrays stand in the file all the same, for other tools, and their digests in the header; beside them
the header says the formula, which the writer has held against every value.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.recordings.sampling.nominal import Grid

__all__ = ["Implied", "rule_for", "values_of"]

Rule = Mapping[str, float]
"""``{"value": x}``, or ``{"first": i, "rate_hz": f, "origin_s": t}`` for the times ``t + (i + row) / f``."""


class Implied:
    """The rules that a run's columns keep so far, while the run is written.

    Parameters
    ----------
    rate_hz : float
        The source's rate.
    """

    __slots__ = ("_rate_hz", "rules")

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self.rules: dict[str, Rule | None] = {}

    def see(self, name: str, start: int, values: NDArray[Any]) -> None:
        """Hold the next values of a column, from a row on, against its rule; the first values tell the rule."""
        if name not in self.rules:
            self.rules[name] = rule_for(name, values, self._rate_hz) if start == 0 else None
        rule = self.rules[name]
        if rule is not None and not _same(values_of(rule, start, start + values.size, values.dtype), values):
            self.rules[name] = None

    def kept(self) -> dict[str, Rule]:
        """Return the rules that every value has kept."""
        return {name: rule for name, rule in self.rules.items() if rule is not None}


def rule_for(name: str, values: NDArray[Any], rate_hz: float) -> Rule | None:
    """Return a rule that the first values of a column keep; None where none does."""
    if not values.size or name not in ("time", "quality"):
        return None
    first = values[0].item()
    if name == "quality":
        return {"value": first}
    if not (np.isfinite(first) and np.isfinite(rate_hz) and rate_hz > 0 and abs(first * rate_hz) < 2**53):
        return None
    from_zero = {"first": round(first * rate_hz), "rate_hz": rate_hz, "origin_s": 0.0}
    from_first = {"first": 0, "rate_hz": rate_hz, "origin_s": first}
    return next(
        (rule for rule in (from_zero, from_first) if _same(values_of(rule, 0, values.size, values.dtype), values)), None
    )


def values_of(rule: Rule, start: int, stop: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return the values that a rule gives for rows from ``start`` on.

    Raises
    ------
    KeyError, TypeError
        If the rule is none.

    Examples
    --------
    >>> values_of({"first": 43, "rate_hz": 100.0, "origin_s": 0.0}, 1, 3, np.dtype("<f8"))
    array([0.44, 0.45])
    """
    if "value" in rule:
        return np.full(stop - start, rule["value"], dtype)
    values = np.empty(stop - start, np.float64)
    Grid(rule["rate_hz"], rule["origin_s"]).fill(int(rule["first"]) + start, values)
    return values.astype(dtype, copy=False)


def _same(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Tell whether two arrays of one type are the same, bit for bit."""
    as_bits = f"u{one.dtype.itemsize}"
    return bool((one.view(as_bits) == np.ascontiguousarray(other).view(as_bits)).all())
