"""Analyse records of every kind of trouble and print what became of them.

``python -m tests.trials.troubles --seeds 8 --tier standard``; ends with exit code 1 where a limit is not met.
"""

import argparse
import sys
import warnings

from pipeline.options import TIERS
from tests.trials.troubles.judge import Verdict, try_one
from tests.trials.troubles.kinds import KINDS
from tests.trials.troubles.table import as_markdown, beyond, summed, total


def main() -> int:
    """Run the trials that were asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.trials.troubles", description=__doc__)
    parser.add_argument("--seeds", type=int, default=20, metavar="N", help="records a kind (default 20)")
    parser.add_argument("--tier", choices=TIERS, default="standard")
    parser.add_argument("--only", default="", metavar="TEXT", help="kinds whose name or cause holds this")
    parser.add_argument("--markdown", action="store_true", help="the table as the documentation has it")
    options = parser.parse_args()
    warnings.simplefilter("error")
    chosen = [kind for kind in KINDS if options.only in kind.name or options.only == kind.cause]
    verdicts: list[Verdict] = []
    for kind in chosen:
        print(kind.name, file=sys.stderr, flush=True)
        for seed in range(options.seeds):
            verdicts.append(try_one(kind, seed, options.tier))
    lines = summed(chosen, verdicts)
    print((as_markdown if options.markdown else beyond)(lines))
    print(f"\n{options.tier}: {total(lines)}")
    return int(any(not line.holds for line in lines))


if __name__ == "__main__":
    raise SystemExit(main())
