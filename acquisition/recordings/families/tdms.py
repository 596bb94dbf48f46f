"""TDMS: National Instruments' binary waveforms, read by npTDMS.

Rate and start come from the waveform properties (``wf_increment``, ``wf_start_offset``); a channel without them needs
another channel of its group as its times, of numbers or of LabVIEW's time stamps, or a rate from the user.
``wf_samples`` is the length of one written chunk and may be smaller than the number of samples. A start in 1903 or 1904
is LabVIEW's zero of time, not a start time.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.recording import FormatIssue
from acquisition.recordings.sampling.timing import Formula
from acquisition.recordings.tables.format import ColumnFormat
from acquisition.recordings.tables.headings import is_time
from acquisition.recordings.tables.table import Column, Table

_MAGIC = b"TDSm"
_LEAD_IN = 28  # bytes before each segment: mark, contents, version, and the length of the rest
_UNITS = ("unit_string", "NI_UnitDescription", "wf_yunit_string", "Unit")


def _evidence(head: bytes) -> str:
    return 'it begins with the bytes "TDSm"' if head.startswith(_MAGIC) else ""


def _tables(path: str, data: bytes) -> list[Table]:
    from nptdms import TdmsFile
    from nptdms.log import log_manager

    remarks_of_reader = io.StringIO()
    log_manager.console_handler.stream = remarks_of_reader  # else it writes on stderr, which may be closed by now
    try:
        with TdmsFile.open(io.BytesIO(data)) as file:
            groups = file.groups()
            tables = [each for group in groups for each in _of_group(path, group, len(groups) > 1, len(data))]
            title = str(file.properties.get("Title") or file.properties.get("name") or "")
    except FormatError:
        raise
    except Exception as error:
        # npTDMS has no special error for a damaged file; its parser may raise any exception.
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        problem = f"npTDMS cannot read it ({reason[:200]})"
        raise FormatError(path, problem, "check that it was copied whole; export it again") from error
    if not tables:
        raise FormatError(path, "expected channels of numbers, got none", "check that the recording was saved")
    traps = (
        [FormatIssue("truncated_row", "the file ends inside its last segment: what followed is lost")]
        if _cut(data)
        else []
    )
    if not traps:  # else it describes the same
        remarks = dict.fromkeys(line.partition("] ")[2] for line in remarks_of_reader.getvalue().splitlines())
        traps += [FormatIssue("reader_remark", f"npTDMS says: {remark}") for remark in remarks]
    return [replace(each, title=title, traps=(*each.traps, *traps)) for each in tables]


def _cut(data: bytes) -> bool:
    """Return whether the file ends inside a segment; each states its length, or all ones if its writer was stopped."""
    start = 0
    while start < len(data):
        if len(data) - start < _LEAD_IN:
            return True
        big = data[start + 4] & 0x40  # a bit of the contents
        start += _LEAD_IN + struct.unpack_from(">Q" if big else "<Q", data, start + 12)[0]
    return start > len(data)


def _of_group(path: str, group: Any, several: bool, size: int) -> Iterator[Table]:
    channels, columns, clocks, start_time = [], [], [], ""
    for each in group.channels():
        kind = each.dtype
        if kind is None or kind.kind not in "fiuM" or not len(each):
            continue
        if len(each) * kind.itemsize > size:
            problem = f'channel "{each.name}" states {len(each)} numbers, more than the file can hold'
            raise FormatError(path, problem, "check that it was copied whole")
        unit = next((str(each.properties[key]) for key in _UNITS if each.properties.get(key)), "")
        stamps = each[:] if kind.kind == "M" else None
        values = np.asarray(each[:], np.float64) if stamps is None else (stamps - stamps[0]) / np.timedelta64(1, "s")
        channels.append(each)
        columns.append(Column(each.name, unit if stamps is None else "s", values))
        if stamps is not None:
            clocks.append(columns[-1])
            start_time = start_time or _utc(stamps[0])
    times = [*clocks, *(column for column in columns if is_time(column.name) and column not in clocks)]
    for each, column in zip(channels, columns, strict=True):
        if column in times and len(columns) > 1:
            continue
        has_step = "wf_increment" in each.properties
        if has_step and clocks and _number(each.properties["wf_increment"], 0.0) == 1.0:
            has_step = False  # LabVIEW's placeholder
        own_time = times[0] if times and times[0].values.size == column.values.size and column not in times else None
        yield Table(
            (column,),
            times=None if has_step or own_time is None else replace(own_time, unit="s"),
            formula=_formula(each.properties) if has_step else None,
            run=group.name if several else "",
            start_time=_utc(each.properties.get("wf_start_time")) or start_time,
            beside=tuple(columns),
        )


def _formula(properties: Any) -> Formula:
    start, step = (
        _number(properties.get(key), default) for key, default in (("wf_start_offset", 0.0), ("wf_increment", np.nan))
    )
    samples = _number(properties.get("wf_samples"), np.nan)
    return Formula(start, step, int(samples) if 1 < samples < 2**53 else None)


def _number(value: Any, default: float) -> float:
    try:
        return default if value is None else float(value)
    except (TypeError, ValueError):
        return float("nan")


def _utc(value: Any) -> str:
    if not isinstance(value, np.datetime64) or np.isnat(value) or value < np.datetime64("1905-01-01"):
        return ""
    return f"{np.datetime_as_string(value, unit='us')}Z"


FORMAT = ColumnFormat("tdms", "TDMS: National Instruments' binary waveforms (npTDMS)", _evidence, _tables)
