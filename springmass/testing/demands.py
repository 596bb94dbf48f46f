"""What every rule demands with."""

from __future__ import annotations


def demand(holds: object, message: str) -> None:
    """Raise an AssertionError, also under ``python -O``, whose message says what to do, unless something holds."""
    if not holds:
        raise AssertionError(message)
