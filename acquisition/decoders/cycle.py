"""Choose the next request to a polled sensor that needs separate requests for distance and temperature."""

from __future__ import annotations

from collections.abc import Callable

from acquisition.errors import SensorError

__all__ = ["OPTIONS", "Cycle", "PolledEncoder"]

OPTIONS = {"temperature_every": "number of distances between two temperatures; 0: no temperatures"}
"""The decoder options of a family whose sensors need separate requests for the temperature."""


class Cycle:
    """A cycle of several distance requests and one temperature request; a lost reply restarts it with a distance.

    Only replies and flushes change its state, so replayed bytes give the same cycle as in the recording.

    Parameters
    ----------
    ask_distance, ask_temperature : bytes
        Bytes of the two requests.
    temperature_every : int
        Number of distances between two temperatures; 0 for no temperatures.

    Raises
    ------
    SensorError
        If ``temperature_every`` is not a whole number of at least 0.
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
        """The next request."""
        return self.ask_temperature if self.wants_temperature else self.ask_distance

    def answered(self, *, temperature: bool) -> None:
        """Advance after a reply."""
        self._distances = 0 if temperature else self._distances + 1

    def restart(self) -> None:
        """Restart the cycle with distances, because a sensor that sends no temperatures still sends distances."""
        self._distances = 0


class PolledEncoder:
    """Encodes the replies of a polled sensor with separate requests for the temperature.

    Parameters
    ----------
    cycle : Cycle
        Cycle with the same parameters as that of the decoder.
    distance_reply, temperature_reply : callable
        Convert a distance in m and a temperature in degC, either of which may be NaN, to the bytes of a reply.
    """

    def __init__(
        self, cycle: Cycle, distance_reply: Callable[[float], bytes], temperature_reply: Callable[[float], bytes]
    ) -> None:
        self._cycle = cycle
        self._distance_reply, self._temperature_reply = distance_reply, temperature_reply

    def encode(self, *, distance_m: float, temperature_c: float, **_: float) -> bytes:
        """Return the reply to the next request of the cycle."""
        request = self._cycle.request
        self._cycle.answered(temperature=self._cycle.wants_temperature)
        return self.reply(request, distance_m=distance_m, temperature_c=temperature_c)

    def reply(self, request: bytes, *, distance_m: float, temperature_c: float) -> bytes:
        """Return the reply to a request; it is empty for an unknown request."""
        if request == self._cycle.ask_distance:
            return self._distance_reply(distance_m)
        return self._temperature_reply(temperature_c) if request == self._cycle.ask_temperature else b""
