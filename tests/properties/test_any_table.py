"""Tables at random: of the dialects that people have nearly all open right or ask.

Numbers are drawn with seeds; what a table holds is known because it was written here.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.identify import open_recording
from acquisition.recordings.questions import Missing
from acquisition.recordings.reading import ReadOptions
from acquisition.recordings.recording import Recording
from tests.sampling import sampled

TIME_NAMES = ("t", "time", "Time", "Zeit", "tiempo", "Tempo", "temps", "times", "elapsed time", "Time Run 2", "czas")
VALUE_NAMES = ("x", "y", "Position", "theta", "Weg s_A1", "posizione", "Channel 1", "x_rojo", "amplitude", "Pos A")
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "rad": 1.0, "deg": np.pi / 180, "V": 1.0, "m/s^2": 1.0, "": 1.0}
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "": 1.0}
PREAMBLES = (
    [],
    ["Chart recorder, bench 3"],
    ["Logger v2", "Sample rate: 100 Hz", "Created: Tue Mar 12 17:31:44 2024"],
    ["--- Pendolo di torsione ---", ""],
    ["run start = 2017-03-30 13:44:57", "mass = 37 g"],
)


@dataclass(frozen=True)
class Written:
    """A table and what it holds, in SI units."""

    text: str
    t: np.ndarray
    value: np.ndarray
    unit: str
    time_unit: str
    channel: str


def heading(name: str, unit: str, form: str) -> str:
    """Write a name with its unit."""
    if not unit or form == "below":
        return name
    return {"brackets": f"{name} ({unit})", "square": f"{name} [{unit}]", "slash": f"{name} / {unit}"}[form]


Names, Rows = list[tuple[str, str]], list[tuple[str, ...]]


def monitor(names: Names, rows: Rows) -> list[str]:
    """Write what a serial monitor logs: the clock before each line."""
    lines = [", ".join(f"{name} ({unit})" if unit else name for name, unit in names), *map(",".join, rows)]
    return [f"15:{i // 6000:02d}:{i // 100 % 60:02d}.{i % 100:02d}0 -> {line}" for i, line in enumerate(lines)]


def quoted(names: Names, rows: Rows) -> list[str]:
    """Write cells in quotes, with decimal commas between commas."""
    head = [f"{name} ({unit})" if unit else name for name, unit in names]
    return [",".join(f'"{cell.replace(".", ",")}"' for cell in row) for row in (head, *rows)]


DRESSES = (monitor, quoted)


def write(seed: int) -> Written:
    """Write one table: separators, decimal mark, preamble, names, units, extra columns, jitter, and what wraps rows."""
    draw = random.Random(seed)
    noise = np.random.default_rng(seed)
    size = draw.randint(60, 400)
    rate = draw.choice((10.0, 25.0, 30.0, 50.0, 60.0, 100.0, 240.0))
    t = np.arange(size) / rate + draw.choice((0.0, 0.0, 1.25, -3.0))
    if draw.random() < 0.4:
        t = t + noise.uniform(-0.2, 0.2, size) / rate
    time_unit, unit = draw.choice(tuple(TIME_UNITS)), draw.choice(tuple(UNITS))
    value = draw.uniform(-2, 2) + draw.uniform(0.1, 3) * np.sin(draw.uniform(2, 9) * t) + noise.normal(0, 0.01, size)
    mark = draw.choice(("\t", ";", ",", ", ", " ", "  "))
    decimal = draw.choice((".", ",")) if mark in ("\t", ";", " ", "  ") else "."
    printed_t = [f"{each / TIME_UNITS[time_unit]:.9f}" for each in t]
    printed = [f"{each:.5f}" for each in value]
    columns = [[draw.choice(TIME_NAMES), time_unit, printed_t], [draw.choice(VALUE_NAMES), unit, printed]]
    extra = draw.random()
    if extra < 0.2:
        columns.insert(0, [draw.choice(("n", "index", "frame")), "", [str(i) for i in range(size)]])
    elif extra < 0.35:
        columns.append(["uncertainty", unit, ["0.009"] * size])
    elif extra < 0.5:
        columns.append(["state", "", [draw.choice(("ok", "low")) for _ in range(size)]])
    elif extra < 0.7:
        columns.append(["other", unit, [f"{each:.4f}" for each in noise.normal(0, 1, size)]])
        draw.shuffle(columns)
    forms = ("brackets", "square", "below") if "," in mark or " " in mark else ("brackets", "square", "slash", "below")
    form = draw.choice(forms)
    glue = "   " if not mark.strip(" ") else mark
    comment = draw.choice(("", "", "# ", "#", "% "))
    lines = [comment + line if line else line for line in draw.choice(PREAMBLES)]
    lines.append(comment + glue.join(heading(name, own, form) for name, own, _ in columns))
    if form == "below" and unit and time_unit:
        lines.append(comment + glue.join(f"({own})" if own else "()" for _, own, _ in columns))
        if draw.random() < 0.3:
            lines.append("")
    elif form == "below":
        unit = time_unit = ""
    rows = list(zip(*(cells for _, _, cells in columns), strict=True))
    numbers = [mark.join(cells) for cells in rows]
    lines += [row.replace(".", ",") if decimal == "," else row for row in numbers]
    plain = all(name != "state" for name, _, _ in columns)
    if plain and (dress := draw.choice((None, None, None, *DRESSES))) is not None:
        lines = dress([(name, own if unit and time_unit else "") for name, own, _ in columns], rows)
        unit, time_unit = (unit, time_unit) if unit and time_unit else ("", "")
    end = draw.choice(("\n", "\r\n"))
    text = draw.choice(("", "\ufeff")) + end.join(lines) + draw.choice(("", end))
    scale = UNITS[unit] if unit else 1.0
    said_t = np.array([float(each) for each in printed_t])
    name = next(name for name, _, cells in columns if cells is printed)
    return Written(text, said_t, np.array([float(x) for x in printed]) * scale, unit, time_unit, name)


def judge(path: Path, table: Written) -> str:
    """Return what is wrong with how a table was read; empty where it opened right, or asked and then did."""
    path.write_text(table.text, encoding="utf-8", newline="")
    answers: dict[str, str] = {}
    for _ in range(2):
        try:
            recording = open_recording(path, ReadOptions.of(answers))
        except NeedsAnswer as error:
            words = str(error)
            if "\n" in words or answers:
                return words
            known = {Missing.CHANNEL: table.channel, Missing.UNIT: "m", Missing.TIME_UNIT: "ms"}
            answers = {what.value: known[what] for what in error.question.missing if what in known}
            if not answers:
                return words
            continue
        except FormatError as error:
            return str(error)
        return wrong(recording, table, answers)
    return "asked twice"


def wrong(recording: Recording, table: Written, answers: dict[str, str]) -> str:
    """Compare channel, samples, times and values with what was written."""
    samples = recording.samples
    if recording.channel != table.channel or len(samples) != table.value.size or recording.malformed_rows:
        return f"{recording.channel}, {len(samples)} samples, {recording.malformed_rows} malformed"
    t = table.t * TIME_UNITS[table.time_unit or answers.get("time_unit", "s")]
    step = float(np.median(np.diff(t)))
    if not np.allclose(samples.t, t, rtol=0, atol=2e-3 * step + 1e-9):
        return f"times of {samples.t[:3]}, not {t[:3]}"
    sound = samples.flags & ~np.uint8(2) == 0
    return "" if np.allclose(samples.distance[sound], table.value[sound]) else f"values of {samples.distance[:3]}"


@pytest.mark.parametrize("tables", sampled([30, 100], 1))
def test_tables_of_the_dialects_open_right_or_ask(tmp_path: Path, tables: int) -> None:
    """Of a hundred at random at least 98 do, and none that opens is wrong in a time or a value."""
    found = {seed: judge(tmp_path / "run.txt", write(seed)) for seed in range(tables)}
    bad = {seed: words for seed, words in found.items() if words}
    assert len(bad) <= 2, bad
    assert not {seed: words for seed, words in bad.items() if words.startswith(("times", "values"))}
