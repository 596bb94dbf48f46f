"""Two simulated runs of one spring, bare and with a disc, as files, and tables of what somebody prints about them."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.synthetic import F8, Truth

Row = tuple[str, str, object, object, str]
FLOW = 1.204 / 1.825e-5  # density of air over its viscosity, s/m^2


@dataclass(frozen=True)
class Recorded:
    """A run in two files of MotionSensor.vi, with the truth and the velocities as they are in the file."""

    truth: Truth
    mass_kg: float
    position: Path
    velocity: Path
    v_file: F8
    v_true: F8


def record(
    folder: Path, name: str, truth: Truth, mass_kg: float, seconds: float, *, noise_m: float, echoes: int, seed: int
) -> Recorded:
    """Write a run at 100 Hz in which some distances, and the velocities with them, are false echoes."""
    rng = np.random.default_rng([63, seed])
    t, h = np.arange(round(100 * seconds)) / 100, 1e-4
    y, v = truth.position(t), (truth.position(t + h) - truth.position(t - h)) / (2 * h)
    v_file = v + 3e-3 * rng.standard_normal(t.size)
    at = rng.choice(t.size, echoes, replace=False)
    y_file = y + noise_m * rng.standard_normal(t.size)
    y_file[at] = rng.uniform(0.03, 0.12, echoes)
    v_file[at] = rng.choice([-1, 1], echoes) * math.sqrt(0.35 * np.mean(v**2) * t.size / max(echoes, 1))
    files = []
    for what, unit, values, digits in (("Distance", "cm", y_file, 4), ("Velocity", "cm/s", v_file, 3)):
        rows = "".join(f"{a:.3f}\t{100 * b:.{digits}f}\r\n" for a, b in zip(t, values, strict=True))
        files.append(folder / f"{name}_{'position' if unit == 'cm' else 'velocity'}.txt")
        head = f"Motion Sensor Data File Mar 12, 2024 2:31 PM\r\nTime (s)\t{what} ({unit})\r\n"
        files[-1].write_text(head + rows, encoding="utf-8", newline="")
    return Recorded(truth, mass_kg, files[0], files[1], v_file, v)


def write_table(path: Path, rows: list[Row]) -> Path:
    """Write a table of printed values."""
    lines = ["run,name,value,u,unit", *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def periodic_rows(name: str, seven_s: float, mass_kg: float, *, right_u: bool = True) -> list[Row]:
    """Return period to k from the time of seven cycles, read to 0.01 s; ``right_u`` of k is no relative one."""
    period, u = seven_s / 7, 0.01 / 7
    omega = 2 * math.pi / period
    k, relative = omega**2 * mass_kg, 2 * u / period
    return [
        (name, "T", f"{period:.4f}", f"{u:.4f}", "s"),
        (name, "f", f"{1 / period:.4f}", f"{u / period**2:.4f}", "Hz"),
        (name, "omega", f"{omega:.3f}", f"{omega * u / period:.3f}", "s^-1"),
        (name, "k", f"{k:.2f}", f"{k * relative:.2f}" if right_u else f"{relative:.4f}", "N/m"),
    ]
