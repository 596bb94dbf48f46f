"""Whose turn it is where a polled sensor gives its temperature to a request of its own."""

from __future__ import annotations

from collections.abc import Callable

from acquisition.errors import SensorError

__all__ = ["OPTIONS", "Cycle", "PolledEncoder"]

OPTIONS = {"temperature_every": "ask for the temperature after so many distances; 0 never does"}
"""What a family with such a sensor takes."""


class Cycle:
    """So many distances, then a temperature, and again; a lost reply starts it anew with a distance.

    It moves by replies and flushes alone, so that the same bytes replayed give the same turns.

    Parameters
    ----------
    ask_distance, ask_temperature : bytes
        The requests.
    temperature_every : int
        Distances between two temperatures; 0 for no temperature at all.

    Raises
    ------
    SensorError
        If it is no whole number from 0.
    """

    def __init__(self, ask_distance: bytes, ask_temperature: bytes, temperature_every: int) -> None:
        if not str(temperature_every).isdecimal():
            raise SensorError(
                f"temperature_every must be a whole number of distances from 0, got {temperature_every!r}"
            )
        self.ask_distance, self.ask_temperature = ask_distance, ask_temperature
        self._every = int(temperature_every)
        self._distances = 0

    @property
    def wants_temperature(self) -> bool:
        """Whether the next request is for the temperature."""
        return 0 < self._every <= self._distances

    @property
    def request(self) -> bytes:
        """What to send next."""
        return self.ask_temperature if self.wants_temperature else self.ask_distance

    def answered(self, *, temperature: bool) -> None:
        """Take note of a reply."""
        self._distances = 0 if temperature else self._distances + 1

    def restart(self) -> None:
        """Begin again with distances: a sensor that gives no temperature still gives those."""
        self._distances = 0


class PolledEncoder:
    """Writes the replies of such a sensor.

    Parameters
    ----------
    cycle : Cycle
        As the decoder's.
    distance_reply, temperature_reply : callable
        From m and degC, which may be NaN, to the bytes of a reply.
    """

    def __init__(
        self, cycle: Cycle, distance_reply: Callable[[float], bytes], temperature_reply: Callable[[float], bytes]
    ) -> None:
        self._cycle = cycle
        self._distance_reply, self._temperature_reply = distance_reply, temperature_reply

    def encode(self, *, distance_m: float, temperature_c: float, **_: float) -> bytes:
        """Return the reply to the request whose turn it is."""
        request = self._cycle.request
        self._cycle.answered(temperature=self._cycle.wants_temperature)
        return self.reply(request, distance_m=distance_m, temperature_c=temperature_c)

    def reply(self, request: bytes, *, distance_m: float, temperature_c: float) -> bytes:
        """Return the reply to a request, nothing to what is none."""
        if request == self._cycle.ask_distance:
            return self._distance_reply(distance_m)
        return self._temperature_reply(temperature_c) if request == self._cycle.ask_temperature else b""
