"""The documentation runs: every ``python`` and ``console`` block of its pages, in order, as a reader would.

A ``console`` block is read line by line: ``$ `` begins a command, and what follows is what it prints, on either stream.
A ``python`` block is a session with ``>>>`` or plain code. Where a block states an output it is compared as doctest
does, blanks normalised and ``...`` for anything. The blocks of a page share one folder and one namespace.
"""

import doctest
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
LONG = (
    "docs/how-to/analyse-a-recording.md",
    "docs/tutorial-report.md",
    "docs/how-to/compare-runs.md",
    "docs/how-to/compare-with-the-classic-method.md",
    "docs/how-to/read-the-budget.md",
    "docs/how-to/record-at-the-bench.md",
    "docs/how-to/simulate-a-bench.md",
    "docs/reference/command-line.md",
    "docs/decisions/0004-demodulation-first.md",
    "docs/explanation/euler.md",
    "docs/explanation/method.md",
)
"""Pages with many commands or long fits: they run with the trials."""
ELSEWHERE = (
    "docs/how-to/analyse-a-course.md",  # tests/cli/test_batch_cli.py, with folders of recordings
    "docs/how-to/many-machines.md",  # tests/docs/test_many_machines.py, with a cluster on this machine
    "docs/how-to/watch-a-recording.md",  # tests/pages: a page stays open until its reader ends it
    "docs/reference/page-messages.md",  # tests/pages/test_at_the_bench.py, with the address of a page
)
"""Pages whose blocks need what no page can bring along, and where the same is run."""
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
FENCE = re.compile(r"^```(?P<language>python|console)[ \t]*\n(?P<body>.*?)^```[ \t]*$", re.MULTILINE | re.DOTALL)

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the console blocks are written for a POSIX shell")


class Block(NamedTuple):
    """A fenced block and the line it begins on."""

    language: str
    body: str
    line: int


def blocks_of(page: str) -> list[Block]:
    """Return a page's blocks that can be run."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return [
        Block(found["language"], found["body"], text.count("\n", 0, found.start("body")) + 1)
        for found in FENCE.finditer(text)
    ]


def commands_of(block: Block) -> Iterator[tuple[int, str, str]]:
    """Yield the commands of a console block: the line, what follows ``$ ``, and the output stated beneath it."""
    lines = block.body.splitlines()
    starts = [i for i, line in enumerate(lines) if line.startswith("$ ")]
    for start, stop in zip(starts, [*starts[1:], len(lines)], strict=True):
        yield block.line + start, lines[start][2:], "\n".join(lines[start + 1 : stop])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a working folder with the sample data, and put the project's own program first on the path."""
    shutil.copytree(ROOT / "sample_data", tmp_path / "sample_data")
    programs = tmp_path / ".programs"
    programs.mkdir()
    for name, arguments in (("springmass", "-m springmass"), ("python", "")):
        script = programs / name
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" {arguments} "$@"\n')
        script.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{programs}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("COLUMNS", "100")
    return tmp_path


def pages() -> list[Any]:
    """Return every page with blocks that are run here; those with many commands are marked as trials."""
    found = (path.relative_to(ROOT).as_posix() for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))])
    run_here = [page for page in found if page not in ELSEWHERE and blocks_of(page)]
    return [pytest.param(page, marks=[pytest.mark.trials] if page in LONG else []) for page in run_here]


@pytest.mark.parametrize("page", pages())
def test_every_block_of_a_page_does_what_it_says(page: str, folder: Path) -> None:
    """The blocks run in order and print what stands beneath them."""
    names: dict[str, object] = {"__name__": "__main__"}
    status = 0
    for block in blocks_of(page):
        if block.language == "python":
            run_python(page, block, names)
        else:
            status = run_console(page, block, folder, status)


def run_python(page: str, block: Block, names: dict[str, object]) -> None:
    """Run a python block in a page's namespace."""
    where = f"{page}, line {block.line}"
    if ">>>" not in block.body:
        # Blank lines in front keep the page's own line numbers in a traceback.
        exec(compile("\n" * (block.line - 1) + block.body, page, "exec"), names)
        return
    session = doctest.DocTestParser().get_doctest(block.body, {}, where, page, block.line)
    session.globs = names
    output: list[str] = []
    outcome = doctest.DocTestRunner(optionflags=OPTIONS).run(session, out=output.append, clear_globs=False)
    assert outcome.failed == 0, "".join(output)


def run_console(page: str, block: Block, folder: Path, status: int) -> int:
    """Run a console block's commands and return the exit code of the last."""
    commands = list(commands_of(block))
    for (line, command, stated), following in zip(commands, [*commands[1:], None], strict=True):
        where = f"{page}, line {line}: {command}"
        done = subprocess.run(
            ["/bin/sh", "-c", f"(exit {status}); {command}"],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        status = done.returncode
        expected = following is not None and following[1] == "echo $?"
        assert status == 0 or expected, f"{where}: exit code {status}\n{done.stdout}"
        if stated.strip():
            same = doctest.OutputChecker().check_output(plain(stated), plain(done.stdout), OPTIONS)
            assert same, f"{where}\nstated:\n{stated}\ngot:\n{done.stdout}"
    return status


def plain(text: str) -> str:
    """Return a text as doctest compares it: ended by one line end, blank lines gone."""
    return "\n".join(line for line in text.splitlines() if line.strip()) + "\n"
