"""Collect the names that the program writes: keys, codes, attributes, columns and messages.

``python -m tests.house.serialised_names --update`` adds the names that ``serialised_names.txt`` lacks. It never removes
one: scripts, notebooks and old files rely on every name that was once written.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import csv
import io
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Collection, Iterator, Mapping
from functools import cache
from http.cookiejar import CookieJar
from pathlib import Path
from typing import Any
from urllib.request import HTTPCookieProcessor, build_opener

import h5py
from websockets.sync.client import connect

from acquisition.block import Flag
from pipeline.bench.scene import PLACES
from pipeline.damping.laws import LAWS
from pipeline.findings.registry import FINDINGS
from springmass import errors, sample_data
from springmass.cli import main
from storage.wire_log.log_header import LogHeader, SensorEntry
from storage.wire_log.records import Kind

LIST = Path(__file__).with_suffix(".txt")
ROOT = Path(__file__).parents[2]
BENCH = """
[bob]
mass_kg = { value = 0.05, u = 0.0001 }
[spring]
constant_n_per_m = 14.0
[start]
displacement_m = 0.05
[damping]
gamma_per_s = 0.01
"""
NAMED = {
    "estimates": "NAME",
    "budget": "NAME",
    "damping.coefficients": "NAME",
    "damping.laws": "LAW",
    "damping.laws.LAW.parameters": "NAME",
    "damping.weights": "LAW",
    "joint_damping[].laws": "LAW",
    "joint_damping[].laws.LAW.parameters": "NAME",
    "bounds": "NAME",
    "[].options": "NAME",
}
"""Objects whose keys are names of estimates, laws or options, and what stands for them in the list."""
OPEN = ("provenance.parameters", "findings[].values", "provenance.configuration", "events[].facts")
"""Objects whose content depends on options and files."""
LITERAL = ("wire log event", "page control", "page phase")
"""Sections whose names occur in rare circumstances: each must be a string in the code."""


def listed() -> dict[str, set[str]]:
    """Return the names of the list by section."""
    sections: dict[str, set[str]] = {}
    for line in LIST.read_text("utf-8").splitlines():
        if section := re.fullmatch(r"\[(\w.*)\]", line):
            names = sections[section[1]] = set()
        elif line and not line.startswith("#"):
            names.add(line)
    return sections


def collected(folder: Path) -> dict[str, set[str]]:
    """Return the names that the program writes by section; files are written into a folder."""
    return {**_of_commands(folder), **_of_code(listed()), "page message": set(_messages(folder))}


def fields_of(value: Any, above: str = "") -> Iterator[str]:
    """Yield the paths of all fields in a JSON value; ``[]`` stands for the items of a list."""
    if isinstance(value, list):
        for item in value:
            yield from fields_of(item, f"{above}[]")
    elif isinstance(value, Mapping) and not above.endswith(OPEN):
        for key, inner in value.items():
            name = NAMED.get(above, str(key))
            path = f"{above}.{name}" if above else name
            yield path
            yield from fields_of(inner, path)


def _of_commands(folder: Path) -> dict[str, set[str]]:
    data, bench = sample_data(), folder / "bench.toml"
    bench.write_text(BENCH, "utf-8")
    position, velocity = data / "damped_simulated_position.txt", data / "damped_simulated_velocity.txt"
    scene = data / "damped.scene.toml"
    recorded, read, converted = folder / "recorded.h5", folder / "read.h5", folder / "converted.h5"
    course, runs = folder / "course", folder / "runs"
    runs.mkdir()
    (runs / position.name).write_bytes(position.read_bytes())
    _run("record", "--simulate", bench, "--seconds", "3", "-o", recorded)
    _run("convert", position, converted, "--velocity", velocity, "--scene", scene)
    _run("analyse", position, "--velocity", velocity, "--scene", scene, "--out", folder)
    _run("batch", runs, "--out", course, "--reports", "0")
    analysed = folder / f"{position.stem}.results"
    simulated = _run("simulate", "--scene", bench, "--seconds", "3", "--json", "-o", read, "--check")
    trajectories = ("trade", "--integrators", "--scene", bench, "--seconds", "2")
    result = json.loads((analysed / "results.json").read_text("utf-8"))
    return {
        "analyse --json": {
            *fields_of(result),
            *fields_of(json.loads(_run("analyse", recorded, "--json"))),
        },
        "compare --json": {
            name
            for name in fields_of(json.loads(_run("compare", position, position, "--scene", scene, "--json")))
            if not name.startswith("runs[].")
        },
        "formats --json": {*fields_of(json.loads(_run("formats", position, "--json")))},
        "formats --json of a folder": {*fields_of(json.loads(_run("formats", runs, "--json").splitlines()[0]))},
        "formats --json --explain": {*fields_of(json.loads(_run("formats", position, "--json", "--explain")))},
        "formats --json without a file": {*fields_of(json.loads(_run("formats", "--json")))},
        "sensors --json": {*fields_of(json.loads(_run("sensors", "--json")))},
        "doctor --json": {*fields_of(json.loads(_run("doctor", "--json", codes=(errors.OK, errors.SOME_FAILED))))},
        "ports --json": {*fields_of(json.loads(_run("ports", "--no-probe", "--port", "none", "--json")))},
        "catalog --json": {*fields_of(json.loads(_run("catalog", course, "--json", "--columns", "run,period,law")))},
        "simulate --json": {*fields_of(json.loads(simulated))},
        "trade --json": {*fields_of(json.loads(_run("trade", "--seeds", "1", "--seconds", "5", "--json")))},
        "trade RECORDING --json": {*fields_of(json.loads(_run("trade", position, "--json")))},
        "trade --integrators --json": {*fields_of(json.loads(_run(*trajectories, "--tolerance", "1e-6", "--json")))},
        "estimate": set(result["estimates"]),
        "effect": {effect["name"] for effect in result["effects"]},
        "course results.csv": _columns(course / "results.csv"),
        "motion.csv": _columns(analysed / "motion.csv"),
        "report results.csv": _columns(analysed / "results.csv"),
        "report budget.csv": _columns(analysed / "budget.csv"),
        "run file": {name for path in (recorded, read, converted) for name in _in_file(path)},
        "run file header": {name for path in (recorded, read, converted) for name in _in_header(path)},
    }


def _run(*words: str | Path, codes: Collection[int] = (errors.OK,)) -> str:
    """Return what a command prints; it must end with one of some exit codes."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([str(word) for word in words])
    assert code in codes, f"springmass {' '.join(map(str, words))}: exit code {code}: {err.getvalue()}"
    return out.getvalue()


def _columns(path: Path) -> set[str]:
    with path.open(encoding="utf-8", newline="") as file:
        return set(next(csv.reader(file)))


def _in_file(path: Path) -> set[str]:
    """Return paths of groups, arrays and attributes of a run file."""
    with h5py.File(path) as file:
        names = {f"/@{name}" for name in file.attrs}

        def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
            names.add(f"/{name}")
            names.update(f"/{name}@{attribute}" for attribute in item.attrs)

        file.visititems(visit)
        names.update(f"/{name}" for name in file)  # second names, which visititems leaves out
        return names


def _in_header(path: Path) -> Iterator[str]:
    with h5py.File(path) as file:
        yield from fields_of(json.loads(file["/entry/provenance/header"][()]))


def _of_code(known: Mapping[str, Collection[str]]) -> dict[str, set[str]]:
    codes = ("OK", "SOME_FAILED", "USAGE", "UNREADABLE", "SENSOR", "REJECTED", "INTERNAL", "INTERRUPTED")
    return {
        "finding": set(FINDINGS),
        "severity": {severity for entry in FINDINGS.values() for severity in entry.severities},
        "exit code": {f"{getattr(errors, name)} {name}" for name in codes},
        "law": set(LAWS),
        "scene place": set(PLACES),
        "flag": {f"{flag.value} {str(flag.name).lower()}" for flag in Flag},
        "wire log header": {"log", "start_utc", *LogHeader.__struct_fields__},
        "wire log sensor": set(SensorEntry.__struct_fields__),
        "wire log kind": {f"{kind.value} {kind.name}" for kind in Kind},
        **{section: set(filter(_occurs, known.get(section, ()))) for section in LITERAL},
    }


def _occurs(name: str) -> bool:
    """Return whether a name is a string in the code; events such as ``display_failed`` are named after what failed."""
    return not _strings().isdisjoint((name, name.removesuffix("_failed")))


@cache
def _strings() -> frozenset[str]:
    """Return every string constant of the packages."""
    packages = ("acquisition", "pipeline", "storage", "springmass")
    paths = [path for package in packages for path in (ROOT / package).rglob("*.py")]
    nodes = (node for path in paths for node in ast.walk(ast.parse(path.read_text("utf-8"))))
    return frozenset(node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str))


def _messages(folder: Path) -> Iterator[str]:
    """Yield the fields of the messages that the page sends of a run, by their type."""
    words = [sys.executable, "-m", "springmass", "page", str(folder / "converted.h5"), "--no-browser"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True) as page:
        try:
            assert page.stderr is not None
            lines = iter(page.stderr.readline, "")
            address = next(hit[0] for line in lines if (hit := re.search(r"http://127\S+", line)))
            jar = CookieJar()
            base = build_opener(HTTPCookieProcessor(jar)).open(address).url.rstrip("/")
            cookie = "; ".join(f"{each.name}={each.value}" for each in jar)
            with connect(f"ws{base[4:]}/v1/run", origin=base, additional_headers={"Cookie": cookie}) as socket:
                socket.send(json.dumps({"type": "region", "from": 1.0, "to": 20.0}))
                missing = {"hello", "state", "motion", "region"}
                while missing:
                    text = socket.recv(timeout=180.0)
                    if isinstance(text, bytes):
                        continue  # samples
                    content = json.loads(text)
                    if content["type"] == "motion" and "estimates" not in content:
                        continue  # there are no samples yet
                    missing.discard(content["type"])
                    yield from (f"{content['type']}.{name}" for name in fields_of(content))
        finally:
            page.terminate()


def update() -> int:
    """Add the names that the list lacks; return how many."""
    known = listed()
    with tempfile.TemporaryDirectory() as folder:
        found = collected(Path(folder))
    count = sum(len(names - known.get(section, set())) for section, names in found.items())
    head = [line for line in LIST.read_text("utf-8").splitlines() if line.startswith("#")]
    sections = {section: known.get(section, set()) | found.get(section, set()) for section in {**known, **found}}
    body = [f"\n[{section}]\n" + "\n".join(sorted(names)) for section, names in sorted(sections.items())]
    LIST.write_text("\n".join([*head, *body]) + "\n", "utf-8")
    return count


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true", required=True, help="add the names that the list lacks")
    parser.parse_args()
    print(f"{LIST.name}: {update()} names added")
