"""Instrument: what the sensor's clock and scale add to every uncertainty, however long the record (Type B)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.errors import TrackError
from pipeline.numerics.estimate import Estimate
from pipeline.track import Track

__all__ = ["U_CRYSTAL", "Instrument"]

U_CRYSTAL = 50e-6 / math.sqrt(3.0)
"""Relative standard uncertainty of a crystal's rate: 50 ppm as the half-width of a rectangle."""
HOST_LIMIT = 500e-6
"""By what share a host's clock may be off, with what steers it: the kernel slews by 500 ppm at most (RFC 5905)."""
CONTRADICTION = 3.0  # standard uncertainties at which the host's clock contradicts the sensor's
HOST_DELAY_S = 0.02
"""Time by which a host's stamps may drift within a record though both clocks are right, s: a USB bridge holds bytes for
up to 16 ms (FTDI AN232B-04), and a host that becomes busy wakes its readers later than before."""


@dataclass(frozen=True, slots=True)
class Instrument:
    """Clock and scale of the sensor.

    Parameters
    ----------
    clock : str
        "nominal", "device" or "host".
    clock_rate : Estimate
        Factor on every frequency: 1 but where the host's clock contradicts the sensor's.
    clock_words : str
        Where the rate comes from, for the effects table.
    clock_refused : bool
        Whether the host's clock contradicts the sensor's by more than either can be off, or could not be compared.
    speed_of_sound_m_per_s : float or None
        That stands in the distances, m/s.
    u_scale : float
        Relative standard uncertainty of the scale from a calibration; 0 where none was made.
    u_offset_m : float
        Of the zero, m.
    """

    clock: str
    clock_rate: Estimate
    clock_words: str
    speed_of_sound_m_per_s: float | None = None
    u_scale: float = 0.0
    u_offset_m: float = 0.0
    clock_refused: bool = False

    @classmethod
    def of(cls, track: Track, *, u_crystal: float = U_CRYSTAL) -> Instrument:
        """Return what a track knows of its sensor.

        Parameters
        ----------
        track : Track
        u_crystal : float
            Relative standard uncertainty of a clock by its crystal's specification.

        Raises
        ------
        TrackError
            If an uncertainty is negative or no number, or a measured rate error has none.

        Notes
        -----
        A clock that nobody compared with another is only known to its crystal's specification. A comparison of the
        sensor's clock with the host's tells two crystals apart and not which of them is right, so it changes nothing
        as long as both can keep their specification. Where it contradicts that by more than three standard
        uncertainties (a ceramic resonator is off by thousands of ppm) the host is the reference: frequencies are
        multiplied by 1 + r, and what remains is the host's own crystal and the comparison's scatter. Where all that the
        clocks drifted apart within the record is less than a host's delays may change (20 ms), nobody can tell a wrong
        clock from a host that became busy: nothing is corrected, and the difference counts as the half-width of a
        rectangle.

        A difference beyond what the sensor's clock may be off and 500 ppm of the host's is none of the clocks': nothing
        is corrected, and the difference counts as the half-width of a rectangle. Where
        readings were held up, a comparison that is left, or none, cannot exclude a clock at its limit: its own
        uncertainty is added, up to that of the limit.

        Examples
        --------
        >>> track = Track.from_arrays([0.0, 0.01], [0.2, 0.2])
        >>> print(Instrument.of(track).clock_rate)
        1.000000 +- 0.000029
        """
        for name, u in (("u_scale", track.u_scale), ("u_offset_m", track.u_offset_m), ("u_crystal", u_crystal)):
            if not (math.isfinite(u) and u >= 0):
                raise TrackError(
                    f"{name} must be finite and not negative, got {u:g}; leave it out where it is not known"
                )
        for name, limit in (("clock_limit", track.clock_limit), ("compared_s", track.compared_s)):
            if limit is not None and not (math.isfinite(limit) and limit >= 0):
                raise TrackError(f"{name} must be finite and not negative, got {limit:g}; leave it out")
        rate, words, refused = _rate(track, u_crystal)
        return cls(track.clock, rate, words, track.speed_of_sound_m_per_s, track.u_scale, track.u_offset_m, refused)


def _rate(track: Track, u_crystal: float) -> tuple[Estimate, str, bool]:
    """Return the factor on every frequency, where it comes from, and whether a comparison was refused for it."""
    spec = f"a crystal's {u_crystal * 1e6:.0f} ppm"
    limit = math.inf if track.clock_limit is None else track.clock_limit + HOST_LIMIT
    if track.rate_error is None:
        return _uncompared(track, u_crystal, limit, spec)
    rate, u = track.rate_error, track.u_rate_error
    if u is None or not (math.isfinite(rate) and math.isfinite(u) and u >= 0):
        raise TrackError(
            f"a rate error needs a finite value and an uncertainty that is not negative, got {rate} and "
            f"{u}; leave both out where the clocks were not compared"
        )
    text = f"the device's clock runs {rate * 1e6:+.0f} ppm against the host's (u {u * 1e6:.0f} ppm)"
    if abs(rate) > limit:
        half = min(abs(rate), 1.0)
        words = (
            f"{text}, and {limit * 1e6:.0f} ppm are all that the two can be apart: nothing is corrected, and "
            f"{half * 1e6:.0f} ppm stand in every frequency's uncertainty as the half-width of a rectangle"
        )
        return Estimate(1.0, math.hypot(u_crystal, half / math.sqrt(3.0))), words, True
    if abs(rate) > CONTRADICTION * math.hypot(u, math.sqrt(2.0) * u_crystal):
        span_s = float(track.t[-1] - track.t[0])
        apart_s = abs(rate) * (span_s if track.compared_s is None else min(track.compared_s, span_s))
        if apart_s < HOST_DELAY_S:
            words = (
                f"{text}, {apart_s * 1e3:.2g} ms in all, which the host's delays may be too: nothing is corrected, and "
                "the difference stands in every frequency's uncertainty"
            )
            return Estimate(1.0, math.hypot(u_crystal, rate / math.sqrt(3.0))), words, False
        words = f"{text}, more than two crystals can differ: frequencies are corrected to the host's"
        return Estimate(1.0 + rate, (1.0 + rate) * math.hypot(u, u_crystal)), words, False
    if track.held_samples:
        u_all = math.hypot(u_crystal, min(u, limit / math.sqrt(3.0), 1.0))
        words = f"{text}, as two crystals may: {u_all * 1e6:.0f} ppm stand in every frequency's uncertainty"
        return Estimate(1.0, u_all), words, False
    words = f"{text}, as two crystals may: {spec} stand in every frequency's uncertainty"
    return Estimate(1.0, u_crystal), words, False


def _uncompared(track: Track, u_crystal: float, limit: float, spec: str) -> tuple[Estimate, str, bool]:
    """Return the same of a clock that was not compared, or could not be: a stall leaves too few stamps in time."""
    if track.clock == "device" and track.held_samples:
        half = min(limit, 1.0)
        words = (
            "too few readings came in time to compare the device's clock with the host's: the "
            f"{half * 1e6:.0f} ppm that they may be apart stand in every frequency's uncertainty as the half-width of "
            "a rectangle"
        )
        return Estimate(1.0, math.hypot(u_crystal, half / math.sqrt(3.0))), words, True
    source = {"nominal": "are row numbers over the nominal rate", "host": "are the host's"}
    times = source.get(track.clock, "were measured by the device")
    return Estimate(1.0, u_crystal), f"times {times}: {spec} stand in every frequency's uncertainty", False
