"""Polled sensors that reply in checksummed frames of fixed size, such as the URM37 and the SEN0149."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from acquisition.decoders.cycle import Cycle, PolledEncoder
from acquisition.decoders.framed import FramedDecoder
from acquisition.decoders.sum_frames import SumFrames, with_sum
from acquisition.readings import NAN, Reading

__all__ = ["ReplyDecoder", "ReplyForm"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplyForm:
    """The form of the replies of a family: a head, a value of two bytes (high byte first) and a sum.

    Parameters
    ----------
    distance_head, temperature_head : bytes
        Bytes before the value, as the encoder writes them; the last byte is the command.
    ask_distance, ask_temperature : bytes
        Bytes of the two requests.
    plausible : callable
        Returns whether the sensor can send a frame whose sum is correct.
    metres, celsius : callable
        Convert a value to m and degC; a value that means no measurement gives NaN.
    distance_code, temperature_code : callable
        Convert m and degC to a value; the argument may be NaN or out of range.
    """

    distance_head: bytes
    temperature_head: bytes
    ask_distance: bytes
    ask_temperature: bytes
    plausible: Callable[[bytes], bool]
    metres: Callable[[int], float]
    celsius: Callable[[int], float]
    distance_code: Callable[[float], int]
    temperature_code: Callable[[float], int]

    def encoder(self, temperature_every: int = 0) -> PolledEncoder:
        """Return an encoder for the simulated sensor."""
        return PolledEncoder(
            Cycle(self.ask_distance, self.ask_temperature, temperature_every),
            lambda distance_m: with_sum(self.distance_head + self.distance_code(distance_m).to_bytes(2, "big")),
            lambda celsius: with_sum(self.temperature_head + self.temperature_code(celsius).to_bytes(2, "big")),
        )


class ReplyDecoder(FramedDecoder):
    """Decodes the replies of a :class:`ReplyForm`; a temperature is added to the next distance reading.

    Parameters
    ----------
    form : ReplyForm
    temperature_every : int
        Number of distances between two temperatures; 0 for no temperatures.
    """

    def __init__(self, form: ReplyForm, temperature_every: int = 0) -> None:
        head = len(form.distance_head)
        starts = bytes({form.distance_head[0], form.temperature_head[0]})
        super().__init__(SumFrames(head + 3, starts, form.plausible))
        self._form = form
        self._command_at = head - 1
        self._cycle = Cycle(form.ask_distance, form.ask_temperature, temperature_every)
        self._celsius = NAN

    @property
    def request(self) -> bytes:
        """The next request."""
        return self._cycle.request

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return the reading of a distance reply; keep a temperature for the next reading."""
        at = self._command_at
        value = frame[at + 1] << 8 | frame[at + 2]
        is_temperature = frame[at] == self._form.temperature_head[-1]
        self._cycle.answered(temperature=is_temperature)
        celsius, self._celsius = self._celsius, self._form.celsius(value) if is_temperature else NAN
        if is_temperature:
            return None
        return Reading(host_ns, distance_m=self._form.metres(value), temperature_c=celsius)

    def flush(self) -> None:
        """Discard an incomplete reply; the next request is for a distance."""
        super().flush()
        self._cycle.restart()
