"""Whatever happens to a wire log, its reader never raises, never invents a record, and tells what is missing."""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from storage.wire_log.records import LogHeader, Record, RecordKind, SensorEntry, frame
from storage.wire_log.scanning import LogContents
from tests.sampling import sampled
from tests.wire import parse_log

LOG = 0x5EED
PAGE = 4096
HEADER = LogHeader(sensors=(SensorEntry(0, "maxbotix", "COM3", 57600),), mono_ns=0, unix_ns=0)
Key = tuple[Any, ...]


def key(record: Record) -> Key:
    """Return what was written, without where it was found."""
    return record.sequence, record.mono_ns, record.kind, record.channel, record.payload


def log_of(reads: int, seed: int) -> tuple[bytes, list[int]]:
    """Return a log of a header, reads and an end, with the byte at which each record ends."""
    rng = np.random.default_rng(seed)
    payloads = [(RecordKind.HEADER, HEADER.encode())]
    payloads += [(RecordKind.DATA, rng.bytes(int(rng.integers(1, 40)))) for _ in range(reads)]
    payloads += [(RecordKind.END, b"{}")]
    records = [
        frame(kind, payload, sequence=n, mono_ns=n * 10**7, log=LOG) for n, (kind, payload) in enumerate(payloads)
    ]
    return b"".join(records), list(itertools.accumulate(map(len, records)))


def in_order(part: list[Key], whole: list[Key]) -> bool:
    """Tell whether all of a part is found in the whole, in its order."""
    rest = iter(whole)
    return all(item in rest for item in part)


def damage_reported(contents: LogContents, whole: list[Key]) -> bool:
    """Tell whether every record is one that was written, and whatever is missing before the last is counted."""
    records = list(contents)
    read = [key(record) for record in records]
    missing = (whole.index(read[-1]) + 1 if read else 0) - len(read)
    return in_order(read, whole) and contents.damage.lost == missing == sum(record.lost_before for record in records)


def test_cut_at_every_byte_it_loses_one_record_at_most() -> None:
    """A log of 40 records opens at every length, with every record that is whole."""
    data, ends = log_of(40, seed=1)
    whole = [key(record) for record in parse_log(data)]
    assert len(whole) == 42
    for length in range(len(data) + 1):
        contents = parse_log(data[:length])
        kept = sum(end <= length for end in ends)
        assert [key(record) for record in contents] == whole[:kept]
        assert contents.damage.tail_bytes == length - (ends[kept - 1] if kept else 0)
        assert contents.damage.lost == 0
        assert contents.damage.ended == (length == len(data))


@pytest.mark.parametrize("what", ["zeroed page", "flipped bit"])
@pytest.mark.parametrize("seed", sampled(range(5), 1))
def test_damage_is_seen_and_costs_only_what_it_touches(seed: int, what: str) -> None:
    """One hundred zeroed pages or flipped bits a seed: each is noticed, and no record is wrong."""
    data, ends = log_of(700, seed)
    whole = [key(record) for record in parse_log(data)]
    rng = np.random.default_rng(seed)
    for _ in range(100):
        if what == "flipped bit":
            at, size = int(rng.integers(0, len(data))), 1
            put = bytes([data[at] ^ 1 << int(rng.integers(0, 8))])
        else:
            at, size = PAGE * int(rng.integers(0, len(data) // PAGE + 1)), PAGE
            put = bytes(len(data[at : at + PAGE]))
        contents = parse_log(data[:at] + put + data[at + size :])
        touched = sum(start < at + size and end > at for start, end in itertools.pairwise([0, *ends]))
        assert damage_reported(contents, whole)
        assert not contents.damage.intact
        assert contents.damage.records >= len(whole) - touched


PAYLOADS = st.lists(
    st.tuples(
        st.sampled_from(list(RecordKind)),
        st.one_of(
            st.binary(max_size=60),
            # Records of another log, whole and in part: what a device might send.
            st.binary(max_size=10).map(lambda inner: frame(RecordKind.DATA, inner, sequence=1, mono_ns=1, log=LOG + 1)),
            st.just(b"\xf5\xa9" * 20),
        ),
    ),
    min_size=1,
    max_size=20,
)


def written(payloads: list[tuple[RecordKind, bytes]]) -> bytes:
    """Return the log of some payloads."""
    items = enumerate(payloads)
    return b"".join(frame(kind, payload, sequence=n, mono_ns=n, log=LOG, channel=n) for n, (kind, payload) in items)


@given(PAYLOADS)
def test_any_payloads_come_back(payloads: list[tuple[RecordKind, bytes]]) -> None:
    """Kinds, channels, times and bytes return, whatever the bytes look like."""
    contents = parse_log(written(payloads))
    got = [(record.mono_ns, record.channel, record.kind, record.payload) for record in contents]
    assert got == [(n, n, kind, payload) for n, (kind, payload) in enumerate(payloads)]
    assert contents.damage.intact


@given(PAYLOADS, st.data())
def test_no_mangling_invents_a_record(payloads: list[tuple[RecordKind, bytes]], data: st.DataObject) -> None:
    """Bytes cut out, put in, overwritten, repeated and moved: what is read was written, in its order."""
    log = written(payloads)
    whole = [key(record) for record in parse_log(log)]
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(log)))
        stop = data.draw(st.integers(start, min(len(log), start + 200)))
        to = data.draw(st.integers(0, len(log)))
        change = data.draw(st.sampled_from(["cut", "put", "zero", "repeat", "move"]))
        piece = log[start:stop]
        if change == "cut":
            log = log[:start] + log[stop:]
        elif change == "put":
            log = log[:start] + data.draw(st.binary(max_size=80)) + log[start:]
        elif change == "zero":
            log = log[:start] + bytes(len(piece)) + log[stop:]
        elif change == "repeat":
            log = log[:to] + piece + log[to:]
        else:
            rest = log[:start] + log[stop:]
            log = rest[:to] + piece + rest[to:]
    contents = parse_log(log)
    foreign = [record for record in contents if key(record) not in whole]
    # Where every record before it is gone, a record that a device sent is the first that is read; then none of ours is.
    assert in_order([key(record) for record in contents], whole) or len(foreign) == contents.damage.records
    damage = contents.damage
    size = sum(28 + len(record.payload) for record in contents)
    assert size + damage.skipped_bytes + damage.tail_bytes <= len(log)


@given(st.binary(max_size=2000))
def test_any_bytes_are_read_without_an_error(data: bytes) -> None:
    """A file that is no log has no records, and every byte of it is accounted for."""
    contents = parse_log(data)
    assert list(contents) == []
    assert contents.damage.tail_bytes == len(data)
