"""The common interface of everything that delivers samples: a live port, a replayed recording, a simulation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, Protocol, Self

from acquisition.block import Block

__all__ = ["ClockKind", "Kind", "Source", "SourceInfo"]

Kind = Literal["live", "replay", "simulated"]
ClockKind = Literal["nominal", "device", "host"]


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """What is known of a source before its first sample.

    Parameters
    ----------
    kind : {"live", "replay", "simulated"}
        It stays with the data, so that simulated data cannot pass for measured.
    name : str
        Port, file or scene.
    rate_hz : float
        Samples per second, Hz.
    sigma_m : float or None
        Standard deviation of a distance, m, if the source knows it.
    quantum_m : float or None
        Smallest step of a distance, m (a timer's tick or the last printed digit), if known.
    clock : {"nominal", "device", "host"}
        Origin of the sample times; "nominal" times are row numbers divided by the rate, not measured times.
    stated_error_m : float or None
        The error of a distance that the recording states, m. It need not be the noise.
    """

    kind: Kind
    name: str
    rate_hz: float
    sigma_m: float | None = None
    quantum_m: float | None = None
    clock: ClockKind = "nominal"
    stated_error_m: float | None = None


class Source(Protocol):
    """An iterator of blocks inside a ``with``.

    Iteration ends with the source. A fault raises :class:`acquisition.errors.SourceError`; ``None`` is never
    delivered.
    """

    @property
    def info(self) -> SourceInfo:
        """What is known before the first sample."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def __iter__(self) -> Iterator[Block]: ...
