"""``springmass analyse``: recordings to Table 1, findings and a report."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from acquisition.errors import AcquisitionError
from pipeline.analyse import Motion
from pipeline.errors import AnalysisError, TrackError
from springmass.analysing import Analysed, analyse_loaded
from springmass.errors import OK, REJECTED, SOME_FAILED, UNREADABLE, USAGE, ProgramError
from springmass.loading import load, read_scene
from storage.errors import StorageError

__all__ = ["run"]


def run(options: argparse.Namespace) -> int:
    """Analyse every input; one that fails does not keep the others from their results."""
    if options.velocity is not None and len(options.input) > 1:
        raise ProgramError(
            f"--velocity completes one position file, got {len(options.input)} inputs; analyse the pair by itself",
            USAGE,
        )
    scene = None if options.scene is None else read_scene(options.scene)
    codes: list[int] = []
    for path in options.input:
        try:
            loaded = load(
                path,
                velocity=options.velocity,
                channel=options.channel,
                rate_hz=options.rate_hz,
                unit=options.unit,
                from_s=options.from_s,
                to_s=options.to_s,
            )
            analysed = analyse_loaded(
                loaded,
                scene,
                parameters=_parameters(options),
                accuracy=options.accuracy,
                with_classic=options.method == "classic",
            )
        except (AcquisitionError, StorageError) as error:
            print(f"springmass: {error}", file=sys.stderr)
            codes.append(UNREADABLE)
            continue
        except (AnalysisError, TrackError) as error:
            print(f"springmass: {path}: {error}", file=sys.stderr)
            codes.append(UNREADABLE)
            continue
        codes.append(_deliver(analysed, options))
    if len(set(codes)) > 1 and any(code not in (OK, REJECTED) for code in codes):
        return SOME_FAILED
    return max(codes)


def _deliver(analysed: Analysed, options: argparse.Namespace) -> int:
    if options.json:
        print(json.dumps(analysed.result, allow_nan=False), flush=True)
    else:
        _print_text(analysed)
    if not options.no_report and (options.out is not None or not options.json):
        _write(analysed, Path(options.out or "."))
    if not isinstance(analysed.analysis.motion, Motion):
        print(f"springmass: {analysed.loaded.path}: no oscillation: {analysed.analysis.motion.why}", file=sys.stderr)
        return UNREADABLE
    wrong = [f["code"] for f in analysed.result["findings"] if f["severity"] == "error"]
    if options.strict and wrong:
        print(f"springmass: {analysed.loaded.path}: rejected under --strict: {', '.join(wrong)}", file=sys.stderr)
        return REJECTED
    return OK


def _print_text(analysed: Analysed) -> None:
    from springmass.printing import classic_text, findings_text
    from springmass.report.tables import text_table

    print(text_table([analysed.loaded.path.name], [analysed.analysis]))
    if analysed.classic is not None:
        print(f"\n{classic_text(analysed.classic)}")
    print()
    print(findings_text(analysed.result["findings"]))


def _write(analysed: Analysed, out: Path) -> None:
    from springmass.report.write import ReportRun, write_report

    out.mkdir(parents=True, exist_ok=True)
    name = analysed.loaded.path.name
    run = ReportRun(name, analysed.analysis, analysed.result["input"], analysed.classic)
    report = write_report(
        out / f"{Path(name).stem}.results",
        [run],
        provenance=analysed.result["provenance"],
        results=[analysed.result],
    )
    print(f"report: {report}", file=sys.stderr)


def _parameters(options: argparse.Namespace) -> dict[str, Any]:
    names = ("accuracy", "method", "velocity", "channel", "rate_hz", "unit", "from_s", "to_s", "strict")
    return {name: getattr(options, name) for name in names}
