"""The arguments of every command and the types of their values; argparse is all that this imports."""

from __future__ import annotations

import argparse
import math

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["BENCH", "COMMANDS", "without_completions"]


def _add_input_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--velocity", metavar="FILE", help="velocity file that belongs to the one position file given")
    _add_completions(parser)


def without_completions(words: Sequence[str]) -> list[str]:
    """Return the words of a command line without the options that say how to read a recording."""
    parser = argparse.ArgumentParser(add_help=False)
    _add_completions(parser)
    return parser.parse_known_args(words)[1]


def _add_completions(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--channel", metavar="NAME", help="which channel of the file to take")
    parser.add_argument("--run", metavar="NAME", help="which run of the file to take, where it holds several")
    parser.add_argument(
        "--rate-hz", type=_positive, metavar="R", help="samples per second, where the file does not say"
    )
    parser.add_argument(
        "--unit", metavar="U", help="unit of the channel where the file does not say: m, cm, mm, rad, V, m/s2, N ..."
    )
    parser.add_argument("--time", metavar="NAME", help="which column is the time, where the file does not say")
    parser.add_argument(
        "--time-unit", metavar="U", help="unit of the times where the file does not say: s, ms, us, ns or min"
    )
    _add_unverified(parser)


def _add_unverified(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--unverified", action="store_true", help="read a run file that is not what was written; what is made says so"
    )


def _add_analyse(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", nargs="+", metavar="INPUT", help="recordings, run files, and folders of them")
    parser.add_argument(
        "--scene",
        action="append",
        default=[],
        metavar="FILE",
        help="scene file (TOML): masses, disc, air, sensor; one for all inputs, or again for each in their order",
    )
    bench = parser.add_argument_group("the bench, in place of what the scene says")
    for (_, key), (option, of_u, words) in BENCH.items():
        bench.add_argument(option, type=_finite, metavar="X", help=words)
        bench.add_argument(of_u, type=_not_negative, metavar="U", help=f"standard uncertainty of {key}")
    _add_accuracy(parser)
    parser.add_argument("--method", choices=("classic",), help="the lab report's own method, to compare against")
    _add_input_options(parser)
    parser.add_argument("--from", dest="from_s", type=_finite, metavar="S", help="use samples from this second on")
    parser.add_argument("--to", dest="to_s", type=_finite, metavar="S", help="use samples up to this second")
    _add_clock(parser)
    parser.add_argument("--out", metavar="DIR", help="folder for what is written (default: here; with --json: none)")
    written = parser.add_mutually_exclusive_group()
    written.add_argument("--report", action="store_true", help="write a report of each of several inputs too")
    written.add_argument("--no-report", action="store_true", help="print, but write no files")
    _add_pdf(parser)
    _add_si(parser)
    parser.add_argument("--json", action="store_true", help="one JSON object per input on stdout")
    parser.add_argument("--strict", action="store_true", help="exit with 5 where a finding is an error")


def _add_si(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--si", action="store_true", help="SI units without prefixes on a terminal, as elsewhere")


def _add_clock(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--clock-ppm",
        type=_ppm,
        metavar="PPM",
        help="what the sensor's clock may be off at most (default: as its family says)",
    )


def _add_accuracy(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--accuracy",
        choices=("fast", "standard", "best"),
        default="standard",
        help="how much time to spend for how much accuracy (default standard)",
    )


def _add_compare(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "input",
        nargs="+",
        metavar="RUN",
        help="two recordings or run files and more, of one spring; or folders of batch",
    )
    _add_where(parser)
    parser.add_argument(
        "--bench", metavar="NAME", help="column of a course that tells benches apart (default: bench, group or section)"
    )
    parser.add_argument(
        "--scene",
        action="append",
        default=[],
        metavar="FILE",
        help="scene file: one for all runs, or again for each in their order (default: what run files carry)",
    )
    _add_accuracy(parser)
    parser.add_argument(
        "--mass-correlation",
        type=_share,
        default=0.0,
        metavar="R",
        help="correlation of the masses' errors, 0 to 1: 1 for one balance whose calibration is the error (default 0)",
    )
    _add_completions(parser)
    parser.add_argument("--from", dest="from_s", type=_finite, metavar="S", help="use samples from this second on")
    parser.add_argument("--to", dest="to_s", type=_finite, metavar="S", help="use samples up to this second")
    parser.add_argument("--out", metavar="DIR", help="folder for the report (default: none is written)")
    _add_pdf(parser)
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    parser.add_argument("--strict", action="store_true", help="exit with 5 where a finding is an error")


def _add_batch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "input", nargs="*", metavar="INPUT", help="recordings, folders with all in them, patterns, @FILE with a list"
    )
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for table, page and reports; go on in it")
    parser.add_argument("--runs", dest="runs", metavar="FILE", help="table (CSV): what is known of each run")
    parser.add_argument("--template", action="store_true", help="print such a table to fill in")
    parser.add_argument("--scene", metavar="FILE", help="scene file for all runs, under what the table says")
    _add_accuracy(parser)
    parser.add_argument("--jobs", type=_count, metavar="N", help="processes (default: one a core)")
    parser.add_argument(
        "--shard", type=_shard, metavar="I/N", help="do the I-th of N parts alone; without it all is put together"
    )
    parser.add_argument("--dask", metavar="ADDRESS", help="let the workers of this dask scheduler do it")
    parser.add_argument("--rehash", action="store_true", help="read every file to see whether it has changed")
    parser.add_argument(
        "--reports", type=_whole, default=20, metavar="N", help="full reports of so many that need a look (default 20)"
    )
    _add_completions(parser)
    parser.add_argument("--from", dest="from_s", type=_finite, metavar="S", help="use samples from this second on")
    parser.add_argument("--to", dest="to_s", type=_finite, metavar="S", help="use samples up to this second")
    _add_clock(parser)


def _shard(text: str) -> tuple[int, int]:
    first, slash, last = text.partition("/")
    if not (slash and first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last)):
        raise argparse.ArgumentTypeError(f"must be I/N with 1 <= I <= N, got {text!r}")
    return int(first), int(last)


def _add_report(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", metavar="DIR", help="folder that batch made")
    parser.add_argument("name", metavar="RUN", help="name of a run in its table, or the path of its recording")


def _add_catalog(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", nargs="+", metavar="DIR", help="folders that batch made")
    _add_where(parser)
    parser.add_argument("--columns", metavar="A,B", help="columns to list")
    parser.add_argument("--sort", metavar="NAME", help="by this column; after a minus, --sort=-NAME, from above")
    parser.add_argument("--limit", type=_count, metavar="N", help="runs at most")
    parser.add_argument("--rebuild", action="store_true", help="build the index from the results again")
    parser.add_argument("--json", action="store_true", help="one JSON object a run on stdout, instead of CSV")


def _add_where(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--where",
        default="",
        metavar="EXPR",
        help="expression over the columns, as \"section = 'A' and period_u < 1e-4\"",
    )


def _add_map(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", nargs="+", metavar="DIR", help="folders that batch made")
    _add_where(parser)
    parser.add_argument(
        "--out", default=".", metavar="DIR", help="folder for drag-map.svg, .pdf and .csv (default: here)"
    )


def _add_demo(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--out", metavar="DIR", default="springmass-demo", help="folder for what it makes (default %(default)s)"
    )


def _add_page_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--page-port", type=_tcp_port, default=0, metavar="N", help="port of the page (default: any)")
    parser.add_argument("--no-browser", action="store_true", help="print the page's address and open no browser")
    parser.add_argument(
        "--want-us",
        type=_positive,
        metavar="U",
        help="uncertainty of the period to record for, in microseconds: the page says how much longer "
        "(default: 40 ppm of the period)",
    )
    parser.add_argument("--lan", action="store_true", help="let viewers in the local network look, and not act")


def _add_page(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", metavar="INPUT", help="recording, run file, or the wire log of a running recording")
    _add_page_options(parser)
    parser.add_argument("--recorder", action="store_true", help="as `record --page` starts it")
    _add_input_options(parser)


def _add_replay(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", metavar="INPUT", help="recording or run file")
    parser.add_argument("--page", action="store_true", help="play it on the page, in a browser, instead")
    _add_page_options(parser)
    parser.add_argument("--speed", type=_speed, default=1.0, metavar="X", help="times real time, or max (default 1)")
    parser.add_argument("--seek", type=_finite, metavar="S", help="start at this second of the record")
    parser.add_argument("--loop", action="store_true", help="start again at the end, until Ctrl-C")
    parser.add_argument("-o", "--output", metavar="RUN.h5", help="write the samples to a run file instead of stdout")
    parser.add_argument("--overwrite", action="store_true", help="replace RUN.h5 where it exists")
    _add_input_options(parser)


def _add_simulate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scene", required=True, metavar="S.toml", help="scene file: masses, spring, start, damping")
    parser.add_argument("--method", default="auto", metavar="NAME", help="integrator, or auto (default auto)")
    parser.add_argument(
        "--dt", type=_finite, default=0.01, metavar="S", help="time between samples, and step (default 0.01)"
    )
    parser.add_argument("--seconds", type=_positive, default=10.0, metavar="N", help="how long (default 10)")
    parser.add_argument(
        "--tolerance",
        type=_finite,
        metavar="E",
        help="largest error over the amplitude (auto: default a hundredth of the band, 1e-6 to 1e-3)",
    )
    parser.add_argument("--check", action="store_true", help="measure the error too, which costs more than the run")
    parser.add_argument("--trade", action="store_true", help="measure error against time of every method on this scene")
    parser.add_argument(
        "--without",
        action="append",
        default=[],
        choices=("drag", "disc", "spring-mass"),
        metavar="EFFECT",
        help="leave an effect out that the scene implies: drag, disc or spring-mass; may be repeated",
    )
    parser.add_argument("--force", action="store_true", help="run a step that is unstable")
    parser.add_argument("--against", metavar="RUN", help="measured run to lay the prediction over")
    _add_completions(parser)
    parser.add_argument(
        "-o", "--output", metavar="RUN.h5", help="write what a rangefinder would have read to a run file"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace RUN.h5 where it exists")
    parser.add_argument(
        "--sensor",
        choices=("ideal", "rangefinder"),
        help="of RUN.h5: ideal reads the motion itself, rangefinder has ticks, noise and echoes (default rangefinder)",
    )
    parser.add_argument(
        "--noise-m", type=_not_negative, metavar="S", help="its noise, m (default the scene's, or 8e-5)"
    )
    parser.add_argument("--echoes", type=_not_negative, metavar="HZ", help="its false echoes a second (default 0.1)")
    parser.add_argument("--seed", type=_integer, default=0, metavar="N", help="of its noise (default 0)")
    parser.add_argument(
        "--out", metavar="DIR", help="folder for NAME.simulated (default: here; with --json or -o: none)"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")


def _add_convert(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", metavar="IN", help="recording, or run file")
    parser.add_argument(
        "output",
        metavar="OUT",
        help="by its suffix: .h5 run file, .txt MotionSensor.vi pair, .lvm, .csv; or a folder for the original",
    )
    parser.add_argument("--scene", metavar="FILE", help="scene file to put into the run file")
    parser.add_argument("--overwrite", action="store_true", help="replace OUT where it exists")
    _add_input_options(parser)


def _add_trade(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", nargs="?", metavar="INPUT", help="put this record before all methods instead")
    parser.add_argument("--seeds", type=_count, metavar="N", help="simulated records (default 100)")
    parser.add_argument("--noise-m", type=_positive, metavar="S", help="their noise, m (default 0.0003)")
    parser.add_argument("--seconds", type=_positive, metavar="N", help="their length, s (default 120)")
    parser.add_argument(
        "--damping", type=_not_negative, metavar="G", help="their linear damping, 1/s (default 0.01463)"
    )
    parser.add_argument("--echoes", type=_echo_share, metavar="X", help="share of false echoes, 0 to 0.4 (default 0)")
    parser.add_argument("--hostile", action="store_true", help="measure the accuracies on records that are not simple")
    parser.add_argument("--integrators", action="store_true", help="measure trajectories instead: error against time")
    parser.add_argument(
        "--scene", metavar="S.toml", help="of --integrators: this scene's motion instead of the usual three"
    )
    parser.add_argument("--tolerance", type=_positive, metavar="E", help="of --scene: to recommend for")
    parser.add_argument("--out", metavar="DIR", help="folder for trade.svg, trade.pdf and trade.json")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    _add_input_options(parser)


def _add_formats(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "input", nargs="?", metavar="FILE", help="say what this file is; of a folder or a zip, all in it"
    )
    parser.add_argument("--explain", action="store_true", help="show how the file is read, column by column")
    parser.add_argument("--json", action="store_true", help="as JSON on stdout")
    _add_input_options(parser)


def _add_record(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--port",
        action="append",
        default=[],
        metavar="P",
        help="port of a sensor; again for another (default: the only one that a known sensor speaks on)",
    )
    parser.add_argument("--sensor", action="append", default=[], metavar="NAME", help="its family, see `sensors`")
    parser.add_argument("--simulate", metavar="SCENE.toml", help="a simulated bench behind a pseudo-terminal instead")
    parser.add_argument(
        "-o", "--output", metavar="RUN.h5", help="run file to make, never replaced (default: date, time and title)"
    )
    parser.add_argument("--seconds", type=_positive, metavar="N", help="how long (default: until Ctrl-C)")
    parser.add_argument("--page", action="store_true", help="show the recording in a browser, with marks and stop")
    parser.add_argument("--ready", action="store_true", help="zero, calibrate, arm, record on the page; needs --page")
    _add_page_options(parser)
    parser.add_argument(
        "--scene", metavar="FILE", help="scene file stored with the run; its air sets the speed of sound"
    )
    parser.add_argument("--title", default="", metavar="TEXT", help="title of the run")
    parser.add_argument("--baud", type=_integer, metavar="B", help="speed of the port (default: the family's)")
    parser.add_argument("--rate-hz", type=_pace, metavar="R", help="readings per second that the sensor is set to")
    parser.add_argument("--option", action="append", default=[], metavar="NAME=VALUE", help="option of the decoder")
    parser.add_argument("--still", type=_positive, metavar="S", help="measure rest position and noise first, so long")
    parser.add_argument(
        "--ruler",
        action="append",
        default=[],
        type=_positive,
        metavar="M",
        help="a still distance by the ruler, m; again for another, then they set the scale too; needs --still",
    )
    parser.add_argument("--speed-of-sound", type=_positive, metavar="C", help="applied to echo times, m/s")
    _add_clock(parser)
    parser.add_argument("--trigger", type=_positive, metavar="M", help="start when the bob leaves its rest by this, m")
    parser.add_argument("--pre", type=_positive, metavar="S", help="seconds to keep from before (default 2)")
    parser.add_argument("--no-trace", action="store_true", help="draw no motion on the terminal")
    parser.add_argument("--seed", type=_integer, default=0, metavar="N", help="of the simulated noise (default 0)")
    parser.add_argument(
        "--crystal-ppm", type=_crystal, default=0.0, metavar="PPM", help="of the simulated sensor's clock"
    )


def _add_recover(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", metavar="RUN.wire", help="wire log")
    parser.add_argument("-o", "--output", metavar="RUN.h5", help="run file to make (default: beside the log)")
    parser.add_argument("--overwrite", action="store_true", help="replace a run file that is there")
    parser.add_argument("--speed-of-sound", type=_positive, metavar="C", help="apply this to echo times instead, m/s")


def _add_ports(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--no-probe", action="store_true", help="only list the ports, open none")
    parser.add_argument("--port", action="append", default=[], metavar="P", help="listen to this address too")
    parser.add_argument("--json", action="store_true", help="as JSON on stdout")


def _add_firmware(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--port", metavar="P", help="the board's port; it is asked what it is")
    parser.add_argument("--flash", action="store_true", help="write the firmware that comes with this program")
    settings = parser.add_argument_group("settings, which the board keeps")
    settings.add_argument("--rate", type=_integer, metavar="R", help="pings per second, 10 to 125")
    settings.add_argument("--gate", type=_gate, metavar="NEAR,FAR", help="times of flight that count, us, from 116")
    settings.add_argument(
        "--spread", type=_integer, metavar="US", help="each ping comes up to this much later, 0 to 2000 us"
    )
    settings.add_argument("--name", metavar="NAME", help="to tell it from others, 12 letters, digits, . _ or - at most")


def _gate(text: str) -> tuple[int, int]:
    near, comma, far = text.partition(",")
    if not (comma and near.isdecimal() and far.isdecimal()):
        raise argparse.ArgumentTypeError(f"must be NEAR,FAR in whole us, got {text!r}")
    return int(near), int(far)


def _add_help(parser: argparse.ArgumentParser) -> None:
    topics = sorted(COMMANDS)
    parser.add_argument("topic", nargs="?", choices=topics, metavar="COMMAND", help=f"one of {', '.join(topics)}")


def _add_completion(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=("bash", "zsh", "tcsh"), metavar="SHELL", help="bash, zsh or tcsh")


def _add_scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("input", nargs="?", metavar="RECORDING", help="note what follows beside this recording")
    parser.add_argument("--check", metavar="FILE", help="say what a scene file states, and what of it no bench has")
    parser.add_argument("--scene", metavar="FILE", help="scene file to be used with the recording from now on")
    parser.add_argument("--note", action="append", default=[], metavar="TEXT", help="a remark; again for another")
    parser.add_argument(
        "--mark",
        action="append",
        default=[],
        type=_mark,
        metavar="S=TEXT",
        help="a mark at this second of the record; again for another",
    )


def _mark(text: str) -> tuple[float, str]:
    seconds, equals, words = text.partition("=")
    if not equals or not words.strip():
        raise argparse.ArgumentTypeError(f"must be SECONDS=TEXT, got {text!r}")
    return _finite(seconds), words.strip()


def _add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="as JSON on stdout")


def _finite(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be a finite number, got {text!r}")
    return value


def _where(holds: Callable[[float], bool], demand: str) -> Callable[[str], float]:
    """Return the type of a number for which something holds."""

    def number(text: str) -> float:
        if not holds(value := _finite(text)):
            raise argparse.ArgumentTypeError(f"{demand}, got {text!r}")
        return value

    return number


_share = _where(lambda x: 0.0 <= x <= 1.0, "must lie in 0 to 1")
_echo_share = _where(lambda x: 0.0 <= x <= 0.4, "must lie between 0 and 0.4")
_pace = _where(lambda x: 1e-3 <= x <= 1e6, "must lie in 0.001 to 1000000")
_ppm = _where(lambda x: 0.0 <= x <= 1e6, "must lie in 0 to 1000000")
_crystal = _where(lambda x: abs(x) <= 5e5, "must lie in -500000 to 500000")
_positive = _where(lambda x: x > 0.0, "must be positive")
_not_negative = _where(lambda x: x >= 0.0, "must not be negative")


def _integer(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a whole number, got {text!r}") from None


def _count(text: str) -> int:
    value = _integer(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be 1 or more, got {text!r}")
    return value


def _whole(text: str) -> int:
    value = _integer(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"must be 0 or more, got {text!r}")
    return value


def _tcp_port(text: str) -> int:
    value = _integer(text)
    if not 0 <= value <= 65535:
        raise argparse.ArgumentTypeError(f"must be a port from 0 to 65535, got {text!r}")
    return value


def _speed(text: str) -> float:
    return math.inf if text == "max" else _positive(text)


# Table and key of the scene to the options of analyse for its value and standard uncertainty, and help.
BENCH = {
    ("bob", "mass_kg"): ("--mass-kg", "--mass-u-kg", "mass of all that hangs on the spring, kg"),
    ("spring", "mass_kg"): ("--spring-mass-kg", "--spring-mass-u-kg", "mass of the spring, kg"),
    ("disc", "diameter_m"): ("--disc-diameter-m", "--disc-diameter-u-m", "diameter of the disc, m"),
    ("air", "temperature_c"): ("--temperature-c", "--temperature-u-c", "temperature of the air, degrees Celsius"),
}

# Command to what adds its arguments, and its help; the module of its name in springmass.commands does its work.
COMMANDS = {
    "demo": (_add_demo, "replay, analyse and compare the bundled recordings: Table 1 in one command"),
    "analyse": (_add_analyse, "turn recordings into Table 1, findings and a report"),
    "compare": (_add_compare, "compare several runs of one spring: do they agree, and does one damping law hold"),
    "batch": (_add_batch, "turn a course of runs into one table and a page, resumable, on one machine or many"),
    "report": (_add_report, "write the full report of one run of a course"),
    "catalog": (_add_catalog, "search, filter and list the runs of courses"),
    "map": (_add_map, "draw the drag coefficients of a course against Reynolds and Keulegan-Carpenter number"),
    "record": (_add_record, "record a run from the bench, so that nothing is lost"),
    "page": (_add_page, "look at a recording in a browser, as it happens or as it was"),
    "recover": (_add_recover, "build a run file from a wire log, however torn"),
    "replay": (_add_replay, "play a recording back through the interface of a live sensor"),
    "simulate": (
        _add_simulate,
        "solve the equation of motion of a scene, to a tolerance or by a method of your choice",
    ),
    "convert": (_add_convert, "write a recording as a run file, or give back the original inside one"),
    "trade": (_add_trade, "measure what accuracy costs on this machine: error over the bound against time"),
    "formats": (_add_formats, "list the families of recordings, or say what a file is"),
    "sensors": (_add_json, "list the families of rangefinders with their rate, resolution, range and limits"),
    "ports": (_add_ports, "list the serial ports and what speaks on them"),
    "firmware": (_add_firmware, "wire, flash and set the 100 Hz rangefinder for a few euros"),
    "scene": (_add_scene, "print a scene to fill in, check one, or note scene and marks beside a recording"),
    "completion": (_add_completion, "print what a shell needs to complete commands and options"),
    "help": (_add_help, "say what a command does"),
    "doctor": (_add_json, "check this installation"),
}


def _add_pdf(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--pdf", action="store_true", help="figures of a report as PDF too, for a paper")
