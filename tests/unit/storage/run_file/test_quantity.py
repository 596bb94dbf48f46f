"""What samples are of travels with them, through the run file and back."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import h5py
import numpy as np

from acquisition.block import UNITS, Block, SourceInfo
from storage.run_file.reading import open_run
from storage.run_file.writing import write_run

INFO = SourceInfo("replay", "pivot", 100.0, sigma_m=1e-3)


def block(quantity: str = "angle", *, first: int = 0) -> Block:
    """A second of a swing at 100 Hz, with a velocity."""
    t = (first + np.arange(100)) / 100
    y = 0.1 * np.cos(8.3 * t)
    return Block(first, t, y, np.zeros(100, np.uint8), None, np.gradient(y, t), quantity, UNITS[quantity])


def test_a_file_from_before_holds_a_length(tmp_path: Path) -> None:
    """A header and attributes without a quantity read as metres, verify, and keep their digest."""
    path = write_run(tmp_path / "run.h5", [block("length")], INFO)
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
