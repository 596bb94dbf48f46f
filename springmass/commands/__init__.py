"""The command line: a command is one function in the module of its name, which is imported when the command is called.

In: the arguments and options that the function declares. Out: lines on stdout, messages on stderr, files, an exit code
of `springmass.errors`. Free to change: what one command prints. A new command is a module here and a line below.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import App, Group, Parameter

from springmass import __version__
from springmass.commands.given import Given
from springmass.errors import LOG, OK, ProgramError
from springmass.layout import STDIN

if TYPE_CHECKING:
    from cyclopts.help import HelpPanel
    from rich.console import Console, ConsoleOptions

EVERY_COMMAND = Group("Every command", sort_key=5)
MAIN_COMMANDS = {
    "demo": "Analyse and compare the bundled recordings.",
    "analyse": "Print period, damping and warnings of recordings; write a report.",
    "explain": "Explain a warning, or list all of them.",
    "scene": "Print or check a scene: what is known of the bench; add notes.",
    "compare": "Compare runs of one spring: do they agree on it and on one law?",
    "batch": "Analyse a course of many runs into one table and a page.",
    "ports": "List serial ports, what speaks on them, and the sensors known.",
    "record": "Record a run from the bench, every byte of it.",
    "page": "Open the window: drop recordings, answer in fields, read results.",
}
"""The commands that a student, a course and a bench need, with their help."""
FURTHER_COMMANDS = {
    "recover": "Build a run file from a wire log, even from a damaged one.",
    "replay": "Play a recording through the interface of a live sensor.",
    "convert": "Convert a recording, or extract the original from a run file.",
    "formats": "List the formats of recordings, or identify that of a file.",
    "simulate": "Solve the equation of motion of a scene.",
    "trade": "Measure what accuracy costs on this machine, in two tables.",
    "firmware": "Wire and set the 100 Hz rangefinder; how to flash it.",
    "doctor": "Check this installation.",
}
COMMANDS = (*MAIN_COMMANDS, *FURTHER_COMMANDS)


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
    group_commands=Group("This program", sort_key=3),
    group_parameters=Group("Options", sort_key=1),
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)
app.meta.suppress_keyboard_interrupt = False
app["--help"].help = "show this help"
app["--version"].help = "show the version"
for _group, _commands in (
    (Group("Commands", sort_key=1), MAIN_COMMANDS),
    (Group("Further commands", sort_key=2), FURTHER_COMMANDS),
):
    for _name, _words in _commands.items():
        _order = COMMANDS.index(_name)
        app.command(f"springmass.commands.{_name}:{_name}", name=_name, help=_words, group=_group, sort_key=_order)


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
    LOG.setLevel(logging.WARNING if quiet else logging.DEBUG if verbose else logging.INFO)
    if not words:
        raise ProgramError("no command", "try springmass demo or springmass --help")
    end = words.index("--") if "--" in words else len(words)
    named = [STDIN if word == "-" else word for word in words[:end]]
    line = [*named, *words[end:]]
    command, bound, unparsed = app.parse_args(line, exit_on_error=False, print_error=False)
    if "given" in unparsed:
        declared = app[line[0]].assemble_argument_collection(default_parameter=app.default_parameter)
        bound.arguments["given"] = Given.of(declared, line)
    return int(command(*bound.args, **bound.kwargs) or OK)


@app.command(name="--completion")
def _completion(
    shell: Annotated[Literal["bash", "zsh", "fish", "powershell"], Parameter(name="SHELL", help="your shell")], /
) -> int:
    """Print the script that lets a shell complete commands and options."""
    print(app.generate_completion(shell=shell))
    return OK


def call(words: Sequence[str]) -> int:
    """Call a command and return its exit code; ``CycloptsError`` if the words are not a valid command line."""
    return int(app.meta(list(words), exit_on_error=False, print_error=False, result_action="return_value") or OK)
