"""Rows of a course: their schema in the store, and the columns of the table made from them."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, field

from acquisition.errors import visible
from pipeline.bench.scene import PLACES
from storage.schema import Count, ValueRefused, decoded, parsed

__all__ = [
    "COLUMNS",
    "COURSE",
    "DETAILS",
    "ESTIMATES",
    "FAILED",
    "LARGEST",
    "NUMBERS",
    "RESERVED",
    "TAG",
    "UNITS",
    "WHOLE",
    "Digest",
    "NoDigest",
    "Tag",
    "checked_row",
    "columns_of",
    "dumped",
    "flat",
]

ESTIMATES = (
    "period", "frequency", "angular_frequency", "spring_constant", "amplitude", "displacement_amplitude",
    "angle_amplitude", "offset", "noise", "phase", "damping_rate", "quality_factor", "velocity_rms", "reynolds_number",
    "reynolds_number_start",
    "keulegan_carpenter_number", "drag_coefficient", "gamma", "beta", "mu", "c", "n", "natural_angular_frequency",
    "own_mass_kg", "first_mode_period", "second_mode_period", "first_mode_amplitude", "second_mode_amplitude",
    "relaxation_rate", "relaxation_rate_slow", "relaxation_rate_fast",
)  # fmt: skip
"""Estimates with two columns each: the value, and with ``_u`` the standard uncertainty, in SI units."""
POSITIVE = ("period", "frequency", "angular_frequency", "natural_angular_frequency", "own_mass_kg")
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
"""Units of columns whose unit is the same in every run; for the others it follows from the column ``unit``."""
DETAILS = ("findings", "messages", "correlations", "drag_points")
"""Columns that contain JSON."""
LAW_COLUMNS = ("law", "admissible", "stated_law", "one_law", "undetermined")
COLUMNS = (*_FIRST, *_INPUT, *LAW_COLUMNS, *WHOLE, *NUMBERS, *_HASHES, *DETAILS)
COURSE = "course"
"""Column with the folder of the course, used when several courses are read together."""
RESERVED = frozenset((COURSE, *COLUMNS))
"""Names that no tag may have."""
FAILED = ("failed", "ended", "no_oscillation")
"""Values of ``status`` for runs without a period; "ended" means that the worker process died."""

LARGEST = 1e100
"""Maximum magnitude of numbers in a row, whose square is still finite. Larger estimates are left out."""
TAG = re.compile(r"[a-z][a-z0-9_]*")

Digest = Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]
NoDigest = Annotated[str, Meta(pattern="^([0-9a-f]{64})?$")]
Tag = Annotated[str, Meta(pattern=f"^{TAG.pattern}$")]
_Number = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
_Size = Annotated[float, Meta(ge=0.0, le=LARGEST)]
_Estimate = tuple[_Number | None, _Size | None]
_Path = Annotated[str, Meta(pattern=r"^[^\x00]+$")]


class _Answers(Struct, forbid_unknown_fields=True):
    """Stated reading options of a recording, see :class:`springmass.runs.options.ReadOptions`."""

    velocity: _Path | None = None
    channel: str | None = None
    run: str | None = None
    rate_hz: float | None = None
    unit: str | None = None
    time: str | None = None
    time_unit: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    from_s: float | None = None
    to_s: float | None = None
    clock_ppm: float | None = None
    unverified: bool = False


class _Job(Struct, forbid_unknown_fields=True):
    """See :class:`springmass.batch.plan.Job`."""

    path: _Path
    answers: _Answers
    scene: dict[str, Any] | None
    tags: dict[Tag, str]
    accuracy: str
    law: str | None = None

    def __post_init__(self) -> None:
        for tag in self.tags:
            if tag in RESERVED:
                raise ValueRefused("tags", f"expected names that are no columns, got {tag!r}")


class _Correlations(Struct, forbid_unknown_fields=True):
    names: list[str] = field(default_factory=list)
    matrix: list[list[_Number | None]] = field(default_factory=list)


class _Row(Struct, forbid_unknown_fields=True, kw_only=True):
    """A row, made by :mod:`springmass.batch.worker` and stored by :mod:`springmass.batch.store`."""

    run: str = ""
    path: _Path
    status: Literal["ok", "no_oscillation", "failed", "ended"]
    error: str
    format: str | None = None
    kind: str | None = None
    channel: str | None = None
    unit: str | None = None
    start_time: str | None = None
    clock: str | None = None
    law: str | None = None
    admissible: str | None = None
    stated_law: str | None = None
    one_law: str | None = None
    undetermined: str | None = None
    samples: Count | None = None
    errors: Count = 0
    warnings: Count = 0
    rate_hz: _Number | None = None
    duration_s: _Number | None = None
    u_clock: _Size | None = None
    reduced_chi2: _Size | None = None
    estimates: dict[str, _Estimate]
    scene: dict[str, _Estimate]
    quality: dict[str, Count]
    findings: list[str]
    messages: list[tuple[Literal["error", "warning"], str]]
    # What the group should know: each harmful finding with its advice, the worst first.
    tell: list[str] = field(default_factory=list)
    correlations: _Correlations
    drag_points: list[tuple[_Size, _Size, _Number, _Size]]
    # The page inserts this text unchanged as an SVG path.
    thumbnail: Annotated[str, Meta(pattern="^(M[-+0-9.eL ]+Z)?$")]
    # Path, size in bytes and modification time in ns of every file from which the run was read.
    stamps: list[tuple[_Path, int, int]]
    hashes: dict[str, Digest]
    input_sha256: Digest | None
    scene_sha256: NoDigest
    parameters_sha256: Digest
    code_sha256: Digest
    job: _Job

    def __post_init__(self) -> None:
        _demand_names(self.estimates, "estimates", ESTIMATES)
        _demand_names(self.scene, "scene", PLACES)
        _demand_names(self.quality, "quality", QUALITY)
        for name in POSITIVE:
            value, _ = self.estimates.get(name, (None, None))
            if value is not None and value <= 0.0:
                raise ValueRefused(f"estimates.{name}", f"expected a positive number, got {value!r}")


def _demand_names(table: Mapping[str, Any], key: str, allowed: Collection[str]) -> None:
    for name in table:
        if name not in allowed:
            raise ValueRefused(key, f"expected names of columns, got {ascii(name)[:60]}")


def checked_row(text: bytes, key: str) -> dict[str, Any]:
    """Return a row of the store after checking its types, ranges and names.

    Parameters
    ----------
    text : bytes
        A JSON object.
    key : str
        Name of the row in error messages.

    Raises
    ------
    storage.schema.ValueRefused
        For the first value that is invalid in a row.
    """
    row: dict[str, Any] = parsed(text, key)
    decoded(row, _Row, key)
    return row


def columns_of(tags: Sequence[str]) -> tuple[str, ...]:
    """Return the columns of a course's table, with its tags after the status."""
    return (*_FIRST, *tags, *COLUMNS[len(_FIRST) :])


def dumped(value: object) -> str:
    """Return canonical JSON in one line: equal values give equal text."""
    return json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":"), sort_keys=True)


def flat(row: Mapping[str, Any], run: str, tags: Sequence[str]) -> dict[str, Any]:
    """Return a row of the table by column: text, integers, floats, or None for unknown values.

    Control characters, direction marks and lone surrogates, which a file name may contain, become escapes.

    Parameters
    ----------
    row : mapping
        Row of the store.
    run : str
        Name of the run.
    tags : sequence of str
        The course's own columns.
    """
    cells: dict[str, Any] = {"run": run, **{tag: row["job"]["tags"].get(tag) for tag in tags}}
    for name, (value, u) in {**row["estimates"], **row["scene"]}.items():
        cells[name], cells[f"{name}_u"] = value, u
    cells.update(row["quality"])
    messages = [[severity, visible(message)] for severity, message in row["messages"]]
    for name, value in {**{name: row[name] for name in DETAILS}, "messages": messages}.items():
        cells[name] = dumped(value) if value else None
    return {name: _text(cells.get(name, row.get(name))) for name in columns_of(tags)}


def _text(value: Any) -> Any:
    return visible(value) if isinstance(value, str) else value
