"""The common interface of all sources of samples: live ports, replayed recordings and simulations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, Protocol, Self

from acquisition.block import Block

Kind = Literal["live", "replay", "simulated"]
ClockKind = Literal["nominal", "device", "host"]


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """The description of a source, available before its first sample.

    Parameters
    ----------
    kind : {"live", "replay", "simulated"}
        Kind of the source. It is stored with the data, so that simulated data cannot be mistaken for measurements.
    name : str
        Name of the port, file or scene.
    rate_hz : float
        Samples per second, Hz.
    sigma_m : float or None
        Standard deviation of a single distance, m; None if unknown.
    quantum_m : float or None
        Resolution of a distance, m (one tick of a timer or the last printed digit); None if unknown.
    clock : {"nominal", "device", "host"}
        Origin of the sample times; "nominal" times were not measured: they are row numbers divided by the rate.
    stated_error_m : float or None
        Error of a distance as stated in the recording, m; None if not stated. It may differ from the noise.
    """

    kind: Kind
    name: str
    rate_hz: float
    sigma_m: float | None = None
    quantum_m: float | None = None
    clock: ClockKind = "nominal"
    stated_error_m: float | None = None


class Source(Protocol):
    """An iterable of blocks, used inside a ``with`` statement; the iteration ends when the source ends."""

    @property
    def info(self) -> SourceInfo:
        """The description of the source, available before the first sample."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def __iter__(self) -> Iterator[Block]: ...
