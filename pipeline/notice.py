"""What a stage found, or why it found nothing, before it is put into words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Severity = Literal["info", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Notice:
    """What a stage found: a code, and its numbers or names as the sentences in ``findings.toml`` call them.

    A number is in SI units, its name ends in the unit, and None means that there is none. Without a severity it is the
    first one of the code.
    """

    code: str
    numbers: Mapping[str, float | str | None] = field(default_factory=dict)
    severity: Severity | None = None


RefusalCode = Literal[
    # No cycles: at rest, at rest but for noise, no line, too few periods, too thin, not periodic, no sinusoid.
    "still",
    "steady",
    "no_line",
    "few_periods",
    "thin",
    "no_period",
    "bent",
    # The equation of motion leaves more than noise, has no minimum, or its best law drives or stops.
    "misfit",
    "no_minimum",
    "driven",
    "no_frequency",
    # The averaged motion: the samples have no minimum, or no period lasts.
    "not_fitted",
    "incoherent",
    # No relaxation, a single exponential, no two modes.
    "no_relaxation",
    "exponential",
    "no_two_modes",
]


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a kind of motion, or a way to fit it, does not describe a recording: a code and its numbers."""

    code: RefusalCode
    numbers: Mapping[str, float | str] = field(default_factory=dict)  # as the sentences in ``findings.toml`` call them

    @property
    def named(self) -> dict[str, float | str]:
        """The numbers, and the code as a name that selects its sentences."""
        return {self.code: "", **self.numbers}
