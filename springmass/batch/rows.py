"""What a row of a course holds: columns, their types, and how a row of the store becomes one of the table."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from acquisition.errors import visible
from pipeline.bench.scene import PLACES

__all__ = [
    "COLUMNS",
    "DETAILS",
    "ESTIMATES",
    "FAILED",
    "FILTERED",
    "NUMBERS",
    "UNITS",
    "WHOLE",
    "columns_of",
    "dumped",
    "flat",
]

ESTIMATES = (
    "period", "frequency", "angular_frequency", "spring_constant", "amplitude", "displacement_amplitude",
    "angle_amplitude", "offset", "noise", "phase", "damping_rate", "quality_factor", "velocity_rms", "reynolds_number",
    "keulegan_carpenter_number", "drag_coefficient", "gamma", "beta", "mu", "c", "n", "natural_angular_frequency",
    "own_mass_kg", "first_mode_period", "second_mode_period", "first_mode_amplitude", "second_mode_amplitude",
    "relaxation_rate", "relaxation_rate_slow", "relaxation_rate_fast",
)  # fmt: skip
"""Each a column with its value and one, ``_u``, with its standard uncertainty, in SI units."""
QUALITY = (
    "used", "missing", "false_echo", "clipped", "duplicate_time", "non_monotonic_time", "outside", "malformed_rows",
)  # fmt: skip
_FIRST = ("run", "path", "status", "error")
_INPUT = ("format", "kind", "channel", "unit", "start_time", "clock")
_HASHES = ("input_sha256", "scene_sha256", "parameters_sha256", "code_sha256")
WHOLE = ("samples", *QUALITY, "errors", "warnings")
NUMBERS = (
    "rate_hz", "duration_s", "u_clock", "reduced_chi2",
    *(name for pair in ((x, f"{x}_u") for x in (*ESTIMATES, *PLACES)) for name in pair),
)  # fmt: skip
FILTERED = (
    "run", "status", "law", "period", "period_u", "spring_constant", "spring_constant_u", "amplitude",
    "damping_rate", "drag_coefficient", "reynolds_number", "keulegan_carpenter_number", "errors", "warnings",
    "bob_mass_kg", "disc_diameter_m", "duration_s",
)  # fmt: skip
"""Columns that are asked for most: a catalog has an index of each."""
UNITS = {
    **dict.fromkeys(("period", "first_mode_period", "second_mode_period", "duration_s"), "s"),
    **dict.fromkeys(("frequency", "rate_hz"), "Hz"),
    **dict.fromkeys(("angular_frequency", "natural_angular_frequency"), "rad/s"),
    **dict.fromkeys(
        ("damping_rate", "gamma", "relaxation_rate", "relaxation_rate_slow", "relaxation_rate_fast"), "1/s"
    ),
    **dict.fromkeys(("own_mass_kg", "bob_mass_kg", "spring_mass_kg"), "kg"),
    "spring_constant": "N/m",
    "displacement_amplitude": "m",
    "angle_amplitude": "rad",
    "phase": "rad",
    "disc_diameter_m": "m",
    "air_temperature_c": "degC",
    "air_pressure_pa": "Pa",
}
"""Of the columns that have the same in every run; that of the others is by the column ``unit``."""
DETAILS = ("findings", "messages", "correlations", "drag_points")
"""Columns of JSON, which no filter needs at once."""
COLUMNS = (*_FIRST, *_INPUT, "law", "admissible", *WHOLE, *NUMBERS, *_HASHES, *DETAILS)
FAILED = ("failed", "ended", "no_oscillation")
"""Values of ``status`` of runs that gave no period; "ended" is a process that was ended from outside."""


def columns_of(tags: Sequence[str]) -> tuple[str, ...]:
    """Return the columns of a course's table, its tags after the status."""
    return (*_FIRST, *tags, *COLUMNS[len(_FIRST) :])


def dumped(value: object) -> str:
    """Return JSON in one line, the same for the same value."""
    return json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":"), sort_keys=True)


def flat(row: Mapping[str, Any], run: str, tags: Sequence[str]) -> dict[str, Any]:
    """Return a row of the table by column: text, whole numbers, numbers, None where there is nothing.

    In text from outside control characters and marks of direction, and halves of characters that a file's name may
    hold, stand as escapes.

    Parameters
    ----------
    row : mapping
        As the worker made it.
    run : str
        The run's name.
    tags : sequence of str
        The columns that are the course's own.
    """
    found: dict[str, Any] = {"run": run, **{tag: row["job"]["tags"].get(tag) for tag in tags}}
    for name, (value, u) in {**row["estimates"], **row["scene"]}.items():
        found[name], found[f"{name}_u"] = value, u
    found.update(row["quality"])
    messages = [[severity, visible(message)] for severity, message in row["messages"]]
    for name, value in {**{name: row[name] for name in DETAILS}, "messages": messages}.items():
        found[name] = dumped(value) if value else None
    return {name: _text(found.get(name, row.get(name))) for name in columns_of(tags)}


def _text(value: Any) -> Any:
    return visible(value) if isinstance(value, str) else value
