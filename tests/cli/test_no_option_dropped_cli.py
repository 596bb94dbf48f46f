"""No option is dropped silently: each shows in what a call gives, or is refused in one line.

The options come from the program. One that stands in no table here fails until it has a call in which it shows.
"""

import contextlib
import io
import json
import os
import re
import shlex
import shutil
import time
import webbrowser
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest
import serial.tools.list_ports
from cyclopts.argument import Argument
from serial.tools.list_ports_common import ListPortInfo

from springmass.cli import main
from springmass.commands import COMMANDS, app
from springmass.errors import LOG
from springmass.loading.load import sample_data
from tests.cli.conftest import BENCH, Viewer
from tests.cli.test_rangefinder_cli import Board

BASE_LOG = Path(__file__).parents[1] / "golden" / "base.wire"
READING = {
    "--velocity": ("short.txt", "bare.csv"),
    "--channel": ("two.csv", "x"),
    "--run": ("short.txt", "nope"),
    "--rate-hz": ("rows.csv --unit cm", "50"),
    "--unit": ("bare.csv", "cm"),
    "--time": ("short.txt", "nope"),
    "--time-unit": ("bare.csv --unit cm", "ms"),
    "--delimiter": ("two.csv --channel x", ";"),
    "--decimal": ("two.csv --channel x", ","),
    "--unverified": ("edited.h5", ""),
}
"""For each option of reading the file of a call, and a value that shows with it."""
Shown = dict[str, tuple[str, ...]]
"""For each option a value, a call in which it shows, and a pattern that only this option brings about.

Without a call it is that of the empty name, and without a pattern anything may differ.
"""
BENCHES = "--scene light.toml --scene heavy.toml --accuracy=fast"
ANY_COMPARE = f"compare short.txt other.txt {BENCHES}"
ANY_BATCH = "batch short.txt --jobs 1 --reports 0 -o out"
FREE = str(20_000 + os.getpid() % 10_000)  # below those that a system hands out by itself
ANY_RECORD = "record --simulate --scene bench.toml --seconds 0.2 -o run.h5"
SHOWN: dict[str, Shown] = {
    "demo": {"": ("demo",), "--output": ("elsewhere", "demo", "file elsewhere/demo.results")},
    "analyse": {
        "": ("analyse short.txt --json --accuracy=fast",),
        **{name: (value, f"analyse {file} --json --accuracy=fast") for name, (file, value) in READING.items()},
        "--scene": ("bench.toml",),
        "--from": ("1.5",),
        "--to": ("3.5",),
        "--method": ("classic",),
        "--output": ("out",),
        "--keep": ("", "analyse bare.csv --unit cm --json"),
        "--no-report": ("", "analyse short.txt"),
        "--full": ("", "analyse short.txt"),
        "--template": ("latex", "analyse short.txt"),
        "--figures": ("svg", "analyse short.txt"),
        "--si": ("", "analyse short.txt --no-report"),
        "--json": ("", "analyse short.txt --no-report"),
        "--strict": ("", "analyse edited.h5 --unverified --json"),
        "--clock-ppm": ("5000",),
        "--accuracy": ("fast", "analyse short.txt --json"),
        "--law": ("quadratic",),
        "--mass-kg": ("0.2",),
        "--set": ("bob.mass_kg=0.2",),
    },
    "explain": {"": ("explain clipped",), "--json": ("",)},
    "scene": {
        "": ("scene short.txt --note seen",),
        **{name: (value, f"scene {file} --note seen") for name, (file, value) in READING.items()},
        "--check": ("bench.toml", "scene"),
        "--scene": ("bench.toml",),
        "--note": ("again",),
        "--mark": ("1.5=touched",),
    },
    "compare": {
        "": (f"{ANY_COMPARE} --json",),
        "--scene": ("light.toml", "compare short.txt other.txt --json"),
        "--mass-correlation": ("1",),
        "--reported": ("reported.csv",),
        "--hooke": ("hooke.csv",),
        "--output": ("out",),
        "--figures": ("svg", f"{ANY_COMPARE} -o out"),
        "--template": ("latex", f"{ANY_COMPARE} -o out"),
        "--json": ("", ANY_COMPARE),
        "--strict": (
            "",
            f"compare edited.h5 other.txt {BENCHES} --json --read unverified=yes",
        ),
        "--read": ("unverified=yes", f"compare edited.h5 other.txt {BENCHES} --json"),
        "--accuracy": ("fast", "compare short.txt other.txt --scene light.toml --scene heavy.toml --json"),
        "--law": ("quadratic",),
    },
    "batch": {
        "": (ANY_BATCH,),
        "--output": ("out", "batch short.txt --jobs 1 --reports 0"),
        "--runs": ("runs.csv",),
        "--template": ("", "batch short.txt"),
        "--scene": ("bench.toml",),
        "--jobs": ("2", "batch short.txt -o out --dask tcp://x", "--jobs"),
        "--dask": ("nothing://here", "batch short.txt -o out"),
        "--reports": ("1", "batch short.txt --jobs 1 -o out --reports=0"),
        "--read": ("channel=x", "batch two.csv --jobs 1 --reports 0 -o out"),
        "--accuracy": ("fast",),
        "--law": ("quadratic",),
    },
    "ports": {"": ("ports --json",), "--no-probe": ("",), "--port": ("PORT",), "--json": ("", "ports")},
    "record": {
        "": (ANY_RECORD,),
        "--port": ("PORT", "record -o run.h5", "socket://"),
        "--sensor": ("us100", ANY_RECORD, "us100 cannot be simulated"),
        "--simulate": ("", "record --seconds 0.2 -o run.h5", "file run.h5"),
        "--output": ("mine.h5", "record --simulate --seconds 0.2", "file mine.h5"),
        "--seconds": ("0.7", "record --simulate --scene bench.toml -o run.h5", r"run\.h5: \d+ samples"),
        "--page": ("", f"{ANY_RECORD} --want-us 5"),  # refused without a page
        "--ready": ("", ANY_RECORD, "--ready: no effect"),
        "--scene": ("bench.toml", "record --simulate --seconds 0.2 -o run.h5", '"constant_n_per_m": 20.0'),
        "--title": ("swing", ANY_RECORD, '"title": "swing"'),
        "--baud": ("19200", ANY_RECORD, '"baud": 19200'),
        "--rate-hz": ("50", ANY_RECORD, '"rate_hz": 50'),
        "--option": ("nope=1", ANY_RECORD, "got nope"),
        "--still": ("0.2", ANY_RECORD, "rest_m"),
        "--ruler": ("0.24", f"{ANY_RECORD} --still 0.2", '"rest_m": 0.24'),
        "--speed-of-sound": ("350", ANY_RECORD, '"speed_of_sound_m_per_s": 350'),
        "--clock-ppm": ("123", ANY_RECORD, '"clock_ppm": 123'),
        "--trigger": ("0.01", ANY_RECORD, '"threshold_m": 0.01'),
        "--pre": ("0.3", f"{ANY_RECORD} --trigger 0.01", '"keep_s": 0.3'),
        "--seed": ("1", "record --port PORT -o run.h5", "--seed: no effect"),
        **{
            name: (value, ANY_RECORD, f"{name}: no effect without --page")
            for name, value in (("--page-port", "1"), ("--no-browser", ""), ("--want-us", "5"), ("--lan", ""))
        },
        "--law": ("linear", ANY_RECORD, "--law: no effect without --page"),
        **{
            name: (value, ANY_RECORD, f"{name}: no effect with --simulate")
            for name, value in (("--framing", "7E1"), ("--wait", "5"), ("--send", "go"))
        },
    },
    "page": {
        "": ("page --play short.txt",),
        "--play": ("", "page short.txt two.csv", "one recording is shown, got 2"),
        "--shortcut": ("", "page", "opens the window"),
        "--page-port": (FREE, "page --play short.txt", f"page: http://127.0.0.1:{FREE}/"),
        "--no-browser": ("", "page --play short.txt"),
        "--want-us": ("0.5",),
        "--lan": ("",),
        "--law": ("quadratic",),
        "--read": ("channel=x", "page --play two.csv"),
    },
    "recover": {
        "": ("recover base.wire",),
        "--output": ("again.h5",),
        "--overwrite": ("", "recover base.wire -o edited.h5"),
        "--speed-of-sound": ("350",),
        "--option": ("nope=1", "recover base.wire", "got nope"),
    },
    "replay": {
        "": ("replay short.txt --speed=max",),
        "--speed": ("0.2", "replay short.txt --seek 3.9", "took half a second"),
        "--seek": ("3.5",),
        "--loop": ("", "replay short.txt --speed=max", "after 1000 lines"),
        "--read": ("channel=x", "replay two.csv --speed=max"),
    },
    "convert": {
        "": ("convert short.txt out.csv",),
        **{name: (value, f"convert {file} out.csv") for name, (file, value) in READING.items()},
        "--scene": ("bench.toml", "convert short.txt out.h5"),
        "--overwrite": ("", "convert short.txt edited.h5"),
    },
    "formats": {
        "": ("formats short.txt",),
        **{name: (value, f"formats {file}") for name, (file, value) in READING.items()},
        "--json": ("",),
    },
    "simulate": {
        "": ("simulate --scene bench.toml --seconds=2 --json",),
        "--scene": ("bench.toml", "simulate --seconds 2 --json"),
        "--method": ("rk4",),
        "--dt": ("0.02",),
        "--seconds": ("3", "simulate --scene bench.toml --json"),
        "--tolerance": ("1e-9",),
        "--check": ("",),
        "--force": ("", "simulate --scene bench.toml --seconds 9 --method forward-euler --dt 0.5 --json"),
        "--against": ("short.txt",),
        "--output": ("out.h5",),
        "--overwrite": ("", "simulate --scene bench.toml --seconds 2 -o edited.h5"),
        "--sensor": ("ideal", "simulate --scene bench.toml --seconds 2 -o out.h5"),
        "--seed": ("3", "simulate --scene bench.toml --seconds 2 -o out.h5"),
        "--figures": ("svg", "simulate --scene bench.toml --seconds 2"),
        "--full": ("", "simulate --scene bench.toml --seconds 2"),
        "--json": ("", "simulate --scene bench.toml --seconds 2"),
        "--read": ("channel=x", "simulate --scene bench.toml --json --against two.csv"),
    },
    "trade": {
        "": ("trade --seeds=1 --seconds=5 --json",),
        "--scene": ("bench.toml", "trade --seeds=1 --seconds=5 --json", '"frequency": 1.59'),
        "--seeds": ("2", "trade --seconds=5 --json", '"seeds": 2'),
        "--seconds": ("5", "trade --seeds 1 short.txt --json"),
        "--json": ("", "trade --seeds=1 --seconds=5", '"schema": 1'),
        "--read": ("channel=nope", "trade two.csv --seeds 1 --json", "nope"),
    },
    "firmware": {
        "": ("firmware --port BOARD",),
        "--port": ("BOARD", "firmware"),
        "--rate": ("50", "firmware --port BOARD", "50 Hz"),
        "--gate": ("600,4000", "firmware --port BOARD", "600 to 4000 us"),
        "--spread": ("1000", "firmware --port BOARD", "1000 us"),
        "--name": ("bench-3", "firmware --port BOARD", "bench-3"),
    },
    "doctor": {"": ("doctor",), "--json": ("",)},
}

ONLY = {
    "formats": ("--json",),
    "trade": ("--scene", "--seeds", "--seconds", "--json"),
    "batch short.txt --template": ("--template",),
    "compare course": ("--json", "--strict"),
    "scene --check bench.toml": ("--check",),
    "firmware": ("--port",),
}
"""Calls that have no use for any other option of their command."""
WITHOUT = {
    "analyse short.txt --no-report": ("--template", "--figures"),
    "analyse short.txt --json": ("--template", "--figures", "--full", "--si"),
    "analyse short.txt other.txt --no-report": ("--template", "--figures", "--full", "--velocity"),
    "compare short.txt other.txt": ("--figures", "--template"),
    "convert short.txt out.csv": ("--scene",),
    "simulate --scene bench.toml --json": ("--read", "--sensor", "--seed", "--overwrite", "--figures"),
    "page base.wire": ("--read",),
    "batch short.txt --read velocity=short_velocity.txt": ("--output",),
    "compare short.txt other.txt --read velocity=short_velocity.txt": ("--json",),
}
"""Calls that have no use for some options, or never have if one is given."""


def options_of(command: str) -> Iterator[Argument]:
    """Yield the options of a command, as it declares them."""
    declared = app[command].assemble_argument_collection(default_parameter=app.default_parameter)
    yield from (each for each in declared if each.parse and each.name.startswith("-"))


def longest(option: Argument) -> str:
    """Return the longest name of an option."""
    return max(option.names, key=len)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of small recordings that lack one thing each, and of what else a command reads."""
    folder = tmp_path_factory.mktemp("files")
    data = sample_data()
    for name, source in (("short", "undamped"), ("other", "damped")):
        for kind in ("position", "velocity"):
            rows = (data / f"{source}_simulated_{kind}.txt").read_bytes().splitlines(keepends=True)[:402]
            (folder / f"{name}{'' if kind == 'position' else '_velocity'}.txt").write_bytes(b"".join(rows))
    t = np.arange(400) / 100.0
    x = 20.0 + 5.0 * np.exp(-0.02 * t) * np.cos(8.3 * t) + np.random.default_rng(1).normal(0.0, 0.01, t.size)
    table = [
        ("two.csv", "t (s),x (cm),y (cm)", (t, x, x + 1.0)),
        ("bare.csv", "t (s),x", (t, x)),
        ("rows.csv", "x", (x,)),
    ]
    for name, heading, columns in table:
        np.savetxt(folder / name, np.stack(columns, axis=1), "%.5f", delimiter=",", header=heading, comments="")
    (folder / "bench.toml").write_text(BENCH)
    for name, source in (("light", "undamped"), ("heavy", "damped")):
        shutil.copy(data / f"{source}.scene.toml", folder / f"{name}.toml")
    assert main(["-q", "batch", str(folder / "short.txt"), "-o", str(folder / "course"), "--reports", "0"]) == 0
    (folder / "reported.csv").write_text("run,name,value,u,unit\nshort,period,0.7,0.001,s\n")
    (folder / "hooke.csv").write_text("mass_kg,position_m\n0.1,0.30\n0.2,0.35\n0.3,0.40\n")
    (folder / "runs.csv").write_text("path,section,bob_mass_kg\nshort.txt,mon,0.2\n")
    shutil.copy(BASE_LOG, folder / "base.wire")
    assert main(["-q", "convert", str(folder / "short.txt"), str(folder / "edited.h5")]) == 0
    with h5py.File(folder / "edited.h5", "r+") as file:
        file["entry/signal/distance"][7] += 0.001
    return folder


class Output(io.StringIO):
    """Standard output whose reader goes away after a thousand lines."""

    def write(self, text: str) -> int:
        """Take a text."""
        if self.getvalue().count("\n") > 1000:
            super().write("after 1000 lines\n")
            raise BrokenPipeError
        return super().write(text)


def described(path: Path) -> str:
    """Return the content of a file, as far as two calls that do the same agree on it."""
    if path.suffix == ".toml" or path.name == "out.csv":
        return path.read_text(encoding="utf-8")
    if path.name == "results.csv" and (path.parent / "course.db").is_file():
        heading, *rows = path.read_text(encoding="utf-8").splitlines()
        return "\n".join(re.sub(r"\b[0-9a-f]{64}\b", "", row) for row in [heading, *rows])
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            return json.dumps(json.loads(file["entry/provenance/header"][()]))
    return ""


@pytest.fixture
def outcome(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], tuple[int, str]]]:
    """Return what gives the exit code of a call, and all that it prints and writes, as a text."""
    board = Board()
    monkeypatch.setenv("BROWSER", "true")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))  # where an icon of the window is put
    port = ListPortInfo(board.port)
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda *_, **__: [port])

    def call(line: str) -> tuple[int, str]:
        line = line.replace("BOARD", board.port).replace("PORT", "socket://127.0.0.1:1")
        folder = tmp_path / "call"
        shutil.copytree(files, folder)
        given = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
        out, err, viewer, opened = Output(), io.StringIO(), Viewer(), list[str]()
        monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) is None)
        began_s = time.monotonic()
        with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            LOG.addHandler(viewer)
            code = main(shlex.split(line))
            LOG.removeHandler(viewer)
        gone_s = time.monotonic() - began_s
        new = sorted(
            path for path in folder.rglob("*") if given.get(path) != path.stat().st_mtime_ns and path.is_file()
        )
        written = [f"file {path.relative_to(folder)}\n{described(path)}" for path in new]
        shutil.rmtree(folder)
        took = ["took half a second"] if gone_s > 0.45 else []
        browser = ["a browser opened"] if opened else []
        return code, "\n".join([out.getvalue(), err.getvalue(), *written, *viewer.seen, *browser, *took])

    yield call
    board.close()


NOISE = re.compile(
    r'"parameters": \{[^}]*\}'  # repeats what was given, whether it is used or not
    r"|http://\S+|\b[0-9a-f]{64}\b|\d{4}-\d\d-\d\dT[\d:.+Z]+|took half a second"
    r'|"(?:session|time_utc|choosing_s|running_s|time_s)": [^,}]*|\b[-+\d.e]+ m?s to \w+|\b\d[\d.e+-]* ms\b'
)
"""What two equal calls do not agree on, and what would differ although an option is dropped."""


def stable(outcome: tuple[int, str]) -> tuple[int, str]:
    """Return an outcome without what differs from call to call."""
    return outcome[0], " ".join(NOISE.sub("", outcome[1]).split())


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("command", COMMANDS)
def test_each_option_shows_or_is_refused(outcome: Callable[[str], tuple[int, str]], command: str) -> None:
    """With a value that matters, the call gives something else; a refusal is one line."""
    shown, plain = SHOWN[command], cache(lambda call: stable(outcome(call)))
    usual = shown[""][0]
    dropped = []
    for name in map(longest, options_of(command)):
        value, call, pattern, *_ = (*shown[name], *(usual, "")[len(shown[name]) - 1 :])
        done = outcome(f"{call} {name} {value}")
        assert "internal error" not in done[1]
        if done[0] in (2, 3):
            assert done[1].count("springmass: ") == 1, (name, done)
        same = not re.search(pattern, done[1]) if pattern else stable(done) == plain(call)
        dropped += [(name, done)] if same else []
    assert dropped == []


@pytest.mark.parametrize("call", [*ONLY, *WITHOUT])
def test_an_option_without_use_in_a_call_is_refused(outcome: Callable[[str], tuple[int, str]], call: str) -> None:
    """One line names it, with exit code 2, and nothing is written."""
    command = call.split()[0]
    for name in map(longest, options_of(command)):
        if name in WITHOUT[call] if call in WITHOUT else name not in ONLY[call]:
            code, text = outcome(f"{call} {name} {SHOWN[command][name][0]}")
            assert (code, text.count("springmass: ")) == (2, 1), (name, text)
            assert "\nfile " not in text
