"""The options of every command, each declared once: name, type, range, help.

A command takes a few of these dataclasses; the command line flattens them into options. The options for reading a
recording are declared in :mod:`springmass.runs.options`. docs/reference/command-line.md is generated from these
declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter, Token

from springmass.values import (
    Count,
    Finite,
    LawName,
    NotNegative,
    PartsPerMillion,
    Positive,
    ReadingsPerSecond,
    SampleShare,
    Share,
    SignedPartsPerMillion,
    TcpPort,
    WholeNumber,
)

__all__ = [
    "THE_PAGE",
    "AnalyseOptions",
    "BatchOptions",
    "BenchOptions",
    "CompareOptions",
    "ConvertOptions",
    "DemoOptions",
    "File",
    "FirmwareOptions",
    "FormatsOptions",
    "JsonOption",
    "PageOptions",
    "PortsOptions",
    "RecordOptions",
    "RecoverOptions",
    "ReplayOptions",
    "SceneOptions",
    "SimulateOptions",
    "TradeOptions",
]

File = str | Path
"""The name of a file; a shell completes it."""
THE_PAGE = Group("The page", sort_key=4)
Accuracy = Literal["fast", "standard", "best"]


def _option(metavar: str, words: str, *names: str) -> Parameter:
    """Return an option that takes a value."""
    return Parameter(name=names, metavar=metavar, help=words)


def _output(metavar: str, words: str) -> Parameter:
    """Return the option that names the output."""
    return _option(metavar, words, "-o", "--output")


def _flag(words: str) -> Parameter:
    return Parameter(help=words)


def _converted(convert: Callable[[str], Any]) -> Callable[[Any, Sequence[Token]], Any]:
    """Return a converter for an option that may be repeated; it gives a tuple of all values."""
    return lambda _, tokens: tuple(convert(token.value) for token in tokens)


def _formats(_: Any, tokens: Sequence[Token]) -> tuple[str, ...]:
    kinds = tuple(kind.strip().lower() for kind in tokens[0].value.split(","))
    if not set(kinds) <= {"svg", "pdf", "png"}:
        raise ValueError("must be svg, pdf or png, or several of them with commas")
    return kinds


Figures = Annotated[
    tuple[Literal["svg", "pdf", "png"], ...],
    Parameter(
        name="--figures",
        metavar="FORMATS",
        help="also write each chart into figures/, as svg, pdf or png (or several: svg,pdf)",
        converter=_formats,
        n_tokens=1,
    ),
]


def _mark(text: str) -> tuple[float, str]:
    seconds, equals, words = text.partition("=")
    try:
        moment = float(seconds)
    except ValueError:
        equals = ""
    if not equals or not words.strip() or not abs(moment) < float("inf"):
        raise ValueError("must be SECONDS=TEXT")
    return moment, words.strip()


def _gate(_: Any, tokens: Sequence[Token]) -> tuple[int, int]:
    near, comma, far = tokens[0].value.partition(",")
    if not (comma and near.isdecimal() and far.isdecimal()):
        raise ValueError("must be NEAR,FAR in whole us")
    return int(near), int(far)


def _speed(_: Any, tokens: Sequence[Token]) -> float:
    text = tokens[0].value
    try:
        speed = float("inf") if text == "max" else float(text)
    except ValueError:
        speed = 0.0
    if not speed > 0.0 or (text != "max" and speed == float("inf")):
        raise ValueError("must be positive, or max")
    return speed


def _decoder_option(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ValueError("must be NAME=VALUE")
    return name, int(value) if value.isdecimal() else value


StatedLaw = Annotated[
    LawName | None, _option("NAME", "damping law, if known: linear, quadratic ...; any: choose from the data")
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class JsonOption:
    """The option of a command that prints a list."""

    json: Annotated[bool, _flag("print JSON on standard output")] = False


@Parameter(name="*", group=Group("The bench, instead of the values in the scene", sort_key=3))
@dataclass(frozen=True, kw_only=True)
class BenchOptions:
    """Values of the bench, each with its standard uncertainty."""

    mass_kg: Annotated[Finite | None, _option("X", "total mass that hangs on the spring, kg")] = None
    mass_u_kg: Annotated[NotNegative | None, _option("U", "its standard uncertainty (default: exact)")] = None
    spring_mass_kg: Annotated[Finite | None, _option("X", "mass of the spring, kg")] = None
    spring_mass_u_kg: Annotated[NotNegative | None, _option("U", "its standard uncertainty")] = None
    disc_diameter_m: Annotated[Finite | None, _option("X", "diameter of the disc, m")] = None
    disc_diameter_u_m: Annotated[NotNegative | None, _option("U", "its standard uncertainty")] = None
    temperature_c: Annotated[Finite | None, _option("X", "temperature of the air, degrees Celsius")] = None
    temperature_u_c: Annotated[NotNegative | None, _option("U", "its standard uncertainty")] = None


BENCH = {
    ("bob", "mass_kg"): ("mass_kg", "mass_u_kg"),
    ("spring", "mass_kg"): ("spring_mass_kg", "spring_mass_u_kg"),
    ("disc", "diameter_m"): ("disc_diameter_m", "disc_diameter_u_m"),
    ("air", "temperature_c"): ("temperature_c", "temperature_u_c"),
}
"""Table and key of the scene, mapped to the fields of :class:`BenchOptions` for the value and its uncertainty."""


@Parameter(name="*", group=THE_PAGE)
@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """The options of the page in the browser."""

    page_port: Annotated[TcpPort, _option("N", "port of the page (default: a free one)")] = 0
    no_browser: Annotated[bool, _flag("print the address of the page, and do not open a browser")] = False
    want_us: Annotated[
        Positive | None, _option("U", "target uncertainty of the period, us (default: 40 ppm of the period)")
    ] = None
    lan: Annotated[bool, _flag("let other devices on the local network view the page")] = False
    law: StatedLaw = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class DemoOptions:
    """The options of ``springmass demo``."""

    output: Annotated[File, _output("DIR", "output folder (default: springmass-demo)")] = "springmass-demo"


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class AnalyseOptions:
    """The options of ``springmass analyse``."""

    scene: Annotated[
        tuple[File, ...], _option("FILE", "scene file: one for all inputs, or one per input in the same order")
    ] = ()
    accuracy: Annotated[Accuracy, _option("TIER", "how much time to spend on accuracy (default: standard)")] = (
        "standard"
    )
    law: StatedLaw = None
    method: Annotated[
        Literal["classic"] | None, _option("NAME", "also apply the lab report's classic method, for comparison")
    ] = None
    output: Annotated[File | None, _output("DIR", "output folder (default: here; with --json: none)")] = None
    report: Annotated[bool, _flag("with several inputs, also write a report for each")] = False
    no_report: Annotated[bool, _flag("print the results, but write no files")] = False
    full: Annotated[bool, _flag("print all warnings and notes, and the sources of uncertainty")] = False
    budget: Annotated[bool, _flag("print the sources of uncertainty")] = False
    ask: Annotated[bool, _flag("ask for the masses and the disc, and save them next to the recording")] = False
    template: Annotated[Literal["latex"] | None, _option("KIND", "also write a lab report template: latex")] = None
    figures: Figures = ()
    si: Annotated[bool, _flag("print SI units without prefixes")] = False
    json: Annotated[bool, _flag("print one JSON object per input on standard output")] = False
    strict: Annotated[bool, _flag("exit with code 5 if a finding is an error")] = False


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CompareOptions:
    """The options of ``springmass compare``."""

    scene: Annotated[
        tuple[File, ...], _option("FILE", "scene file: one for all runs, or one per run in the same order")
    ] = ()
    accuracy: Annotated[Accuracy, _option("TIER", "how much time to spend on accuracy (default: standard)")] = (
        "standard"
    )
    law: StatedLaw = None
    mass_correlation: Annotated[
        Share, _option("R", "correlation between the errors of two bobs' masses (default: 0)")
    ] = 0.0
    output: Annotated[File | None, _output("DIR", "folder for a report (default: write no report)")] = None
    figures: Figures = ()
    json: Annotated[bool, _flag("print one JSON object on standard output")] = False
    strict: Annotated[bool, _flag("exit with code 5 if a finding is an error")] = False


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class BatchOptions:
    """The options of ``springmass batch``."""

    output: Annotated[
        File | None, _output("DIR", "folder for table, page and reports; an existing course is continued")
    ] = None
    runs: Annotated[File | None, _option("FILE", "CSV table with what you know about each run")] = None
    template: Annotated[bool, _flag("print an empty table for --runs to fill in")] = False
    scene: Annotated[File | None, _option("FILE", "scene file for all runs; values in the table take precedence")] = (
        None
    )
    accuracy: Annotated[Accuracy, _option("TIER", "how much time to spend on accuracy (default: standard)")] = (
        "standard"
    )
    law: StatedLaw = None
    jobs: Annotated[Count | None, _option("N", "number of processes (default: one per core)")] = None
    dask: Annotated[str | None, _option("ADDRESS", "analyse on the workers of this dask scheduler")] = None
    reports: Annotated[
        WholeNumber, _option("N", "write full reports of the N runs that most need a look (default: 20)")
    ] = 20


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RecordOptions:
    """The options of ``springmass record``."""

    port: Annotated[
        tuple[str, ...], _option("P", "port of a sensor; may be repeated (default: the port on which a sensor answers)")
    ] = ()
    sensor: Annotated[
        tuple[str, ...], _option("NAME", "family of the sensor, from the list of `springmass sensors`")
    ] = ()
    simulate: Annotated[File | None, _option("SCENE.toml", "record a simulated bench instead of a port")] = None
    output: Annotated[
        File | None, _output("RUN.h5", "run file to create, never overwritten (default: date, time and title)")
    ] = None
    seconds: Annotated[Positive | None, _option("N", "length of the recording, s (default: until Ctrl-C)")] = None
    page: Annotated[bool, _flag("show the recording in a browser, with buttons for marks and stop")] = False
    ready: Annotated[bool, _flag("set zero, calibrate, arm and record from the page; needs --page")] = False
    scene: Annotated[
        File | None, _option("FILE", "scene file to store with the run; its air sets the speed of sound")
    ] = None
    title: Annotated[str, _option("TEXT", "title of the run")] = ""
    baud: Annotated[int | None, _option("B", "baud rate of the ports (default: that of the sensor family)")] = None
    rate_hz: Annotated[
        ReadingsPerSecond | None, _option("R", "rate that the sensor is set to, readings per second")
    ] = None
    option: Annotated[
        tuple[tuple[str, Any], ...],
        Parameter(
            metavar="NAME=VALUE",
            help="option of the decoder; may be repeated",
            converter=_converted(_decoder_option),
            accepts_keys=False,
            n_tokens=1,
        ),
    ] = ()
    still: Annotated[Positive | None, _option("S", "first measure rest position and noise for S seconds")] = None
    ruler: Annotated[
        tuple[Positive, ...], _option("M", "ruler distance of the bob at rest, m; may be repeated; needs --still")
    ] = ()
    speed_of_sound: Annotated[Positive | None, _option("C", "speed of sound for echo times, m/s")] = None
    clock_ppm: Annotated[
        PartsPerMillion | None, _option("PPM", "largest rate error of the sensor's clock (default: that of its family)")
    ] = None
    trigger: Annotated[Positive | None, _option("M", "start when the bob is M metres from its rest position")] = None
    pre: Annotated[Positive | None, _option("S", "seconds to keep before the trigger (default: 2)")] = None
    no_trace: Annotated[bool, _flag("do not draw the motion on the terminal")] = False
    seed: Annotated[int, _option("N", "with --simulate: seed of the noise (default: 0)")] = 0
    crystal_ppm: Annotated[
        SignedPartsPerMillion, _option("PPM", "with --simulate: rate error of the sensor's clock (default: 0)")
    ] = 0.0


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RecoverOptions:
    """The options of ``springmass recover``."""

    output: Annotated[File | None, _output("RUN.h5", "run file to create (default: next to the log)")] = None
    overwrite: Annotated[bool, _flag("replace an existing run file")] = False
    speed_of_sound: Annotated[
        Positive | None, _option("C", "speed of sound for converting echo times, m/s (default: the log's)")
    ] = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ReplayOptions:
    """The options of ``springmass replay``."""

    page: Annotated[bool, _flag("play it on a page in the browser instead")] = False
    speed: Annotated[
        float, Parameter(metavar="X", help="speed, in multiples of real time, or max (default: 1)", converter=_speed)
    ] = 1.0
    seek: Annotated[Finite | None, _option("S", "start at this second of the recording")] = None
    loop: Annotated[bool, _flag("start again at the end, until Ctrl-C")] = False
    output: Annotated[File | None, _output("RUN.h5", "write the samples to a run file instead of standard output")] = (
        None
    )
    overwrite: Annotated[bool, _flag("replace an existing RUN.h5")] = False


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SimulateOptions:
    """The options of ``springmass simulate``."""

    scene: Annotated[File, _option("S.toml", "scene file: masses, spring, start, damping")]
    method: Annotated[str, _option("NAME", "integrator, or auto (default: auto)")] = "auto"
    dt: Annotated[Finite, _option("S", "sampling interval and step of the solver, s (default: 0.01)")] = 0.01
    seconds: Annotated[Positive, _option("N", "length of the simulation, s (default: 10)")] = 10.0
    tolerance: Annotated[
        Finite | None, _option("E", "largest error relative to the amplitude (default: from the band)")
    ] = None
    check: Annotated[bool, _flag("also measure the error; this takes longer than the simulation")] = False
    trade: Annotated[bool, _flag("measure error and time of every method on this scene")] = False
    without: Annotated[
        tuple[Literal["drag", "disc", "spring-mass"], ...],
        _option("EFFECT", "leave out an effect that the scene implies; may be repeated"),
    ] = ()
    force: Annotated[bool, _flag("simulate even if the step is unstable")] = False
    against: Annotated[File | None, _option("RUN", "measured run to compare with the prediction")] = None
    output: Annotated[File | None, _output("RUN.h5", "write the readings of a rangefinder to a run file")] = None
    overwrite: Annotated[bool, _flag("replace an existing RUN.h5")] = False
    sensor: Annotated[
        Literal["ideal", "rangefinder"] | None, _option("NAME", "the sensor of RUN.h5 (default: rangefinder)")
    ] = None
    noise_m: Annotated[
        NotNegative | None, _option("S", "noise of the sensor, m (default: from the scene, or 8e-5)")
    ] = None
    echoes: Annotated[NotNegative | None, _option("HZ", "false echoes per second (default: 0.1)")] = None
    seed: Annotated[int, _option("N", "seed of the noise (default: 0)")] = 0
    folder: Annotated[
        File | None, _option("DIR", "folder for NAME.simulated (default: here; with --json or -o: none)")
    ] = None
    figures: Figures = ()
    json: Annotated[bool, _flag("print one JSON object on standard output")] = False


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ConvertOptions:
    """The options of ``springmass convert``."""

    output: Annotated[File | None, _output("OUT", "the output, instead of a second argument")] = None
    scene: Annotated[File | None, _option("FILE", "scene file to store in the run file")] = None
    overwrite: Annotated[bool, _flag("replace an existing output")] = False


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class TradeOptions:
    """The options of ``springmass trade``."""

    seeds: Annotated[
        Count | None, _option("N", "number of simulated recordings (default: 100; with --hostile: 20)")
    ] = None
    noise_m: Annotated[Positive | None, _option("S", "noise of the recordings, m (default: 0.0003)")] = None
    seconds: Annotated[Positive | None, _option("N", "length of the recordings, s (default: 120)")] = None
    damping: Annotated[NotNegative | None, _option("G", "linear damping of the recordings, 1/s (default: 0.01463)")] = (
        None
    )
    echoes: Annotated[SampleShare | None, _option("X", "share of false echoes, 0 to 0.4 (default: 0)")] = None
    hostile: Annotated[bool, _flag("measure the accuracies on difficult recordings")] = False
    integrators: Annotated[bool, _flag("measure the integrators instead: error and time")] = False
    scene: Annotated[File | None, _option("S.toml", "with --integrators: measure only the motion of this scene")] = None
    tolerance: Annotated[Positive | None, _option("E", "with --scene: error to recommend a method for")] = None
    output: Annotated[File | None, _output("DIR", "folder for trade.svg, trade.pdf and trade.json")] = None
    json: Annotated[bool, _flag("print one JSON object on standard output")] = False


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FormatsOptions:
    """The options of ``springmass formats``."""

    json: Annotated[bool, _flag("print JSON on standard output")] = False


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PortsOptions:
    """The options of ``springmass ports``."""

    no_probe: Annotated[bool, _flag("only list the ports; do not open them")] = False
    port: Annotated[tuple[str, ...], _option("P", "also listen on this address; may be repeated")] = ()
    json: Annotated[bool, _flag("print JSON on standard output")] = False


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FirmwareOptions:
    """The options of ``springmass firmware``."""

    port: Annotated[str | None, _option("P", "port of the board")] = None
    flash: Annotated[bool, _flag("write the firmware that comes with this program")] = False
    rate: Annotated[int | None, _option("R", "pings per second, 10 to 125; the board stores the setting")] = None
    gate: Annotated[
        tuple[int, int] | None,
        Parameter(
            metavar="NEAR,FAR",
            help="range of accepted times of flight, us; NEAR is at least 116",
            converter=_gate,
            n_tokens=1,
        ),
    ] = None
    spread: Annotated[int | None, _option("US", "largest random delay of a ping, 0 to 2000 us")] = None
    name: Annotated[str | None, _option("NAME", "name of the board: at most 12 letters, digits, . _ or -")] = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SceneOptions:
    """The options of ``springmass scene``."""

    check: Annotated[File | None, _option("FILE", "show what a scene file states and which values are unusual")] = None
    scene: Annotated[File | None, _option("FILE", "scene file to use with the recording from now on")] = None
    note: Annotated[tuple[str, ...], _option("TEXT", "a remark; may be repeated")] = ()
    mark: Annotated[
        tuple[tuple[float, str], ...],
        Parameter(
            metavar="S=TEXT",
            help="a mark S seconds into the recording; may be repeated",
            converter=_converted(_mark),
            n_tokens=1,
        ),
    ] = ()
