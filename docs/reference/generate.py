"""Write tables of command-line.md and estimates.md, findings.md and results.schema.json from the program.

``python docs/reference/generate.py`` brings the pages up to date; ``tests/docs/test_docs.py`` checks that they are.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
from cyclopts import Group
from cyclopts.argument import Argument

from pipeline.findings.finding import RANK, FindingKind, kinds, usual_advice
from pipeline.numerics.estimate import Estimate
from pipeline.quantities import QUANTITIES
from pipeline.results.formulas import FORMULAS
from springmass.commands import COMMANDS, app
from springmass.commands.options import HOW_READ, THE_PAGE
from springmass.comparing.comparison import ComparisonResult
from springmass.result.run_json import RESULT_SCHEMA, NumberWithU, RunResult
from springmass.terminal.printing import with_options

PAGE = Path(__file__).with_name("command-line.md")
FINDINGS_PAGE = Path(__file__).with_name("findings.md")
ESTIMATES_PAGE = Path(__file__).with_name("estimates.md")
JSON_PAGE = Path(__file__).with_name("json.md")
SCHEMA = Path(__file__).with_name("results.schema.json")
SHOWN = {"error": "error", "warning": "warning", "info": "note"}
TABLE = re.compile(r"<!-- options of (?P<what>[\w ]+) -->\n.*?<!-- end -->\n", re.DOTALL)
LIST = re.compile(r"<!-- commands -->\n.*?<!-- end -->\n", re.DOTALL)
EVERY_RECORDING = "every command that reads a recording"
ELSEWHERE = {
    HOW_READ: "as [above](#options-of-every-command-that-reads-a-recording)",
    THE_PAGE: "as for `springmass page`",
}
"""Groups of options with a separate table, and what the other tables say about them."""

ESTIMATES = re.compile(r"<!-- estimates (?P<which>with|without) a scene -->\n.*?<!-- end -->\n", re.DOTALL)
NEEDS = {
    "bob_mass": "bob mass",
    "disc_diameter": "disc",
    "known_air": "air temperature",
    "pendulum_length": "`[pendulum] length_m`",
}
"""What a result needs of a scene, by the input of the formulas."""
LAW = "fit and choice of the law"
INCLUDES = {
    "phase_slope": "scatter, correlation and bend of the phases",
    "start_phase": "scatter, correlation and bend of the phases",
    "small_swings": "scatter of the phases, choice of the law",
    "stiffness_factor": "change of the frequency",
    **dict.fromkeys(("law", "law_start", "law_rate", "law_rms"), LAW),
    "rest_position": "scatter, correlation and drift of the rest position",
    "noise_of_samples": "counting statistics, difference from the root mean square, share of samples left out",
    **dict.fromkeys(("amplitude_factor", "rate_factor", "offset_misfit", "phase_misfit"), "misfit of the model"),
    "sensor_zero": "calibration of the zero",
    "sensor_filter": "filter of the sensor",
    "time_factor": "clock rate",
    "distance_scale": "distance scale",
    "bob_mass": "masses",
    "pendulum_length": "length",
    "disc_diameter": "diameter",
    **dict.fromkeys(("air", "known_air"), "air and its formulas"),
}
"""What u of a result includes, by the input of the formulas."""

HEAD = """\
# Findings

This page is for everyone who sees a warning and wants to know what it means and what to do.

A finding is one sentence about a run. It has a code, which never changes its meaning, and a severity:

- **error**: a number of the result must not be used. Under `--strict` the exit code is 5, as for the
  warning `sensor_lost`.
- **warning**: a number may be less good than usual. The uncertainties already include what is known of it.
- **note** (`info` in JSON): worth knowing; nothing needs doing.

In JSON each finding also has `advice`, `details` (statistics, alternatives, method) and `values` (its numbers by name,
in SI units).
"""

GONE = """\
## Codes that are gone

Version 0.2.0 replaced these codes. They named causes that no recording showed, or that the user could do nothing about.
`halves_differ`, which it replaced too, is back since 0.4.0.

- `correlated_residuals`: `model_misfit`, `values.rms_m` and `values.noise_m`.
- `amplitude_modulated`: `model_misfit`.
- `rows_lost`, `rows_doubled`: `model_misfit`, or `phase_jump` if many rows in succession are missing.
- `interleaved_records`, `mains_hum`: `model_misfit`, or `no_oscillation`.
- `contact`: `touched`, or `model_misfit`.
- `wave_slips`: `false_echoes`.
- `locked_echoes`: `clipped`.
"""


def arguments_of(command: str) -> list[Argument]:
    """Return the arguments and options of a command that are its own, as declared."""
    declared = app[command].assemble_argument_collection(default_parameter=app.default_parameter)
    return [each for each in declared if each.parse and each.show]


def group_of(argument: Argument) -> Group:
    """Return the heading under which the help shows an option."""
    return next(iter(argument.parameter.group or ()))


def names_of(argument: Argument) -> list[str]:
    """Return an option with each of its names, or an argument, with what it takes."""
    if argument.index is not None or not argument.name.startswith("-"):
        return [argument.name]
    value = "" if argument.hint is bool else f" {argument.parameter.metavar}"
    return [f"{name}{value}" for name in sorted(argument.names, key=len)]


def table_of(what: str) -> str:
    """Return the table of a command, or of all options that say how a recording is read."""
    rows = list(_reading_rows() if what == EVERY_RECORDING else _rows(what))
    heads = "argument or option" if any("`-" not in row for row in rows) else "option"
    return "\n".join([f"| {heads} | meaning |", "| --- | --- |", *rows, ""])


def _reading_rows() -> Iterator[str]:
    yield from (_row(each) for each in arguments_of("analyse") if group_of(each) == HOW_READ)


def _rows(command: str) -> Iterator[str]:
    arguments = arguments_of(command)
    for each in arguments:
        if group_of(each) not in ELSEWHERE or (command == "page" and group_of(each) == THE_PAGE):
            yield _row(each)
    for group, meaning in ELSEWHERE.items():
        names = [f"`{each.name}`" for each in arguments if group_of(each) == group]
        if names and (command, group) != ("page", THE_PAGE):
            yield f"| {', '.join(names)} | {meaning} |"


def _row(argument: Argument) -> str:
    names = ", ".join(f"`{name}`" for name in names_of(argument))
    choices = argument.get_choices()
    listed = f"; one of {', '.join(f'`{each}`' for each in choices)}" if choices else ""
    return f"| {names} | {argument.parameter.help}{listed} |"


def commands() -> str:
    """Return the table of commands."""
    rows = [f"| [`{name}`](#springmass-{name}) | {app[name].help} |" for name in COMMANDS]
    return "\n".join(["| command | what it does |", "| --- | --- |", *rows, ""])


def updated(page: str) -> str:
    """Return the page with its tables as they are declared."""
    page = LIST.sub(lambda _: f"<!-- commands -->\n{commands()}<!-- end -->\n", page)
    return TABLE.sub(
        lambda found: f"<!-- options of {found['what']} -->\n{table_of(found['what'])}<!-- end -->\n", page
    )


def inputs_of(name: str, *, needed: bool) -> set[str]:
    """Return the inputs that a result depends on, or those that it needs."""
    if name not in FORMULAS:
        return {name}
    formula = FORMULAS[name]
    return set().union(*(inputs_of(each, needed=needed) for each in (formula.needed if needed else formula.parameters)))


def estimates(which: str) -> str:
    """Return the table of the estimates that a scene determines, or of the others."""
    heads = ["name", "unit", "definition", *["needs"] * (which == "with"), "what u includes"]
    rows = [heads, ["---"] * len(heads)]
    for name in (each for each in FORMULAS if each in QUANTITIES):
        needs = [words for each, words in NEEDS.items() if each in inputs_of(name, needed=True)]
        if bool(needs) == (which == "with"):
            inputs = inputs_of(name, needed=False)
            includes = dict.fromkeys(words for each, words in INCLUDES.items() if each in inputs)
            row = [f"`{name}`", QUANTITIES[name].unit_in("m") or "1", FORMULAS[name].definition]
            rows.append([*row, *[", ".join(needs)] * (which == "with"), "; ".join(includes)])
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def estimates_page(page: str) -> str:
    """Return the page of estimates with its tables as the formulas are."""
    return ESTIMATES.sub(
        lambda found: f"<!-- estimates {found['which']} a scene -->\n{estimates(found['which'])}<!-- end -->\n", page
    )


def findings_page() -> str:
    """Return the page of findings, grouped by symptom and the gravest first."""
    groups: dict[str, list[tuple[str, FindingKind]]] = {}
    for code, kind in kinds().items():
        groups.setdefault(kind.symptom, []).append((code, kind))
    parts = [HEAD]
    for symptom, group in groups.items():
        parts.append(f"## {symptom}\n\n| code | severity | meaning | what to do |\n| --- | --- | --- | --- |")
        for code, kind in sorted(group, key=lambda item: (min(RANK[s] for s in item[1].severity), item[0])):
            severity = " or ".join(SHOWN[one] for one in sorted(kind.severity, key=RANK.__getitem__))
            parts.append(
                f"| `{code}` | {severity} | {kind.meaning} | {with_options(code, usual_advice(code)) or '-'} |"
            )
        parts[-1] += "\n"
    return "\n".join([*parts, GONE])


def results_schema(page: str) -> dict[str, Any]:
    """Return the JSON Schema of results from the types that write them, with the meanings that the page gives them."""
    types = [RunResult, ComparisonResult, NumberWithU]
    (run, comparison, _), definitions = msgspec.json.schema_components(
        types, schema_hook={Estimate: {"$ref": "#/$defs/NumberWithU"}}.__getitem__, ref_template="#/$defs/{name}"
    )
    for definition in definitions.values():
        if any("default" in each for each in definition["properties"].values()):  # a dataclass: all of it is written
            definition["required"] = list(definition["properties"])
    definitions = _without_infinity(definitions)
    found = set()
    for part, root in zip(page.split("## Of a comparison"), (run, comparison), strict=True):
        for fields, meaning in re.findall(r"^\| (`[^|]*`) \| [^|]* \| ([^|]+) \|$", part, re.MULTILINE):
            for field in re.findall("`(.*?)`", fields):
                name, node = _described(field, root, definitions)
                if name:
                    node.setdefault("description", re.sub(r"`|\[|\]\([^)]*\)|\]", "", meaning))
                    found.add(name)
    if missing := {f"{of}.{name}" for of, each in definitions.items() for name in each["properties"]} - found:
        raise SystemExit(f"json.md: no row describes {', '.join(sorted(missing))}; add one")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"Results of springmass as JSON, schema {RESULT_SCHEMA}",
        "anyOf": [run, comparison, {"type": "array", "items": run}],
        "$defs": definitions,
    }


def _without_infinity(node: Any) -> Any:
    """Return a schema in which a number may be null, because JSON has no infinity; and without defaults."""
    if isinstance(node, list):
        return [_without_infinity(each) for each in node]
    if not isinstance(node, dict):
        return node
    if node.get("type") == "number" or {"type": "number"} in node.get("anyOf", ()):
        return {"type": ["number", "null"]}
    return {key: _without_infinity(value) for key, value in node.items() if key != "default"}


def _described(field: str, node: dict[str, Any], definitions: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return the name, as ``TYPE.FIELD``, and the schema of a field such as ``budget.NAME.inputs[].name``.

    The name is empty if it is a key of a mapping, such as that of an estimate.
    """
    path = ""
    for token in field.replace("[]", ".[]").split("."):
        node = next((each for each in node.get("anyOf", ()) if each != {"type": "null"}), node)
        of = node.get("$ref", "").removeprefix("#/$defs/")
        node = definitions.get(of, node)
        path = ""
        if token == "[]":
            node = node["items"]
        elif token in node.get("properties", {}):
            path, node = f"{of}.{token}", node["properties"][token]
        elif "additionalProperties" in node:
            node = node["additionalProperties"]
        else:
            raise SystemExit(f"json.md: no field {field} is written; remove its row")
    return path, node


if __name__ == "__main__":
    PAGE.write_text(updated(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    FINDINGS_PAGE.write_text(findings_page(), encoding="utf-8")
    ESTIMATES_PAGE.write_text(estimates_page(ESTIMATES_PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    schema = results_schema(JSON_PAGE.read_text(encoding="utf-8"))
    SCHEMA.write_text(json.dumps(schema, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{len(COMMANDS)} commands, {len(kinds())} finding codes")
