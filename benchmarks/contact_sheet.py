"""Draw every shared recording with its fit, residuals and findings: ``python benchmarks/contact_sheet.py FOLDER``.

The recordings and their reading options come from ``tests/recordings/findings.toml``. The pages are PNG files. After a
change to a check, look through all pages for findings that a recording does not deserve.
"""

from __future__ import annotations

import argparse
import textwrap
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.recordings.identify import open_recording
from pipeline.analyse import Analysis, Oscillation
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError
from pipeline.params import STANDARD
from pipeline.track import UNUSABLE
from springmass.runs.analysing import analyse_track
from springmass.runs.tracks import to_track

ROOT = Path(__file__).resolve().parents[1]
RECORDINGS = ROOT.parent / "shared" / "recordings"
TABLE = ROOT / "tests" / "recordings" / "findings.toml"
PER_PAGE = 4
PERIODS = 8  # number of periods in the second panel


def listed() -> list[dict[str, Any]]:
    """Return the table of recordings: ``file``, its reading options, and ``codes``."""
    return list(tomllib.loads(TABLE.read_text("utf-8"))["recording"])


def analysed(row: Mapping[str, Any]) -> Analysis:
    """Analyse one recording of the table without a scene and without the notes next to the file."""
    options = {name: value for name, value in row.items() if name not in ("file", "codes")}
    recording = open_recording(RECORDINGS / row["file"], **options)
    track = to_track(recording.samples, recording.info, recorded_format=recording.format)
    return analyse_track(track, Scene(), STANDARD, recording.traps)


def words_of(row: Mapping[str, Any], result: Analysis | PipelineError) -> Iterator[str]:
    """Yield the lines of text next to the figure: the name, the main estimates and all findings."""
    options = ", ".join(f"{name}={value}" for name, value in row.items() if name not in ("file", "codes"))
    yield from textwrap.wrap(row["file"], 78)
    yield options
    if isinstance(result, PipelineError):
        yield from textwrap.wrap(f"{type(result).__name__}: {result}", 78)
        return
    track = result.track
    yield f"{len(track)} samples at {track.rate_hz:.4g} Hz; used {result.quality['used']}"
    for name in ("period", "amplitude", "damping_rate", "offset", "noise"):
        if name in result.estimates:
            yield f"{name}: {result.estimates[name]}"
    if isinstance(result.motion, Oscillation):
        yield f"law: {result.motion.damping.best.name}"
    for finding in result.findings:
        mark = {"error": "E", "warning": "W", "info": "-"}[finding.severity]
        yield from textwrap.wrap(f"{mark} {finding.code}: {finding.message}", 84, subsequent_indent="     ")


def draw(axes: Any, row: Mapping[str, Any], result: Analysis | PipelineError) -> None:
    """Fill one row of panels: the whole position, its first periods with the fit, residuals, and text.

    Parameters
    ----------
    axes : (4,) matplotlib.axes.Axes
    row : mapping
        The recording's row of the table.
    result : Analysis or PipelineError
    """
    whole, first, residuals, text = axes
    text.axis("off")
    text.text(0.0, 1.0, "\n".join(words_of(row, result)), va="top", fontsize=6.5, family="monospace")
    if isinstance(result, PipelineError):
        return
    track = result.track
    used = (track.flags & UNUSABLE) == 0
    if isinstance(result.motion, Oscillation):
        used = (result.motion.demodulated.flags & UNUSABLE) == 0
    for panel in (whole, first):
        panel.plot(track.t[~used], track.y[~used], "x", color="tab:red", ms=3, mew=0.6)
    whole.plot(track.t, track.y, ",", color="black")
    whole.plot(track.t[used], track.y[used], "-", color="tab:blue", lw=0.3)
    whole.set_ylabel(track.unit, fontsize=6)
    if isinstance(result.motion, Oscillation):
        motion, t = result.motion, track.t[used]
        period = 2.0 * np.pi / motion.phase.angular_frequency.value
        near = used & (track.t <= t[0] + PERIODS * period)
        first.plot(track.t[near], track.y[near], ".", color="black", ms=2)
        first.plot(track.t[near], motion.waveform.position[near], "-", color="tab:orange", lw=0.7)
        low, high = np.min(track.y[near]), np.max(track.y[near])
        first.set_xlim(t[0] - 0.3 * period, t[0] + (PERIODS + 0.3) * period)
        first.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low))
        residuals.plot(t, motion.waveform.residual[used], ".", color="tab:blue", ms=1)
    else:
        first.plot(track.t[: len(track) // 8], track.y[: len(track) // 8], ".", color="black", ms=2)


def main() -> None:
    """Draw all recordings of the table, four to a page."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder for the pages, made where it is absent")
    parser.add_argument("--only", default="", help="text that the name of the file contains")
    given = parser.parse_args()
    if not RECORDINGS.is_dir():
        parser.error("the recordings are missing; they belong in ../shared/recordings")
    given.folder.mkdir(parents=True, exist_ok=True)
    rows = [row for row in listed() if given.only in row["file"]]
    for page, start in enumerate(range(0, len(rows), PER_PAGE), 1):
        chosen = rows[start : start + PER_PAGE]
        figure, grid = plt.subplots(
            len(chosen), 4, figsize=(17.0, 3.4 * len(chosen)), squeeze=False, width_ratios=(3, 3, 3, 4)
        )
        for axes, row in zip(grid, chosen, strict=True):
            for panel in axes:
                panel.tick_params(labelsize=6)
            try:
                draw(axes, row, analysed(row))
            except PipelineError as error:  # a refusal is also drawn, with its message
                draw(axes, row, error)
        figure.tight_layout()
        figure.savefig(given.folder / f"page-{page:02d}.png", dpi=90)
        plt.close(figure)
        print(f"page {page}: {', '.join(row['file'] for row in chosen)}")


if __name__ == "__main__":
    main()
