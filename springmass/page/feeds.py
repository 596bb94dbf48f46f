"""Sources of the page's samples: a growing log, or a complete run."""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from acquisition.events import Calibrated, RunEnded, StoredEvent, Triggered, Zeroed, recorded_events
from acquisition.live.calibration import Calibration
from acquisition.live.decoding import SensorChain
from springmass.loading.loaded import Loaded
from springmass.page.view import SensorSamples, View
from springmass.report.recorded import named_event
from storage.errors import NotALog, StorageError
from storage.schema import plain
from storage.wire_log.records import Record, RecordKind, event_of
from storage.wire_log.scanning import read_log
from storage.wire_log.survey import Part
from storage.wire_log.wire_samples import LogDecoder, chain_of

AT_ONCE = 10_000
"""Maximum number of records per call: 100 s of a sensor at 100 Hz. A long log is therefore shown piece by piece."""
NOT_LISTED = (Calibrated, RunEnded)
"""Events that the page does not list, because a person at the bench need not read them."""


class LogFeed:
    """Fills a view from a log that is being written; raises NotALog if the file is not a wire log."""

    def __init__(self, path: Path) -> None:
        self._log = read_log(path)
        header = self._log.header
        if header is None:
            raise NotALog(path, "expected a wire log with a header, got none", "name the log of a recording")
        self._scan = self._log.scan()
        self._sensors = {sensor.channel: sensor for sensor in header.sensors}
        self._series: dict[Part, SensorSamples] = {}
        self._shown = [Part(channel, 1) for channel in self._sensors]
        self._timed: list[Record] = []
        self.view = View(
            "LIVE",
            path.with_suffix(".h5").name,
            header.title,
            0.0,
            [f"{sensor.channel}: {sensor.family}" for sensor in header.sensors],
            simulated=header.kind == "simulated",
            calibration=_calibration(header.sensors[0].calibration),
            scene=header.scene,
            provenance={"sensor": plain(header.sensors[0]), "events": []},
        )
        self._decoder = LogDecoder(self._sensors, self._begin, self._note)
        first = self._decoder.chains[self._shown[0]].family
        timed = first.has_device_time or {"time", "sequence"} & header.sensors[0].options.keys()
        self.view.clock = "device" if timed else "host"
        self.view.rate_hz = self._decoder.chains[self._shown[0]].timebase.rate_hz
        self._take(())

    def poll(self) -> None:
        """Read what was added since the last call; an error that prevents this is shown in the view."""
        if self.view.error or self.view.ended:
            return
        try:
            self._take(islice(self._scan.records(self._log.grow()), AT_ONCE))
        except (StorageError, OSError) as error:
            self.view.error = str(error)
        self._place_marks()
        self.view.ended = self._scan.damage.ended

    def close(self) -> None:
        """Close the log."""
        self._log.close()

    def _take(self, records: Iterable[Record]) -> None:
        for part, block in self._decoder.blocks(records):
            self._series[part].push(block)
        chain = self._decoder.chains[self._shown[0]]
        if self._scan.damage.ended:
            self.view.provenance["decoding"] = chain.report()
        # The kind of clock is unknown until the first reading.
        port = self._sensors[self._shown[0].sensor].port
        self.view.info = chain.info(port, "simulated" if self.view.simulated else "live")

    def _begin(self, part: Part) -> SensorChain:
        """Begin a part: the view then shows the sensor's samples from the first one of this part on."""
        number = list(self._sensors).index(part.sensor)
        self._shown[number] = part
        if part.number == 1:
            self._series[part] = self.view.series[number]
        else:
            self._series[part] = SensorSamples()
            series = [self._series[shown] for shown in self._shown]
            self.view = replace(self.view, series=series, session=secrets.token_hex(8))
        return chain_of(self._sensors[part.sensor])

    def _note(self, record: Record, event: StoredEvent | None) -> None:
        typed = None if event is None else event.typed
        if record.kind is RecordKind.MARK or isinstance(typed, Triggered):
            self._timed.append(record)
        if isinstance(typed, Zeroed):
            self.view.zero = typed.facts
        if event is not None and not isinstance(typed, NOT_LISTED):
            self.view.notes.append(named_event(event))

    def _place_marks(self) -> None:
        """Give marks and triggers the times that the run file will give them, which the first samples improve."""
        origin_ns = self.view.series[0].origin.ns
        if origin_ns is None:
            return
        timed = [((record.mono_ns - origin_ns) * 1e-9, record) for record in self._timed]
        self.view.marks = [(t_s, record.text()) for t_s, record in timed if record.kind is RecordKind.MARK]
        events = [
            {"t_s": t_s, **plain(event_of(record.payload))} for t_s, record in timed if record.kind is RecordKind.EVENT
        ]
        self.view.provenance = {**self.view.provenance, "events": events}


def _calibration(numbers: Mapping[str, Any] | None) -> str:
    """Return how the first sensor's distances are calibrated, in words."""
    calibration = Calibration.from_mapping(numbers or {})
    if not (calibration.u_scale or calibration.u_offset_m):
        return "not calibrated"
    offset = f"offset {calibration.offset_m * 1e3:.1f} mm"
    return f"by ruler: {offset}, scale {calibration.scale:.4f}" if calibration.u_scale else f"by ruler: {offset}"


def view_of(loaded: Loaded) -> View:
    """Return a view of a saved run."""
    view = View(
        "REPLAY",
        loaded.path.name,
        loaded.title,
        loaded.info.rate_hz,
        [loaded.channel or loaded.format],
        loaded.samples.quantity,
        loaded.samples.unit,
        loaded.info.clock,
        simulated=loaded.info.kind == "simulated",
        loaded=loaded,
        ended=True,
    )
    view.series[0].push(loaded.samples)
    view.marks += [(float(mark["t_s"]), str(mark["text"])) for mark in loaded.provenance.get("marks", ())]
    view.notes += [trap.message for trap in loaded.traps]
    for _, event in recorded_events(loaded.provenance):
        if isinstance(typed := event.typed, Zeroed):
            view.zero = typed.facts
    return view
