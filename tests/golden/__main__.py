"""Compare what the command line gives with what was frozen, or freeze it.

    python -m tests.golden                    # print what moved as a table; exit code 1 if anything did
    python -m tests.golden --freeze           # rewrite the lines that moved beyond their tolerance, and no other
    python -m tests.golden --since COMMIT     # what the frozen values have moved by since that commit, run nothing

`--only TEXT` takes the command lines that contain a text, `--every N` each N-th, `--first` ends at the first move.
To add a command line, write it behind a `$` into a file below `values` and freeze.
"""

import argparse
import os
import shlex
import statistics
import subprocess
import sys
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.golden.commands import Table, outcome
from tests.golden.golden import VALUES, Goldens, Move, moves, parsed, written
from tests.golden.inputs import ROOT, Places, missing


def main() -> int:
    """Compare, freeze or summarise; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__.partition("\n")[0])
    parser.add_argument("--freeze", action="store_true", help="rewrite the lines that moved")
    parser.add_argument("--since", metavar="COMMIT", help="what moved in the files since a commit")
    parser.add_argument("--every", type=int, default=1, metavar="N")
    parser.add_argument("--only", default="", metavar="TEXT")
    parser.add_argument("--first", action="store_true", help="end at the first difference")
    options = parser.parse_args()
    if options.since:
        return _summary(options.since)
    files = {path: parsed(path.read_text("utf-8")) for path in sorted(VALUES.glob("*.txt"))}
    wanted = [command for goldens in files.values() for command in goldens if options.only in command][:: options.every]
    todo = [command for command in wanted if not missing(shlex.split(command))]
    frozen = {command: table for goldens in files.values() for command, table in goldens.items()}
    start, moved, values = time.monotonic(), list[Move](), 0
    # One thread a process: two processes already keep two cores busy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with TemporaryDirectory() as folder, ProcessPoolExecutor(int(os.environ.get("JOBS", "2"))) as pool:
        tables = pool.map(partial(_outcome, folder), todo, chunksize=4)
        for command, table in zip(todo, tables, strict=True):
            values += len(table)
            of_it = list(moves(command, frozen[command], table))
            if of_it:
                print(f"\n{command}", *of_it, sep="\n", flush=True)
            if of_it and options.first:
                pool.shutdown(wait=False, cancel_futures=True)
                return 1
            moved += of_it
            _adopt(frozen[command], table, of_it)
    if options.freeze:
        for path, goldens in files.items():
            path.write_text(written(goldens), "utf-8")
    print(f"{len(todo)} command lines, {values} values, {len(moved)} moved, {time.monotonic() - start:.0f} s")
    if len(todo) < len(wanted):
        print(f"{len(wanted) - len(todo)} command lines skipped: the shared recordings are not here")
    different = len({move.command for move in moved})
    print(f"{len(todo) - different} passed, {0 if options.freeze else different} failed")
    return int(bool(moved) and not options.freeze)


def _outcome(folder: str, command: str) -> Table:
    return outcome(Places(Path(folder) / str(os.getpid())), shlex.split(command))


def _adopt(frozen: Table, table: Table, moved: list[Move]) -> None:
    """Put the values that moved into a frozen table."""
    for move in moved:
        if move.quantity in table:
            frozen[move.quantity] = table[move.quantity]
        else:
            del frozen[move.quantity]


def _summary(commit: str) -> int:
    """Print by how much the frozen values of each quantity moved since a commit."""
    by_quantity: dict[str, list[Move]] = defaultdict(list)
    lines = 0
    for path in sorted(VALUES.glob("*.txt")):
        before = subprocess.run(
            ("git", "show", f"{commit}:{path.relative_to(ROOT).as_posix()}"),
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        old: Goldens = parsed(before.stdout)
        for command, table in parsed(path.read_text("utf-8")).items():
            lines += command in old
            for move in moves(command, old[command], table) if command in old else ():
                by_quantity[move.quantity].append(move)
    print(f"{lines} command lines stand in both; moved values by quantity: command lines, median and largest move in u")
    for quantity, each in sorted(by_quantity.items(), key=lambda item: -len(item[1])):
        shifts = sorted(abs(move.of_u) for move in each if move.of_u is not None)
        what = (
            f"{statistics.median(shifts):8.3g} {shifts[-1]:8.3g}" if shifts else f"{each[0].before} -> {each[0].after}"
        )
        print(f"{len(each):5} {quantity:45} {what}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
