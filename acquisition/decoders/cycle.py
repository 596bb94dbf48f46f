"""Whose turn it is where a polled sensor gives its temperature to a request of its own."""

from __future__ import annotations

from acquisition.errors import SensorError

__all__ = ["OPTIONS", "Cycle"]

OPTIONS = {"temperature_every": "ask for the temperature after so many distances; 0 never does"}
"""What a family with such a sensor takes."""


class Cycle:
    """So many distances, then a temperature, and again; a lost reply starts it anew with a distance.

    It moves by replies and flushes alone, so that the same bytes replayed give the same turns.

    Parameters
    ----------
    temperature_every : int
        Distances between two temperatures; 0 for no temperature at all.

    Raises
    ------
    SensorError
        If it is no whole number from 0.
    """

    def __init__(self, temperature_every: int) -> None:
        if not str(temperature_every).isdecimal():
            raise SensorError(
                f"temperature_every must be a whole number of distances from 0, got {temperature_every!r}"
            )
        self._every = int(temperature_every)
        self._distances = 0

    @property
    def wants_temperature(self) -> bool:
        """Whether the next request is for the temperature."""
        return 0 < self._every <= self._distances

    def answered(self, *, temperature: bool) -> None:
        """Take note of a reply."""
        self._distances = 0 if temperature else self._distances + 1

    def restart(self) -> None:
        """Begin again with distances: a sensor that gives no temperature still gives those."""
        self._distances = 0
