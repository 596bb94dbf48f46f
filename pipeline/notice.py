"""What a stage found, before it is put into words."""

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
