"""Misfits: the uncertainties that a check adds to the estimates."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.registry.quantities import check_input


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """Uncertainties of the estimates because the model of the fit does not describe the record.

    Parameters
    ----------
    name : str
        Name of the input in every budget, one of :data:`pipeline.registry.quantities.INPUTS`.
    amplitude_m, offset_m, phase_rad, damping_rate : float
        Standard uncertainties that are added to amplitude, offset, phase and damping rate, in m, m, rad and 1/s.
    clock : float
        Relative standard uncertainty that is added to all quantities measured by the times of the record.

    Raises
    ------
    ValueError
        If the name is not registered.
    """

    name: str
    amplitude_m: float = 0.0
    offset_m: float = 0.0
    phase_rad: float = 0.0
    damping_rate: float = 0.0
    clock: float = 0.0

    def __post_init__(self) -> None:
        check_input(self.name)
