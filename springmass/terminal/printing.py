"""Format Table 1, findings, comparisons and the classic method's numbers as text for a terminal or a pipe."""

import shutil
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from acquisition.errors import visible
from pipeline.analyse import Analysis
from pipeline.numerics.estimate import Estimate
from pipeline.results.classic import Classic
from pipeline.several.compare import Comparison
from springmass.comparing.reported import Reported
from springmass.result.table1 import rows_and_needs
from springmass.terminal.style import TerminalStyle, concise, shown
from springmass.typeset import count

_MARKS = {"error": "ERROR  ", "warning": "warning", "info": "note   "}
RUNS_NAMED = 5  # maximum number of runs that a line names
WARNINGS_SHOWN = 3  # number of warnings shown without --full
NARROW = 80  # maximum width of wrapped warnings, columns
OPTION_OF_MASS = ": --mass-kg KG"
FINDING_INDENT = " " * 8


def findings_text(
    findings: Sequence[Mapping[str, Any]], written: Callable[[str], str] = str, *, full: bool = False
) -> str:
    """Return findings of a result's JSON as wrapped lines, the most harmful first, with message and advice.

    Without ``full``, notes and all but the first three warnings are left out. ``written`` converts a message to the
    characters of this terminal.
    """
    from springmass.result.advice import by_harm, is_standing

    ordered = by_harm(findings)
    errors, warnings, notes = ([f for f in ordered if f["severity"] == grade] for grade in _MARKS)
    lines = [_finding_line(f, written) for f in (*errors, *(warnings if full else warnings[:WARNINGS_SHOWN]))]
    if not full:
        more = len(warnings) - WARNINGS_SHOWN
        if more > 0:
            lines.append(f"and {count(more, 'more warning')}: --full")
        return "\n".join(lines or ["No warnings."])
    lines += [_finding_line(f, written) for f in notes if not is_standing(f)]
    if standing := [f["code"] for f in notes if is_standing(f)]:
        words = f"{_MARKS['info']} of every file of this format: {', '.join(standing)}"
        lines.append(wrapped(words, FINDING_INDENT, NARROW))
    if lines:
        lines.append("springmass explain CODE prints meaning, cause, advice and an example of each.")
    return "\n".join(lines or ["No warnings."])


def _finding_line(finding: Mapping[str, Any], written: Callable[[str], str]) -> str:
    """Return severity, code, message and advice."""
    severity, advice = finding["severity"], finding.get("advice", "")
    message = written(finding["message"])
    if advice and severity != "info":
        message += f"{'' if message[-1:] in '.!?' else '.'} {with_options(finding['code'], advice)}"
    return wrapped(f"{_MARKS[severity]} {finding['code']}: {message}", FINDING_INDENT, NARROW)


def option_of(name: str) -> str:
    """Return the option for a keyword argument: ``--rate-hz`` for ``rate_hz``, ``--from`` for ``from_s``."""
    return f"--{name.removesuffix('_s').replace('_', '-')}"


def with_options(code: str, advice: str) -> str:
    """Return what to do about a finding, with the options that state the values of which it speaks."""
    from pipeline.findings.finding import kinds

    options = [f"--set {each}" if "." in each else option_of(each) for each in kinds()[code].states]
    return f"{advice.removesuffix('.')} ({', '.join(options)})." if options else advice


def shared_findings_text(runs: Mapping[str, Sequence[Mapping[str, Any]]], written: Callable[[str], str]) -> str:
    """Return the errors and warnings of several runs by name, one paragraph per code, and the number of notes."""
    grave: dict[str, dict[str, Mapping[str, Any]]] = {}
    notes = 0
    for name, findings in runs.items():
        for f in findings:
            if f["severity"] == "info":
                notes += 1
            else:
                grave.setdefault(f["code"], {})[visible(name)] = f
    lines = []
    for code, by_run in sorted(grave.items(), key=lambda item: min(f["severity"] for f in item[1].values())):
        names, first = list(by_run), next(iter(by_run.values()))
        listed = ", ".join(names[:RUNS_NAMED]) + (
            f" and {len(names) - RUNS_NAMED} more" if len(names) > RUNS_NAMED else ""
        )
        head = f"{_MARKS[first['severity']]} {code}, {len(names)} of {len(runs)} runs ({listed}): "
        lines.append(
            wrapped(f"{head}{'' if len(names) == 1 else 'the first: '}{written(first['message'])}", FINDING_INDENT)
        )
    verb = "does" if notes == 1 else "do"
    lines.append(f"{count(notes, 'note')} {verb} not affect the results; --json lists them.")
    return "\n".join(lines)


def classic_text(classic: Classic) -> str:
    """Return the results of the lab report's own method, marked as such."""
    lines = ["By the report's own method (biased, for comparison only):"]
    lines += [f"  {name.replace('_', ' '):<22} {estimate}" for name, estimate in classic.estimates.items()]
    return "\n".join([*lines, f"  {'chi-square of its fit':<22} {classic.chi2:.4g}"])


def comparison_text(comparison: Comparison, analyses: Sequence[Analysis], style: TerminalStyle) -> str:
    """Return a comparison as an aligned table, followed by its message; on a terminal with digits in parentheses."""

    def form(estimate: Estimate | None) -> str:
        return concise(estimate, style) if style.terminal else str(estimate)

    rows = [("period", "mass that swings", "spring constant", "residual / u")]
    for analysis, k, pull in zip(analyses, comparison.each, comparison.pulls, strict=True):
        period, mass = analysis.estimates["period"], analysis.derived.effective_mass_kg
        rows.append((form(period), form(mass), form(k), f"{pull:+.1f}"))
    # Constants that disagree have no meaningful mean.
    mean = form(comparison.spring_constant) if comparison.agree else "none"
    rows.append(("", "", mean, f"chi2 {comparison.chi2:.3g} / {comparison.dof}"))
    names, close = [readable(name, style) for name in comparison.names], 0
    if style.terminal:
        close = len(rows[0]) + 1
        room = style.width - len(aligned(rows, close=close).splitlines()[1]) - 2
        names = [shortened(name, max(room, 8)) for name in names]
    table = aligned([(name, *row) for name, row in zip(("run", *names, "together"), rows, strict=True)], close=close)
    return f"{table}\n\n{wrapped(comparison.message)}"


def reported_text(rows: Sequence[Reported], style: TerminalStyle) -> str:
    """Return printed values beside those of this analysis, with the verdict on each."""
    lines = [("printed", "of", "value", "this analysis", "verdict")]
    for row in rows:
        ours = "-" if row.found is None else concise(row.found, style)
        lines.append((readable(row.name, style), readable(row.run, style), row.printed, ours, row.verdict))
    return aligned(lines)


def wrapped(text: str, indent: str = "", columns: int = 100) -> str:
    """Return text wrapped to the terminal or to ``columns``, with all lines after the first indented."""
    width = min(shutil.get_terminal_size((columns, 24)).columns, columns)
    shown = visible(" ".join(text.splitlines()))
    return textwrap.fill(shown, width, subsequent_indent=indent, break_on_hyphens=False)


def fitted(text: str, width: int) -> str:
    """Return text with lines wider than a terminal broken between words."""
    return "\n".join(textwrap.fill(line, width, subsequent_indent="    ") for line in text.splitlines())


def visible_lines(text: str) -> str:
    """Return external text with control characters made visible and line breaks kept."""
    return "\n".join(map(visible, text.splitlines()))


NAME_WIDTH, LEAST_NAME_WIDTH = 24, 12  # of the column of quantities, which wrap, for several runs and for one


def text_table(names: Sequence[str], runs: Sequence[Analysis], style: TerminalStyle) -> str:
    """Return Table 1 in aligned columns; runs that do not fit side by side follow in another block.

    Names that are wider than their column are shortened. If the runs do not fit side by side, the uncertainty is given
    as digits in parentheses.
    """
    rows = rows_and_needs(runs)
    symbols = [row.on_screen if style.unicode else row.symbol for row in rows]
    left = max([len("quantity"), *(len(row.quantity) for row in rows)])
    room = style.width - max([len("symbol"), *map(len, symbols)]) - 4
    for form in (shown, concise) if len(names) > 1 else (shown,):
        cells = [tuple(form(x, style) for x in row.estimates) for row in rows]
        widest = max([8, *(len(cell) for row in cells for cell in row)])
        if len(names) == 1:
            notes = [len(row.note + OPTION_OF_MASS) for row in rows if row.note]
            widest = max([widest, *(note for note in notes if note <= room - left)])
        if room + 3 - len(names) * (widest + 3) >= left:
            break
    # Otherwise the names of quantities wrap, and if that does not suffice, further blocks follow.
    together = min(len(names), max(1, (room + 3 - min(left, NAME_WIDTH)) // (widest + 3)))
    left = min(left, max(LEAST_NAME_WIDTH, room + 3 - together * (widest + 3)))
    for i, row in enumerate(rows):
        if row.note:
            note = row.note + OPTION_OF_MASS
            cells[i] = (note if len(note) <= widest else "no mass",) * len(names)
    heads = [shortened(readable(name, style), widest) for name in names]
    blocks = []
    for first in range(0, len(names), together):
        part = slice(first, first + together)
        lines = [("quantity", "symbol", *heads[part])]
        lines += [(row.quantity, symbol, *each[part]) for row, symbol, each in zip(rows, symbols, cells, strict=True)]
        blocks.append(aligned(lines, [left, 0, *[widest] * len(heads[part])], close=2))
    return "\n\n".join(blocks) + "\n"


def aligned(rows: Sequence[Sequence[str]], least: Sequence[int] = (), close: int = 0) -> str:
    """Return rows in columns, with a rule under the first; a first column wider than ``least[0]`` wraps.

    The first ``close`` columns are separated by two blanks, the others by three.
    """
    from rich.cells import cell_len, set_cell_size

    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    widths = [max(pair) for pair in zip(widths, least, strict=True)] if least else widths
    widths[0] = least[0] if least else widths[0]
    gaps = [2 if i < close else 3 for i in range(len(widths))]
    lines: list[str] = []
    for quantity, *others in rows:
        first, *more = textwrap.wrap(quantity, widths[0]) or [""]
        cells = [set_cell_size(text, w + gap) for text, w, gap in zip((first, *others), widths, gaps, strict=True)]
        lines += ["".join(cells).rstrip(), *(f"  {line}" for line in more)]
    return "\n".join([lines[0], "-" * (sum(widths) + sum(gaps[:-1])), *lines[1:]])


def shortened(name: str, width: int) -> str:
    """Return a name without its middle: those of one experiment differ at the end as often as at the beginning."""
    return name if len(name) <= width else f"{name[: width // 2 - 1]}..{name[len(name) - (width - width // 2 - 1) :]}"


def readable(text: str, style: TerminalStyle) -> str:
    """Return foreign text in the characters of a stream."""
    return visible(text) if style.unicode else visible(text).encode("ascii", "replace").decode()
