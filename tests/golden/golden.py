"""What a command line says, as a flat table, and its comparison with what 0.2.0 (commit 1096557) said.

Only the command line is called, so nothing here holds a module, a class or a stage in place. A golden is a table of
path -> [value, tolerance]. A value may move by ``TOLERANCE`` of its uncertainty u, and u by ``TOLERANCE`` of itself;
counts, codes of findings, laws and exit codes are exact. Goldens are never regenerated,
so that small moves do not add up. A change on purpose is a line of the ``.allow`` file: a pattern of ``command line |
path``, ``#`` and the reason; it names one code or one kind of recording. Where an option or a JSON name changes, one
table in ``run`` or ``outcome`` translates the old into the new.

In a command line ``{0}`` stands for the shared recordings, ``{1}`` for sample_data, ``{2}`` for the synthetic records
of the archive, ``{C}`` for a course of 24 of them, ``{H}`` for this folder and ``{O}`` for a fresh one.
"""

from __future__ import annotations

import contextlib
import csv
import fnmatch
import hashlib
import io
import json
import math
import os
import shutil
import tarfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import h5py

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
RECORDINGS = ROOT.parent / "shared" / "recordings"
FROZEN, ALLOWED = HERE / "golden-0.2.0.json", HERE / "golden-0.2.0.allow"
TOLERANCE, EXACT = 0.02, 1e-9
GROW = float(os.environ.get("VALUES", TOLERANCE)) / TOLERANCE
GROW_U = float(os.environ.get("US", TOLERANCE)) / TOLERANCE
"""By VALUES=0.1 US=0.25 a simpler estimation may move a value by a tenth of its u and a u by a quarter of itself."""
KEPT = ("quality", "estimates", "spring", "joint_damping", "comparison", "classic", "equation", "method", "amplitude_m")
STANDARDISED = ("pull", "chi2", "excess_chi2")
"""Numbers in units of a standard uncertainty, or squares of such: ten thousandths of it are rounding."""
COURSE_LEFT_OUT = ("path", "error", "messages", "correlations", "drag_points", "software")

BENCH = {
    "--mass-kg": ("--mass-u-kg", "bob.mass_kg"),
    "--spring-mass-kg": ("--spring-mass-u-kg", "spring.mass_kg"),
    "--disc-diameter-m": ("--disc-diameter-u-m", "disc.diameter_m"),
    "--temperature-c": ("--temperature-u-c", "air.temperature_c"),
}
"""Options of 0.2.0 for a value of the bench and its uncertainty, and the key that ``--set`` takes instead."""

Table = dict[str, list[Any]]


@dataclass(frozen=True, slots=True)
class Places:
    """The folders that the braces of a command line stand for."""

    folders: dict[str, Path]

    def filled(self, words: list[str]) -> list[str]:
        """Put the folders in place; ``{O}`` stays until the command runs."""
        for name, folder in self.folders.items():
            words = [word.replace(name, str(folder)) for word in words]
        return words


def unpacked(folder: str | Path) -> Places:
    """Unpack the synthetic records into a folder, and make the course there."""
    troubles, course = Path(folder) / "troubles", Path(folder) / "course"
    with tarfile.open(HERE / "troubles.tar.xz") as archive:
        archive.extractall(troubles, filter="data")
    samples = sorted((ROOT / "sample_data").glob("*damped_simulated_position.txt"))
    records = [troubles / f"trouble{number}.csv" for number in range(200)]
    course.mkdir()
    for path in [*samples, *(record for record in records if record.exists())][:24]:
        shutil.copy(path, course)
    return Places({"{0}": RECORDINGS, "{1}": ROOT / "sample_data", "{2}": troubles, "{C}": course, "{H}": HERE})


def missing(places: Places, words: list[str]) -> bool:
    """Say whether a command line needs the shared recordings where there are none."""
    return any("{0}" in word for word in words) and not places.folders["{0}"].is_dir()


@cache
def frozen() -> dict[str, Table]:
    """Return the goldens by command line, which is a JSON list of words."""
    return dict(json.loads(FROZEN.read_text("utf-8")))


def translated(words: list[str]) -> list[str]:
    """Return a command line of 0.2.0 in today's options."""
    words = list(words)
    for option, (of_u, key) in BENCH.items():
        if option in words:
            value = words[words.index(option) + 1]
            if of_u in words:
                at_u = words.index(of_u)
                value += f"+/-{words[at_u + 1]}"
                del words[at_u : at_u + 2]
            at = words.index(option)
            words[at : at + 2] = ["--set", f"{key}={value}"]
    return words


def run(words: list[str]) -> tuple[int, str, str]:
    """Run one command line in this process: exit code, stdout, stderr."""
    from springmass.cli import main

    words = translated(words)
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(words)
    return int(code or 0), out.getvalue(), err.getvalue()


def outcome(words: list[str]) -> Table:
    """Run a command line and return what it says as a flat table."""
    with TemporaryDirectory() as fresh:
        words = [word.replace("{O}", fresh) for word in words]
        code, out, err = run(words)
        motion = _motion(Path(fresh) / "x.h5") | _course(Path(fresh) / "course" / "results.csv")
    defect = code == 70 or "Traceback" in err or "internal error" in err
    said = "defect" if defect else "one line" if len(err.splitlines()) == 1 else "other"
    table: Table = {"exit": [code, None]} | ({"refusal": [said, None]} if code else {}) | motion
    if words[0] == "batch":
        return table
    if words[0] == "replay":
        rows = [line for line in out.splitlines() if line[:1] in "-0123456789"]
        digest = hashlib.sha256("\n".join(rows).encode()).hexdigest()
        return table | {"samples": [len(rows), None], "sha256": [digest, None]}
    for number, line in enumerate(filter(None, out.splitlines())):
        result = json.loads(line)
        table |= _leaves(_results(result), str(number) if number else "") | _shares(result.get("budget") or {})
    return table


def _results(result: dict[str, Any]) -> dict[str, Any]:
    """Return what is compared of one JSON object of the command line."""
    keep: dict[str, Any] = {name: result.get(name) for name in KEPT if name in result}
    keep.get("comparison", {}).pop("message", None)
    keep["input"] = {name: value for name, value in (result.get("input") or {}).items() if name != "path"}
    damping = result.get("damping") or {}
    keep["damping"] = {name: damping.get(name) for name in ("selected", "admissible", "stated", "coefficients")}
    keep["findings"] = {found["code"]: found["severity"] for found in result.get("findings", [])}
    keep["effects"] = {effect["name"]: bool(effect["included"]) for effect in result.get("effects", [])}
    return keep


def _shares(budget: dict[str, Any]) -> Table:
    """Return the shares of the budgets above one hundredth, which may move by two hundredths."""
    return {
        f"budget.{name}.{share['name']}": [share["share"], 0.02]
        for name, each in budget.items()
        for share in each.get("inputs", [])
        if (share.get("share") or 0) > 0.01
    }


def _leaves(value: Any, path: str = "") -> Table:
    """Flatten a result; an estimate gives a value and a u with tolerances from its u."""
    if isinstance(value, dict) and {"value", "u"} <= set(value) and isinstance(value["value"], (int, float)):
        u = value["u"] if isinstance(value["u"], (int, float)) and math.isfinite(value["u"]) else None
        table: Table = {path: [value["value"], TOLERANCE * u if u else EXACT * abs(value["value"])]}
        return table | {f"{path} u": [u, TOLERANCE * u if u else None], f"{path} unit": [value.get("unit"), None]}
    if isinstance(value, (dict, list)):
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        return {
            below: leaf
            for key, each in pairs
            for below, leaf in _leaves(each, f"{path}.{key}" if path else key).items()
        }
    return {path: [value, EXACT * abs(value) if isinstance(value, float) else None]}


def _motion(path: Path) -> Table:
    """Return eleven distances of a simulated run, each with a tolerance of a thousandth of the swing."""
    if not path.exists():
        return {}
    with h5py.File(path) as file:
        y = file["distance"][()]
    tolerance = 1e-3 * float(y.max() - y.min())
    return {f"y[{i}]": [float(y[i]), tolerance] for i in range(0, y.size, max(y.size // 10, 1))}


def _course(path: Path) -> Table:
    """Return the table of a course: numbers with tolerances from their u, counts, laws and codes as they are."""
    if not path.exists():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    table: Table = {"rows": [len(rows), None]}
    for row in rows:
        for name, text in row.items():
            if not text or name in COURSE_LEFT_OUT or name.endswith("sha256"):
                continue
            at = f"{row['run']}.{name}"
            u = _number(row.get(f"{name}_u", ""))
            value = _number(text)
            if value is None:
                table[at] = [text, None]
            elif name.endswith("_u"):
                table[f"{at[:-2]} u"] = [value, TOLERANCE * abs(value)]
            else:
                table[at] = [value, TOLERANCE * u if u else EXACT * abs(value)]
    return table


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def differences(key: str, before: Table, now: Table) -> tuple[list[str], list[str], float]:
    """Return what changed, what of it is allowed, and the greatest move of the others in tolerances."""
    changed, worst = [], 0.0
    for path in {**before, **now}:
        (a, tolerance), (b, _) = before.get(path, ["absent", None]), now.get(path, ["absent", None])
        if path.startswith("budget."):  # shares below one hundredth are not listed
            a, b, tolerance = 0.0 if a == "absent" else a, 0.0 if b == "absent" else b, 0.02
        elif tolerance is not None:
            tolerance *= GROW_U if path.endswith(" u") else GROW
            if path.rpartition(".")[2] in STANDARDISED:
                tolerance = max(tolerance, 1e-4)
        numbers = all(isinstance(each, (int, float)) and not isinstance(each, bool) for each in (a, b))
        if a == b:
            continue
        if numbers and tolerance is not None and abs(a - b) <= tolerance:
            worst = max(worst, abs(a - b) / tolerance)
        else:
            changed.append(f"{path}: {a} -> {b}")
    name = " ".join(json.loads(key))
    kept = [line for line in changed if not _allowed(f"{name} | {line.partition(':')[0]}")]
    return kept, [line for line in changed if line not in kept], worst


def _allowed(line: str) -> bool:
    return any(fnmatch.fnmatch(line, pattern) for pattern in _patterns())


@cache
def _patterns() -> tuple[str, ...]:
    lines = ALLOWED.read_text("utf-8").splitlines() if ALLOWED.exists() else []
    return tuple(filter(None, (line.partition("#")[0].strip() for line in lines)))
