"""``springmass analyse``: recordings to Table 1, findings and a report."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from acquisition.errors import AcquisitionError
from pipeline.analyse import Oscillation, Overdamped
from pipeline.errors import PipelineError
from springmass.commands import completions
from springmass.errors import OK, REJECTED, SOME_FAILED, UNREADABLE, USAGE, ProgramError, complain, tell
from springmass.runs.analysing import Analysed, analyse_loaded, distinct_names, in_a_name, make_folder
from springmass.runs.json_results import picked, rejected
from springmass.runs.loading import load
from springmass.runs.scenes import read_scenes
from storage.errors import StorageError

__all__ = ["run"]

PARAMETERS = ("accuracy", "method", "velocity", "channel", "rate_hz", "unit", "from_s", "to_s", "clock_ppm", "strict")


def run(options: argparse.Namespace) -> int:
    """Analyse every input; one that fails does not keep the others from their results."""
    if options.velocity is not None and len(options.input) > 1:
        raise ProgramError(
            f"--velocity completes one position file, got {len(options.input)} inputs; analyse the pair by itself",
            USAGE,
        )
    scenes = read_scenes(options.scene, len(options.input))
    out = make_folder(options.out or ".") if _wants_report(options) else None
    codes: list[int] = []
    for path, name, scene in zip(options.input, distinct_names(options.input), scenes, strict=True):
        try:
            loaded = load(
                path, **completions(options), from_s=options.from_s, to_s=options.to_s, clock_ppm=options.clock_ppm
            )
            analysed = analyse_loaded(
                loaded,
                scene,
                parameters=picked(options, PARAMETERS),
                accuracy=options.accuracy,
                with_classic=options.method == "classic",
            )
        except ProgramError as error:
            complain(error)
            codes.append(error.exit_code)
        except (AcquisitionError, StorageError) as error:
            complain(error)
            codes.append(UNREADABLE)
        except PipelineError as error:
            complain(f"{path}: {error}")
            codes.append(UNREADABLE)
        else:
            codes.append(_deliver(analysed, options, None if out is None else out / in_a_name(name, ".results")))
    if len(set(codes)) > 1 and any(code not in (OK, REJECTED) for code in codes):
        return SOME_FAILED
    return max(codes)


def _wants_report(options: argparse.Namespace) -> bool:
    return not options.no_report and (options.out is not None or not options.json)


def _deliver(analysed: Analysed, options: argparse.Namespace, results: Path | None) -> int:
    path = analysed.result["input"]["path"]
    if options.json:
        print(json.dumps(analysed.result, allow_nan=False), flush=True)
    else:
        _print_text(analysed)
    if results is not None:
        _write(analysed, results)
    if not isinstance(analysed.analysis.motion, (Oscillation, Overdamped)):
        complain(f"{path}: no oscillation: {analysed.analysis.motion.why}")
        return UNREADABLE
    if options.strict and (wrong := rejected(analysed.result["findings"])):
        complain(f"{path}: rejected under --strict: {', '.join(wrong)}")
        return REJECTED
    return OK


def _print_text(analysed: Analysed) -> None:
    from springmass.printing import classic_text, findings_text
    from springmass.report.budgets import budget_text
    from springmass.report.tables import text_table

    print(text_table([analysed.name], [analysed.analysis]))
    if analysed.classic is not None:
        print(f"\n{classic_text(analysed.classic)}")
    elif told := budget_text(analysed.analysis):
        print(told)
    print()
    print(findings_text(analysed.result["findings"]))


def _write(analysed: Analysed, results: Path) -> None:
    from springmass.report.write import write_report

    tell(f"report: {write_report(results, [analysed])}")
