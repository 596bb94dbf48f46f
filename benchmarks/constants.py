"""Count the numeric constants of the code: `python benchmarks/constants.py [--list] [ROOM ...]`.

The count covers module-level assignments of numbers, including tuples and arrays of numbers, in acquisition, pipeline,
storage and springmass. A table counts as one constant, ``A, B = 1, 2`` as two. A constant has a source if its comment
names a publication, a formula, a probability, a standard or a measurement, or says that it is chosen. ``--list`` prints
the constants without a source. A ROOM such as pipeline/motion limits count and list to that folder.
"""

from __future__ import annotations

import argparse
import ast
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PACKAGES = ("acquisition", "pipeline", "storage", "springmass")
SOURCE = re.compile(
    r"doi|arxiv|https?:|\bet al|\[\d+\]_|data ?sheet|\bNIST\b|\bISO\b|\bIEEE\b|\bRFC ?\d|CODATA|\(\d{4}\)|"
    r"probab|\bchance|false.alarm|in a (hundred|thousand|million)|share of (plain )?records|"
    r"measured|python -m|pytest|benchmarks/|tests/|\bformula|follows? from|by definition|\bIEC\b|is chosen",
    re.IGNORECASE,
)


class Constant(NamedTuple):
    """A numeric constant in the code, with its comments."""

    path: Path
    line: int
    name: str
    value: str
    words: str

    @property
    def room(self) -> str:
        """The package and subpackage that contain the constant."""
        parts = self.path.relative_to(ROOT).parts
        return "/".join(parts[: min(2, len(parts) - 1)])

    @property
    def sourced(self) -> bool:
        """Whether the comments name a source, a probability or a measurement."""
        return SOURCE.search(self.words) is not None


def constants(path: Path) -> Iterator[Constant]:
    """Yield the numeric constants of a module in order."""
    tree = ast.parse(path.read_bytes())
    comments = _comments(path)
    for node in tree.body:
        for name, value in _assigned(node):
            yield Constant(path, node.lineno, name, ast.unparse(value), _beside(node, comments))


def _assigned(node: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    """Yield each name to which a statement assigns a number, with the expression of the number."""
    if isinstance(node, ast.AnnAssign) and node.value is not None:
        targets: list[ast.expr] = [node.target]
        value = node.value
    elif isinstance(node, ast.Assign):
        targets, value = node.targets, node.value
    else:
        return
    for target in targets:
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
            pairs = list(zip(target.elts, value.elts, strict=True))
        else:
            pairs = [(target, value)]
        for name, part in pairs:
            if isinstance(name, ast.Name) and _is_number(part):
                yield name.id, part


def _is_number(node: ast.expr) -> bool:
    """Return whether an expression consists of numbers only, of which at least one is a literal."""
    literals = [each.value for each in ast.walk(node) if isinstance(each, ast.Constant)]
    return bool(literals) and all(type(each) in (int, float, complex) for each in literals) and _is_arithmetic(node)


def _is_arithmetic(node: ast.expr) -> bool:
    if isinstance(node, ast.Constant | ast.Name | ast.Attribute):
        return True
    if isinstance(node, ast.UnaryOp):
        return _is_arithmetic(node.operand)
    if isinstance(node, ast.BinOp):
        return _is_arithmetic(node.left) and _is_arithmetic(node.right)
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        return all(map(_is_arithmetic, node.elts))
    if isinstance(node, ast.Dict):
        return all(map(_is_arithmetic, (*filter(None, node.keys), *node.values)))
    if isinstance(node, ast.Call):
        made = ast.unparse(node.func).rpartition(".")
        return made[0] in ("np", "math", "") and made[2] in CALLS and all(map(_is_arithmetic, node.args))
    return False


CALLS = frozenset({"array", "linspace", "arange", "geomspace", "sqrt", "log", "radians", "float", "frozenset"})


def _comments(path: Path) -> dict[int, str]:
    with path.open("rb") as file:
        return {t.start[0]: t.string for t in tokenize.tokenize(file.readline) if t.type == tokenize.COMMENT}


def _beside(node: ast.stmt, comments: dict[int, str]) -> str:
    """Return the comments on a statement's lines and directly above it."""
    lines = list(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    above = node.lineno - 1
    while above in comments:
        lines.insert(0, above)
        above -= 1
    return " ".join(comments.get(line, "") for line in lines)


def main() -> None:
    """Print the counts by folder, and the total."""
    parser = argparse.ArgumentParser(description="Count the numbers that decide something.")
    parser.add_argument("rooms", nargs="*", metavar="ROOM", help="folders to count; all packages by default")
    parser.add_argument("--list", action="store_true", help="print each number that names no source")
    options = parser.parse_args()
    folders = [ROOT / room for room in options.rooms or PACKAGES]
    found = [each for folder in folders for path in sorted(folder.rglob("*.py")) for each in constants(path)]
    if options.list:
        for each in found:
            if not each.sourced:
                print(f"{each.path.relative_to(ROOT)}:{each.line}: {each.name} = {each.value}")
    rows = {room: [each for each in found if each.room == room] for room in dict.fromkeys(each.room for each in found)}
    rows["total"] = found
    print(f"{'room':<28}{'numbers':>8}{'no source':>11}")
    for room, numbers in rows.items():
        print(f"{room:<28}{len(numbers):>8}{sum(not number.sourced for number in numbers):>11}")


if __name__ == "__main__":
    main()
