"""What a run file says when it is loaded."""

import hashlib
from pathlib import Path

import numpy as np

from acquisition.block import Block, SourceInfo
from acquisition.recordings.recording import Original
from springmass.loading.load import load
from storage.run_file.layout import CHUNK
from storage.run_file.writing import write_run


def test_a_chunk_of_true_zeros_loads_with_the_digest_of_the_file(tmp_path: Path) -> None:
    """A rangefinder that read nothing but zeros is no damaged file; a digest that is computed later is the file's."""
    n, original = CHUNK + 9, Original("old.txt", b"Time (s)\tDistance (cm)\r\n")
    block = Block(0, np.arange(n) / 100, np.zeros(n), np.zeros(n, np.uint8))
    path = write_run(tmp_path / "run.h5", [block], SourceInfo("replay", "old.txt", 100.0), originals=[original])
    loaded = load(path)
    assert not loaded.samples.distance.any()
    assert loaded.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert loaded.originals == (original,)
