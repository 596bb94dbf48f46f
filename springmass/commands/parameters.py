"""How the parameters of commands are declared, and their numeric types, whose ranges the command line demands."""

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any

from cyclopts import Parameter, Token

from pipeline.bench.law_names import ANY_LAW, law_names


def argument(name: str, words: str, *, required: bool | None = None) -> Parameter:
    """Return the declaration of a positional argument."""
    return Parameter(name=name, metavar=name, help=words, required=required)


def option(metavar: str, words: str, *names: str) -> Parameter:
    """Return the declaration of an option that takes a value."""
    return Parameter(name=names, metavar=metavar, help=words)


def output(metavar: str, words: str) -> Parameter:
    """Return the declaration of the option that names the output."""
    return option(metavar, words, "-o", "--output")


def flag(words: str) -> Parameter:
    """Return the declaration of an option without a value."""
    return Parameter(help=words)


def _where(holds: Callable[[float], bool], demand: str) -> Parameter:
    """Return a validator that rejects infinities, NaN and numbers for which ``holds`` is false, also in a tuple."""

    def validate(_: object, value: Any) -> None:
        for each in value if isinstance(value, tuple) else (value,):
            if each is None:
                continue
            if not math.isfinite(each):
                raise ValueError("It must be a finite number.")
            if not holds(each):
                raise ValueError(f"It {demand}.")

    return Parameter(validator=validate)


def _whole(_: object, tokens: Sequence[Token]) -> int:
    """Convert a whole number; cyclopts itself would cut off a fraction."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError("must be a whole number") from None


def _one_of_the_laws(_: object, name: str | None) -> None:
    if name is not None and name not in (*law_names(), ANY_LAW):
        raise ValueError(f"It must be one of {', '.join((*law_names(), ANY_LAW))}.")


LawName = Annotated[
    str | None,
    Parameter(validator=_one_of_the_laws),
    option("NAME", "damping law, if known: linear, quadratic ...; any: choose from the data"),
]
Finite = Annotated[float, _where(lambda _: True, "")]
Positive = Annotated[float, _where(lambda x: x > 0.0, "must be positive")]
Share = Annotated[float, _where(lambda x: 0.0 <= x <= 1.0, "must lie in 0 to 1")]
ReadingsPerSecond = Annotated[float, _where(lambda x: 1e-3 <= x <= 1e6, "must lie in 0.001 to 1000000")]
PartsPerMillion = Annotated[float, _where(lambda x: 0.0 <= x <= 1e6, "must lie in 0 to 1000000")]
SpeedOfSound = Annotated[float, _where(lambda x: 100.0 < x < 2000.0, "must lie between 100 and 2000 m/s")]
Whole = Annotated[int, Parameter(converter=_whole)]
PositiveCount = Annotated[Whole, _where(lambda x: x >= 1, "must be 1 or more")]
WholeNumber = Annotated[Whole, _where(lambda x: x >= 0, "must be 0 or more")]
TcpPort = Annotated[Whole, _where(lambda x: 0 <= x <= 65535, "must be a port from 0 to 65535")]
