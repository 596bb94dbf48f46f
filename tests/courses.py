"""Courses of simulated recordings, in plain numpy, and what the folder of a course's results holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["contents", "damped", "short_course", "write_recording"]

HEAD = "Motion Sensor Data File Mar 12, 2024 2:05 PM\r\nTime (s)\tDistance (cm)\tDist Error (cm)\r\n"


def write_recording(path: Path, y: NDArray[np.float64], rate_hz: float = 100.0) -> Path:
    """Write distances, m, in the form of MotionSensor.vi."""
    t = np.arange(y.size) / rate_hz
    rows = "\r\n".join(f"{a:.3f}\t{b:.3f}\t0.239" for a, b in zip(t, 100.0 * y, strict=True))
    path.write_bytes(f"{HEAD}{rows}\r\n".encode())
    return path


def damped(seed: int, *, seconds: float = 8.0, omega: float = 8.3) -> NDArray[np.float64]:
    """Return distances of a damped oscillation with noise of 0.3 mm, m."""
    t = np.arange(round(100 * seconds)) / 100.0
    noise = 3e-4 * np.random.default_rng(seed).standard_normal(t.size)
    return 0.2 + 0.05 * np.exp(-0.01 * t) * np.cos(omega * t + seed) + noise


def short_course(folder: Path, runs: int) -> Path:
    """Make a folder of so many short recordings."""
    folder.mkdir(parents=True)
    for i in range(runs):
        write_recording(folder / f"run{i:03d}.txt", damped(i, omega=8.0 + 0.01 * i))
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file of a course's results by name, but its log and its lock."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in ("batch.log", "lock")]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
