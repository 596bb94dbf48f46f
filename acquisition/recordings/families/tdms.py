"""TDMS: National Instruments' binary waveforms, read by npTDMS.

Rate and start come from the waveform properties (``wf_increment``, ``wf_start_offset``); a channel without them needs
another channel of its group as its times, or a rate from the user. ``wf_samples`` is the length of one written chunk
and may be smaller than the number of samples. A start in 1903 or 1904 is LabVIEW's zero of time, not a start time.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from acquisition.errors import FormatError
from acquisition.recordings.tables.contents import Arrays, Channel, Contents, Formula, is_time
from acquisition.recordings.tables.sheet import ColumnFormat

__all__ = ["FORMAT"]

_MAGIC = b"TDSm"
_UNITS = ("unit_string", "NI_UnitDescription", "wf_yunit_string", "Unit")


def _evidence(head: bytes) -> str:
    return 'it begins with the bytes "TDSm"' if head.startswith(_MAGIC) else ""


def _contents(path: str, data: bytes) -> Contents:
    from nptdms import TdmsFile

    try:
        with TdmsFile.open(io.BytesIO(data)) as file:
            groups = file.groups()
            channels = [each for group in groups for each in _channels(path, group, len(groups) > 1, len(data))]
            title = str(file.properties.get("Title") or file.properties.get("name") or "")
    except FormatError:
        raise
    except Exception as error:
        # npTDMS has no special error for a damaged file; its parser may raise any exception.
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        problem = f"npTDMS cannot read it ({reason[:200]})"
        raise FormatError(path, problem, "check that it was copied whole; export it again") from error
    if not channels:
        raise FormatError(path, "expected channels of numbers, got none", "check that the recording was saved")
    return Contents(tuple(channels), title=title)


def _channels(path: str, group: Any, several: bool, size: int) -> Iterator[Channel]:
    numeric = []
    for each in group.channels():
        kind = each.dtype
        if kind is None or kind.kind not in "fiu" or not len(each):
            continue
        if len(each) * kind.itemsize > size:
            problem = f'channel "{each.name}" states {len(each)} numbers, more than the file can hold'
            raise FormatError(path, problem, "check that it was copied whole")
        numeric.append(each)
    times = {id(each): each for each in numeric if is_time(each.name)}
    own_time = next(iter(times.values()), None)
    for each in numeric:
        if id(each) in times and len(numeric) > 1:
            continue
        values = np.asarray(each[:], np.float64)
        step = each.properties.get("wf_increment")
        time = None
        if step is None and own_time is not None and len(own_time) == len(each) and own_time is not each:
            time = np.asarray(own_time[:], np.float64)
        yield Channel(
            name=each.name,
            unit=next((str(each.properties[key]) for key in _UNITS if each.properties.get(key)), ""),
            source=Arrays(time, values, "" if own_time is None else own_time.name),
            run=group.name if several else "",
            formula=_formula(each.properties) if step is not None else None,
            time_unit="s",
            start_time=_start_time(each.properties),
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


def _start_time(properties: Any) -> str:
    value = properties.get("wf_start_time")
    if not isinstance(value, np.datetime64) or np.isnat(value) or value < np.datetime64("1905-01-01"):
        return ""
    return f"{np.datetime_as_string(value, unit='us')}Z"


FORMAT = ColumnFormat("tdms", "TDMS: National Instruments' binary waveforms (npTDMS)", _evidence, _contents)
