"""Plant faults one at a time in a copy of the checkout, and report which the tests and the goldens notice.

    python -m tests.mutants                   # all faults of mutants.toml
    python -m tests.mutants clock_sign        # some of them

A fault is caught if a test of `make test` fails or a golden changes. Its text ``old`` is looked for in its file, and in
the four packages if the code has moved. If it does not stand exactly once, the fault is stale and left out. The exit
code is 1 if more than ``--most`` slip through or more than ``MOST_STALE`` are stale.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TABLE = Path(__file__).with_suffix(".toml")
PYTEST = (sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not trials")
GOLDEN = (sys.executable, "-m", "tests.golden", "--first")
MOST_STALE = 3
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


def located(fault: Fault, sources: dict[str, str]) -> Fault | None:
    """Return a fault with the file that holds its text: its own, or the only one that does; None if there is none."""
    counts = {file: count for file, text in sources.items() if (count := text.count(fault.old))}
    if counts.get(fault.file) == 1:
        return fault
    return replace(fault, file=next(iter(counts))) if sum(counts.values()) == 1 else None


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
        path.write_text(text.replace(fault.old, fault.new), "utf-8")
        package = fault.file.partition("/")[0]
        everything = (*PYTEST, "tests", "acquisition", "pipeline", "storage", "springmass")
        near = (*PYTEST, *(each for each in FIRST[package] if (copy / each).exists()))
        for stage in (near, GOLDEN, everything):  # in the order of their times
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


def main(arguments: list[str] | None = None) -> int:
    """Plant the faults that are asked for; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", help="faults to plant (default: all)")
    parser.add_argument("--most", type=int, default=3, help="how many may slip through")
    options = parser.parse_args(arguments)
    table = [fault for fault in faults() if not options.names or fault.name in options.names]
    paths = [path for package in FIRST for path in (ROOT / package).rglob("*.py")]
    sources = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in paths}
    stale, slipped, todo = [], [], []
    for fault in table:
        if (planted := located(fault, sources)) is not None:
            todo.append(planted)
        else:
            stale.append(fault.name)
            print(f"{fault.name:24} {fault.file:40} STALE: its text does not stand exactly once", flush=True)
    start = time.monotonic()
    with ThreadPoolExecutor(int(os.environ.get("JOBS", "2"))) as pool:
        for fault, seen in zip(todo, pool.map(caught_by, todo), strict=True):
            slipped += [] if seen else [fault.name]
            print(f"{fault.name:24} {fault.file:40} {seen or 'SLIPPED THROUGH'}", flush=True)
    print(f"{len(todo) - len(slipped)} of {len(todo)} caught in {time.monotonic() - start:.0f} s")
    print(f"slipped through: {slipped}, at most {options.most}; stale: {stale}, at most {MOST_STALE}")
    return int(len(slipped) > options.most or len(stale) > MOST_STALE)


if __name__ == "__main__":
    sys.exit(main())
