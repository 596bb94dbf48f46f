"""Generate the simulated recordings of this folder, reproducibly byte for byte, and files with their true values.

``python sample_data/generate.py [--check] [DIR]`` writes every file to DIR (by default this folder). ``--check``
writes nothing; it names each missing or different file, and exits with 1 if there is one.

The recordings test the estimator, so nothing is imported from the tested packages: the physics, the density of
the air and the file format are deliberately implemented a second time here.

Notes
-----
The distance is ``y(t) = offset + A(t) cos(omega (t - t_first) + phase)`` with constant ``omega = sqrt(k / m)``.
The mass is ``m = bob + spring / 3 + (8/3) rho a^3``, where the last term is the added mass of a disc of radius a in
air of density rho. ``A`` follows the averaged amplitude law ``dA/dt = -(gamma A + beta A^2)``. README.md describes
the model of the sensor.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]
Tables = dict[str, dict[str, object]]

HERE = Path(__file__).resolve().parent

SPRING_CONSTANT_N_PER_M = 14.0
SPRING_MASS_KG = 0.0100
TEMPERATURE_C = 20.0
PRESSURE_PA = 101325.0
RELATIVE_HUMIDITY = 0.4

NOISE_M = 8.0e-5
HEAVY_FRACTION = 0.03
HEAVY_FACTOR = 4.0
ECHO_ROWS_AT_100_HZ = (3, 18)
ECHO_SHIFT_M = (0.0025, 0.0075)
STATED_ERROR_CM = "0.239"  # the instrument prints this constant on every row; it is not the noise


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """The load on the spring: a bob (mass in kg), and a disc (diameter in m) or None."""

    scene_file: str
    bob_mass_kg: float
    disc_diameter_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One simulated recording; if the title is None, both header lines are omitted, as in a cropped file."""

    name: str
    title: str | None
    seed: int
    bench: Bench
    rows: int
    amplitude_m: float
    offset_m: float
    phase_rad: float
    rate_hz: int = 100
    first: int = 0
    gamma_per_s: float = 0.003
    beta_per_m_s: float = 0.0
    quantum_nm: int = 43000
    echo_fraction: float = 0.0
    limit_m: float | None = None
    velocity_rows: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """A run's samples ``ticks`` (n,), in units of the quantum, and the sorted rows of each disturbance.

    Rows are counted from 0. ``exact_ticks`` (n,) are the readings before rounding to ticks.
    """

    exact_ticks: F8
    ticks: I8
    echo_rows: list[int]
    clipped_rows: list[int]
    heavy_rows: list[int]


UNDAMPED = Bench(scene_file="undamped.scene.toml", bob_mass_kg=0.2007)
DAMPED = Bench(scene_file="damped.scene.toml", bob_mass_kg=0.2176, disc_diameter_m=0.102)

RUNS = (
    Run(
        name="undamped_simulated",
        title="Motion Sensor Data File Mar 12, 2024 2:05 PM",
        seed=20240312,
        bench=UNDAMPED,
        rows=1000,
        amplitude_m=0.0510,
        offset_m=0.2150,
        phase_rad=2.40,
        echo_fraction=0.01,
        velocity_rows=1000,
    ),
    Run(
        name="damped_simulated",
        title="Motion Sensor Data File Mar 12, 2024 2:31 PM",
        seed=20240313,
        bench=DAMPED,
        rows=12000,
        amplitude_m=0.0520,
        offset_m=0.2190,
        phase_rad=-0.70,
        gamma_per_s=0.0065,
        beta_per_m_s=0.200,
        echo_fraction=0.05,
        velocity_rows=12007,
    ),
    Run(
        name="clipped_simulated",
        title="Motion Sensor Data File Mar 13, 2024 10:12 AM",
        seed=20240314,
        bench=UNDAMPED,
        rows=2000,
        amplitude_m=0.0710,
        offset_m=0.2790,
        phase_rad=1.90,
        limit_m=0.3242,
    ),
    Run(
        name="cropped_simulated",
        title=None,
        seed=20240315,
        bench=UNDAMPED,
        rows=800,
        first=504,
        amplitude_m=0.0465,
        offset_m=0.2205,
        phase_rad=0.55,
        echo_fraction=0.01,
    ),
    Run(
        name="sixty_hz_simulated",
        title="Motion Sensor Data File Thu, Mar 14, 2024 3:40 PM",
        seed=20240316,
        bench=UNDAMPED,
        rows=900,
        rate_hz=60,
        amplitude_m=0.0480,
        offset_m=0.2310,
        phase_rad=-1.85,
        quantum_nm=42560,
        echo_fraction=0.01,
    ),
)


# --- the bench


def air_density_kg_per_m3() -> float:
    """Return the density of the scene's moist air as an ideal mixture (vapour pressure by Magnus), kg/m^3.

    It is rounded to 1e-4, so that no printed digit depends on the last bit of a library's exp.
    """
    vapour_pa = RELATIVE_HUMIDITY * 611.2 * math.exp(17.62 * TEMPERATURE_C / (243.12 + TEMPERATURE_C))
    dry_molar_kg, vapour_molar_kg, gas_constant = 0.0289647, 0.0180153, 8.314462618
    mass_kg = (PRESSURE_PA - vapour_pa) * dry_molar_kg + vapour_pa * vapour_molar_kg
    return round(mass_kg / (gas_constant * (TEMPERATURE_C + 273.15)), 4)


def added_mass_kg(bench: Bench) -> float:
    """Return the mass of air that moves with the disc, (8/3) rho a^3, in kg; 0 without a disc."""
    if bench.disc_diameter_m is None:
        return 0.0
    radius_m = bench.disc_diameter_m / 2
    return 8 / 3 * air_density_kg_per_m3() * radius_m * radius_m * radius_m


def effective_mass_kg(bench: Bench) -> float:
    """Return the effective mass, bob + spring / 3 + added mass, in kg."""
    return bench.bob_mass_kg + SPRING_MASS_KG / 3 + added_mass_kg(bench)


def angular_frequency_rad_per_s(bench: Bench) -> float:
    """Return the angular frequency sqrt(k / m), in rad/s."""
    return math.sqrt(SPRING_CONSTANT_N_PER_M / effective_mass_kg(bench))


def scene_tables(bench: Bench) -> Tables:
    """Return the scene's tables with the true values; ``u`` is the uncertainty of a scale or ruler."""
    tables: Tables = {
        "bob": {"mass_kg": {"value": bench.bob_mass_kg, "u": 0.00005}},
        "spring": {"mass_kg": {"value": SPRING_MASS_KG, "u": 0.0005}},
    }
    if bench.disc_diameter_m is not None:
        tables["disc"] = {"diameter_m": {"value": bench.disc_diameter_m, "u": 0.0005}}
    tables["air"] = {
        "temperature_c": TEMPERATURE_C,
        "pressure_pa": PRESSURE_PA,
        "relative_humidity": RELATIVE_HUMIDITY,
    }
    tables["sensor"] = {"position": "below"}
    return tables


# --- the motion


def seconds_since_first(run: Run, samples: int) -> F8:
    """Return the times since the first sample (samples,), in s."""
    return np.arange(samples) / run.rate_hz


def amplitude(run: Run, t: F8) -> F8:
    """Return the amplitude (n,), in m, which solves dA/dt = -(gamma A + beta A^2).

    ``t`` (n,) are the times since the first sample, in s.
    """
    lost = -np.expm1(-run.gamma_per_s * t)
    falling: F8 = run.amplitude_m * (1 - lost)
    return falling / (1 + run.beta_per_m_s * run.amplitude_m / run.gamma_per_s * lost)


def motion(run: Run, t: F8) -> F8:
    """Return the true distances (n,), in m, at the times ``t`` (n,), in s since the first sample."""
    angle = angular_frequency_rad_per_s(run.bench) * t + run.phase_rad
    return run.offset_m + amplitude(run, t) * np.cos(angle)


def near_turning_rows(run: Run, samples: int) -> I8:
    """Return the rows at which the bob is nearest to the sensor, where the angle is an odd multiple of pi."""
    omega = angular_frequency_rad_per_s(run.bench)
    last_angle = omega * (samples - 1) / run.rate_hz + run.phase_rad
    first_turn, end_turn = (math.ceil((angle / math.pi - 1) / 2) for angle in (run.phase_rad, last_angle))
    turns = np.arange(first_turn, end_turn)
    rows: F8 = np.rint(((2 * turns + 1) * math.pi - run.phase_rad) / omega * run.rate_hz)
    return rows.astype(np.int64)


# --- the sensor


def uniforms(bits: np.random.PCG64, n: int) -> F8:
    """Return uniform numbers (n,) in (0, 1) from the raw bits, a stream that numpy promises never to change."""
    raw = np.asarray(bits.random_raw(n), dtype=np.uint64)
    return ((raw >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53


def noise(bits: np.random.PCG64, samples: int) -> tuple[F8, NDArray[np.bool_]]:
    """Return errors (samples,), in m, and a mask of those drawn from the wide part of the mixture."""
    radius = np.sqrt(-2 * np.log(uniforms(bits, samples)))
    normal = radius * np.cos(2 * math.pi * uniforms(bits, samples))
    heavy = uniforms(bits, samples) < HEAVY_FRACTION
    return NOISE_M * np.where(heavy, HEAVY_FACTOR, 1.0) * normal, heavy


def false_echoes(run: Run, bits: np.random.PCG64, samples: int) -> F8:
    """Return the displacements by false echoes (samples,), in m; 0 where the echo comes from the bob.

    Each turning point gets one cluster, in a random order that favours large amplitudes, until the run's share of
    rows is used up.
    """
    shift = np.zeros(samples)
    turns = near_turning_rows(run, samples)
    weight = (amplitude(run, turns / run.rate_hz) / run.amplitude_m) ** 2
    order = np.argsort(-np.log(uniforms(bits, len(turns))) / weight)
    least, most = (max(3, rows * run.rate_hz // 100) for rows in ECHO_ROWS_AT_100_HZ)
    left = round(run.echo_fraction * samples)
    for turn in turns[order].tolist():
        drawn = uniforms(bits, 5)
        length = min(left, least + int(drawn[:2].max() * (most - least + 1)))
        start = turn - length // 2 + round((drawn[2] - 0.5) * 0.1 * run.rate_hz)
        if length < least:
            break
        if start >= 0 and start + length <= samples:
            shift[start : start + length] = cluster(length, drawn[3], drawn[4])
            left -= length
    return shift


def cluster(length: int, size: float, slope: float) -> F8:
    """Return the displacements of one cluster (length,), in m: nearly constant, with ramps of up to two rows.

    ``size`` and ``slope`` are in (0, 1).
    """
    smallest, largest = ECHO_SHIFT_M
    flat = (smallest + size * (largest - smallest)) * (1 + 0.1 * (slope - 0.5) * np.linspace(-1, 1, length))
    edge = 2 if length >= 8 else 1 if length >= 5 else 0
    rise = np.arange(1, length + 1) / (edge + 1)
    shift: F8 = flat * np.minimum(1, np.minimum(rise, rise[::-1]))
    return shift


def measure(run: Run) -> Record:
    """Return the sensor's readings: motion, limit, false echoes and noise, rounded to ticks of the timer."""
    samples = max(run.rows, run.velocity_rows or 0)
    bits = np.random.PCG64(run.seed)
    errors, heavy = noise(bits, samples)
    shift = false_echoes(run, bits, samples)
    true_m = motion(run, seconds_since_first(run, samples))
    limit_m = math.inf if run.limit_m is None else run.limit_m
    exact_ticks = (np.minimum(true_m, limit_m) + shift + errors) / (run.quantum_nm * 1e-9)
    return Record(
        exact_ticks=exact_ticks,
        ticks=np.rint(exact_ticks).astype(np.int64),
        echo_rows=rows_where(shift != 0, run.rows),
        clipped_rows=rows_where(true_m > limit_m, run.rows),
        heavy_rows=rows_where(heavy, run.rows),
    )


def rows_where(condition: NDArray[np.bool_], rows: int) -> list[int]:
    """Return the row numbers below ``rows`` at which the condition (n,) is true."""
    found: list[int] = np.flatnonzero(condition[:rows]).tolist()
    return found


# --- the files


def three_decimals(numerator: int, denominator: int) -> str:
    """Return numerator / denominator with three decimals by integer arithmetic; a half is rounded away from 0."""
    thousandths = (2000 * abs(numerator) + denominator) // (2 * denominator)
    sign = "-" if numerator < 0 and thousandths else ""
    return f"{sign}{thousandths // 1000}.{thousandths % 1000:03d}"


def text_file(run: Run, columns: str, rows: Sequence[str]) -> bytes:
    """Return the file's bytes: header lines and rows, with CRLF between them and nothing after the last one."""
    header = [] if run.title is None else [run.title, columns]
    return "\r\n".join([*header, *rows]).encode("ascii")


def position_file(run: Run, record: Record) -> bytes:
    """Return the position file: nominal time (s), distance (cm) and the constant error column (cm)."""
    times = (three_decimals(run.first + i, run.rate_hz) for i in range(run.rows))
    distances = (three_decimals(tick * run.quantum_nm, 10**7) for tick in record.ticks[: run.rows].tolist())
    rows = [f"{t}\t{distance}\t{STATED_ERROR_CM}" for t, distance in zip(times, distances, strict=True)]
    return text_file(run, "Time (s)\tDistance (cm)\tDist Error (cm)", rows)


def velocity_file(run: Run, record: Record) -> bytes:
    """Return the velocity file: nominal time (s) and backward difference of the distance before printing (cm/s)."""
    steps = np.diff(record.ticks[: run.velocity_rows]).tolist()
    speeds = ["NaN", *(three_decimals(step * run.quantum_nm * run.rate_hz, 10**7) for step in steps)]
    rows = [f"{three_decimals(run.first + i, run.rate_hz)}\t{speed}" for i, speed in enumerate(speeds)]
    return text_file(run, "Time (s)\tVelocity (cm/s)", rows)


def truth_values(run: Run) -> dict[str, dict[str, object]]:
    """Return the true values and units by name; amplitude, phase and damping rate are those at the first sample."""
    omega = angular_frequency_rad_per_s(run.bench)
    rate = run.gamma_per_s + run.beta_per_m_s * run.amplitude_m
    values: dict[str, tuple[float, str]] = {
        "period": (2 * math.pi / omega, "s"),
        "frequency": (omega / (2 * math.pi), "Hz"),
        "angular_frequency": (omega, "rad/s"),
        "amplitude": (run.amplitude_m, "m"),
        "offset": (run.offset_m, "m"),
        "phase": (run.phase_rad, "rad"),
        "noise": (math.hypot(NOISE_M, run.quantum_nm / 1e9 / math.sqrt(12)), "m"),
        "gamma": (run.gamma_per_s, "1/s"),
        "beta": (run.beta_per_m_s, "1/(m s)"),
        "damping_rate": (rate, "1/s"),
        "quality_factor": (omega / (2 * rate), ""),
        "spring_constant": (SPRING_CONSTANT_N_PER_M, "N/m"),
        "effective_mass": (effective_mass_kg(run.bench), "kg"),
        "added_mass": (added_mass_kg(run.bench), "kg"),
        "air_density": (air_density_kg_per_m3(), "kg/m^3"),
        "quantum": (run.quantum_nm / 1e9, "m"),
    }
    return {name: {"value": value, "unit": unit} for name, (value, unit) in values.items()}


def truth_file(run: Run, record: Record, files: Sequence[str]) -> bytes:
    """Return the true values as JSON, with one line per quantity and one line per list of rows."""
    content: dict[str, object] = {
        "kind": "simulated",
        "format": "MotionSensor.vi",
        "files": list(files),
        "seed": run.seed,
        "rate_hz": run.rate_hz,
        "samples": run.rows,
        "velocity_samples": run.velocity_rows,
        "t_first_s": run.first / run.rate_hz,
        "law": "linear+quadratic" if run.beta_per_m_s else "linear",
        "conventions": {
            "motion": "y = offset + A(t) cos(omega (t - t_first) + phase)",
            "damping": "dA/dt = -(gamma A + beta A^2), A(t_first) = amplitude",
            "noise": "standard deviation of a reading's core, rounding to ticks included",
            "rows": "counted from 0 at the first data row of the position file",
        },
        "truth": truth_values(run),
        "heavy_tail": {"fraction": HEAVY_FRACTION, "factor": HEAVY_FACTOR},
        "clip_limit_m": run.limit_m,
        "counts": {
            "false_echo": len(record.echo_rows),
            "clipped": len(record.clipped_rows),
            "heavy_tail": len(record.heavy_rows),
        },
        "false_echo_rows": record.echo_rows,
        "clipped_rows": record.clipped_rows,
        "heavy_tail_rows": record.heavy_rows,
        "scene_file": run.bench.scene_file,
        "scene": scene_tables(run.bench),
    }
    return (json_lines(content) + "\n").encode("ascii")


def json_lines(content: Mapping[str, object], indent: str = "") -> str:
    """Return a JSON object with one line per key; nested objects are expanded by one level."""
    lines = []
    for key, value in content.items():
        inner = json_lines(value, indent + "  ") if isinstance(value, dict) and not indent else json.dumps(value)
        lines.append(f"{indent}  {json.dumps(key)}: {inner}")
    return "{\n" + ",\n".join(lines) + f"\n{indent}}}"


def scene_file(bench: Bench) -> bytes:
    """Return the scene as TOML."""
    lines = ["# What was at the bench of the simulated run; the values are the true ones."]
    for table, keys in scene_tables(bench).items():
        lines += ["", f"[{table}]", *(f"{key} = {toml_value(value)}" for key, value in keys.items())]
    return ("\n".join(lines) + "\n").encode("ascii")


def toml_value(value: object) -> str:
    """Return a number, a string, or a flat table of numbers as TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(inner)}" for key, inner in value.items()) + " }"
    return json.dumps(value) if isinstance(value, str) else format_number(value)


def format_number(value: object) -> str:
    """Return a number without an exponent, so that 0.00005 is not written as 5e-05."""
    text = f"{value:.6f}".rstrip("0") if isinstance(value, float) else str(value)
    return text + "0" if text.endswith(".") else text


def run_files(run: Run) -> dict[str, bytes]:
    """Return the bytes of each file of one run, by name."""
    record = measure(run)
    files = {f"{run.name}_position.txt": position_file(run, record)}
    if run.velocity_rows is not None:
        files[f"{run.name}_velocity.txt"] = velocity_file(run, record)
    return files | {f"{run.name}.truth.json": truth_file(run, record, list(files))}


def every_file() -> dict[str, bytes]:
    """Return the bytes of each file that belongs in the folder, by name."""
    files = {bench.scene_file: scene_file(bench) for bench in (UNDAMPED, DAMPED)}
    for run in RUNS:
        files |= run_files(run)
    return files


# --- the program


def check(folder: Path, files: Mapping[str, bytes]) -> int:
    """Print on stderr each file that is missing or differs; return 1 if there is one, otherwise 0."""
    wrong = 0
    for name, content in files.items():
        path = folder / name
        if not path.is_file():
            print(f"{path}: missing; run generate.py without --check", file=sys.stderr)
        elif path.read_bytes() != content:
            print(f"{path}: differs from what generate.py writes", file=sys.stderr)
        else:
            continue
        wrong = 1
    return wrong


def write(folder: Path, files: Mapping[str, bytes]) -> int:
    """Write the files, creating the folder if necessary; return 0."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check the files; return the exit code, which is 3 if the folder cannot be used."""
    parser = argparse.ArgumentParser(description="Write the simulated recordings and their truth.")
    parser.add_argument("folder", nargs="?", type=Path, default=HERE, metavar="DIR", help="where (default: here)")
    parser.add_argument("--check", action="store_true", help="compare instead of writing; exit 1 where files differ")
    options = parser.parse_args(arguments)
    action: Callable[[Path, Mapping[str, bytes]], int] = check if options.check else write
    try:
        return action(options.folder, every_file())
    except OSError as error:
        print(f"{options.folder}: {error.strerror or error}", file=sys.stderr)
        return 3


if __name__ == "__main__":
    sys.exit(main())
