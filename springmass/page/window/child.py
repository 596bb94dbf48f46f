"""The process that opens the recording of a card, and answers requests about it over a pipe.

It keeps what it has read and measured, so that a changed mass needs no new analysis of the samples. After the answers
to a request comes None. Results go into the folder of the card, because they may be large.
"""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import visible
from acquisition.recordings.families.archive import is_one_recording, members
from acquisition.recordings.identify import read_bytes, sniff
from acquisition.recordings.questions import Missing
from acquisition.recordings.reading import value_of
from pipeline.bench.scene import Scene
from springmass.charts.draw import save
from springmass.charts.run import charts_of
from springmass.charts.several import static
from springmass.comparing.comparison import compare_runs
from springmass.comparing.reported import REPORTED_COLUMNS, judge, read_reported
from springmass.comparing.user_table import read_hooke
from springmass.errors import ProgramError
from springmass.loading.options import AnalysisOptions
from springmass.loading.scenes import read_scene
from springmass.page.window.bench import form_of, scene_of
from springmass.page.window.contents import asked, compared_of, drawn, judged, opened, results_of
from springmass.report.recorded import notes_of
from springmass.report.write import charts_across, write_report
from springmass.result.output_names import numbered, plain_name
from springmass.runs.run import Run
from springmass.runs.tasks import Failed, Task, attempted
from storage.atomic import write_whole

Request = Mapping[str, Any]
Answer = dict[str, Any]


class Opened:
    """The recordings that this process has read, each with its last run."""

    def __init__(self) -> None:
        self._read: dict[str, tuple[Any, Run]] = {}
        self._last: dict[str, tuple[Run, Request, Run]] = {}

    def read(self, card: Request) -> Run:
        """Return the recording of a card, read once for the same answers."""
        answers = {name: value_of(name, text) for name, text in card["answers"].items() if text != ""}
        how = AnalysisOptions.of(answers | ({"velocity": card["velocity"]} if card["velocity"] else {}))
        if (before := self._read.get(card["path"])) is None or before[0] != how:
            before = self._read[card["path"]] = how, Run.of(card["path"], how=how, name=card["name"])
        return before[1]

    def run(self, card: Request) -> tuple[Run, dict[str, str]]:
        """Return the run of a card on its bench, and why some of the bench cannot be taken."""
        read = self.read(card)
        how = {name: x for name in ("from_s", "to_s", "law", "accuracy") if (x := card[name]) is not None}
        before = self._last.get(card["path"])
        if before is None or before[0] is not read or before[1] != how:
            before = read, how, Run.of(read, how=AnalysisOptions(**how))
        stated = Scene.from_mapping(card["scene"], where="scene") if card["scene"] else read.scene
        scene, errors = scene_of(stated, card["bench"])
        run = before[2].on_bench(scene)
        self._last[card["path"]] = read, how, run
        if note := card["notes"].strip():
            noted = {"notes": [*run.loaded.provenance.get("notes", ()), note]}
            run = run.named(run.name, loaded=replace(run.loaded, provenance={**run.loaded.provenance, **noted}))
        return run, errors

    def show(self, request: Request) -> Iterator[Answer]:
        """Read a recording, then analyse it; the results are complete in the file that the request names."""
        card = request["card"]
        read = self.read(card)
        yield {"opened": opened(read.loaded)}
        run, errors = self.run(card)
        form = form_of(run.scene, card["bench"], errors)
        yield {"form": form}
        write_whole(request["into"], json.dumps(results_of(run), allow_nan=False))
        yield {"results": True, "why": "" if run.ok else run.why}

    def write(self, request: Request) -> Iterator[Answer]:
        """Write what a person takes away into a folder."""
        (run, _), folder = self.run(request["card"]), Path(request["into"])
        match request["what"]:
            case "run":
                run.save(folder / "run.h5", overwrite=True)
            case "figures":
                charts, pictures = charts_of(run.analysis, notes_of(run.recorded), profiles=True), folder / "figures"
                pictures.mkdir(exist_ok=True)
                save(charts, pictures, ("png", "svg"))
                with zipfile.ZipFile(folder / "figures.zip", "w", zipfile.ZIP_DEFLATED) as archive:
                    for picture in sorted(pictures.iterdir()):
                        archive.write(picture, picture.name)
            case _:
                write_report(folder / "report", [run])
        yield {}

    def judge(self, request: Request) -> Iterator[Answer]:
        """Judge the values that a report states of one recording."""
        run, _ = self.run(request["card"])
        table = _table(Path(request["into"]), REPORTED_COLUMNS, [[run.name, *row] for row in request["rows"]])
        rows, findings = judge(read_reported(table, [run]), [run])
        said = [f"{f.message} {f.details}".strip() for f in findings]
        yield {"judged": judged(rows), "findings": said}

    def compare(self, request: Request) -> Iterator[Answer]:
        """Compare recordings of one spring, with Hooke's law if points are given; without recordings, these alone."""
        folder, rows, found = Path(request["into"]), request["hooke"], Answer()
        points = _table(folder, request["columns"], rows) if rows else None
        names = numbered([card["name"] for card in request["cards"]])
        runs = [self.run(card)[0].named(name) for name, card in zip(names, request["cards"], strict=True)]
        if any(run.scene.bob_mass_kg is None for run in runs):
            raise ProgramError("a comparison needs the mass of every bob", "type it on its card")
        if len(runs) > 1:
            compared = compare_runs(runs, static=points)
            found = compared_of(compared, charts_across(runs, compared))
        elif points is not None:
            line = static(read_hooke(points))
            found = {"verdict": line.caption, "rows": [], "findings": [], "charts": drawn({"hooke": line})}
        else:
            raise ProgramError("two recordings with a mass are needed", "give the mass of each bob")
        write_whole(folder / "comparison.json", json.dumps(found, allow_nan=False))
        yield {}

    def scene(self, request: Request) -> Iterator[Answer]:
        """Read a scene file."""
        yield {"scene": read_scene(request["path"]).to_mapping()}

    def unpack(self, request: Request) -> Iterator[Answer]:
        """Write the files of an archive into a folder that has room for them, under names without a path."""
        path, folder, names = request["path"], Path(request["into"]), list[str]()
        files = list(members(path, read_bytes(path)))
        if len(files) > request["files"] or sum(len(data) for _, data in files) > request["bytes"]:
            raise ProgramError("unpacked, it would exceed 1 GB or 200 files together", "drop some of its files")
        for name, data in files:
            names.append(plain_name(name, names))
            write_whole(folder / names[-1], data)
        yield {"names": names}


def _table(folder: Path, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Path:
    path = folder / "typed.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, delimiter=";").writerows([columns, *rows])
    return path


def answers(opened_here: Opened, request: Request) -> Iterator[Answer]:
    """Yield the answers to a request; an error or a question is one of them."""
    card = request.get("card", {})
    where = card.get("path") or request.get("path", "")
    parts: Iterator[Answer] = getattr(opened_here, request["do"])(request)
    while (answer := attempted(Task(where, card.get("name", "")), partial(next, parts, None))) is not None:
        if isinstance(answer, Failed):
            yield _why(answer, where)
            break
        yield answer


def _why(failed: Failed, where: str) -> Answer:
    """Return a question, or why there are no results, in words without the path of our copy.

    ``archive`` says that its files may be recordings by themselves.
    """
    asks, archive = failed.question, attempted(failed.task, partial(sniff, where)) == "zip"
    if asks is not None:
        several = archive and Missing.RUN in asks.question.missing and not is_one_recording(read_bytes(where))
        return {"question": asked(asks), "archive": several}
    error, folder = failed.error, f"{Path(where).parent}{os.sep}" if where else ""
    problem, remedy = (visible(text.replace(folder, "") if folder else text) for text in (error.problem, error.remedy))
    return {"problem": problem, "remedy": remedy, "archive": archive}


def serve(requests: Connection) -> None:
    """Answer requests until there are no more; what a library prints goes nowhere, and a request that is slow ends it.

    The system ends a process whose time runs out, because nothing in it could while a library computes.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the window ends its processes
    with open(os.devnull, "w") as nowhere:
        for output in (1, 2):
            os.dup2(nowhere.fileno(), output)
    here = Opened()
    with contextlib.suppress(EOFError):
        while True:
            request = requests.recv()
            if hasattr(signal, "setitimer"):
                signal.setitimer(signal.ITIMER_PROF, request["longest_s"])
            for answer in chain(answers(here, request), [None]):
                requests.send(answer)


def _warm_up() -> None:
    """Import what an analysis imports when it is first needed."""
    t = np.arange(600) / 50.0
    y = 0.2 + 0.02 * np.exp(-0.02 * t) * np.cos(8.0 * t) + 1e-4 * np.random.default_rng(1).standard_normal(t.size)
    results_of(Run.of((t, y)))


_warm_up()
