"""Dialects of tables that public repositories hold, one of each: what a few lines of each open as."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.errors import UnknownFormat
from acquisition.recordings.identify import open_recording

N = 60
T = np.arange(N) / 20
X = np.round(0.2 + 0.05 * np.cos(5 * T), 4)
SETTINGS = ["Record Length,2.5e+03", "Sample Interval,5.0e-02", "Source,CH1", "Vertical Units,V", "Horizontal Units,s"]


def rows(form: str) -> str:
    """Write a row for each sample."""
    return "\n".join(
        form.format(i=i, t=t, x=x, ms=round(t * 1e3), s=25 + t) for i, (t, x) in enumerate(zip(T, X, strict=True))
    )


def commas(form: str) -> str:
    """Write rows with decimal commas."""
    return rows(form).replace(".", ",")


MONITOR = "15:00:{s:06.3f} -> "
DIALECTS = {
    "monitor": (rows(MONITOR + "{x:.4f}"), {"unit": "m"}),
    "monitor, labelled": ("15:00:24.100 -> sensor ready\n" + rows(MONITOR + "Distance: {x:.4f} m"), {}),
    "monitor, named": (
        "15:00:24.100 -> time,distance\n" + rows(MONITOR + "{ms},{x:.4f}"),
        {"unit": "m", "time_unit": "ms"},
    ),
    "quoted commas": ('"Zeit (s)","Weg (m)"\n' + commas('"{t:.3f}"_"{x:.4f}"').replace("_", ","), {}),
    "times, minutes": ("Time,Height (m)\n" + rows("00:{t:05.2f},{x:.4f}"), {}),
    "words first": ("Date and Time Run 5,Time (s) Run 5,Position (m) Run 5\n" + rows("2023-10-09,{t:.3f},{x:.4f}"), {}),
    "DEF": ('DEC=2\nDEF="n";"t / s";"x / m"\n' + commas("{i}\t{t:.3f}\t{x:.4f}"), {}),
    "side by side": ("t1,x1,t2,x2\n" + rows("{s:.3f},0.5,{t:.3f},{x:.4f}"), {"channel": "x2", "unit": "m"}),
    "settings beside": (
        "\n".join(
            f"{SETTINGS[i] if i < len(SETTINGS) else ','},,{a:+.6f},{b:.5f},"
            for i, (a, b) in enumerate(zip(T, X, strict=True))
        ),
        {},
    ),
    "zeros left out": ("t (s),x (m)\n" + "\n".join(f"{a:g},{b:g}" for a, b in zip(T, X, strict=True)), {}),
}


@pytest.mark.parametrize("name", DIALECTS)
def test_a_dialect_opens_with_what_it_says(tmp_path: Path, name: str) -> None:
    """Every sample, at its time, at the right rate, and none malformed."""
    text, answers = DIALECTS[name]
    path = tmp_path / "run.txt"
    path.write_text(text + "\n", encoding="utf-8")
    recording = open_recording(path, **answers)  # type: ignore[arg-type]
    samples = recording.samples
    np.testing.assert_allclose(samples.t - samples.t[0], T, atol=1e-9)
    np.testing.assert_allclose(samples.distance, X, atol=1e-9)
    assert recording.info.rate_hz == pytest.approx(20.0, rel=1e-9)
    assert recording.malformed_rows == 0
    assert (samples.unit, "quantised" in {trap.code for trap in recording.traps}) in (("m", False), ("V", False))


@pytest.mark.parametrize(("encoding", "heading"), [("gbk", "时间(s),位移(cm)"), ("cp1252", "Größe t (s),Länge (cm)")])
def test_headings_keep_their_letters(tmp_path: Path, encoding: str, heading: str) -> None:
    """GB 2312 is told from cp1252 by its pairs of bytes."""
    path = tmp_path / "run.csv"
    path.write_bytes(f"{heading}\n{rows('{t:.3f},{x:.4f}')}\n".encode(encoding))
    assert open_recording(path).channel == heading.split(",")[1].partition("(")[0].strip()


@pytest.mark.parametrize("answers", [{"time": "column 2"}, {"time": "t"}, {"time": "T (s)"}])
def test_times_may_be_named_by_name_or_number(tmp_path: Path, answers: dict[str, Any]) -> None:
    """With or without the unit, in either case."""
    path = tmp_path / "run.csv"
    path.write_text("x (m),t (s),n (s)\n" + rows("{x:.4f},{t:.3f},{i}") + "\n", encoding="utf-8")
    np.testing.assert_allclose(open_recording(path, channel="x", **answers).samples.t, T, atol=1e-9)


REFUSED = {
    "labels": (rows("t={t:.3f} x={x:.4f}"), "no format recognises it"),
    "labels and units": (rows("Time: {t:.3f} s, Height: {x:.4f} m"), "no format recognises it"),
    "objects": ("\n".join(json.dumps({"t": a, "x": b}) for a, b in zip(T, X, strict=True)), "JSON"),
    "list of objects": (json.dumps([{"t": a, "x": b} for a, b in zip(T.tolist(), X.tolist(), strict=True)]), "JSON"),
    "object of lists": (json.dumps({"time": T.tolist(), "x": X.tolist()}), "JSON"),
    "lists of lists": (json.dumps(np.transpose([T, X]).tolist()), "JSON"),
    "lists": (f"t = {T.tolist()}\nx = np.array({X.tolist()})\n", "lists of Python"),
    "tuples": ("# t, x\n" + rows("({t:.3f}, {x:.4f}),"), "lists of Python"),
    "markdown": ("| t (s) | x (m) |\n|---|---|\n" + rows("| {t:.3f} | {x:.4f} |"), "a table of Markdown"),
    "pipes": ("t|x\n" + rows("{t:.3f}|{x:.4f}"), "no format recognises it"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_wraps_its_rows_is_refused_by_name(tmp_path: Path, name: str) -> None:
    """One line says what the file is, and what to do."""
    text, named = REFUSED[name]
    path = tmp_path / "run.txt"
    path.write_text(text + "\n", encoding="utf-8")
    with pytest.raises(UnknownFormat) as refusal:
        open_recording(path)
    assert named in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_program_with_a_list_in_it_is_no_recording(tmp_path: Path) -> None:
    """Lists are columns where they are most of a text, and not one line of many."""
    path = tmp_path / "plot.py"
    code = "\n".join(f"def figure_{name}(axes):\n    axes.plot(first, second, label={name!r})" for name in "abcdefgh")
    path.write_text(f"masses = [0.1, 0.2, 0.3, 0.4]\n{code}\n", encoding="utf-8")
    with pytest.raises(UnknownFormat):
        open_recording(path)
