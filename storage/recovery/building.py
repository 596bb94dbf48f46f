"""Build the run file of one part: write its samples as they are decoded, and the log and the header at the end."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

from acquisition.block import Block
from acquisition.live.decoding import SensorChain
from acquisition.recordings.recording import Trap
from storage.recovery.losses import LossCount
from storage.recovery.report import RecoveredRun
from storage.run_file.writing import RunWriter
from storage.schema import plain
from storage.wire_log.notes import Survey
from storage.wire_log.parts import Part
from storage.wire_log.records import SensorEntry
from storage.wire_log.scanning import Damage, LogContents
from storage.wire_log.wire_samples import Origin


class RunBuilder:
    """Builds the run file of one part of a sensor's data."""

    def __init__(self, writer: RunWriter, part: Part, sensor: SensorEntry, chain: SensorChain) -> None:
        self._writer, self._part, self._sensor, self._chain = writer, part, sensor, chain
        self._origin = Origin()
        self._samples = 0
        self._losses = LossCount(chain.timebase.rate_hz)

    def append(self, block: Block) -> None:
        """Append the next samples."""
        self._origin.push(block)
        self._samples += len(block)
        self._losses.push(block)
        self._writer.append(block)

    def finish(self, log: LogContents, survey: Survey, reads: int, extra: Mapping[str, Any]) -> RecoveredRun:
        """Write the log and the header; ``extra`` are further entries of the provenance."""
        header, parts = survey.header, survey.parts_of(self._part.sensor)
        decoding, damage = self._chain.report(), log.damage
        begin_ns = survey.spans[self._part].begin_ns
        last = self._part == parts[-1]
        end_ns = survey.end_ns if last else survey.spans[parts[self._part.number]].begin_ns
        losses = self._losses.losses(survey.events_of(self._part), begin_ns, end_ns, last=last)
        origin = begin_ns if self._origin.ns is None else self._origin.ns
        self._writer.keep([(log.path.name, log.size, log.pieces())])
        self._writer.finish(
            self._chain.info(self._sensor.port, header.kind),
            scene=header.scene,
            title=header.title,
            traps=(*_traps(damage), *losses.traps()),
            malformed_rows=sum(count for name, count in decoding["faults"].items() if not name.endswith("bytes")),
            format="wire",
            provenance={
                "start_time": header.utc(origin),
                "clock_map": {"mono_ns": header.mono_ns, "unix_ns": header.unix_ns, "t0_mono_ns": origin},
                "recorded_with": header.version,
                "sensor": plain(self._sensor),
                "part": {"number": self._part.number, "of": len(parts)},
                "reads": reads,
                "log": {"name": log.path.name, **dataclasses.asdict(damage)},
                **survey.provenance(origin),
                "decoding": decoding,
                "losses": dataclasses.asdict(losses),
                **extra,
            },
        )
        return RecoveredRun(self._sensor, self._part.number, self._writer.path, self._samples, decoding, losses)


def _traps(damage: Damage) -> Iterator[Trap]:
    if not damage.intact:
        yield Trap("damaged_log", f"The wire log is damaged: {damage.describe()}.", max(1, damage.lost))
    if not damage.ended:
        yield Trap("cut_short", "The recording was cut short; everything in its log is here.")
