"""Run a command line and describe all that it gives as a flat table: its exit code, its JSON, the files that it writes.

Only the command line is called, so nothing here holds a module, a class or a stage in place. Sentences are left out,
because they may be worded anew. A number with an uncertainty is one entry.
"""

import contextlib
import csv
import functools
import hashlib
import io
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np
from jsonschema import Draft202012Validator

from tests.golden.inputs import ROOT, Places

Value = str | int | float | bool | tuple[float, float, str]
"""A text, a count, a number, or a number with its standard uncertainty and unit."""
Table = dict[str, Value]

SENTENCES = {"message", "advice", "title", "why", "family", "path", "reason", "needs", "words", "detail", "details"}
"""Keys of JSON whose text may be worded anew, or that name a file of this machine."""
DROPPED = {"schema", "sha256", "correlations", "provenance", "time_s", "choosing_s", "running_s"}
"""Keys that say nothing of the outputs, take too much room, or measure time."""
LISTED = 0.02
"""The smallest share of a budget that is listed, and what a coverage factor must exceed 2 by."""
DECODING = ("recover", "convert", "replay")
"""Commands that only read and write: their samples are equal to the last bit."""


def run(words: list[str]) -> tuple[int, str, str]:
    """Run one command line in this process: exit code, stdout, stderr."""
    from springmass.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(words)
    return int(code or 0), out.getvalue(), err.getvalue()


def outcome(places: Places, words: list[str]) -> Table:
    """Run a command line and return the table of its outputs."""
    with TemporaryDirectory() as folder:
        fresh = Path(folder)
        filled = places.filled(words, fresh)
        before = set(fresh.rglob("*"))
        with contextlib.chdir(fresh):  # what lands in the working folder is seen as well
            code, out, err = run(filled)
        table: Table = {"exit": code}
        for path in sorted(set(fresh.rglob("*")) - before):
            if path.is_file():
                table |= _file(path, path.relative_to(fresh).as_posix(), exact=words[0] in DECODING)
    if code:
        table |= _refusal(code, err, filled)
    if words[0] == "replay":
        rows = [line for line in out.splitlines() if line[:1] in "-0123456789"]
        return table | {"rows": len(rows), "sha256": _digest("\n".join(rows).encode())}
    for number, line in enumerate(filter(None, out.splitlines())):
        with contextlib.suppress(json.JSONDecodeError):
            result = json.loads(line, parse_constant=_no_json)
            table |= _invalid(result) | dict(_leaves(_prepared(result), str(number) if number else ""))
    if words[0] == "scene":
        table["keys"] = " ".join(sorted(re.findall(r"\[\w+\] \w+|\b\w+_(?:implausible|unusual)\b", out))) or "none"
    return table


def _no_json(constant: str) -> str:
    """Return what stands for NaN and the infinities, which are no JSON."""
    return f"{constant} is no JSON"


def _invalid(result: Any) -> Table:
    """Return where JSON of a run or a comparison differs from the published schema; nothing if it does not."""
    keys = result if isinstance(result, dict) else ()
    kind = "RunResult" if "estimates" in keys else "ComparisonResult" if "joint_damping" in keys else None
    error = None if kind is None else next(_validator(kind).iter_errors(result), None)
    return {} if error is None else {"invalid": f"{error.json_path}: {error.message}"}


@functools.cache
def _validator(kind: str) -> Draft202012Validator:
    """Return what checks JSON against a part of the published schema, in which no further fields may stand."""

    def closed(schema: Any) -> Any:
        if isinstance(schema, list):
            return [closed(each) for each in schema]
        if not isinstance(schema, dict):
            return schema
        inner = {key: closed(each) for key, each in schema.items()}
        return inner | {"additionalProperties": False} if "required" in schema else inner

    schema = closed(json.loads((ROOT / "docs/reference/results.schema.json").read_text("utf-8")))
    return Draft202012Validator(schema | {"anyOf": [{"$ref": f"#/$defs/{kind}"}]})


def _refusal(code: int, err: str, words: list[str]) -> Table:
    """Return how a refusal looks, and the options that it names and that were not typed."""
    defect = code == 70 or "Traceback" in err or "internal error" in err
    lines = [line for line in err.splitlines() if line.startswith("springmass: ")]
    said = "defect" if defect else "one line" if len(lines) == 1 else f"{len(lines)} lines"
    options = {option for option in re.findall(r"--[a-z][a-z-]+", err) if option not in words}
    return {"refusal": said} | ({"refusal names": " ".join(sorted(options))} if options else {})


def _prepared(result: Any) -> Any:
    """Return one JSON object without what is left out, and with what is long made short."""
    if isinstance(result, list):
        return [_prepared(each) for each in result]
    if not isinstance(result, dict):
        return result
    short = {key: _prepared(value) for key, value in result.items() if key not in DROPPED | SENTENCES}
    for key in ("findings", "traps"):
        if (listed := result.get(key)) and isinstance(listed[0], dict):
            short[key] = {each["code"]: each.get("severity", each.get("count")) for each in listed}
    if isinstance(result.get("effects"), list):
        short["effects"] = [each["name"] for each in result["effects"] if each["included"]]
    if isinstance(result.get("budget"), dict):
        short["budget"] = {name: dict(_shares(each)) for name, each in result["budget"].items()}
    if isinstance(result.get("grades"), dict):
        short["grades"] = {
            name: ": ".join([each["grade"], ", ".join(each["reasons"])])
            for name, each in result["grades"].items()
            if each["grade"] != "sound"
        }
    damping = short.get("damping")
    if isinstance(damping, dict) and "laws" in damping:
        damping["rejected"] = [name for name, law in damping.pop("laws").items() if law["rejected"]]
        for coefficient in damping["coefficients"].values():
            coefficient.pop("law")
    return short


def _shares(budget: dict[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield a coverage factor above that of a normal distribution, and the shares of at least two hundredths."""
    if (factor := budget.get("coverage_factor") or 2.0) >= 2.0 + LISTED:
        yield "coverage_factor", round(factor, 3)
    for each in budget.get("inputs", []):
        if (each.get("share") or 0.0) >= LISTED:
            yield f"share {each['name']}", round(each["share"], 3)


def _leaves(value: Any, path: str) -> Iterator[tuple[str, Value]]:
    """Flatten JSON or TOML; what is None or empty has no entry."""
    if isinstance(value, dict):
        if isinstance(value.get("value"), (int, float)) and isinstance(value.get("u"), (int, float)):
            yield path, (float(value["value"]), float(value["u"]), str(value.get("unit") or ""))
            value = {key: each for key, each in value.items() if key not in ("value", "u", "unit")}
        for key, each in value.items():
            yield from _leaves(each, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list):
        if value and all(isinstance(each, str) for each in value):
            yield path, " ".join(value)
        elif len(value) > 12 and all(isinstance(each, (int, float)) for each in value):
            yield from _column(path, np.asarray(value, float), exact=False)
        else:
            for index, each in enumerate(value):
                yield from _leaves(each, f"{path}.{index}")
    elif isinstance(value, (bool, int, float)) or (isinstance(value, str) and value):
        yield path, value


def _file(path: Path, name: str, *, exact: bool) -> Table:
    """Describe a file that a command wrote."""
    name = re.sub(r"-[0-9a-f]{8}(?=\.results/)", "", name)  # a digest of where the recording lies
    table: Table = {name: "written"}
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            file.visititems(lambda at, item: table.update(_dataset(f"{name} {at}", item, exact=exact)))
    elif path.suffix == ".toml":
        table |= dict(_leaves(_prepared(tomllib.loads(path.read_text("utf-8"))), name))
    elif path.name == "results.csv" and "course" in name:
        table |= _course(path, name)
    elif path.suffix == ".csv":
        rows = list(csv.reader(path.read_text("utf-8").splitlines()))
        table |= {f"{name} rows": len(rows), f"{name} columns": " | ".join(rows[0] if rows else [])}
        if exact:
            table[f"{name} sha256"] = _digest(path.read_bytes())
    elif path.suffix == ".txt" and exact:
        table[f"{name} sha256"] = _digest(path.read_bytes())
    return table


def _dataset(at: str, item: Any, *, exact: bool) -> Table:
    """Describe a column of samples of a run file, and of the times at which its bytes came."""
    if not isinstance(item, h5py.Dataset) or item.ndim != 1 or not item.size or item.dtype.kind not in "fiu":
        return {}
    return {} if item.name.startswith("/wire") else dict(_column(at, item[()], exact=exact))


def _column(at: str, values: Any, *, exact: bool) -> Iterator[tuple[str, Value]]:
    """Describe a column by its length, and by its bits or nine of its numbers."""
    yield f"{at} length", int(values.size)
    if exact or values.dtype.kind != "f":
        yield f"{at} sha256", _digest(np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes())
    elif np.isfinite(values).any():
        # Numbers of a column are compared at a thousandth of its range.
        tenth = 0.1 * float(np.ptp(values[np.isfinite(values)]))
        for index in np.unique(np.linspace(0, values.size - 1, 9).astype(int)):
            yield f"{at}[{index}]", (float(values[index]), tenth, "")


def _course(path: Path, name: str) -> Table:
    """Return the table of a course: a number and its u are one entry."""
    table: Table = {}
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            for key, text in row.items():
                if not text or key in SENTENCES | DROPPED or key.endswith(("_u", "sha256")) or key in _FREE:
                    continue
                at, value, u = f"{name} {row['run']}.{key}", _number(text), _number(row.get(f"{key}_u") or "")
                table[at] = text if value is None else value if u is None else (value, u, "")
    return table


_FREE = ("error", "messages", "correlations", "drag_points", "software")
"""Columns of a course with sentences, with long lists, or that change with every commit."""


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _digest(data: bytes) -> str:
    return f"sha-{hashlib.sha256(data).hexdigest()[:16]}"
