"""What every rule demands with."""


def demand(holds: object, message: str) -> None:
    """Raise an AssertionError, also under ``python -O``, whose message says what to do, unless something holds."""
    if not holds:
        raise AssertionError(message)
