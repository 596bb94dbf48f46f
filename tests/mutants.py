"""Plant faults one at a time in a copy of the checkout, and report which the tests and the goldens notice.

    python -m tests.mutants                   # all faults of mutants.toml
    python -m tests.mutants clock_sign        # some of them
    python -m tests.mutants --draw 16 --seed 51    # print further faults, drawn in lines that six commands execute

A fault is caught if a test of `make test` fails or a golden changes. The exit code is 1 if more than ``--most`` slip
through. When code moves, carry its faults over: the text in ``old`` must stand in the file exactly once.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import tomli_w

ROOT = Path(__file__).resolve().parents[1]
TABLE = Path(__file__).with_suffix(".toml")
PYTEST = (sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not trials")
GOLDEN = (sys.executable, "-m", "tests.golden", "--first")
LIMIT_S = 1800.0
"""A fault may make a program hang: a run that takes longer has noticed it."""
FIRST = {
    "acquisition": ("tests/unit/acquisition", "tests/conformance", "tests/properties", "tests/cli/test_record_cli.py"),
    "storage": ("tests/unit/storage", "tests/properties", "tests/faults"),
    "pipeline": ("tests/unit/pipeline", "tests/unit/springmass/test_sample_truth.py"),
    "springmass": ("tests/unit/springmass", "tests/cli", "tests/pages"),
}
"""Where a fault of each package is looked for before everything else runs."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: in a file, the text ``old`` is replaced by ``new``."""

    name: str
    file: str
    old: str
    new: str


def faults() -> list[Fault]:
    """Return the faults of the table."""
    return [Fault(**row) for row in tomllib.loads(TABLE.read_text("utf-8"))["fault"]]


def caught_by(fault: Fault) -> str:
    """Plant a fault in a copy, run tests and goldens, and return what notices it; empty if nothing does."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        copy.mkdir()
        files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True).stdout
        subprocess.run(["cp", "--parents", "-t", copy, *filter(None, files.decode().split("\0"))], cwd=ROOT, check=True)
        if (shared := ROOT.parent / "shared").is_dir():
            (Path(folder) / "shared").symlink_to(shared)
        path = copy / fault.file
        text = path.read_text("utf-8")
        if text.count(fault.old) != 1:
            raise SystemExit(
                f"{fault.name}: its text stands {text.count(fault.old)} times in {fault.file}; carry it over"
            )
        path.write_text(text.replace(fault.old, fault.new), "utf-8")
        package = fault.file.partition("/")[0]
        everything = (*PYTEST, "tests", "acquisition", "pipeline", "storage", "springmass")
        near = (*PYTEST, *(each for each in FIRST[package] if (copy / each).exists()))
        # The goldens hold estimates: they are the fastest net for the pipeline and the slowest for the others.
        stages = (near, GOLDEN, everything) if package == "pipeline" else (near, everything, GOLDEN)
        for stage in stages:
            if seen := _notices(stage, copy):
                return seen
    return ""


def _notices(command: tuple[str, ...], copy: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": str(copy), "JOBS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return "a run that does not end"
    if done.returncode == 0:
        return ""
    lines = [line for line in done.stdout.splitlines() if line.strip()]
    failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
    return (failed or lines or ["no output"])[0][:160]


def drawn(count: int, seed: int) -> list[Fault]:
    """Draw faults in executed lines: signs, bounds, numbers that are off by one, dropped calls and wrong flags."""
    draw = random.Random(seed)
    places = {kind: [] for kind in ("sign", "bound", "off_by_one", "dropped", "flag")}
    for path, lines in _executed().items():
        for kind, node, text in _possible(ast.parse((ROOT / path).read_text("utf-8"))):
            if node.lineno in lines and node.lineno == node.end_lineno:
                places[kind].append((path, node, text))
    found: list[Fault] = []
    kinds = [kind for kind in places if places[kind]]
    while len(found) < count:
        kind = kinds[len(found) % len(kinds)]
        path, node, text = draw.choice(places[kind])
        source = (ROOT / path).read_text("utf-8")
        line = source.splitlines()[node.lineno - 1]
        changed = line[: _column(line, node.col_offset)] + text + line[_column(line, node.end_col_offset) :]
        if source.count(line) == 1 and changed != line:
            found.append(Fault(f"{kind}_{Path(path).stem}", path, line, changed))
    return found


def _column(line: str, offset: int) -> int:
    return len(line.encode()[:offset].decode())


def _possible(tree: ast.AST) -> Iterator[tuple[str, ast.expr | ast.stmt, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
            sign = "-" if isinstance(node.op, ast.Add) else "+"
            yield "sign", node, f"{ast.unparse(node.left)} {sign} ({ast.unparse(node.right)})"
        elif isinstance(node, ast.Compare) and isinstance(node.ops[0], (ast.Lt, ast.LtE, ast.Gt, ast.GtE)):
            number = node.comparators[0]
            if len(node.ops) == 1 and isinstance(number, ast.Constant) and isinstance(number.value, (int, float)):
                yield "bound", number, repr(2 * number.value + 1)
        elif isinstance(node, ast.Constant) and type(node.value) is int and 0 <= node.value <= 64:
            yield "off_by_one", node, str(node.value + 1)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield "dropped", node, "pass"
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) in ("Flag", "Quality"):
            others = [name for name in ("MISSING", "FALSE_ECHO", "CLIPPED", "DUPLICATE_TIME") if name != node.attr]
            yield "flag", node, f"{ast.unparse(node.value)}.{others[0]}"


def _executed() -> dict[str, set[int]]:
    """Return the lines of the four packages that a recording, a recovery, an analysis and a course execute."""
    from coverage import CoverageData

    with tempfile.TemporaryDirectory() as folder:
        recording, scene = ROOT / "sample_data/damped_simulated_position.txt", ROOT / "sample_data/damped.scene.toml"
        log, bench = ROOT / "tests/golden/base.wire", ROOT / "tests/golden/scenes/mixed.toml"
        commands = [
            ["record", "--simulate", "--scene", bench, "--seconds", "2", "-o", "run.h5"],
            ["recover", log, "-o", "out.h5"],
            ["analyse", recording, "--scene", scene, "--output", "."],
            ["compare", recording, recording, "--scene", scene],
            ["batch", ROOT / "sample_data", "-o", "course", "--jobs", "1", "--reports", "0"],
            ["simulate", "--scene", bench, "--seconds", "5", "-o", "simulated.h5"],
        ]
        for words in commands:
            command = [sys.executable, "-m", "coverage", "run", "-p", f"--source={ROOT}", "-m", "springmass", *words]
            subprocess.run(list(map(str, command)), cwd=folder, check=True, capture_output=True)
        lines: dict[str, set[int]] = {}
        for part in Path(folder).glob(".coverage*"):
            data = CoverageData(str(part))
            data.read()
            for name in data.measured_files():
                path = Path(name).relative_to(ROOT)
                if path.parts[0] in FIRST and path.suffix == ".py":
                    lines.setdefault(str(path), set()).update(data.lines(name) or ())
    return dict(sorted(lines.items()))


def main() -> int:
    """Draw faults, or plant those of the table; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", help="faults to plant (default: all)")
    parser.add_argument("--most", type=int, default=6, help="how many may slip through")
    parser.add_argument("--draw", type=int, default=0, metavar="COUNT", help="print this many further faults")
    parser.add_argument("--seed", type=int, default=51)
    asked = parser.parse_args()
    if asked.draw:
        rows = [{name: getattr(fault, name) for name in Fault.__slots__} for fault in drawn(asked.draw, asked.seed)]
        print(tomli_w.dumps({"fault": rows}, multiline_strings=True))
        return 0
    todo = [fault for fault in faults() if not asked.names or fault.name in asked.names]
    start, slipped = time.monotonic(), []
    with ThreadPoolExecutor(int(os.environ.get("JOBS", "2"))) as pool:
        for fault, seen in zip(todo, pool.map(caught_by, todo), strict=True):
            slipped += [] if seen else [fault.name]
            print(f"{fault.name:34} {seen or 'SLIPPED THROUGH'}", flush=True)
    print(f"{len(todo) - len(slipped)} of {len(todo)} caught in {time.monotonic() - start:.0f} s; {slipped}")
    return int(len(slipped) > asked.most)


if __name__ == "__main__":
    sys.exit(main())
