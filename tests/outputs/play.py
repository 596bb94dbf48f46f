"""Play a subject in every output and check that a person or a program can read each of them."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from unittest import mock
from xml.etree import ElementTree

import html5lib
import numpy as np
from pylatexenc.latexwalker import LatexWalker

import springmass as sm
from acquisition.errors import AcquisitionError
from pipeline.analyse import Oscillation
from pipeline.errors import AnalysisError, PipelineError
from pipeline.findings.registry import FINDINGS
from pipeline.registry.quantities import QUANTITIES
from springmass.cli import main
from springmass.errors import INTERNAL, OK, UNREADABLE
from tests.outputs.subjects import Subject

__all__ = ["Ran", "play", "read_page", "read_tables", "run"]

COLUMNS = 80
NO_NUMBER = re.compile(r"(?<![\w.])[+-]?(nan|inf)(?![\w])", re.IGNORECASE)
CONTROL = re.compile(r"\x1b\[[0-9;]*m")


class _Terminal(io.StringIO):
    """A stream that claims to be a terminal."""

    encoding = "utf-8"

    def isatty(self) -> bool:
        """Claim it."""
        return True


class Ran:
    """A command that was run in this process: its exit code and what it wrote."""

    def __init__(self, arguments: Sequence[str], *, terminal: bool = False) -> None:
        out, err = (_Terminal(), _Terminal()) if terminal else (io.StringIO(), io.StringIO())
        environment = {"COLUMNS": str(COLUMNS), "TERM": "xterm-256color"} if terminal else {}
        with mock.patch.dict(os.environ, environment), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            self.code = main(list(arguments))
        self.out, self.err = out.getvalue(), err.getvalue()
        assert self.code != INTERNAL, self.err
        assert "Traceback" not in self.err
        assert not NO_NUMBER.search(CONTROL.sub("", self.out)), self.out


def run(*arguments: str | Path, terminal: bool = False) -> Ran:
    """Run a command line."""
    return Ran([str(argument) for argument in arguments], terminal=terminal)


def play(subject: Subject, folder: Path) -> int:
    """Play one subject in every output; return how many outputs were played.

    Parameters
    ----------
    subject : Subject
    folder : Path
        Empty; everything is written there.
    """
    played = _play_in_python(subject, folder)
    if subject.laws:
        return played
    options = [*subject.options, *_scene(subject, folder)]
    plain = run("analyse", subject.path, *options, "--out", folder)
    assert plain.code in (OK, UNREADABLE), plain.err
    results = list(folder.glob("*.results"))
    if not results:
        assert plain.code == UNREADABLE
        assert len(plain.err.splitlines()) == 1, plain.err
        return played + 1
    (written,) = results
    narrow = run("analyse", subject.path, *options, "--no-report", terminal=True)
    assert narrow.code == plain.code
    assert max(len(line) for line in CONTROL.sub("", narrow.out).splitlines()) <= COLUMNS, narrow.out
    as_json = run("analyse", subject.path, *options, "--json", "--no-report")
    (line,) = as_json.out.splitlines()
    result = _strict_json(line)
    assert set(result["estimates"]) <= set(QUANTITIES)
    assert {(f["code"], f["severity"]) for f in result["findings"]} <= {
        (c, s) for c in FINDINGS for s in FINDINGS[c].severities
    }
    read_page(written / "report.html")
    return played + 3 + 1 + read_tables(written)


def _scene(subject: Subject, folder: Path) -> list[str]:
    """Write the subject's scene; return the option that names it."""
    if not subject.scene:
        return []
    path = folder / "bench.toml"
    lines = []
    for table, keys in subject.scene.items():
        lines.append(f"[{table}]")
        for key, value in keys.items():
            inner = (
                ", ".join(f"{name} = {_toml(one)}" for name, one in value.items()) if isinstance(value, dict) else ""
            )
            lines.append(f"{key} = {{ {inner} }}" if inner else f"{key} = {_toml(value)}")
    path.write_text("\n".join(lines), encoding="utf-8")
    return ["--scene", str(path)]


def _toml(value: object) -> str:
    return json.dumps(value) if isinstance(value, str | bool) else repr(value)


def read_page(page: Path) -> None:
    """Parse a page as HTML without a single error, and look for numbers that are none in its text."""
    text = page.read_text(encoding="utf-8")
    tree = html5lib.HTMLParser(strict=True).parse(text)
    shown = " ".join(_texts(tree))
    assert not NO_NUMBER.search(shown), NO_NUMBER.findall(shown)


def _texts(tree: ElementTree.Element) -> Iterator[str]:
    """Yield the text of a page, its style and scripts aside."""
    for element in tree.iter():
        if isinstance(element.tag, str) and element.tag.rpartition("}")[2] not in ("style", "script", "metadata"):
            yield element.text or ""
        yield element.tail or ""


def read_tables(folder: Path) -> int:
    """Parse every table and figure of a report; return how many there are."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".html"]
    for path in files:
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".json":
            _strict_json(text)
        elif path.suffix == ".csv":
            rows = list(csv.reader(io.StringIO(text)))
            assert len({len(row) for row in rows}) == 1, path
            assert not any(NO_NUMBER.fullmatch(cell) for row in rows for cell in row), path
        elif path.suffix == ".tex":
            LatexWalker(text, tolerant_parsing=False).get_latex_nodes()
            assert not NO_NUMBER.search(text), path
        else:
            assert path.suffix == ".svg"
            ElementTree.fromstring(text)
    return len(files)


def _strict_json(text: str) -> dict[str, object]:
    def refuse(constant: str) -> float:
        raise AssertionError(f"{constant} is no JSON")

    found = json.loads(text, parse_constant=refuse)
    assert isinstance(found, dict)
    return found


def _play_in_python(subject: Subject, folder: Path) -> int:
    """Play what Python and a notebook show."""
    from matplotlib import pyplot

    laws = {"laws": (..., *subject.laws)} if subject.laws else {}
    try:
        found = sm.analyse(subject.path, dict(subject.scene) or None, **laws, **subject.answers)
    except (AcquisitionError, PipelineError) as refused:
        why = str(refused)
    else:
        why = ""
    if why:
        assert len(why.splitlines()) == 1
        return 1
    shown = repr(found)
    assert not NO_NUMBER.search(shown), shown
    html5lib.HTMLParser(strict=True).parseFragment(found._repr_html_())
    frame = found.to_dataframe(correlations=True)
    assert np.isfinite(frame[["value", "u"]].to_numpy(float)).all()
    dataset = found.to_dataset()
    assert all(math.isfinite(float(dataset[name])) for name in found.keys())  # noqa: SIM118  # its iterator is its keys
    for draw in (found.plot.position, found.plot.amplitude, found.plot.phase, found.plot.energy, found.plot.drag):
        if isinstance(found.motion, Oscillation) or draw == found.plot.position:
            with contextlib.suppress(AnalysisError):  # documented of a record without an energy or a drag
                draw().figure.canvas.draw()
        pyplot.close("all")
    if subject.laws:
        from springmass import load
        from springmass.report.write import write_report
        from springmass.runs.analysing import Analysed
        from springmass.runs.json_results import result_of

        loaded = load(subject.path, **subject.answers)
        result = result_of(loaded, found, time_utc="2026-01-01T00:00:00+00:00", accuracy="standard", parameters={})
        page = write_report(folder / "own.results", [Analysed("own", found, result)])
        read_page(page)
        return 9 + 1 + read_tables(page.parent)
    return 9
