"""Links of the documentation lead somewhere, and the README's commands do what it shows."""

import re
import runpy
import shutil
import tomllib
from pathlib import Path

import pytest

from springmass import __version__
from springmass.cli import main

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.rglob("*.md"), *(ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "CHANGELOG"))])
LINK = re.compile(r"!?\[[^\]]*\]\((?P<target>[^)\s]+)\)")


def without_code(text: str) -> str:
    """Return a page without its fenced blocks, where brackets mean something else."""
    return re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)


def anchors(text: str) -> set[str]:
    """Return the anchors that a page's headings give."""
    heads = re.findall(r"^#{1,6} (.+)$", without_code(text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


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


def test_generated_pages_are_up_to_date(tmp_path: Path) -> None:
    """``python docs/reference/generate.py`` changes nothing."""
    copy = shutil.copytree(DOCS / "reference", tmp_path / "reference")
    runpy.run_path(str(copy / "generate.py"), run_name="__main__")
    for page in [*copy.glob("*.md"), *copy.glob("*.json")]:
        assert page.read_text(encoding="utf-8") == (DOCS / "reference" / page.name).read_text(encoding="utf-8")


def test_one_version_is_stated() -> None:
    """The package, its metadata, its citation and the newest release of the changelog state one version and date."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = re.search(r"^## \[(\d\S+)\] - (\S+)$", changelog, re.MULTILINE)
    assert newest
    assert project["version"] == __version__ == newest[1]
    assert f"version: {newest[1]}\ndate-released: {newest[2]}\n" in citation


def test_the_readme_shows_what_the_demo_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each line of the README's first output is a line of the demo's own, apart from blanks."""
    assert main(["demo", "--output", str(tmp_path / "demo-output")]) == 0
    printed = [line.split() for line in capsys.readouterr().out.replace(f"{tmp_path}/", "").splitlines()]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = re.search(r"^```text\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    assert shown
    assert [line for line in shown[1].splitlines() if line != "..." and line.split() not in printed] == []
