"""The trade in words and as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from acquisition.errors import visible
from pipeline.numerics.estimate import Estimate
from springmass.runs.json_results import picked, plain
from springmass.trade.measure import Trade
from springmass.trade.methods import UNITS, Method, Unavailable

__all__ = ["hostile_json", "hostile_text", "own_json", "own_text", "ratio", "trade_json", "trade_text"]

TRUTH = ("seconds", "rate_hz", "noise_m", "frequency_hz", "amplitude_m", "damping_per_s", "echoes")
HEADS = {"frequency": "frequency", "amplitude": "amplitude", "damping_rate": "damping"}


def trade_text(trade: Trade, absent: Sequence[Unavailable]) -> str:
    """Return the table, and what to take."""
    truth = trade.truth
    lines = [
        f"{trade.seeds} simulated records of {truth.seconds:g} s at {truth.rate_hz:g} Hz, amplitude "
        f"{truth.amplitude_m * 1e3:g} mm, noise {truth.noise_m * 1e3:g} mm, damping {truth.damping_per_s:g} 1/s"
        + (f", {truth.echoes:.1%} false echoes" if truth.echoes else ""),
        "Bounds (Cramér-Rao): " + ", ".join(f"{HEADS[q]} {bound:.2g} {UNITS[q]}" for q, bound in trade.bound.items()),
        "",
    ]
    body = [["method", "time / ms", *(f"{HEADS[q]} / bound" for q in UNITS), "failed", "beaten in time and error by"]]
    for row in trade.rows:
        errors = [ratio(row.error[q]) if q in row.error else "-" for q in UNITS]
        failed = str(row.failed) if row.failed else "-"
        body.append([row.method.label, f"{row.seconds * 1e3:.3g}", *errors, failed, trade.beaten(row) or "-"])
    lines += _aligned(body)
    lines += [f"\nNot measured: {each.name}, {each.needs} is not installed." for each in absent]
    chosen = next(row for row in trade.rows if row.method.name == trade.recommended)
    reach = "within a tenth of the bound" if chosen.worst <= 1.1 * trade.doubt else "the most exact here"
    lines.append(
        f"\nRecommended for such records: --accuracy {trade.recommended} ({reach}, {chosen.seconds * 1e3:.3g} ms)."
    )
    return "\n".join(lines)


def trade_json(trade: Trade, absent: Sequence[Unavailable], version: str) -> dict[str, Any]:
    """Return the measurement as a JSON object."""
    return {
        "schema": 1,
        "kind": "simulated",
        "truth": picked(trade.truth, TRUTH),
        "seeds": trade.seeds,
        "bounds": dict(trade.bound),
        "methods": [
            {
                "name": row.method.name,
                "kind": row.method.kind,
                "time_s": row.seconds,
                "error_over_bound": dict(row.error),
                "bias_over_bound": dict(row.bias),
                "failed": row.failed,
                "beaten_by": trade.beaten(row),
            }
            for row in trade.rows
        ],
        "absent": plain(absent),
        "recommended": trade.recommended,
        "version": version,
    }


def hostile_text(trades: Mapping[str, Trade]) -> str:
    """Return a line a kind of record: what every tier errs, over the least of them, and its time over the quickest."""
    methods = [row.method for row in next(iter(trades.values())).rows]
    body = [["record", *(f"{method.name}: f, A, damping; time" for method in methods), ""]]
    for name, trade in trades.items():
        least_s = min(row.seconds for row in trade.rows)
        cells = []
        for row in trade.rows:
            over = trade.over_least(row)
            failed = f" ({row.failed} failed)" if row.failed else ""
            errors = ", ".join(ratio(over[q]) if q in over else "-" for q in UNITS)
            cells.append(f"{errors}; {row.seconds / least_s:.1f}{failed}")
        body.append([name, *cells, ""])
    seeds = next(iter(trades.values())).seeds
    head = f"{seeds} simulated records of each kind: root mean square errors over the least, time over the quickest"
    return "\n".join([head, "", *_aligned(body)])


def hostile_json(trades: Mapping[str, Trade], version: str) -> dict[str, Any]:
    """Return the same as a JSON object."""
    records = [
        {
            "record": name,
            "seeds": trade.seeds,
            "methods": [
                {
                    "name": row.method.name,
                    "time_s": row.seconds,
                    "error": {q: error * trade.bound[q] for q, error in row.error.items()},
                    "error_over_least": trade.over_least(row),
                    "failed": row.failed,
                }
                for row in trade.rows
            ],
        }
        for name, trade in trades.items()
    ]
    return {"schema": 1, "kind": "simulated", "records": records, "version": version}


Own = Sequence[tuple[Method, Mapping[str, Estimate] | str, float]]


def own_text(path: str, results: Own) -> str:
    """Return what each method makes of one record."""
    body = [["method", "time / ms", "period / s", "amplitude / mm", "damping / (1/s)"]]
    notes = []
    for method, found, seconds in results:
        if isinstance(found, str):
            body.append([method.label, f"{seconds * 1e3:.3g}", "-", "-", "-"])
            notes.append(f"{method.label}: {found}")
            continue
        period, amplitude, rate = _period(found), found.get("amplitude"), found.get("damping_rate")
        scaled = None if amplitude is None else Estimate(amplitude.value * 1e3, amplitude.u * 1e3)
        body.append([method.label, f"{seconds * 1e3:.3g}", _plain(period), _plain(scaled), _plain(rate)])
    lines = [
        f"{visible(path)}, by every method (the references assume an exponential and no false echo):",
        "",
        *_aligned(body),
    ]
    return "\n".join([*lines, *notes])


def own_json(path: str, results: Own, absent: Sequence[Unavailable], version: str) -> dict[str, Any]:
    """Return what each method makes of one record as a JSON object."""
    methods = []
    for method, found, seconds in results:
        entry: dict[str, Any] = {"name": method.name, "kind": method.kind, "time_s": seconds}
        if isinstance(found, str):
            entry["failed"] = found
        else:
            entry["estimates"] = plain({"period": _period(found), **found})
        methods.append(entry)
    return {
        "schema": 1,
        "kind": "record",
        "input": path,
        "methods": methods,
        "absent": plain(absent),
        "version": version,
    }


def _period(found: Mapping[str, Estimate]) -> Estimate:
    frequency = found["frequency"]
    return Estimate(1.0 / frequency.value, frequency.u / frequency.value**2, "s")


def _plain(estimate: Estimate | None) -> str:
    if estimate is None:
        return "-"
    if not math.isfinite(estimate.u):
        return f"{estimate.value:.6g}"
    return str(Estimate(estimate.value, estimate.u))


def ratio(value: float) -> str:
    """Return an error over its bound to the digits that a hundred records know."""
    return f"{value:.2f}" if value < 10 else f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Set columns: the first and the last to the left, numbers to the right; a rule below the head."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    last = len(widths) - 1
    lines = [
        "  ".join(
            cell.ljust(width) if i in (0, last) else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    return [lines[0], "-" * max(len(line) for line in lines), *lines[1:]]
