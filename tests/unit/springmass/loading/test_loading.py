"""A run file is checked against its checksums and digests when it is loaded."""

import hashlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition.block import Block, SourceInfo
from acquisition.recordings.recording import Original
from springmass.loading.load import load
from storage.errors import RunDamaged
from storage.run_file.layout import CHUNK
from storage.run_file.writing import write_run

INFO = SourceInfo("replay", "old.txt", 100.0)
ORIGINAL = Original("old.txt", b"Time (s)\tDistance (cm)\r\n")
DISTANCE = "entry/signal/distance"


def write(path: Path, distance: np.ndarray) -> Path:
    """Write a run of so many distances."""
    n = distance.size
    block = Block(0, np.arange(n) / 100, distance, np.zeros(n, np.uint8))
    return write_run(path, [block], INFO, originals=[ORIGINAL], overwrite=True)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a run of three chunks."""
    return write(tmp_path / "run.h5", np.random.default_rng(4).normal(0.5, 0.1, 3 * CHUNK))


def test_the_digest_and_the_originals_are_those_of_the_file(path: Path) -> None:
    """Computed later, they are what they would have been immediately."""
    loaded = load(path)
    assert loaded.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert loaded.originals == (ORIGINAL,)


def test_a_lost_chunk_is_an_error_on_loading(path: Path) -> None:
    """A chunk of zeros has the checksum zero; its column's digest tells it."""
    with h5py.File(path) as file:
        chunk = file[DISTANCE].id.get_chunk_info(2)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset : chunk.byte_offset + chunk.size] = bytes(chunk.size)
    path.write_bytes(content)
    with pytest.raises(RunDamaged, match="distance"):
        load(path)


def test_a_chunk_of_true_zeros_loads(tmp_path: Path) -> None:
    """A rangefinder that read nothing but zeros is no damaged file."""
    loaded = load(write(tmp_path / "run.h5", np.zeros(CHUNK + 9)))
    assert not loaded.samples.distance.any()
