"""Measurements as tables and as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from acquisition.errors import visible
from pipeline.numerics.estimate import Estimate
from springmass.runs.json_results import picked, plain
from springmass.trade.measure import OwnResult, Row, Trade
from springmass.trade.methods import UNITS

__all__ = ["aligned", "hostile_json", "hostile_text", "own_json", "own_text", "ratio", "trade_json", "trade_text"]

TRUTH = ("seconds", "rate_hz", "noise_m", "frequency_hz", "amplitude_m", "damping_per_s", "echoes")
HEADS = {"frequency": "frequency", "amplitude": "amplitude", "damping_rate": "damping"}


def trade_text(trade: Trade) -> str:
    """Return a table with one row per method, and the recommended accuracy."""
    truth = trade.truth
    echoes = f", {truth.echoes:.1%} false echoes" if truth.echoes else ""
    rows = [["method", "time / ms", *(f"{HEADS[q]} / bound" for q in UNITS), "failed", "beaten in time and error by"]]
    for row in trade.rows:
        failed = str(row.failed) if row.failed else "-"
        rows.append(
            [row.method.label, f"{row.seconds * 1e3:.3g}", *_ratios(row.error), failed, trade.beaten(row) or "-"]
        )
    best = trade.recommended
    reach = "within a tenth of the bound" if best.worst <= trade.enough else "the most exact here"
    return "\n".join(
        [
            f"{trade.seeds} simulated records of {truth.seconds:g} s at {truth.rate_hz:g} Hz, amplitude "
            f"{truth.amplitude_m * 1e3:g} mm, noise {truth.noise_m * 1e3:g} mm, damping {truth.damping_per_s:g} 1/s"
            f"{echoes}",
            "Bounds (Cramér-Rao): " + ", ".join(f"{HEADS[q]} {trade.bound[q]:.2g} {unit}" for q, unit in UNITS.items()),
            "",
            *aligned(rows),
            "",
            f"Recommended for such records: --accuracy {best.method.name} ({reach}, {best.seconds * 1e3:.3g} ms).",
        ]
    )


def trade_json(trade: Trade, version: str) -> dict[str, Any]:
    """Return the measurement as a JSON object, with errors divided by the bound."""
    rows = [
        {**_row(row), "kind": row.method.kind, "beaten_by": trade.beaten(row)}
        | {"error_over_bound": row.error, "bias_over_bound": row.bias}
        for row in trade.rows
    ]
    facts = {"truth": picked(trade.truth, TRUTH), "seeds": trade.seeds, "bounds": trade.bound, "methods": rows}
    facts["recommended"] = trade.recommended.method.name
    return {"schema": 1, "kind": "simulated", **facts, "version": version}


def _row(row: Row) -> dict[str, Any]:
    return {"name": row.method.name, "time_s": row.seconds, "failed": row.failed}


def hostile_text(trades: Mapping[str, Trade]) -> str:
    """Return one line per kind of record: each tier's errors over the smallest ones, and its time over the shortest."""
    first = next(iter(trades.values()))
    rows = [["record", *(f"{row.method.name}: f, A, damping; time" for row in first.rows), ""]]
    for name, trade in trades.items():
        least_s = min(row.seconds for row in trade.rows)
        cells = [
            f"{', '.join(_ratios(trade.over_least(row)))}; {row.seconds / least_s:.1f}"
            + (f" ({row.failed} failed)" if row.failed else "")
            for row in trade.rows
        ]
        rows.append([name, *cells, ""])
    head = (
        f"{first.seeds} simulated records of each kind: root mean square errors over the least, time over the quickest"
    )
    return "\n".join([head, "", *aligned(rows)])


def hostile_json(trades: Mapping[str, Trade], version: str) -> dict[str, Any]:
    """Return the results for all kinds of records as a JSON object, with errors in SI units too."""
    records = []
    for name, trade in trades.items():
        errors = [{q: error * trade.bound[q] for q, error in row.error.items()} for row in trade.rows]
        rows = [
            {**_row(row), "error": error, "error_over_least": trade.over_least(row)}
            for row, error in zip(trade.rows, errors, strict=True)
        ]
        records.append({"record": name, "seeds": trade.seeds, "methods": rows})
    return {"schema": 1, "kind": "simulated", "records": records, "version": version}


def own_text(path: str, results: Sequence[OwnResult]) -> str:
    """Return each method's estimates from one record, or the reason for its failure."""
    rows = [["method", "time / ms", "period / s", "amplitude / mm", "damping / (1/s)"]]
    notes = []
    for method, estimates, seconds in results:
        if isinstance(estimates, str):
            notes.append(f"{method.label}: {estimates}")
            estimates = {}
        cells = (
            _cell(_period(estimates)),
            _cell(estimates.get("amplitude"), 1e3),
            _cell(estimates.get("damping_rate")),
        )
        rows.append([method.label, f"{seconds * 1e3:.3g}", *cells])
    head = f"{visible(path)}, by every method (the references assume an exponential and no false echo):"
    return "\n".join([head, "", *aligned(rows), *notes])


def own_json(path: str, results: Sequence[OwnResult], version: str) -> dict[str, Any]:
    """Return each method's estimates from one record as a JSON object."""
    methods = []
    for method, estimates, seconds in results:
        entry: dict[str, Any] = {"name": method.name, "kind": method.kind, "time_s": seconds}
        if isinstance(estimates, str):
            methods.append({**entry, "failed": estimates})
        else:
            methods.append({**entry, "estimates": plain({"period": _period(estimates), **estimates})})
    return {"schema": 1, "kind": "record", "input": path, "methods": methods, "version": version}


def _period(estimates: Mapping[str, Estimate]) -> Estimate | None:
    frequency = estimates.get("frequency")
    return None if frequency is None else Estimate(1.0 / frequency.value, frequency.u / frequency.value**2, "s")


def _cell(estimate: Estimate | None, factor: float = 1.0) -> str:
    if estimate is None:
        return "-"
    value, u = estimate.value * factor, estimate.u * factor
    return str(Estimate(value, u)) if math.isfinite(u) else f"{value:.6g}"


def _ratios(errors: Mapping[str, float]) -> list[str]:
    return [ratio(errors[q]) if q in errors else "-" for q in UNITS]


def ratio(value: float) -> str:
    """Return an error over its bound, rounded to the digits that a hundred records determine."""
    return f"{value:.2f}" if value < 10 else f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Align rows in columns, the first and the last to the left, the others to the right; add a rule below the head."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    inner = [f"{{:>{width}}}" for width in widths[1:-1]]
    form = "  ".join([f"{{:<{widths[0]}}}", *inner, "{}"])
    lines = [form.format(*row).rstrip() for row in rows]
    return [lines[0], "-" * max(map(len, lines)), *lines[1:]]
