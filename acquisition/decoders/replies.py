"""Polled sensors that answer in summed frames of one size: what the URM37 and the SEN0149 have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from acquisition.decoders.cycle import Cycle
from acquisition.decoders.rows import NAN, rows
from acquisition.decoders.sum_frames import SumFrames, with_sum
from acquisition.readings import Readings

__all__ = ["ReplyDecoder", "ReplyEncoder", "ReplyForm"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplyForm:
    """How one family of them writes a reply: head, two bytes of value with the high one first, sum.

    Parameters
    ----------
    distance_head, temperature_head : bytes
        All before the value, as the encoder writes it; the last byte is the command.
    ask_distance, ask_temperature : bytes
        The requests.
    plausible : callable
        Whether a frame whose sum is right can be one.
    metres, celsius : callable
        From a value to m and degC, NaN where there is none.
    distance_code, temperature_code : callable
        The way back, from a number that may be NaN or out of range.
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


class ReplyDecoder:
    """Decodes such replies; a temperature goes with the next distance.

    Parameters
    ----------
    form : ReplyForm
    temperature_every : int
        Ask for the temperature after so many distances; 0 never does.
    """

    def __init__(self, form: ReplyForm, temperature_every: int = 0) -> None:
        head = len(form.distance_head)
        starts = bytes({form.distance_head[0], form.temperature_head[0]})
        self._form = form
        self._frames = SumFrames(head + 3, starts, form.plausible)
        self._command_at = head - 1
        self._cycle = Cycle(temperature_every)
        self._celsius = NAN

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of what was no reading."""
        return MappingProxyType(self._frames.faults)

    @property
    def pending(self) -> int:
        """Bytes held until the frame they began is whole."""
        return self._frames.pending

    @property
    def request(self) -> bytes:
        """What to send next."""
        return self._form.ask_temperature if self._cycle.wants_temperature else self._form.ask_distance

    def feed(self, host_ns: int, data: bytes) -> Readings:
        """Return the distances whose replies these bytes complete."""
        form, command, at = self._form, self._form.temperature_head[-1], self._command_at
        distance_m: list[float] = []
        temperature_c: list[float] = []
        for frame in self._frames.split(data):
            value = frame[at + 1] << 8 | frame[at + 2]
            is_temperature = frame[at] == command
            self._cycle.answered(temperature=is_temperature)
            if is_temperature:
                self._celsius = form.celsius(value)
                continue
            distance_m.append(form.metres(value))
            temperature_c.append(self._celsius)
            self._celsius = NAN
        return rows(host_ns, distance_m=distance_m, temperature_c=temperature_c)

    def flush(self) -> None:
        """Forget a half-received reply; the next request is for a distance."""
        self._frames.flush()
        self._cycle.restart()


class ReplyEncoder:
    """Writes such replies.

    Parameters
    ----------
    form : ReplyForm
    temperature_every : int
        As the decoder's.
    """

    def __init__(self, form: ReplyForm, temperature_every: int = 0) -> None:
        self._form = form
        self._cycle = Cycle(temperature_every)

    def encode(self, *, distance_m: float, temperature_c: float, **_: float) -> bytes:
        """Return the reply to the request whose turn it is."""
        temperature = self._cycle.wants_temperature
        self._cycle.answered(temperature=temperature)
        request = self._form.ask_temperature if temperature else self._form.ask_distance
        return self.reply(request, distance_m=distance_m, temperature_c=temperature_c)

    def reply(self, request: bytes, *, distance_m: float, temperature_c: float) -> bytes:
        """Return the reply to a request, nothing to what is none."""
        form = self._form
        if request == form.ask_distance:
            return with_sum(form.distance_head + form.distance_code(distance_m).to_bytes(2, "big"))
        if request == form.ask_temperature:
            return with_sum(form.temperature_head + form.temperature_code(temperature_c).to_bytes(2, "big"))
        return b""
