"""List the classes and constants of the packages that share a name; `make lint` calls it.

    python benchmarks/names.py          # those without a reason
    python benchmarks/names.py --all    # all of them

A name that means two things is a defect. The exit code is 1 if a shared name has no reason in ``KEPT``, or if a name
there is no longer shared. A constant that begins with an underscore is read only next to its definition, so that two
modules may have the same; a class may not.
"""

from __future__ import annotations

import ast
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("acquisition", "pipeline", "springmass", "storage")

REGISTERED = "a registry reads the object of this name from the module that it imports"
SAME = "the same in acquisition and in pipeline, neither of which imports the other"
KEPT = {
    "FAMILIES": REGISTERED,
    "FAMILY": REGISTERED,
    "FORMAT": REGISTERED,
    "RULES": "springmass.testing reads the rules of each kind of extension by this name",
    "F8": SAME,
    "I8": SAME,
    "U8": SAME,
    "Item": "a type variable: any item of a sequence",
    "Part": "a part of a sensor's data in a log, and the part of a recording that swings freely",
    "Samples": "those of a table in a file, and those of a track that were judged",
}
"""Every name that two modules may share, with the reason."""


def defined(path: Path) -> Iterator[str]:
    """Yield the names of all classes of a module, and of its public constants."""
    tree = ast.parse(path.read_text("utf-8"))
    yield from (node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    for node in tree.body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        for target in targets:
            each = target.elts if isinstance(target, ast.Tuple) else [target]
            yield from (name.id for name in each if isinstance(name, ast.Name) and not name.id.startswith("_"))


def main(every: bool) -> int:
    """Print the shared names with their modules, those without a reason first, and return the exit code."""
    places = defaultdict[str, dict[str, None]](dict)
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for name in defined(path):
                places[name][path.relative_to(ROOT).as_posix()] = None
    shared = {name: modules for name, modules in places.items() if len(modules) > 1}
    without, stale = sorted(shared.keys() - KEPT.keys()), sorted(KEPT.keys() - shared.keys())
    for name in [*without, *(sorted(shared.keys() & KEPT.keys()) if every else ())]:
        print(f"{name}: {KEPT.get(name, 'NO REASON: rename one, or add the reason to KEPT')}")
        print("".join(f"    {module}\n" for module in shared[name]), end="")
    for name in stale:
        print(f"{name}: no longer shared; remove it from KEPT")
    print(f"{len(shared)} names of classes and constants are shared, {len(without)} without a reason")
    return 1 if without or stale else 0


if __name__ == "__main__":
    sys.exit(main("--all" in sys.argv[1:]))
