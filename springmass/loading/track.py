"""Make the track that the pipeline analyses of a recording's samples: times, distances, flags, clock and scale."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from acquisition.block import Block, SourceInfo
from acquisition.decoders.sensor import RESONATOR_PPM
from acquisition.events import Triggered, recorded_events
from acquisition.live.calibration import SPEED_OF_SOUND_M_PER_S, Calibration
from acquisition.live.clock_fit import facts_of, fit_clock
from pipeline.track import Track

MOTION_SENSOR = "motion-sensor"  # family that assumes a fixed speed of sound


LINE_PROTOCOL = "line-protocol"  # family that sends echo times


COMPARED = {"rate_error_ppm", "u_rate_error_ppm", "span_s", "held_readings", "longest_stall_s"}  # of two clocks


def to_track(
    samples: Block, info: SourceInfo, *, recorded_format: str = "", provenance: Mapping[str, Any] | None = None
) -> Track:
    """Return samples as a track for the pipeline.

    The noise stated by a source is passed on. The error column of a file is not noise and is passed on separately.
    """
    facts = provenance or {}
    # But for its name, a track states what a source states under the same names.
    of_source = {**asdict(info), "u_rate": info.u_rate or 0.0}
    del of_source["name"]
    moments = [t_s for t_s, event in recorded_events(facts) if isinstance(event.typed, Triggered)]
    return Track(
        t=samples.t,
        y=samples.distance,
        flags=samples.flags,
        **of_source,
        velocity=samples.velocity,
        unit=samples.unit,
        trigger_s=float(moments[0]) if moments else None,  # when the bob left its rest position
        **_clock_comparison(samples, info, facts),
        **_scale(recorded_format, facts.get("sensor") or {}),
    )


def _clock_comparison(samples: Block, info: SourceInfo, provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return the device clock's rate relative to the host's, if both timestamps exist, and its largest rate error."""
    noted = provenance.get("decoding", {}).get("clock", {})
    if info.clock != "device":
        return {}
    if noted.keys() >= COMPARED:
        comparison = noted  # by the pings, whose times are in no sample; files of earlier versions may lack it
    elif samples.host_ns is not None and (samples.host_ns >= 0).all():
        comparison = facts_of(fit_clock(samples.t, samples.host_ns))
    else:
        return {}
    clock = {
        "clock_limit": 1e-6 * noted.get("limit_ppm", RESONATOR_PPM),
        "held_samples": comparison["held_readings"],
        "longest_stall_s": comparison["longest_stall_s"],
    }
    if comparison["rate_error_ppm"] is None or comparison["u_rate_error_ppm"] is None:
        return clock
    rate, u_rate = comparison["rate_error_ppm"] * 1e-6, comparison["u_rate_error_ppm"] * 1e-6
    return {**clock, "rate_error": rate, "u_rate_error": u_rate, "compared_s": comparison["span_s"]}


def _scale(recorded_format: str, sensor: Mapping[str, Any]) -> dict[str, Any]:
    """Return how distances were calculated: the speed of sound, if it is known, and the calibration's uncertainties."""
    if recorded_format == MOTION_SENSOR:
        return {"sonic": True, "speed_of_sound_m_per_s": SPEED_OF_SOUND_M_PER_S}
    if not sensor:
        return {}
    calibration = Calibration.from_mapping(sensor.get("calibration", {}))
    scale = {"sonic": True, "u_scale": calibration.u_scale, "u_offset_m": calibration.u_offset_m}
    # Families that send distances instead of echo times have applied an unknown speed of sound.
    if sensor.get("family") == LINE_PROTOCOL or sensor.get("options", {}).get("unit") == "us":
        scale["speed_of_sound_m_per_s"] = calibration.speed_of_sound_m_per_s
    return scale


def between(track: Track, low_s: float, high_s: float) -> Track:
    """Return the samples between two times, both included; all samples if neither time is finite."""
    if math.isinf(low_s) and math.isinf(high_s):
        return track
    keep = (track.t >= low_s) & (track.t <= high_s)
    velocity = None if track.velocity is None else track.velocity[keep]
    return replace(track, t=track.t[keep], y=track.y[keep], flags=track.flags[keep], velocity=velocity)
