"""The command line: every command with its arguments. The work is in ``springmass.commands``, imported when called.

Options are declared in :mod:`springmass.options` and :mod:`springmass.runs.options`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Group, Parameter

from springmass import __version__
from springmass.errors import OK, USAGE, ProgramError, adopt
from springmass.layout import STDIN
from springmass.options import (
    AnalyseOptions,
    BatchOptions,
    BenchOptions,
    CompareOptions,
    ConvertOptions,
    DemoOptions,
    File,
    FirmwareOptions,
    FormatsOptions,
    JsonOption,
    PageOptions,
    PortsOptions,
    RecordOptions,
    RecoverOptions,
    ReplayOptions,
    SceneOptions,
    SimulateOptions,
    TradeOptions,
)
from springmass.runs.options import (
    READ,
    ChannelOptions,
    ComparedOptions,
    InputOptions,
    ReadOptions,
    RunsOptions,
)

if TYPE_CHECKING:
    from cyclopts.help import HelpPanel
    from rich.console import Console, ConsoleOptions

__all__ = ["COMMANDS", "app", "call", "without_reading"]

EVERY_COMMAND = Group("Every command", sort_key=5)
Shell = Literal["bash", "zsh", "fish", "powershell"]


def _argument(name: str, words: str, *, required: bool | None = None) -> Parameter:
    """Return the declaration of a positional argument."""
    return Parameter(name=name, metavar=name, help=words, required=required)


Recording = Annotated[File, _argument("INPUT", "recording, run file or wire log")]


def _columns(console: Console, options: ConsoleOptions, panel: HelpPanel) -> None:
    """Print one group of commands or options as text in columns."""
    from cyclopts.help import DefaultFormatter, PanelSpec  # these import rich, which few commands need
    from rich import box

    DefaultFormatter(panel_spec=PanelSpec(box=box.SIMPLE, padding=(0, 0)))(console, options, panel)


app = App(
    name="springmass",
    help="Estimate period, spring constant and damping law from rangefinder samples, with reliable uncertainties.",
    help_epilogue="Exit codes: 0 done, 1 some inputs failed, 2 usage, 3 unreadable input, 4 sensor, port or recording "
    "disk, 5 rejected under --strict, 70 internal error, 130 Ctrl-C",
    help_formatter=_columns,
    help_format="plaintext",
    version=f"springmass {__version__}",
    version_format="plaintext",
    default_parameter=Parameter(negative=(), show_default=False),
    group_parameters=Group("Options", sort_key=1),
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)
app.meta.suppress_keyboard_interrupt = False
app["--help"].help = "show this help"
app["--version"].help = "show the version"


@app.meta.default
def _begin(
    *words: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
    quiet: Annotated[
        bool, Parameter(name=("-q", "--quiet"), group=EVERY_COMMAND, help="print only errors and warnings on stderr")
    ] = False,
    verbose: Annotated[
        bool,
        Parameter(
            name=("-v", "--verbose"),
            group=EVERY_COMMAND,
            help="print on stderr which files and settings are read, used and written",
        ),
    ] = False,
) -> int:
    adopt(quiet, verbose)
    if not words:
        raise ProgramError("no command; try springmass demo or springmass --help", USAGE)
    return int(app(_renamed(words), exit_on_error=False, print_error=False) or OK)


def _renamed(words: Sequence[str]) -> list[str]:
    """Return a command line with the option names of version 0.1 replaced, and ``-`` replaced by the path of stdin."""
    end = words.index("--") if "--" in words else len(words)
    now = "--folder" if words[0] == "simulate" else "--output"
    return [STDIN if word == "-" else re.sub(r"^--out(?==|$)", now, word) for word in words[:end]] + list(words[end:])


@app.command(name="--completion")
def completion(shell: Annotated[Shell, _argument("SHELL", "bash, zsh, fish or powershell")], /) -> int:
    """Print the script that lets a shell complete commands and options."""
    print(app.generate_completion(shell=shell))
    return OK


def call(words: Sequence[str]) -> int:
    """Call a command and return its exit code.

    Raises
    ------
    cyclopts.CycloptsError
        If the words are not a valid command line.
    """
    return int(app.meta(list(words), exit_on_error=False, print_error=False, result_action="return_value") or OK)


_reading = App(default_parameter=app.default_parameter, help_flags=(), version_flags=())


@_reading.default
def _read(*, read: ChannelOptions = ChannelOptions()) -> ChannelOptions:
    return read


def without_reading(words: Sequence[str]) -> tuple[list[str], dict[str, Any]]:
    """Return a command line without the options for reading a recording, and these options as a dictionary.

    Examples
    --------
    >>> without_reading(["analyse", "run.csv", "--unit", "rad", "--json"])
    (['analyse', 'run.csv', '--json'], {'unit': 'rad'})
    """
    words = list(words)
    end = words.index("--") if "--" in words else len(words)
    _, bound, others, _ = _reading.parse_known_args(words[:end])
    return others + words[end:], bound.arguments.get("read", READ).given()


@app.command
def demo(*, options: DemoOptions = DemoOptions()) -> int:
    """Replay, analyse and compare the bundled recordings, and print the results."""
    from springmass.commands.demo import run

    return run(options)


@app.command
def analyse(
    *inputs: Annotated[
        File, _argument("INPUT", "recordings, run files or folders of these; - for standard input", required=True)
    ],
    options: AnalyseOptions = AnalyseOptions(),
    read: ReadOptions = READ,
    bench: BenchOptions = BenchOptions(),
) -> int:
    """Analyse recordings: print results and findings, and write a report."""
    from springmass.commands.analyse import run

    return run(inputs, options, read, bench)


@app.command
def explain(
    codes: Annotated[tuple[str, ...], _argument("CODE", "codes of warnings, as analyse prints them")] = (),
    /,
    *,
    options: JsonOption = JsonOption(),
) -> int:
    """Explain a warning: meaning, cause, advice and an example. Without a code, list all warnings."""
    from springmass.commands.explain import run

    return run(codes, options)


@app.command
def compare(
    *inputs: Annotated[
        File,
        _argument("RUN", "two or more runs of one spring, or folders from batch", required=True),
    ],
    options: CompareOptions = CompareOptions(),
    read: ComparedOptions = ComparedOptions(),
) -> int:
    """Compare runs of one spring: whether they agree, and whether one damping law fits them all."""
    from springmass.commands.compare import run

    return run(inputs, options, read)


@app.command
def batch(
    *inputs: Annotated[File, _argument("INPUT", "recordings, folders (with subfolders), patterns, or @FILE (a list)")],
    options: BatchOptions = BatchOptions(),
    read: RunsOptions = RunsOptions(),
) -> int:
    """Analyse a course of many runs into one table and a page; you can interrupt and resume it."""
    from springmass.commands.batch import run

    return run(inputs, options, read)


@app.command
def record(*, options: RecordOptions = RecordOptions(), page: PageOptions = PageOptions()) -> int:
    """Record a run from the bench and store every byte that the sensor sends."""
    from springmass.commands.record import run

    return run(options, page)


@app.command(name="page")
def page_(
    path: Recording,
    /,
    *,
    page: PageOptions = PageOptions(),
    read: InputOptions = InputOptions(),
    recorder: Annotated[bool, Parameter(help="used internally by `record --page`")] = False,
) -> int:
    """Show a recording in a browser, live or afterwards."""
    from springmass.commands.page import run

    return run(path, page, read, recorder=recorder)


@app.command
def recover(
    log: Annotated[File, _argument("RUN.wire", "wire log")],
    /,
    *,
    options: RecoverOptions = RecoverOptions(),
) -> int:
    """Build a run file from a wire log, even from a damaged one."""
    from springmass.commands.recover import run

    return run(log, options)


@app.command
def replay(
    path: Recording,
    /,
    *,
    options: ReplayOptions = ReplayOptions(),
    page: PageOptions = PageOptions(),
    read: InputOptions = InputOptions(),
) -> int:
    """Play a recording through the interface of a live sensor."""
    from springmass.commands.replay import run

    return run(path, options, page, read)


@app.command
def simulate(*, options: SimulateOptions, read: ChannelOptions = ChannelOptions()) -> int:
    """Solve the equation of motion of a scene, to a given tolerance or with a method that you choose."""
    from springmass.commands.simulate import run

    return run(options, read)


@app.command
def convert(
    path: Annotated[File, _argument("IN", "recording, run file or wire log")],
    output: Annotated[
        File | None, _argument("OUT", ".h5 (run file), .txt (pair) or .csv; or a folder to copy the original to")
    ] = None,
    /,
    *,
    options: ConvertOptions = ConvertOptions(),
    read: InputOptions = InputOptions(),
) -> int:
    """Convert a recording to a run file or another format, or extract the original from a run file."""
    from springmass.commands.convert import run

    return run(path, output, options, read)


@app.command
def trade(
    path: Annotated[File | None, _argument("INPUT", "measure all methods on this recording instead")] = None,
    /,
    *,
    options: TradeOptions = TradeOptions(),
    read: InputOptions = InputOptions(),
) -> int:
    """Measure what accuracy costs on this machine: error relative to its lower bound, and computing time."""
    from springmass.commands.trade import run

    return run(path, options, read)


@app.command
def formats(
    path: Annotated[File | None, _argument("FILE", "identify this file, or every file in this folder or zip")] = None,
    /,
    *,
    options: FormatsOptions = FormatsOptions(),
    read: InputOptions = InputOptions(),
) -> int:
    """List the formats of recordings, or identify the format of a file."""
    from springmass.commands.formats import run

    return run(path, options, read)


@app.command
def sensors(*, options: JsonOption = JsonOption()) -> int:
    """List the families of rangefinders with rate, resolution, range and limits."""
    from springmass.commands.sensors import run

    return run(options)


@app.command
def ports(*, options: PortsOptions = PortsOptions()) -> int:
    """List the serial ports and the sensors that answer on them."""
    from springmass.commands.ports import run

    return run(options)


@app.command
def firmware(*, options: FirmwareOptions = FirmwareOptions()) -> int:
    """Wire, flash and set the 100 Hz rangefinder."""
    from springmass.commands.firmware import run

    return run(options)


@app.command
def scene(
    path: Annotated[File | None, _argument("RECORDING", "save scene, remarks and marks next to this recording")] = None,
    /,
    *,
    options: SceneOptions = SceneOptions(),
) -> int:
    """Print a scene template, check a scene, or save a scene and marks next to a recording."""
    from springmass.commands.scene import run

    return run(path, options)


@app.command
def doctor(*, options: JsonOption = JsonOption()) -> int:
    """Check this installation."""
    from springmass.commands.doctor import run

    return run(options)


COMMANDS = tuple(name for name in app if not name.startswith("-"))
"""The names of all commands."""
