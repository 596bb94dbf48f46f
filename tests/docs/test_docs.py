"""The documentation is complete and its links lead somewhere."""

from __future__ import annotations

import ast
import json
import re
import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from acquisition.recordings.identify import formats
from pipeline.bench.scene import Scene
from pipeline.damping.laws import LAWS
from springmass import analyse, sample_data
from springmass.cli import main
from springmass.command_line import COMMANDS
from springmass.glossary import TERMS
from springmass.runs.analysing import load_and_analyse
from springmass.runs.options import ReadOptions
from springmass.runs.scenes import read_scene
from storage.run_file.layout import COLUMNS

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
REFERENCE = DOCS / "reference"
PAGES = sorted([*DOCS.rglob("*.md"), *(ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "CHANGELOG"))])
LINK = re.compile(r"!?\[[^\]]*\]\((?P<target>[^)\s]+)\)")
PACKAGES = ("acquisition", "pipeline", "storage", "springmass")
# Finding codes of the design that no stage of this version emits; the page says so.
PLANNED: tuple[str, ...] = ()


# Objects of the JSON whose keys are names, and what the page calls them.
NAMED = {"estimates": "NAME", "budget": "NAME", "damping.laws": "LAW", "damping.laws.LAW.parameters": "NAME"}
NAMED |= {"damping.weights": "LAW", "damping.coefficients": "NAME"}
NAMED |= {f"joint_damping[].{laws}": name for laws, name in (("laws", "LAW"), ("laws.LAW.parameters", "NAME"))}


def without_code(text: str) -> str:
    """Return a page without its fenced blocks, where brackets mean something else."""
    return re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)


def anchors(text: str) -> set[str]:
    """Return the anchors that a page's headings give."""
    heads = re.findall(r"^#{1,6} (.+)$", without_code(text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def rows(page: str) -> set[str]:
    """Return what stands in code style in the first cell of the page's table rows, and in its headings."""
    text = (REFERENCE / page).read_text(encoding="utf-8")
    cells = re.findall(r"^\| ([^|]*)\|", text, re.MULTILINE) + re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {name for cell in cells for name in re.findall(r"`([^`]+)`", cell)}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_internal_links_lead_to_a_file_and_a_heading(page: Path) -> None:
    """Every link that is no address names a file that is there, and a heading of it."""
    text = page.read_text(encoding="utf-8")
    for found in LINK.finditer(without_code(text)):
        target, _, anchor = found["target"].partition("#")
        if re.match(r"[a-z]+:", target):
            continue
        file = page if not target else (page.parent / target).resolve()
        assert file.exists(), f"{page.name}: {found['target']}"
        if anchor:
            assert anchor in anchors(file.read_text(encoding="utf-8")), f"{page.name}: {found['target']}"


def test_every_page_is_reached_from_the_index() -> None:
    """The index links every page of the documentation but the template of decisions."""
    text = (DOCS / "index.md").read_text(encoding="utf-8")
    linked = {(DOCS / found["target"].partition("#")[0]).resolve() for found in LINK.finditer(text)}
    assert set(DOCS.rglob("*.md")) - linked <= {DOCS / "index.md", DOCS / "decisions" / "0000-template.md"}


def constants_of_calls(names: tuple[str, ...]) -> Iterator[str]:
    """Yield the literal first arguments of calls of these names in the packages."""
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if not isinstance(node, ast.Call) or not node.args:
                    continue
                called = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
                first = node.args[0]
                if called in names and isinstance(first, ast.Constant) and isinstance(first.value, str):
                    yield first.value


def test_every_finding_code_in_the_code_is_documented() -> None:
    """What a stage or a reader may say has its line in the page of findings."""
    codes = set(constants_of_calls(("Finding", "Trap")))
    assert {"clipped", "law_rejected", "truncated_row"} <= codes
    assert codes - rows("findings.md") == set()


def test_every_finding_on_the_sample_data_is_documented() -> None:
    """Codes that are built from tables and not written out are seen where they appear."""
    for path in sorted(sample_data().glob("*_position.txt")):
        codes = {finding.code for finding in analyse(path).findings}
        assert codes - rows("findings.md") == set()


def test_the_page_of_findings_invents_nothing() -> None:
    """A documented code occurs in the code, or is said to be of a later version."""
    code = "".join(file.read_text(encoding="utf-8") for p in PACKAGES for file in (ROOT / p).rglob("*.py"))
    assert [name for name in rows("findings.md") if f'"{name}"' not in code and name not in PLANNED] == []


GENERATE = runpy.run_path(str(REFERENCE / "generate.py"))


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_and_option_is_documented(command: str) -> None:
    """The section of a command in the reference names each of its arguments and options."""
    text = (REFERENCE / "command-line.md").read_text(encoding="utf-8")
    section = re.search(rf"^## springmass {command}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert section, command
    for argument in GENERATE["arguments_of"](command):
        assert f"`{argument.name}" in section[1], f"{command}: {argument.name}"


def test_the_tables_of_options_are_as_declared() -> None:
    """``python docs/reference/generate.py`` changes nothing in the page."""
    text = (REFERENCE / "command-line.md").read_text(encoding="utf-8")
    assert GENERATE["updated"](text) == text
    assert len(GENERATE["TABLE"].findall(text)) == len(COMMANDS) + 1


def test_the_page_of_findings_is_that_of_the_registry() -> None:
    """``python docs/reference/generate.py`` changes nothing in the page of findings."""
    assert GENERATE["findings_page"]() == (REFERENCE / "findings.md").read_text(encoding="utf-8")


def test_a_row_of_the_page_of_findings_has_at_most_30_words() -> None:
    """Code, severity, meaning and advice together."""
    for line in (REFERENCE / "findings.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("| `"):
            assert len(re.findall(r"[\w'-]*[A-Za-z0-9][\w'-]*", line)) <= 30, line


def test_the_glossary_page_is_that_of_the_program() -> None:
    """``python docs/reference/generate.py`` changes nothing in the glossary, which is sorted and says nothing twice."""
    assert GENERATE["glossary_page"]() == (REFERENCE / "glossary.md").read_text(encoding="utf-8")
    names = [each.name for each in TERMS]
    assert names == sorted(set(names), key=str.casefold)


def test_every_option_in_the_reference_exists() -> None:
    """The reference names no option that the program does not know."""
    known = {name for command in COMMANDS for each in GENERATE["arguments_of"](command) for name in each.names}
    text = (REFERENCE / "command-line.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`(--?[a-z][a-z-]*)", without_code(text)))
    assert named <= known | {"--help", "--version", "-h", "-q", "--quiet", "-v", "--verbose", "--out"}


def test_help_texts_are_short() -> None:
    """A help text is a noun phrase or an imperative of at most 80 characters, without a full stop."""
    for command in COMMANDS:
        for argument in GENERATE["arguments_of"](command):
            assert 0 < len(argument.parameter.help) <= 80, f"{command}: {argument.name}"
            assert not re.search(r"[^.]\.$", argument.parameter.help), f"{command}: {argument.name}"


def test_every_estimate_is_documented() -> None:
    """What a full scene and either method give stands in the page of estimates."""
    data = sample_data()
    scene, pair = read_scene(data / "damped.scene.toml"), ReadOptions(velocity=data / "damped_simulated_velocity.txt")
    done = load_and_analyse(data / "damped_simulated_position.txt", pair, scene, with_classic=True)
    assert done.classic is not None
    names = set(done.analysis.estimates) | set(done.classic.estimates)
    assert "drag_coefficient" in names
    assert names - rows("estimates.md") == set()


def test_every_field_of_the_json_is_documented() -> None:
    """Each key of a result, by its path, has a row in the page of the JSON."""
    data = sample_data()
    run = load_and_analyse(data / "damped_simulated_position.txt", scene=read_scene(data / "damped.scene.toml"))
    result = run.described({}, time_utc="now").result
    documented = rows("json.md")
    assert set(paths(json.loads(json.dumps(result)))) - documented == set()


def test_every_field_of_a_comparison_is_documented(capsys: pytest.CaptureFixture[str]) -> None:
    """Each key that a comparison has beside its runs' own results has a row in the same page."""
    data = sample_data()
    run, scene = str(data / "undamped_simulated_position.txt"), str(data / "undamped.scene.toml")
    assert main(["compare", run, run, "--scene", scene, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["joint_damping"]
    for known in ("runs", "provenance"):
        del result[known]
    assert set(paths(result)) - rows("json.md") == set()


def paths(value: Any, above: str = "") -> Iterator[str]:
    """Yield the paths of an object's fields; the names of estimates, laws and parameters are NAME and LAW."""
    if isinstance(value, list):
        for item in value:
            yield from paths(item, f"{above}[]")
        return
    if not isinstance(value, dict) or above == "provenance.parameters" or above.endswith("findings[].values"):
        return
    for key, inner in value.items():
        shown = NAMED.get(above, key)
        path = f"{above}.{shown}" if above else shown
        if not isinstance(inner, list) or not inner or not isinstance(inner[0], dict):
            yield path
        yield from paths(inner, path)


def test_every_key_of_a_scene_is_documented() -> None:
    """The page of the scene names every table and key that a scene may hold."""
    text = (REFERENCE / "scene.md").read_text(encoding="utf-8")
    for file in sorted(sample_data().glob("*.scene.toml")):
        for table, keys in read_scene(file).to_mapping().items():
            assert all(f"`[{table}] {key}`" in text for key in keys), file.name
    documented = re.findall(r"^\| `\[(\w+)\] (\w+)`", text, re.MULTILINE)
    attributes = set(Scene.__dataclass_fields__)
    assert len(documented) == len(attributes)
    for table, key in documented:
        value: object = {"position": "below", "law": "linear", "mean_samples": 5, "median_samples": 5}.get(key, 0.5)
        assert Scene.from_mapping({table: {key: value}}) != Scene()


def test_laws_formats_and_columns_are_documented() -> None:
    """What the registries and the run file hold stands in the reference."""
    estimates = (REFERENCE / "estimates.md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in estimates for name in LAWS)
    families = rows("formats.md")
    assert {each.name for each in formats()} <= families
    run_file = (REFERENCE / "run-file.md").read_text(encoding="utf-8")
    assert all(f"`{column.path}`" in run_file for column in COLUMNS)


def test_the_two_commands_of_the_readme_are_targets() -> None:
    """`make demo` and `make test`, and every other target that a page names, stand in the Makefile."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z][a-z-]*):", makefile, re.MULTILINE))
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    first_screen = "\n".join(readme.splitlines()[:45])
    assert "make demo" in first_screen
    assert "make test" in first_screen
    for page in PAGES:
        for block in re.findall(r"`+(make [^`]+)`", page.read_text(encoding="utf-8")):
            for name in re.findall(r"make ([a-z][a-z-]*)", block):
                assert name in targets, f"{page.name}: make {name}"


def test_the_readme_shows_what_the_demo_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each line of the README's first output is a line of the demo's own; its values agree within half their u."""
    assert main(["demo", "--out", str(tmp_path / "demo-output")]) == 0
    printed = capsys.readouterr().out.replace(f"{tmp_path}/", "").splitlines()
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = re.search(r"^```text\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    assert shown
    lines = [line for line in shown[1].splitlines() if line != "..."]
    assert [line for line in lines if not any(agree(line, other) for other in printed)] == []


def agree(line: str, other: str) -> bool:
    """Tell whether two lines differ at most in values, by half their uncertainties."""
    pair = re.compile(r"(-?[\d.]+) \+- ([\d.]+)")
    ours, theirs = pair.findall(line), pair.findall(other)
    if pair.sub("", line).split() != pair.sub("", other).split() or len(ours) != len(theirs):
        return False
    return all(
        abs(float(a) - float(b)) <= 0.5 * float(u) and abs(float(u) - float(v)) <= 0.1 * float(v)
        for (a, u), (b, v) in zip(ours, theirs, strict=True)
    )


@pytest.mark.parametrize("picture", ["page.png", "report.png"])
def test_the_pictures_of_the_readme_are_taken_by_the_script(picture: str) -> None:
    """The README shows what docs/figures/screenshots.py takes, and it stays small."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"docs/figures/{picture}" in readme
    assert picture in (DOCS / "figures" / "screenshots.py").read_text(encoding="utf-8")
    assert 1_000 < (DOCS / "figures" / picture).stat().st_size < 300_000


def test_the_readme_is_short() -> None:
    """It says what the program does, for whom and how to start, in at most 120 lines."""
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 120
    assert lines[2].startswith("springmass turns recordings of a mass on a spring into period, spring constant")
