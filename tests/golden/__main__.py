"""Compare what the command line says with what 0.2.0 said.

    python -m tests.golden                  # every command line and every damaged log; exit code 1 if anything changed
    python -m tests.golden --every 20       # every twentieth of them
    python -m tests.golden --add analyse {1}/run.txt --json    # freeze one more command line; it never overwrites one
    VALUES=0.1 US=0.25 python -m tests.golden    # a value may move by 0.1 u, and a u by a quarter

`--only TEXT` takes the command lines that contain a text; `--first` ends at the first difference.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from tempfile import TemporaryDirectory

from tests.golden import damaged_logs
from tests.golden.golden import ALLOWED, FROZEN, Places, differences, frozen, missing, outcome, unpacked


def main() -> int:
    """Check, or add; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__.partition("\n")[0])
    parser.add_argument("--every", type=int, default=1, metavar="N")
    parser.add_argument("--only", default="", metavar="TEXT")
    parser.add_argument("--first", action="store_true")
    parser.add_argument("--add", nargs=argparse.REMAINDER, default=[], metavar="WORD")
    asked, start = parser.parse_args(), time.monotonic()
    # One thread a process: two processes already keep two cores busy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with TemporaryDirectory() as folder, ProcessPoolExecutor(int(os.environ.get("JOBS", "2"))) as pool:
        places = unpacked(folder)
        if asked.add:
            return _add(places, asked.add)
        before = frozen()
        keys = [key for key in before if asked.only in " ".join(json.loads(key))]
        todo = [key for key in keys[:: asked.every] if not missing(places, json.loads(key))]
        skipped = len(keys[:: asked.every]) - len(todo)
        failed = excused = values = moved = 0
        greatest = 0.0
        now = pool.map(outcome, [places.filled(json.loads(key)) for key in todo], chunksize=4)
        for key, table in zip(todo, now, strict=True):
            changed, allowed, worst = differences(key, before[key], table)
            failed, excused, values = failed + len(changed), excused + len(allowed), values + len(table)
            greatest = max(greatest, worst)
            if changed:
                moved += 1
                print("", " ".join(json.loads(key)), *(f"  {line}" for line in changed), sep="\n", flush=True)
            if failed and asked.first:
                pool.shutdown(wait=False, cancel_futures=True)
                return 1
        logs = [] if asked.only else damaged_logs.names()[:: asked.every]
        spoiled = list(filter(None, pool.map(damaged_logs.difference, logs)))
    print(*spoiled, sep="\n", end="\n" if spoiled else "")
    print(
        f"{len(todo)} command lines, {values} values, {len(logs)} damaged logs, {time.monotonic() - start:.0f} s: "
        f"{failed} values and {len(spoiled)} logs changed, {excused} allowed by {ALLOWED.name}; "
        f"the largest move is {greatest:.2f} of its tolerance"
    )
    if skipped:
        print(f"{skipped} command lines skipped: the shared recordings are not here")
    different = moved + len(spoiled)
    print(f"{len(todo) + len(logs) - different} passed, {different} failed")
    return int(different > 0)


def _add(places: Places, words: list[str]) -> int:
    goldens = frozen()
    if (key := json.dumps(words)) not in goldens:
        goldens[key] = outcome(places.filled(words))
    FROZEN.write_text(json.dumps(goldens, indent=0, ensure_ascii=False), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
