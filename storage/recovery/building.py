"""Build one sensor's run file: write samples and bytes of the log as they arrive, and the header at the end."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from typing import Any

from acquisition.block import Block
from acquisition.live.decoding import SensorChain
from acquisition.recordings.recording import Trap
from storage.recovery.losses import LossCount, end_of
from storage.recovery.recovered import RecoveredRun
from storage.run_file.writing import RunWriter
from storage.schema import plain
from storage.wire_log.notes import Notes
from storage.wire_log.records import LogHeader, SensorEntry
from storage.wire_log.scanning import Damage, LogContents

__all__ = ["SensorRun"]

FIRST_SAMPLES = 1000
"""Number of initial samples that determine the host time of t = 0; later ones would add the sensor's clock error."""


class SensorRun:
    """Builds one sensor's run file.

    Parameters
    ----------
    writer : RunWriter
    contents : LogContents
        The log.
    sensor : SensorEntry
    chain : SensorChain
        The chain that decodes the samples.
    """

    def __init__(self, writer: RunWriter, contents: LogContents, sensor: SensorEntry, chain: SensorChain) -> None:
        self._writer, self._contents, self._sensor, self._chain = writer, contents, sensor, chain
        self._digest = hashlib.sha256()
        self._first_ns: list[int] = []
        self._samples = 0
        self._losses = LossCount(chain.timebase.rate_hz)
        writer.keep([(part.path.name, part.size) for part in contents.parts])

    def take(self, part: int, data: bytes) -> None:
        """Store the log's next bytes."""
        self._digest.update(data)
        self._writer.take(part, data)

    def append(self, block: Block) -> None:
        """Append the next samples."""
        assert block.host_ns is not None
        if (missing := FIRST_SAMPLES - self._samples) > 0:
            pairs = zip(block.t[:missing].tolist(), block.host_ns[:missing].tolist(), strict=True)
            self._first_ns += [host_ns - round(t * 1e9) for t, host_ns in pairs]
        self._samples += len(block)
        self._losses.push(block)
        self._writer.append(block)

    def finish(
        self, header: LogHeader, notes: Notes, reads: int, last_ns: int, extra: Mapping[str, Any]
    ) -> RecoveredRun:
        """Write the header and finish the file.

        Parameters
        ----------
        header : LogHeader
        notes : Notes
            Marks and events of the log.
        reads : int
            Number of reads of the sensor's port.
        last_ns : int
            Host time of the log's last record, ns.
        extra : mapping
            Further entries of the provenance.
        """
        decoding = self._chain.report()
        faults, damage = decoding["faults"], self._contents.damage
        end_ns = end_of(notes.events(), [last_ns], header.mono_ns)
        losses = self._losses.losses(notes.events(self._sensor.channel), header.mono_ns, end_ns)
        # A host time may be late but never early, so the earliest estimate is the best.
        origin = min(self._first_ns, default=header.mono_ns)
        self._writer.finish(
            self._chain.info(self._sensor.port, header.kind),
            scene=header.scene,
            title=header.title,
            traps=(*_traps(damage), *losses.traps()),
            malformed_rows=sum(count for name, count in faults.items() if not name.endswith("bytes")),
            format="wire",
            provenance={
                "start_time": header.utc(origin),
                "clock_map": {"mono_ns": header.mono_ns, "unix_ns": header.unix_ns, "t0_mono_ns": origin},
                "recorded_with": header.version,
                "sensor": plain(self._sensor),
                "reads": reads,
                "log": {
                    "name": self._contents.path.name,
                    "sha256": self._digest.hexdigest(),
                    **dataclasses.asdict(damage),
                },
                **notes.provenance(origin),
                "decoding": decoding,
                "losses": dataclasses.asdict(losses),
                **extra,
            },
        )
        return RecoveredRun(self._sensor, self._writer.path, self._samples, faults, decoding, losses)


def _traps(damage: Damage) -> tuple[Trap, ...]:
    traps = []
    if not damage.intact:
        traps.append(Trap("damaged_log", f"The wire log is damaged: {damage.describe()}.", max(1, damage.lost)))
    if not damage.ended:
        traps.append(Trap("cut_short", "The recording was cut short; everything in its log is here."))
    return tuple(traps)
