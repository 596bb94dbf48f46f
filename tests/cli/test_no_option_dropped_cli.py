"""No option is dropped silently: each has an effect on what a call gives, or is refused in one line."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from cyclopts.argument import Argument

from springmass.commands import app
from springmass.loading.load import sample_data
from tests.cli.conftest import Cli

DATA = sample_data()
POSITION, OTHER = str(DATA / "undamped_simulated_position.txt"), str(DATA / "damped_simulated_position.txt")
SCENE = str(Path(__file__).parents[1] / "golden" / "scenes" / "linear.toml")
Call = Callable[[list[str]], tuple[object, ...]]
TIMINGS = re.compile(r'"time_utc": "[^"]*"|"\w*_s": [-+\d.e]+|\b[-+\d.e]+ m?s\b')
CALLS = {
    "simulate without a run": ["simulate", "--scene", SCENE, "--json", "--seconds", "2"],
    "analyse without a report": ["analyse", POSITION, "--json", "--accuracy", "fast"],
    "compare without a report": ["compare", POSITION, OTHER, "--scene", SCENE, "--json", "--accuracy", "fast"],
    "trade without a recording": ["trade", "--seeds", "1", "--json"],
    "formats without a file": ["formats"],
    "a template of a course": ["batch", POSITION, "--template"],
    "replay": ["replay", "SHORT", "--speed", "max"],
    "convert to CSV": ["convert", "SHORT", "OUT.csv"],
}
"""Calls in which some options of their command can have no effect."""
MAY_CHANGE_NOTHING = frozenset(
    {"--overwrite", "--unverified", "--loop", "--recorder", "--force", "--dask", "--strict", "--no-report"}
)
"""Permissions and limits, which matter only where something stands in the way, and what does not end."""


def options_of(command: str) -> Iterator[Argument]:
    """Yield the options of a command, as it declares them."""
    declared = app[command].assemble_argument_collection(default_parameter=app.default_parameter)
    yield from (each for each in declared if each.parse and each.name.startswith("-"))


def value_of(option: Argument) -> list[str]:
    """Return a value that the command would use if it used any: a number, a choice, or a name of nothing."""
    if option.hint is bool:
        return []
    if choices := option.get_choices():
        return [choices[-1]]
    if "KEY" in str(option.parameter.metavar):
        return ["channel=nope"]
    numeric = any(kind in str(option.hint) for kind in ("float", "int")) and "str" not in str(option.hint)
    return ["3"] if numeric else ["nope"]


@pytest.fixture
def outcome(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Call:
    """Return what a call gives: exit code, output, messages and files."""
    monkeypatch.chdir(tmp_path)
    rows = Path(POSITION).read_text(encoding="utf-8").splitlines(keepends=True)[:400]
    (tmp_path / "short.txt").write_text("".join(rows), encoding="utf-8")

    def call(words: list[str]) -> tuple[object, ...]:
        folder = tmp_path / "call"
        folder.mkdir()
        monkeypatch.chdir(folder)
        places = {"SHORT": str(tmp_path / "short.txt"), "OUT.csv": "out.csv"}
        done = cli(*(places.get(word, word) for word in words))
        files = {str(each.relative_to(folder)): each.stat().st_size for each in folder.rglob("*") if each.is_file()}
        monkeypatch.chdir(tmp_path)
        shutil.rmtree(folder)
        out, err = (TIMINGS.sub("", text) for text in (done.out, done.err))  # two calls never take the same time
        return done.code, out, err, files

    return call


@pytest.mark.parametrize("name", CALLS)
def test_each_option_shows_or_is_refused(outcome: Call, name: str) -> None:
    """An option that changes neither output, messages, files nor exit code is dropped."""
    words = CALLS[name]
    plain = outcome(words)
    assert plain[0] == 0
    dropped = []
    for option in options_of(words[0]):
        if option.name in words or MAY_CHANGE_NOTHING & {*option.names}:
            continue
        done = outcome([*words, max(option.names, key=len), *value_of(option)])
        if done == plain:
            dropped.append(option.name)
        if done[0]:
            assert str(done[2]).count("springmass: ") == 1, (option.name, done[2])
    assert dropped == []


REFUSED = (
    ["analyse", POSITION, OTHER, "--template", "latex", "--no-report"],
    ["analyse", POSITION, OTHER, "--full", "--no-report"],
    ["simulate", "--scene", SCENE, "--read", "channel=nope"],
    ["convert", POSITION, "out.csv", "--scene", SCENE],
    ["page", str(Path(SCENE).parents[1] / "base.wire"), "--no-browser", "--read", "channel=nope"],
)


@pytest.mark.parametrize("words", REFUSED, ids=lambda words: " ".join((words[0], *words[-2:])))
def test_an_option_without_effect_is_refused(
    cli: Cli, words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One line names the option, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    done = cli(*words)
    assert done.code == 2
    assert any(word in done.complaint for word in words if word.startswith("--"))
    assert not list(tmp_path.iterdir())
