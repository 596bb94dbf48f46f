"""Measure the table of docs/how-to/choose-an-accuracy.md and draw its figure: `make docs-trade`, a few minutes."""

from __future__ import annotations

import time
from pathlib import Path

from springmass.charts.draw import style, written
from springmass.trade.drawing import trade_figure
from springmass.trade.measure import Trade, measure
from springmass.trade.methods import UNITS, references, tiers
from springmass.trade.tables import ratio
from springmass.trade.truth import Truth

HERE = Path(__file__).resolve().parent
CASES = {
    "f, A, γ at 0.3 mm": Truth(),
    "f, A, γ at 2.39 mm": Truth(noise_m=0.00239),
    "f, A, γ at 0.3 mm, 5 % echoes": Truth(echoes=0.05),
}


def main(folder: Path = HERE, seeds: int = 100) -> str:
    """Measure every case, draw the first into a folder and return the table."""
    methods = [*tiers(linear=True), *references()]
    trades = {name: measure(truth, methods, seeds, timer=time.perf_counter) for name, truth in CASES.items()}
    first = next(iter(trades.values()))
    with style():
        (folder / "trade.svg").write_bytes(written(trade_figure(first), "svg"))
    fit_s = next(row.seconds for row in first.rows if row.method.name == "scipy")
    lines = [f"| method | time / fit | {' | '.join(trades)} |", "| --- " * (2 + len(trades)) + "|"]
    for i, row in enumerate(first.rows):
        label = f"`{row.method.name}`" if row.method.kind == "tier" else row.method.label
        cells = [label, f"{row.seconds / fit_s:.2f}", *(_errors(trade, i) for trade in trades.values())]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _errors(trade: Trade, row: int) -> str:
    error = trade.rows[row].error
    return ", ".join(ratio(error[quantity]) if quantity in error else "-" for quantity in UNITS)


if __name__ == "__main__":
    print(main())
