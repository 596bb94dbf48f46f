"""What a card shows of a recording, as data: how it was read, what it asks, its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from acquisition.errors import NeedsAnswer, visible
from acquisition.recordings.identify import get_format
from acquisition.recordings.questions import Missing, MissingItem
from springmass.charts.chart import Chart, to_json
from springmass.charts.run import charts_of, recording
from springmass.comparing.comparison import SpringComparison
from springmass.comparing.reported import Reported
from springmass.loading.loaded import Loaded
from springmass.page.window.cards import LABELS
from springmass.report.html import SYMBOL_WITH_INDEX, tables_of
from springmass.report.recorded import date_words, notes_of
from springmass.report.words import summary, verdict
from springmass.result.advice import notices_of, sentence
from springmass.runs.run import Run
from springmass.typeset import cells, pretty, typeset

OWN_FORMATS = {"run": "run file of springmass", "wire": "log of a recording"}


def opened(loaded: Loaded) -> dict[str, Any]:
    """Return how a recording was read, with an outline of its samples."""
    track = loaded.track
    times = track.t[track.t == track.t]
    return {
        "format": OWN_FORMATS.get(loaded.format) or get_format(loaded.format).title,
        "foreign": loaded.format not in OWN_FORMATS,
        "facts": [
            *filter(None, [visible(loaded.title), loaded.channel and f"values from “{visible(loaded.channel)}”"]),
            f"{len(track)} samples",
            f"{track.rate_hz:.5g} Hz",
            f"{float(times.max() - times.min()) if times.size else 0.0:.4g} s",
        ],
        "recorded": date_words(loaded.provenance),
        "simulated": loaded.info.kind == "simulated",
        "assumed": [sentence(visible(trap.message)) for trap in loaded.traps],
        "outline": to_json(recording(track)),
    }


def asked(error: NeedsAnswer) -> dict[str, Any]:
    """Return a question as fields, with the first rows of the table."""
    question = error.question
    needs = [each for need in question.needs for each in (need, need.instead) if each is not None]
    reason = question.reason or ("" if question.columns else question.sentence)
    return {
        "reason": sentence(visible(reason)) if reason else "",
        "times": visible(question.times),
        "fields": [_field(need) for need in needs],
        "rows": [[visible(cell) for cell in row] for row in question.rows],
    }


def _field(need: MissingItem) -> dict[str, Any]:
    label = LABELS[need.what]
    if need.what is Missing.UNIT:
        label = f"Unit of {visible(need.of) or 'the values'}"
        if need.stated:
            label += f" (the file says {visible(need.stated)})"
    return {"name": need.what.value, "label": label, "choices": [visible(each) for each in need.choices]}


def results_of(run: Run) -> dict[str, Any]:
    """Return the results of an analysed run: the table, the summary, the findings and the charts of its report.

    Every second part of a sentence of the summary is a symbol whose index is lowered.
    """
    analysis = run.analysis
    charts = charts_of(analysis, notes_of(run.recorded))
    (table,) = tables_of([run])
    grades = run.result["grades"]
    notices = notices_of(run.result["findings"], charts)
    return {
        "rows": [
            {
                "name": row.name,
                "quantity": row.quantity,
                "symbol": row.page_symbol,
                "value": pretty(x) if (x := row.estimates[0]) is not None else "",
                "cells": cells(x),
                "note": row.note,
                "grade": table["grades"][row.name].grade if row.name in table["grades"] else "",
                "why": table["grades"][row.name].why if row.name in table["grades"] else "",
            }
            for row in table["rows"]
        ],
        "graded": bool(grades),
        "estimates": run.result["estimates"],
        "summary": [(title, SYMBOL_WITH_INDEX.split(text)) for title, text in summary(analysis)],
        "findings": [*notices["warnings"], *notices["notes"]],
        "charts": drawn(charts),
    }


def drawn(charts: Mapping[str, Chart]) -> list[dict[str, Any]]:
    """Return charts for charts.js, with their captions."""
    return [to_json(chart) | {"caption": chart.caption} for chart in charts.values()]


def compared_of(compared: SpringComparison, charts: Mapping[str, Chart]) -> dict[str, Any]:
    """Return a comparison: the verdict, a row for each run and for their mean, and its charts."""
    springs = compared.comparison
    each = zip(springs.names, springs.each, springs.pulls, strict=True)
    rows = [[name, pretty(k), f"{pull:+.1f}".replace("-", "−")] for name, k, pull in each]
    if springs.agree:
        rows.append(["weighted mean", pretty(springs.spring_constant), ""])
    return {
        "verdict": " ".join([*verdict(compared), *(typeset(joint.message) for joint in compared.joint)]),
        "rows": rows,
        "findings": [finding.advice for finding in compared.findings if finding.advice],
        "charts": drawn(charts),
    }


def judged(rows: Sequence[Reported]) -> list[dict[str, str]]:
    """Return the verdict on each value that a report states."""
    return [
        {"name": row.name, "printed": typeset(row.printed), "ours": pretty(row.found), "verdict": row.verdict}
        for row in rows
    ]
