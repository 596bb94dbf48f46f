"""Options that several commands share: how a recording is read and analysed, files, outputs, figures, the page."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import Field, dataclass, field, fields, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Group, Parameter, Token

from acquisition.recordings.reading import ReadOptions, ValueKind, value_of
from springmass.commands.parameters import LawName, PartsPerMillion, Positive, TcpPort, argument, flag, option
from springmass.errors import ProgramError
from springmass.loading.options import LOAD_FIELDS, Accuracy, AnalysisOptions, LoadOptions

if TYPE_CHECKING:
    from pipeline.numerics.estimate import Estimate

    FileArgument = str
else:
    FileArgument = str | Path  # as it is typed; a shell completes the name of a file where a path is allowed

HOW_READ = Group("How the recording is read", sort_key=2)
THE_PAGE = Group("The page", sort_key=4)
FURTHER_OPTIONS = Parameter(group=Group("Further options", sort_key=4))
"""Marks an option that few people use, which the help shows below the others."""


def converted(metavar: str, words: str, convert: Callable[[str], Any], *, repeated: bool = True) -> Parameter:
    """Return the declaration of an option, with a function that converts its value or, if ``repeated``, its values."""

    def every(_: Any, tokens: Sequence[Token]) -> Any:
        return tuple(convert(token.value) for token in tokens) if repeated else convert(tokens[0].value)

    return Parameter(metavar=metavar, help=words, converter=every, accepts_keys=False, n_tokens=1)


def _decoder_option(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ValueError("must be NAME=VALUE")
    return name, int(value) if value.isdecimal() else value


def _formats(text: str) -> tuple[str, ...]:
    kinds = tuple(kind.strip().lower() for kind in text.split(","))
    if not set(kinds) <= {"svg", "pdf", "png"}:
        raise ValueError("must be svg, pdf or png, or several of them with commas")
    return kinds


RecordingArgument = Annotated[FileArgument, argument("INPUT", "recording, run file or wire log")]
Scenes = Annotated[
    tuple[FileArgument, ...], option("FILE", "scene file: one for all inputs, or one per input in the same order")
]
FiguresOption = Annotated[
    tuple[Literal["svg", "pdf", "png"], ...],
    converted(
        "FORMATS",
        "also write each chart into figures/, as svg, pdf or png (or several: svg,pdf)",
        _formats,
        repeated=False,
    ),
]
Json = Annotated[bool, Parameter(name="--json", help="print JSON on standard output")]
DecoderOptions = Annotated[
    tuple[tuple[str, Any], ...], converted("NAME=VALUE", "option of the decoder; may be repeated", _decoder_option)
]
ClockPpm = Annotated[
    PartsPerMillion | None, option("PPM", "largest rate error of the sensor's clock (default: that of its family)")
]
Template = Annotated[Literal["latex"] | None, option("KIND", "also write a lab report template: latex")]
Overwrite = Annotated[bool, flag("replace an existing output")]
Strict = Annotated[bool, flag("exit with code 5 if a finding is an error")]


def _mass(text: str) -> Estimate:
    from pipeline.bench.typed import typed

    return typed(text, "kg")


def _setting(text: str) -> tuple[tuple[str, str], Any]:
    """Return table and key of the scene, and the value."""
    match = re.fullmatch(r"\s*(\w+)\.(\w+)\s*=\s*(.+)", text)
    if match is None:
        raise ValueError("must be TABLE.KEY=VALUE as in a scene, for example spring.mass_kg=0.0104+/-0.0001")
    from pipeline.bench.scene import BENCH_KEYS
    from pipeline.bench.typed import typed

    table, key, value = match.groups()
    quantity = BENCH_KEYS.get((table, key))
    return (table, key), value.strip() if quantity is None else typed(value, quantity.unit)


@Parameter(name="*", group=Group("The bench, instead of the values in the scene", sort_key=1.5))
@dataclass(frozen=True, kw_only=True)
class BenchOptions:
    """Values of the bench, each with its standard uncertainty."""

    mass_kg: Annotated[
        Any, converted("M", "all that hangs on the spring, kg: 0.2007+/-0.0001, '200.7 g'", _mass, repeated=False)
    ] = None
    set: Annotated[
        tuple[tuple[tuple[str, str], Any], ...],
        converted("KEY=X", "any value of a scene: spring.mass_kg=0.0104+/-0.0001; may be repeated", _setting),
    ] = ()

    def values(self) -> dict[tuple[str, str], Any]:
        """Return the given values by table and key of the scene."""
        return ({} if self.mass_kg is None else {("bob", "mass_kg"): self.mass_kg}) | dict(self.set)


@Parameter(name="*", group=THE_PAGE)
@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """The options of the page in the browser."""

    page_port: Annotated[TcpPort, option("N", "port of the page (default: a free one)")] = 0
    no_browser: Annotated[bool, flag("print the address of the page, and do not open a browser")] = False
    want_us: Annotated[
        Positive | None, option("U", "target uncertainty of the period, us (default: 40 ppm of the period)")
    ] = None
    lan: Annotated[bool, flag("let other devices on the local network view the page")] = False
    law: LawName = None


_TYPES = {
    ValueKind.NAME: str | None,
    ValueKind.POSITIVE: Positive | None,
    ValueKind.FILE: str | Path | None,
    ValueKind.YES: bool,
}


def _declared(of: Field[Any]) -> tuple[str, Any, Any]:
    """Return an option of reading as the command line declares it."""
    kind, words = _TYPES[of.metadata["kind"]], option(of.metadata["metavar"], of.metadata["help"])
    return of.name, Annotated[kind, words], field(default=of.default)


def _arguments(name: str, base: type[ReadOptions]) -> type:
    """Return a class of the options of reading as the command line has them, each with its words."""
    # Cyclopts looks into a class only if it names the module that it comes from.
    words = {"__doc__": "The options of reading, each with its words.", "__module__": __name__}
    declared = [_declared(each) for each in fields(base)]
    made = make_dataclass(name, declared, bases=(base,), namespace=words, frozen=True, kw_only=True)
    return Parameter(name="*", group=HOW_READ)(made)


if TYPE_CHECKING:
    FileArguments = ReadOptions
    ReadArguments = LoadOptions
else:
    FileArguments = _arguments("FileArguments", ReadOptions)
    ReadArguments = _arguments("ReadArguments", LoadOptions)


def _answer(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ValueError("must be KEY=VALUE, for example unit=cm")
    name = name.strip().replace("-", "_")
    return name, value_of(name, value, LOAD_FIELDS)


@Parameter(name="*", group=Group("Options", sort_key=1))
@dataclass(frozen=True, kw_only=True)
class ReadPairs:
    """The options of reading as one option, for commands that usually find them in the notes next to a file."""

    read: Annotated[
        tuple[tuple[str, Any], ...],
        converted("KEY=VALUE", "how to read the file: unit=cm, rate_hz=100 ...; may be repeated", _answer),
    ] = ()

    @property
    def options(self) -> LoadOptions:
        """The options of reading."""
        names = [name for name, _ in self.read]
        if repeated := [name for name in names if names.count(name) > 1]:
            raise ProgramError(f"--read {repeated[0]}: expected one value, got {names.count(repeated[0])}", "give one")
        return LoadOptions(**dict(self.read))

    def refuse(self, use: str, *names: str) -> None:
        """Refuse options of reading for which a use of the command has no use."""
        if unused := [name for name, _ in self.read if name in names]:
            raise ProgramError(f"--read {', '.join(unused)}: no effect {use}", "leave it out")


@Parameter(name="*", group=Group("Options", sort_key=1))
@dataclass(frozen=True, kw_only=True)
class AnalysisArguments:
    """The options of an analysis as the command line has them, each with its words."""

    accuracy: Annotated[Accuracy, option("TIER", "how much time to spend on accuracy (default: standard)")] = "standard"
    law: LawName = None

    def of(self, read: LoadOptions, **more: Any) -> AnalysisOptions:
        """Return the options of the analysis of a recording that is read in a given way, with those of the command."""
        return AnalysisOptions(**vars(self), **read.given(), **more)
