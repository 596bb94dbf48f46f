"""Blocks of consecutive samples, and the description of what delivers them: a port, a recording or a simulation."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

B1 = NDArray[np.bool_]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
U8 = NDArray[np.uint8]

UNITS = {
    "length": "m",
    "angle": "rad",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "acceleration": "m/s^2",
    "force": "N",
    "voltage": "V",
    "number": "1",
}
"""SI unit of each quantity that a source can measure; a test compares `pipeline.units.RECORDED_UNITS` with it."""


class Flag(enum.IntFlag):
    """Reasons to distrust a sample; the flags of a sample are the sum of these bits.

    The values are part of the run file (CF ``flag_masks``) and must never change.
    """

    MISSING = 1
    FALSE_ECHO = 2
    CLIPPED = 4
    DUPLICATE_TIME = 8
    NON_MONOTONIC_TIME = 16
    MALFORMED = 32
    GAP_BEFORE = 64


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Consecutive samples of one rangefinder.

    Parameters
    ----------
    first : int
        Index of the first sample of the block within the run.
    t : (n,) float64, s
        Sensor time since the start of the run.
    distance : (n,) float64, m
        Distance from the sensor, or another quantity; NaN if it was not measured.
    flags : (n,) uint8
        Sums of :class:`Flag` bits.
    host_ns : (n,) int64, ns, or None
        Host time at which each sample arrived; None for a recording, which has no host times.
    velocity : (n,) float64, m/s, or None
        Velocity as stated in the recording; NaN for samples without a velocity.
    quantity, unit : str
        Quantity and unit of ``distance``, from :data:`UNITS`. The velocity is in this unit per second.

    Raises
    ------
    ValueError
        If the quantity is not in :data:`UNITS`, or the unit is not the SI unit of the quantity.
    """

    first: int
    t: F8
    distance: F8
    flags: U8
    host_ns: I8 | None = None
    velocity: F8 | None = None
    quantity: str = "length"
    unit: str = "m"

    def __post_init__(self) -> None:
        if UNITS.get(self.quantity) != self.unit:
            allowed = ", ".join(f"{quantity} in {unit}" for quantity, unit in UNITS.items())
            raise ValueError(f"expected one of {allowed}, got {self.quantity} in {self.unit}; convert to SI first")

    def __len__(self) -> int:
        return int(self.t.size)

    def __getitem__(self, rows: slice) -> Block:
        """Return the samples of a slice with step 1, as a block whose arrays are views."""
        start, stop, step = rows.indices(len(self))
        if step != 1:
            raise ValueError(f"expected a slice of step 1, got step {step}; index the arrays of the block instead")
        cut = slice(start, stop)
        host_ns = None if self.host_ns is None else self.host_ns[cut]
        velocity = None if self.velocity is None else self.velocity[cut]
        t, distance, flags = self.t[cut], self.distance[cut], self.flags[cut]
        return Block(self.first + start, t, distance, flags, host_ns, velocity, self.quantity, self.unit)


def concatenate(blocks: Iterable[Block]) -> Block:
    """Join blocks of one quantity, in the given order; the result is empty if there are no blocks.

    A column that only some of the blocks have is filled up in the others: velocities with NaN, host times with -1.
    """
    parts = list(blocks)
    if not parts:
        empty = np.empty(0)
        return Block(0, empty, empty, np.empty(0, np.uint8))
    if len(quantities := {b.quantity for b in parts}) > 1:
        raise ValueError(f"expected blocks of one quantity, got {', '.join(sorted(quantities))}; join them separately")
    host = velocity = None
    if any(b.host_ns is not None for b in parts):
        host = np.concatenate([b.host_ns if b.host_ns is not None else np.full(len(b), -1) for b in parts])
    if any(b.velocity is not None for b in parts):
        velocity = np.concatenate([b.velocity if b.velocity is not None else np.full(len(b), np.nan) for b in parts])
    return Block(
        parts[0].first,
        np.concatenate([b.t for b in parts]),
        np.concatenate([b.distance for b in parts]),
        np.concatenate([b.flags for b in parts]),
        host,
        velocity,
        parts[0].quantity,
        parts[0].unit,
    )


SourceKind = Literal["live", "replay", "simulated"]
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
    u_rate : float or None
        Relative standard uncertainty of the rate of times that follow from arrivals, besides that of their clock.
    misplaced_s : float or None
        Time by which samples are early or late up to the next lost one if the place of one is wrong, s.
    """

    kind: SourceKind
    name: str
    rate_hz: float
    sigma_m: float | None = None
    quantum_m: float | None = None
    clock: ClockKind = "nominal"
    stated_error_m: float | None = None
    u_rate: float | None = None
    misplaced_s: float | None = None
