"""Measure whether the values that are called sound are right, and whether values that are right are called sound.

The parts are ``kinds --seeds 4``, ``files``, ``recordings``, ``clean --records 4000`` and ``disc``, as in
``python -m tests.trials.grades disc``. Each prints a table, and its exit code is 1 if a bar is missed. Clean records
and real recordings are compared with what release 0.3.0 says of them.
"""

import argparse
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor

from tests.trials.grades import cases, clean, disc, kinds, recordings
from tests.trials.grades.graded import Said, Truth

WRONG = 4.0  # standard uncertainties beyond which a value is wrong
APART = 2.0  # of the larger u, between two starts of one run


def table(name: str, said: Said, truth: Mapping[str, Truth]) -> int:
    """Print a line for each value with a truth, and return how many of them are sound and wrong."""
    warnings = ", ".join(sorted(said.warnings)) or "no warnings"
    for quantity, z in said.errors(truth).items():
        x = said.values[quantity]
        verdict = "WRONG" if x.sound and not abs(z) <= WRONG else ""
        print(f"{name} | {quantity} | {x.value:.6g} | {x.u:.2g} | {'sound' if x.sound else '-'} | {z:.1f} | {verdict}")
    print(f"{name} | {warnings}")
    return len(said.wrong(truth, WRONG))


def _kinds(options: argparse.Namespace) -> bool:
    wrong = 0
    for kind in options.only or kinds.KINDS:
        for seed in range(options.seeds):
            trouble = kinds.trouble(kind, seed)
            wrong += table(f"{kind} {seed}", trouble.said(), trouble.truth)
    print(f"{wrong} values are sound and more than {WRONG:g} u from the truth")
    return not wrong


def _files(options: argparse.Namespace) -> bool:
    wrong = sum(table(name, cases.FILES[name].said(), cases.FILES[name].truth) for name in options.only or cases.FILES)
    print(f"{wrong} values are sound and more than {WRONG:g} u from the truth")
    return not wrong


def _recordings(_: argparse.Namespace) -> bool:
    lost, was = list(recordings.lost()), sum(map(len, recordings.released().values()))
    for symbol, line, warnings in lost:
        print(f"{symbol} | {line} | {', '.join(sorted(warnings)) or 'no warnings'}")
    print(f"{was - len(lost)} of {was} values that 0.3.0 calls sound stay sound")
    return len(lost) <= (1.0 - recordings.STAY) * was


def _clean(options: argparse.Namespace) -> bool:
    seeds = range(options.records)
    with ProcessPoolExecutor(options.jobs) as pool:
        bars = list(clean.bars(seeds, pool.map(clean.said_of_record, seeds, chunksize=8)))
    print(*bars, sep="\n")
    return all(bar.met for bar in bars)


def _disc(_: argparse.Namespace) -> bool:
    for start_s in disc.STARTS_S:
        values, warnings = disc.values_from(start_s)
        shown = ", ".join(f"{name} = {x}" for name, x in values.items())
        print(f"from {start_s or 0:g} s: {shown}; {', '.join(sorted(warnings)) or 'no warnings'}")
    for start_s, x in disc.small_swings().items():
        print(f"from {start_s:g} s: T_s = {x.value:.6f} s, u {x.u:.2g} s, {'sound' if x.sound else 'not sound'}")
    apart = [*disc.apart(), *disc.small_swings_apart()]
    for pair, name, z in apart:
        print(f"{pair} | {name} | {z:+.1f} of the larger u")
    return all(abs(z) <= APART for *_, z in apart)


PARTS = {"kinds": _kinds, "files": _files, "recordings": _recordings, "clean": _clean, "disc": _disc}


def main() -> int:
    """Run the part that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.trials.grades", description=__doc__)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--seeds", type=int, default=4, metavar="N", help="records a kind (default 4)")
    parser.add_argument("--only", action="append", metavar="NAME", help="a kind or a case; may be repeated")
    parser.add_argument("--records", type=int, default=clean.RECORDS, metavar="N", help="clean records (default all)")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (default 2)")
    options = parser.parse_args()
    return int(not PARTS[options.part](options))


if __name__ == "__main__":
    raise SystemExit(main())
