"""A name that no registry lists cannot be produced, and every name that is produced is listed."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.checks.misfit import Misfit
from pipeline.findings.registry import FINDINGS
from pipeline.numerics.estimate import Estimate
from pipeline.registry.effects import EFFECTS
from pipeline.registry.quantities import INPUTS, QUANTITIES
from pipeline.results.budget import Inputs
from pipeline.results.effects import Effect

ROOT = Path(__file__).resolve().parents[4]
PACKAGES = ("acquisition", "pipeline", "storage", "springmass")


def calls(name: str) -> Iterator[tuple[str, ast.Call]]:
    """Yield every call of a function or class of this name in the four packages, with its place."""
    for path in (path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
                if called == name:
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", node


def literal(node: ast.expr | None) -> list[str]:
    """Return the strings that an argument can be, as far as it states them; of a condition both."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [node.value]
    return [*literal(node.body), *literal(node.orelse)] if isinstance(node, ast.IfExp) else []


def stated(name: str, position: int = 0, keyword: str = "name") -> dict[str, list[str]]:
    """Return the names that calls state literally, by their place."""
    found = {}
    for place, call in calls(name):
        given = call.args[position] if len(call.args) > position else None
        given = given or next((each.value for each in call.keywords if each.arg == keyword), None)
        found[place] = literal(given)
    return found


def test_every_finding_that_is_written_somewhere_is_registered() -> None:
    """Codes and severities of findings, and the codes of what readers and recovery note, are all in the list."""
    codes, severities = stated("Finding"), stated("Finding", 1, "severity")
    assert sum(map(len, codes.values())) > 35
    for place, names in codes.items():
        assert all(severity in FINDINGS[code].severities for code in names for severity in severities[place]), place
    noted = stated("Trap", 0, "code")
    assert sum(map(len, noted.values())) > 25
    assert {code for names in noted.values() for code in names} <= set(FINDINGS)


def test_every_effect_and_input_that_is_written_somewhere_is_registered() -> None:
    """The names of effects, misfits and inputs are all in the lists."""
    effects = {name for names in stated("Effect").values() for name in names}
    assert effects <= set(EFFECTS)
    inputs = {name for names in stated("Misfit").values() for name in names}
    for method in ("add", "add_joint", "add_alternatives"):
        inputs |= {
            name for place, names in stated(method).items() if place.startswith("pipeline/results") for name in names
        }
    assert len(inputs) > 20
    assert inputs <= set(INPUTS)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Effect("a_new_effect", None, None, "1", False, "text"),
        lambda: Misfit(name="a_new_misfit"),
        lambda: Inputs().add("a_new_input", Estimate(1.0, 0.1), "A"),
    ],
)
def test_a_name_that_is_not_registered_is_refused_where_it_is_made(make: object) -> None:
    """It fails at its producer, and not in a table of the report."""
    with pytest.raises(ValueError, match="registered"):
        make()  # type: ignore[operator]


def test_a_table_of_quantities_has_every_symbol() -> None:
    """Each quantity has a label and three symbols, and no two of Table 1 share one."""
    shown = [quantity for quantity in QUANTITIES.values() if quantity.in_table]
    assert all(q.label and q.symbol and q.page_symbol and q.tex_symbol for q in QUANTITIES.values())
    assert len({q.symbol for q in shown}) == len(shown)
    assert all(given.label for given in INPUTS.values())
