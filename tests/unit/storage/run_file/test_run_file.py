"""The run file: written as a whole, and believed only where it can be checked."""

import hashlib
import itertools
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from acquisition.block import Block, SourceInfo, concatenate
from acquisition.errors import PortError
from acquisition.recordings.recording import FormatIssue, Original
from storage.errors import NotARun, RunDamaged, RunOpen, WriteFailed
from storage.run_file.layout import CHUNK, HEADER
from storage.run_file.reading import open_run
from storage.run_file.writing import write_run
from tests.faults.conftest import files_up_to
from tests.wire import bits

INFO = SourceInfo("live", "COM3", 100.0, sigma_m=3e-4, quantum_m=1e-4, clock="device", stated_error_m=0.001)
SCENE = {"bob": {"mass_kg": {"value": 0.2176, "u": 0.00005}}, "sensor": {"position": "below"}}
TRAPS = (FormatIssue("truncated_row", "The last row was cut.", 1, 12003), FormatIssue("nominal_clock", "No times."))
ORIGINALS = (Original("run position.txt", bytes(range(256)) * 3), Original("run velocity.txt", b""))
PROVENANCE = {"software": "springmass", "version": "0.1.0", "configuration": {"rate_hz": 100.0}}


def block(n: int, first: int = 0, **columns: Any) -> Block:
    """Return n samples of an oscillation with a few of them missing."""
    t = np.arange(first, first + n) / 100
    distance = 0.5 + 0.05 * np.sin(14 * t) + np.random.default_rng(abs(first)).normal(0, 3e-4, n)
    distance[::7] = np.nan
    return Block(first, t, distance, np.isnan(distance).astype(np.uint8), **columns)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a run of 300 samples with everything that a run can have."""
    t = np.arange(300)
    return write_run(
        tmp_path / "run.h5",
        [block(300, host_ns=t * 10_000_000 + 5, velocity=t / 7)],
        INFO,
        originals=ORIGINALS,
        scene=SCENE,
        title="Träger 3",
        channel="position",
        traps=TRAPS,
        malformed_rows=2,
        format="motion-sensor",
        provenance=PROVENANCE,
    )


def edit(path: Path, change: Any) -> None:
    """Change a run file behind its back."""
    with h5py.File(path, "r+") as file:
        change(file)


def test_many_chunks_come_back(tmp_path: Path) -> None:
    """Blocks longer and shorter than a chunk, and columns that come late, keep every sample."""
    cuts = [0, 10, CHUNK - 1, CHUNK + 5, 2 * CHUNK + 9, 3 * CHUNK, 3 * CHUNK + 11]
    parts = [block(stop - start, 40 + start) for start, stop in itertools.pairwise(cuts)]
    late = parts[-2]
    velocity, host = np.arange(len(late)) / 3, np.arange(len(late), dtype=np.int64)
    parts[-2] = Block(late.first, late.t, late.distance, late.flags, host, velocity)
    whole = concatenate(parts)
    path = write_run(tmp_path / "a.h5", iter(parts), INFO)
    with open_run(path) as run:
        assert bits(run.samples()) == bits(whole)
        run.verify()


@pytest.mark.parametrize("error", [PortError("unplugged"), KeyboardInterrupt()])
@pytest.mark.parametrize("samples", [10, 2 * CHUNK])
def test_a_failing_source_leaves_the_old_state(tmp_path: Path, error: BaseException, samples: int) -> None:
    """A failure between blocks passes through as it is; what stood there stands, and there is no part of a file."""
    (tmp_path / "old.h5").write_bytes(b"old")

    def source() -> Iterator[Block]:
        yield block(samples)
        raise error

    for name in ("new.h5", "old.h5"):
        with pytest.raises(type(error)) as caught:
            write_run(tmp_path / name, source(), INFO, overwrite=True)
        assert caught.value is error
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"old.h5": b"old"}


@pytest.mark.parametrize(
    ("blocks", "options", "message"),
    [
        ([block(5), block(5, 6)], {}, r"sample 5, got 6"),
        ([block(5, velocity=np.zeros(4))], {}, r"velocity"),
        ([block(5)], {"channel": 7}, r"channel"),
        ([block(5)], {"scene": {"bob": object()}}, r"JSON"),
        ([block(5)], {"provenance": {"x": float("nan")}}, r"JSON"),
    ],
)
def test_what_cannot_be_kept_is_refused(
    tmp_path: Path, blocks: list[Block], options: dict[str, Any], message: str
) -> None:
    """Gaps, unequal columns and objects that JSON cannot hold are errors of one line, and leave no file."""
    with pytest.raises(WriteFailed, match=message) as caught:
        write_run(tmp_path / "a.h5", blocks, INFO, **options)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("limit", [300_000, 0])
def test_a_full_disk_is_one_line(tmp_path: Path, limit: int) -> None:
    """A disk that takes no more is an error, not a crash of the process, and leaves nothing behind."""
    noise = np.random.default_rng(0).normal(size=CHUNK)
    blocks = [Block(k * CHUNK, noise, noise, np.zeros(CHUNK, np.uint8)) for k in range(2)]
    with files_up_to(limit), pytest.raises(WriteFailed, match=r"^[^\n]*could not be written \(File too large\)[^\n]*$"):
        write_run(tmp_path / "a.h5", blocks, INFO)
    assert list(tmp_path.iterdir()) == []


def test_a_later_schema_is_refused(path: Path) -> None:
    """A file of a layout that this version does not know is not guessed at."""

    def later(file: Any) -> None:
        text = bytes(file[HEADER][()]).replace(b'"schema":1', b'"schema":9')
        file[HEADER][()] = np.bytes_(text)
        file[HEADER].attrs["sha256"] = np.bytes_(hashlib.sha256(text).hexdigest())

    edit(path, later)
    with pytest.raises(NotARun, match=r"schema 1, got 9"):
        open_run(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f["entry/signal/distance_errors"].__setitem__(3, 9), "'distance_errors' .*SHA-256"),
        (lambda f: f["wire/bytes"].__setitem__(3, 9), "the original file 'run position.txt' .*SHA-256"),
        (lambda f: f["raw/host_mono_ns"].__setitem__(3, 9), "the column 'host_mono_ns' .*SHA-256"),
        (lambda f: f.__delitem__("raw"), "the column 'host_mono_ns' is damaged"),
    ],
)
def test_verify_names_what_differs(path: Path, change: Any, message: str) -> None:
    """A column and an original that differ from their checksums are named in one line."""
    edit(path, change)
    with open_run(path) as run, pytest.raises(RunDamaged, match=message) as caught:
        run.verify()
    assert "\n" not in str(caught.value)


def test_equal_content_has_an_equal_digest(path: Path, tmp_path: Path) -> None:
    """The digest is of decoded content: how samples were cut into blocks does not enter, a sample does."""
    whole = block(300)
    a = write_run(tmp_path / "a.h5", [whole], INFO)
    b = write_run(tmp_path / "b.h5", [whole[:100], whole[100:]], INFO)
    changed = whole.distance.copy()
    changed[5] = np.nextafter(changed[5], 1)
    c = write_run(tmp_path / "c.h5", [Block(0, whole.t, changed, whole.flags)], INFO)
    digests = []
    for each in (a, b, c):
        with open_run(each) as run:
            digests.append(run.sha256)
    assert digests[0] == digests[1] != digests[2]


def test_a_run_that_another_program_writes_is_not_called_damaged(path: Path) -> None:
    """The file is whole: the line says to close it there, and afterwards it opens."""
    code = "import sys, h5py; file = h5py.File(sys.argv[1], 'r+'); print('open', flush=True); sys.stdin.read()"
    command = [sys.executable, "-c", code, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as second:
        assert second.stdout is not None
        assert second.stdout.readline() == "open\n"
        with pytest.raises(RunOpen, match=r"run\.h5 is open in another program; close it there"):
            open_run(path)
        second.communicate("")
    with open_run(path) as run:
        run.verify()


def test_a_file_from_before_holds_a_length(path: Path) -> None:
    """A header and attributes without a quantity read as metres, verify, and keep their digest."""
    with h5py.File(path, "r+") as file:
        header = json.loads(file["/entry/provenance/header"][()])
        del header["quantity"], header["unit"], file["/entry/signal/distance"].attrs["quantity"]
        header["implied"] = {"quality": {"value": 0}}  # a formula of a column, which some files hold
        text = json.dumps(header, sort_keys=True, separators=(",", ":")).encode()
        del file["/entry/provenance/header"]
        digest = hashlib.sha256(text).hexdigest()
        file.create_dataset("/entry/provenance/header", data=np.bytes_(text)).attrs["sha256"] = np.bytes_(digest)
    with open_run(path) as run:
        run.verify()
        samples = run.samples()
        assert (samples.quantity, samples.unit, run.sha256) == ("length", "m", digest)
