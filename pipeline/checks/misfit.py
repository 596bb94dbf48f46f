"""Misfits: the uncertainties that a check adds to the estimates."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """Standard uncertainties of the estimates because the model of the fit does not describe the record."""

    name: str  # of the input in every budget
    amplitude_m: float = 0.0
    offset_m: float = 0.0
    phase_rad: float = 0.0
    damping_rate: float = 0.0
    clock: float = 0.0  # relative, of all quantities measured by the times of the record
