"""Check the required accuracy of the estimates: `python benchmarks/accuracy --seeds 2000`, `make accuracy`.

Prints each requirement with its limit and the measured value; the exit code is 1 if a requirement is not met.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor

from benchmarks.accuracy.checks import CHECKS, Bench, Line


def main() -> int:
    """Run the selected checks; return 1 if a requirement is not met."""
    parser = argparse.ArgumentParser(prog="benchmarks/accuracy", description=__doc__)
    parser.add_argument("--seeds", type=int, default=2000, metavar="N", help="records a case (default 2000)")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (default 2)")
    parser.add_argument("--only", choices=sorted(CHECKS), action="append", help="run only this part; may be repeated")
    options = parser.parse_args()
    bad = 0
    with ProcessPoolExecutor(options.jobs) as pool:
        bench = Bench(options.seeds, pool.map, options.jobs)
        for name in options.only or CHECKS:
            print(f"\n{name}", flush=True)
            for line in CHECKS[name](bench):
                bad += not line.ok
                print(shown(line), flush=True)
    print(f"\n{'all met' if not bad else f'{bad} not met'}", file=sys.stderr)
    return int(bad > 0)


def shown(line: Line) -> str:
    """Return a requirement as a line of the table."""
    return f"  {'ok  ' if line.ok else 'FAIL'}  {line.what:<64} {line.measured:<28} {line.limit}"


if __name__ == "__main__":
    raise SystemExit(main())
