"""Courses of simulated recordings, in plain numpy, and what the folder of a course's results holds."""

import csv
import math
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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


def faulty_course(folder: Path) -> list[str]:
    """Make 24 runs of one spring of 14 N/m at six benches with planted faults; return what ``batch`` is given.

    A1 and A3 have each other's mass, B2 and C3 too; D2 is in grams; E1 in centimetres as metres; E3 is clipped; F2 is
    no recording, F4 is empty.
    """
    said = {f"{bench}{i}": mass for bench in "ABCDEF" for i, mass in enumerate((0.15, 0.2, 0.25, 0.3), 1)}
    (folder / "runs").mkdir(parents=True)
    for seed, (name, mass) in enumerate(said.items()):
        y = 0.1 + damped(seed, seconds=20.0, omega=math.sqrt(14.0 / (mass + 0.010 / 3.0)))
        y = 100.0 * y if name == "E1" else np.maximum(y, 0.27) if name == "E3" else y
        write_recording(folder / "runs" / f"{name}.txt", y)
    (folder / "runs" / "F2.txt").write_text("Dear all,\nthe recordings are attached.\n")
    (folder / "runs" / "F4.txt").write_bytes(b"")
    for one, other in (("A1", "A3"), ("B2", "C3")):
        said[one], said[other] = said[other], said[one]
    said["D2"] *= 1000.0
    with (folder / "runs.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(("path", "bob_mass_kg", "bob_mass_kg_u", "spring_mass_kg", "spring_mass_kg_u", "group"))
        table.writerows((f"runs/{name}.txt", mass, 5e-5, 0.010, 1e-4, name[0]) for name, mass in said.items())
    return [str(folder / "runs"), "--runs", str(folder / "runs.csv"), "--jobs", "1", "--accuracy", "fast"]


def rows_of(table: str | Path) -> list[dict[str, str]]:
    """Return the rows of a CSV."""
    with Path(table).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file of a course's results by name, except its data, whose order varies, and its lock."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.match("course.*")]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def bad_files(folder: Path) -> list[str]:
    """Write files none of which gives a period, each for another reason; return their paths."""
    head, *rows = write_recording(folder / "bad.txt", damped(1)).read_bytes().splitlines(keepends=True)
    names, rows = rows[0], rows[1:]
    times = [row.partition(b"\t")[0] for row in rows]
    made = {
        "bad.txt": b"".join([head, names, *rows]).replace(b"0.", b"zero."),
        "empty.txt": b"",
        "head_alone.txt": head + names,
        "one_row.txt": b"".join([head, names, rows[0]]),
        "words.txt": b"Dear all,\nthe recordings are attached.\n",
        "noise.txt": np.random.default_rng(1).bytes(5000),
        "nul.txt": bytes(4096),
        "no_run.h5": b"",
        "torn.h5": b"\x89HDF\r\n\x1a\n" + bytes(600),
        "torn.xlsx": b"PK\x03\x04" + b"x" * 300,
        "torn.zip": b"PK\x05\x06" + bytes(10),
        "torn.cap": b"PK\x03\x04" + b"y" * 100,
        "torn.lvm": b"LabVIEW Measurement\t\nWriter_Version\t2\n",
        "torn.tdms": b"TDSm" + b"\xff" * 60,
        "no_number.txt": b"".join([head, names, *(t + b"\tNaN\t0.239\r\n" for t in times)]),
        "huge.txt": b"".join([head, names, *(t + b"\t1e308\t0.239\r\n" for t in times)]),
        "at_rest.txt": b"".join([head, names, *(t + b"\t20.0000\t0.239\r\n" for t in times)]),
        "one_time.txt": b"".join(
            [head, names, *(b"0.000" + row[len(t) :] for t, row in zip(times, rows, strict=True))]
        ),
        "backward.txt": b"".join([head, names, *reversed(rows)]),
        "one_line.txt": head + names + b"1" * 300_000,
        "quotes.csv": b'time,distance\n"0.0,1\n0.1,"2\n',
        "which.csv": b"a,b\n" + b"".join(b"%.2f,%.3f\n" % (0.01 * i, np.sin(i)) for i in range(200)),
        "infinite.csv": b"time (s),distance (m)\n" + b"".join(b"%.2f,inf\n" % (0.01 * i) for i in range(200)),
    }
    for name, content in made.items():
        (folder / name).write_bytes(content)
    (folder / "nowhere.txt").symlink_to("gone.txt")
    os.mkfifo(folder / "pipe.txt")
    (folder / "device.h5").symlink_to("/dev/null")
    return [str(Path(folder.name) / name) for name in (*made, "nowhere.txt", "pipe.txt", "device.h5")]
