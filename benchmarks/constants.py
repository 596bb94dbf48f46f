"""Count the numeric constants of the code: `python benchmarks/constants.py [--list] [ROOM ...]`.

The count covers module-level assignments of numbers, including tuples and arrays of numbers, and numeric defaults of
classes named ``Params``, in acquisition, pipeline, storage and springmass. A table counts as one constant,
``A, B = 1, 2`` as two. A constant has a source if its comment, or its entry in the docstring of ``Params``, names a
publication, a probability, a standard or a measurement. ``--list`` prints the constants without a source. A ROOM such
as pipeline/motion limits count and list to that folder.
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
    r"measured|python -m|pytest|benchmarks/|tests/",
    re.IGNORECASE,
)


class Constant(NamedTuple):
    """A numeric constant in the code, with its comments and documentation."""

    path: Path
    line: int
    name: str
    value: str
    of_params: bool
    words: str

    @property
    def room(self) -> str:
        """The package and subpackage that contain the constant."""
        parts = self.path.relative_to(ROOT).parts
        return "/".join(parts[: min(2, len(parts) - 1)])

    @property
    def sourced(self) -> bool:
        """Whether the documentation names a source, a probability or a measurement."""
        return SOURCE.search(self.words) is not None


def constants(path: Path) -> Iterator[Constant]:
    """Yield the numeric constants of a module in order."""
    tree = ast.parse(path.read_bytes())
    comments = _comments(path)
    for node in tree.body:
        for name, value in _assigned(node):
            words = _beside(node, comments)
            yield Constant(path, node.lineno, name, ast.unparse(value), False, words)
        if isinstance(node, ast.ClassDef) and node.name == "Params":
            entries = _entries(ast.get_docstring(node) or "")
            for field in node.body:
                for name, value in _assigned(field):
                    words = f"{entries.get(name, '')} {_beside(field, comments)}"
                    yield Constant(path, field.lineno, name, ast.unparse(value), True, words)


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


def _entries(docstring: str) -> dict[str, str]:
    """Return the text of a docstring for each parameter."""
    entries: dict[str, str] = {}
    names: list[str] = []
    for line in docstring.splitlines():
        if head := re.match(r"(\w+(?:, \w+)*) : ", line):
            names = head[1].split(", ")
        for name in names:
            entries[name] = f"{entries.get(name, '')} {line.strip()}"
    return entries


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
    print(f"{'room':<28}{'module':>8}{'Params':>8}{'no source':>11}")
    for room, numbers in rows.items():
        of_params = sum(number.of_params for number in numbers)
        missing = sum(not number.sourced for number in numbers)
        print(f"{room:<28}{len(numbers) - of_params:>8}{of_params:>8}{missing:>11}")


if __name__ == "__main__":
    main()
