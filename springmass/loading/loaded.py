"""A recording that was read, with its scene, origin and digest, and its track, which ``--from`` and ``--to`` cut."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.block import Block, SourceInfo
from acquisition.decoders.sensor import RESONATOR_PPM
from acquisition.events import Triggered, recorded_events
from acquisition.live.calibration import SPEED_OF_SOUND_M_PER_S, Calibration
from acquisition.live.clock_fit import facts_of, fit_clock
from acquisition.recordings.recording import FormatIssue, Original, Recording
from acquisition.regular_file import open_regular
from pipeline.track import Track
from springmass.errors import UNREADABLE, ProgramError
from springmass.loading.options import AnalysisOptions
from storage.run_file.reading import open_run

UNVERIFIED = "unverified"
MOTION_SENSOR = "motion-sensor"  # family that assumes a fixed speed of sound
LINE_PROTOCOL = "line-protocol"  # family that sends echo times
COMPARED = {"rate_error_ppm", "u_rate_error_ppm", "span_s", "held_readings", "longest_stall_s"}  # of two clocks


@dataclass(frozen=True, eq=False)
class Loaded:
    """One input that has been read: its recording, and what is known of it besides.

    ``format`` is the family that read it, "run" for a run file, "wire" for a wire log, "memory" for arrays; the format
    of the recording is the family of what is inside a run file. ``scene`` comes from the notes next to the file, or
    else from inside a run file. ``sha256`` is the digest of the file's bytes, empty for arrays and for an empty wire
    log. With ``originals_inside`` the original files are inside the run file, and are read when they are needed.
    ``reading`` are the options with which the file was read, by name. The track has the samples from ``from_s`` to
    ``to_s``; ``clock_ppm`` is the stated rate error of the sensor's clock.
    """

    recording: Recording
    format: str
    scene: Mapping[str, Any] | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    sha256: str = ""
    originals_inside: bool = False
    reading: Mapping[str, Any] = field(default_factory=dict)
    from_s: float = -math.inf
    to_s: float = math.inf
    clock_ppm: float | None = None

    @property
    def path(self) -> Path:
        """The path of the file; that of the current folder for arrays."""
        return Path(self.recording.path)

    @property
    def info(self) -> SourceInfo:
        """Rate, quantum, clock and kind."""
        return self.recording.info

    @property
    def channel(self) -> str:
        """The quantity or column whose values are the samples."""
        return self.recording.channel

    @property
    def title(self) -> str:
        """The title line of the file; empty without one."""
        return self.recording.title

    @property
    def traps(self) -> tuple[FormatIssue, ...]:
        """The remarks of the reader."""
        return self.recording.traps

    @property
    def samples(self) -> Block:
        """All samples as they were recorded."""
        return self.recording.samples

    @cached_property
    def track(self) -> Track:
        """The samples that the pipeline analyses."""
        track = _between(_track_of(self.recording, self.provenance), self.from_s, self.to_s)
        if self.clock_ppm is None:
            return track
        bound = 1e-6 * self.clock_ppm
        return replace(track, clock_limit=bound, u_clock=bound / math.sqrt(3.0))

    @property
    def source(self) -> str:
        """The path as it was given; empty for arrays, which have none."""
        return "" if self.path == Path() else str(self.path)

    @property
    def originals(self) -> tuple[Original, ...]:
        """Exact copies of the original files; those inside a run file are checked as they are read."""
        if not self.originals_inside:
            return self.recording.originals
        if sha256_of(self.path) != self.sha256:
            raise ProgramError(f"{self.path}: the file has changed since it was loaded", "load it again", UNREADABLE)
        with open_run(self.path, unverified=any(trap.code == UNVERIFIED for trap in self.traps)) as run:
            return run.originals()

    def within(self, options: AnalysisOptions) -> Loaded:
        """Return the input with the chosen seconds of its track, and with the stated error of its clock."""
        low = -math.inf if options.from_s is None else options.from_s
        high = math.inf if options.to_s is None else options.to_s
        ppm = self.clock_ppm if options.clock_ppm is None else options.clock_ppm
        part = replace(self, from_s=max(low, self.from_s), to_s=min(high, self.to_s), clock_ppm=ppm)
        if (options.from_s, options.to_s) != (None, None) and not len(part.track):
            times = self.track.t[np.isfinite(self.track.t)]
            span = f"spans {times.min():g} to {times.max():g} s" if times.size else "holds no sample"
            where = self.source or "arrays"
            raise ProgramError(f"{where}: no sample lies between {low:g} and {high:g} s", f"the record {span}")
        return part


def sha256_of(path: Path) -> str:
    """Return the digest of a file's bytes."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _track_of(recording: Recording, provenance: Mapping[str, Any]) -> Track:
    """Return the samples of a recording as a track for the pipeline.

    The noise stated by a source is passed on. The error column of a file is not noise and is passed on separately.
    """
    samples, info = recording.samples, recording.info
    # But for its name, a track states what a source states under the same names.
    of_source = {**asdict(info), "u_rate": info.u_rate or 0.0, "misplaced_s": info.misplaced_s or 0.0}
    del of_source["name"]
    moments = [t_s for t_s, event in recorded_events(provenance) if isinstance(event.typed, Triggered)]
    return Track(
        t=samples.t,
        y=samples.distance,
        flags=samples.flags,
        **of_source,
        velocity=samples.velocity,
        unit=samples.unit,
        trigger_s=float(moments[0]) if moments else None,  # when the bob left its rest position
        **_clock_comparison(samples, info, provenance),
        **_scale(recording.format, provenance.get("sensor") or {}),
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
        return {"speed_of_sound_m_per_s": SPEED_OF_SOUND_M_PER_S}
    if not sensor:
        return {}
    calibration = Calibration.from_mapping(sensor.get("calibration", {}))
    scale = {"sonic": True, "u_scale": calibration.u_scale, "u_offset_m": calibration.u_offset_m}
    # Families that send distances instead of echo times have applied an unknown speed of sound.
    if sensor.get("family") == LINE_PROTOCOL or sensor.get("options", {}).get("unit") == "us":
        scale["speed_of_sound_m_per_s"] = calibration.speed_of_sound_m_per_s
    return scale


def _between(track: Track, low_s: float, high_s: float) -> Track:
    """Return the samples between two times, both included; all samples if neither time is finite."""
    if math.isinf(low_s) and math.isinf(high_s):
        return track
    keep = (track.t >= low_s) & (track.t <= high_s)
    velocity = None if track.velocity is None else track.velocity[keep]
    return replace(track, t=track.t[keep], y=track.y[keep], flags=track.flags[keep], velocity=velocity)
