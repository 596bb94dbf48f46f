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
        A clock that nobody compared with another is as good as its crystal's specification. A comparison of the
        sensor's clock with the host's tells two crystals apart and not which of them is right, so it changes nothing
        as long as both can keep their specification. Where it contradicts that by more than three standard
        uncertainties (a ceramic resonator is off by thousands of ppm) the host is the reference: frequencies are
        multiplied by 1 + r, and what remains is the host's own crystal and the comparison's scatter. Where all that the
        clocks drifted apart within the record is less than a host's delays may change (20 ms), nobody can tell a wrong
        clock from a host that became busy: nothing is corrected, and the difference counts as the half-width of a
        rectangle.

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
        rate, words = _rate(track, u_crystal)
        return cls(track.clock, rate, words, track.speed_of_sound_m_per_s, track.u_scale, track.u_offset_m)


def _rate(track: Track, u_crystal: float) -> tuple[Estimate, str]:
    spec = f"a crystal's {u_crystal * 1e6:.0f} ppm"
    if track.rate_error is None:
        words = {
            "nominal": f"times are row numbers over the nominal rate: {spec} stand in every frequency's uncertainty",
            "host": f"times are the host's: {spec} stand in every frequency's uncertainty",
        }
        return Estimate(1.0, u_crystal), words.get(
            track.clock, f"times were measured by the device: {spec} stand in every frequency's uncertainty"
        )
    u = track.u_rate_error
    if u is None or not (math.isfinite(track.rate_error) and math.isfinite(u) and u >= 0):
        raise TrackError(
            f"a rate error needs a finite value and an uncertainty that is not negative, got {track.rate_error} and "
            f"{u}; leave both out where the clocks were not compared"
        )
    told = f"the device's clock runs {track.rate_error * 1e6:+.0f} ppm against the host's (u {u * 1e6:.0f} ppm)"
    if abs(track.rate_error) > CONTRADICTION * math.hypot(u, math.sqrt(2.0) * u_crystal):
        apart_s = abs(track.rate_error) * float(track.t[-1] - track.t[0])
        if apart_s < HOST_DELAY_S:
            return (
                Estimate(1.0, math.hypot(u_crystal, track.rate_error / math.sqrt(3.0))),
                f"{told}, {apart_s * 1e3:.2g} ms in all, which the host's delays may be too: nothing is corrected, and "
                "the difference stands in every frequency's uncertainty",
            )
        rate = Estimate(1.0 + track.rate_error, (1.0 + track.rate_error) * math.hypot(u, u_crystal))
        return (
            rate,
            f"{told}, more than two crystals can differ: frequencies are corrected to the host's",
        )
    return Estimate(1.0, u_crystal), f"{told}, as two crystals may: {spec} stand in every frequency's uncertainty"
