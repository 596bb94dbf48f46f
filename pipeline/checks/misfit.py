"""What a check adds to the uncertainties."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.registry.quantities import check_input

__all__ = ["Misfit"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """What the estimates may be off by, because the model does not hold as the fit takes for granted.

    Parameters
    ----------
    name : str
        Of the input in every budget, one of :data:`pipeline.registry.quantities.INPUTS`.
    amplitude_m, offset_m, phase_rad, damping_rate : float
        Standard uncertainties that it adds to the estimates of these names, m, m, rad, 1/s.
    clock : float
        Relative standard uncertainty that it adds to all that is measured by the record's times.

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
