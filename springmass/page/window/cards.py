"""The cards of a window: what each opens and what was typed on it, kept on disk, and what its process answers."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import secrets
import shutil
import time
from collections.abc import AsyncIterator, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import msgspec
from platformdirs import user_state_path

from acquisition.recordings.questions import Missing
from acquisition.units import MEASURES, TIMES
from pipeline.damping.laws import LAWS, words_of
from springmass.errors import ProgramError
from springmass.page.window.processes import Children, ProcessEnded
from springmass.page.window.recording import RecorderProcess
from springmass.result.output_names import plain_name
from storage.atomic import write_whole

MOST_OF_FILE, MOST_TOGETHER, MOST_FILES = 200_000_000, 1_000_000_000, 200
KEPT_S = 24 * 3600.0
ALIVE_S = 60.0
"""A window whose folder was not touched for so long has ended; it touches it every second."""
LABELS = {
    Missing.CHANNEL: "Column of values",
    Missing.UNIT: "Unit",
    Missing.TIME: "Column of times",
    Missing.TIME_UNIT: "Unit of the times",
    Missing.RATE_HZ: "Rate in samples per second",
    Missing.RUN: "Run",
}
"""What may be stated about how a file is read; all but the run may be stated about any file."""
SETTLED = ("done", "question", "failed")
"""Stages of a card that wait for a person."""
_UNSET = dict.fromkeys(("velocity", "scene", "from_s", "to_s", "law", "accuracy"))
BLANK: Mapping[str, Any] = {**_UNSET, "answers": {}, "bench": {}, "notes": "", "saved": False}
"""What is kept of a card besides its name and its file."""


class NotTaken(Exception):
    """Something that the window does not take, in words for its user."""


class Card:
    """One recording: ``kept`` is on disk, ``state`` is what its process said last, ``revision`` numbers its changes."""

    def __init__(self, folder: Path, kept: Mapping[str, Any]) -> None:
        self.id, self.folder = folder.name, folder
        self.kept: dict[str, Any] = {**BLANK, **kept}
        self.state: dict[str, Any] = {"stage": "waiting", "version": 0}
        self.revision = self.wanted = self.asked = 0
        self.task: asyncio.Task[None] | None = None

    @property
    def size(self) -> int:
        """The bytes of its files."""
        return sum(os.path.getsize(each) for each in self.paths if os.path.isfile(each))

    @property
    def paths(self) -> list[str]:
        """The files of the recording."""
        return [each for each in (self.kept["path"], self.kept["velocity"]) if each]

    def message(self) -> dict[str, Any]:
        """Return the card as the page shows it."""
        shown = {name: value for name, value in self.kept.items() if name not in ("path", "velocity", "scene")}
        return {"type": "card", "id": self.id, **shown, **self.state}

    def keep(self) -> None:
        """Write what is kept."""
        write_whole(self.folder / "card.json", json.dumps(self.kept))


class Cards:
    """All cards of this window, in a folder that only its user may open; ``turned`` is set at the next change."""

    def __init__(self, top: Path | None = None) -> None:
        self._top = (top or user_state_path("springmass", appauthor=False)) / "window"
        self._top.mkdir(parents=True, exist_ok=True)
        self._top.chmod(0o700)
        self.earlier = self._sweep()
        self.folder = self._top / secrets.token_hex(8)
        self.folder.mkdir(mode=0o700)
        self.cards: dict[str, Card] = {}
        self.children = Children()
        self.revision = 0
        self._drops: dict[tuple[str, str], Path] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self.turned = asyncio.Event()
        self.recorder = RecorderProcess(self._top)
        self._recorder = self.recorder.message()

    # What other windows left.

    def _sweep(self) -> list[dict[str, Any]]:
        """Remove what windows left a day ago, and return what later ones left, the latest first."""
        found = []
        for folder in filter(Path.is_dir, self._top.iterdir()):
            age_s = time.time() - folder.stat().st_mtime
            if age_s <= ALIVE_S:
                continue
            try:
                cards = [json.loads(path.read_text("utf-8")) for path in folder.glob("*/card.json")]
                names = [card["name"] for card in cards if not card["saved"]]
            except (OSError, ValueError, LookupError, TypeError):  # nothing that this version could open again
                names = []
            if names and age_s <= KEPT_S:
                found.append({"id": folder.name, "names": names, "age_s": age_s})
            else:
                shutil.rmtree(folder, ignore_errors=True)
        return sorted(found, key=lambda each: float(each["age_s"]))

    def restore(self, wanted: str, *, forget: bool) -> None:
        """Open the cards that an earlier window left, or remove them."""
        left = next((each for each in self.earlier if each["id"] == wanted), None)
        if left is None:
            raise NotTaken("these recordings are open already, or gone")
        self.earlier.remove(left)
        if forget:
            shutil.rmtree(self._top / wanted, ignore_errors=True)
        else:
            before, here = self._top / wanted, self.folder / f"from-{wanted}"
            before.rename(here)
            for path in sorted(here.glob("*/card.json"), key=lambda each: each.stat().st_mtime):
                kept = json.loads(path.read_text("utf-8"))
                moved = {
                    name: kept[name] and kept[name].replace(str(before), str(here)) for name in ("path", "velocity")
                }
                self._add(kept | moved)
                path.unlink()
        self._change()

    def look(self) -> bool:
        """Show other windows that this one has not ended, and open a finished recording; return whether one goes on."""
        os.utime(self.folder)
        if (run := self.recorder.finished()) is not None:
            self.open_paths([run], {})
        if (seen := self.recorder.message()) != self._recorder:
            self._recorder = seen
            self._change()
        return self.recorder.running

    def record(self, asked: Mapping[str, Any]) -> None:
        """Start a recorder."""
        try:
            self.recorder.start(asked)
        except (ProgramError, OSError) as error:
            raise NotTaken(str(error)) from error

    def close(self) -> None:
        """End all processes; cards that are not saved stay for a day."""
        self.children.close()
        if all(card.kept["saved"] for card in self.cards.values()):
            shutil.rmtree(self.folder, ignore_errors=True)

    # What is dropped.

    async def receive(self, drop: str, folder: str, name: str, stream: AsyncIterator[bytes]) -> None:
        """Write a file of a drop as it arrives; NotTaken, and nothing kept, if it or all together are too large."""
        if (drop, folder) not in self._drops:
            self._drops[drop, folder] = self._new_folder()
        place = self._drops[drop, folder]
        path = place / plain_name(name, os.listdir(place))
        files, left = self._room()
        most = min(MOST_OF_FILE, left)
        try:
            with path.open("wb") as file:
                async for data in stream:
                    most -= len(data)
                    if most < 0 or files < 1:
                        raise NotTaken(
                            f"{name}: at most 200 MB a file, 1 GB and 200 files together; remove cards, or use Python"
                        )
                    file.write(data)
        except BaseException:
            path.unlink()
            raise

    def _new_folder(self) -> Path:
        """Return a folder for files that lay in one folder."""
        place = self.folder / f"files-{secrets.token_hex(4)}"
        place.mkdir(mode=0o700)
        return place

    def _room(self) -> tuple[int, int]:
        """Return how many files and bytes may still be added."""
        sizes = [path.stat().st_size for path in self.folder.glob("**/files-*/*") if path.is_file()]
        return MOST_FILES - len(sizes), MOST_TOGETHER - sum(sizes)

    async def open_drop(self, drop: str, on: str = "") -> None:
        """Open the files of a drop as cards; a scene among them is that of the card that it fell on, or of all."""
        places = [place for (of, _), place in self._drops.items() if of == drop]
        for each in [key for key in self._drops if key[0] == drop]:
            del self._drops[each]
        dropped = [kept for place in places for kept in _recordings(place)]
        scenes = [path for place in places for path in place.glob("*.toml") if not path.name.endswith(".about.toml")]
        stated, refused = None, ""
        if len(scenes) > 1:
            refused = f"{len(scenes)} scenes were dropped and none is used; drop one of them on its recording"
        elif scenes:
            try:
                stated = await self._scene_of(scenes[0])
            except NotTaken as error:
                refused = str(error)
        others = [on] if on in self.cards else [] if dropped else [*self.cards]
        for kept in dropped:
            self._add(kept if others else {**kept, "scene": stated})
        for card in others if stated is not None else ():
            self.card(card).kept["bench"] = {}
            self.change(card, {"scene": stated})
        if refused:
            raise NotTaken(refused)

    async def _scene_of(self, path: Path) -> dict[str, Any]:
        """Return the tables of a scene file."""
        answer = await self.ask("scene", {"do": "scene", "path": str(path)}, path.stat().st_size)
        return dict(answer["scene"])

    def open_paths(self, paths: Iterable[str | Path], stated: Mapping[str, Any]) -> None:
        """Open files where they lie, as the command line names them, with what it states of them."""
        named = [Path(os.path.abspath(path)) for path in paths]
        for kept in [*_of_files(named), *(each for folder in named if folder.is_dir() for each in _recordings(folder))]:
            self._add({**kept, **stated})

    async def examples(self, folder: Path) -> None:
        """Open the bundled recordings, each with its scene."""
        for name in ("undamped", "damped"):
            position, velocity = (str(folder / f"{name}_simulated_{what}.txt") for what in ("position", "velocity"))
            scene = await self._scene_of(folder / f"{name}.scene.toml")
            self._add({"name": f"Example: {name}", "path": position, "velocity": velocity, "scene": scene})

    def _add(self, kept: Mapping[str, Any]) -> Card:
        if len(self.cards) >= MOST_FILES:
            raise NotTaken(f"at most {MOST_FILES} recordings; remove some first")
        folder = self.folder / secrets.token_hex(8)
        folder.mkdir(mode=0o700)
        card = self.cards[folder.name] = Card(folder, kept)
        self._want(card)
        return card

    # What is done with a card.

    def card(self, wanted: str) -> Card:
        """Return a card by its number."""
        if wanted not in self.cards:
            raise NotTaken("this recording was removed; drop it again")
        return self.cards[wanted]

    def change(self, wanted: str, changes: Mapping[str, Any]) -> None:
        """Take what was typed on a card, and show what follows from it.

        Answers and cells of the bench replace those of their name alone: a page may not have seen the last change yet.
        """
        card = self.card(wanted)
        taken = checked(changes)
        for name in {"answers", "bench"} & taken.keys():
            taken[name] = {each: text for each, text in (card.kept[name] | taken[name]).items() if text}
        card.kept |= taken | {"saved": False}
        if set(changes) == {"notes"}:
            card.keep()
            self._change(card)
        else:
            self._want(card)

    def separate(self, wanted: str) -> None:
        """Make a card of each run of a file that holds several."""
        card = self.card(wanted)
        (runs,) = [field["choices"] for field in card.kept["asked"] if field["name"] == "run"]
        for run in runs[1:]:
            answers = {**card.kept["answers"], "run": run}
            self._add({**card.kept, "name": f"{card.kept['name']}: {run}", "answers": answers})
        card.kept["name"] += f": {runs[0]}"
        self.change(wanted, {"answers": {"run": runs[0]}})

    def remove(self, wanted: str) -> None:
        """Remove a card with its files."""
        card = self.card(wanted)
        self.children.forget(card.id, "It was removed")
        del self.cards[wanted]
        used = {path for each in self.cards.values() for path in each.paths}
        for path in map(Path, card.paths):
            if self.folder in path.parents and str(path) not in used:
                path.unlink(missing_ok=True)
        shutil.rmtree(card.folder, ignore_errors=True)
        self._change()

    async def of_card(self, wanted: str, do: str, **more: Any) -> dict[str, Any]:
        """Return what the process of a card answers, which writes into the folder of the card."""
        card = self.card(wanted)
        return await self.ask(card.id, {"do": do, "card": card.kept, "into": str(card.folder), **more}, card.size)

    async def write(self, wanted: str, what: str) -> None:
        """Write what a person takes away."""
        await self.of_card(wanted, "write", what=what)
        if what == "run":
            card = self.card(wanted)
            card.kept["saved"] = True
            card.keep()
            self._change(card)

    async def compare(self, request: Mapping[str, Any]) -> Path:
        """Compare cards; return the file with the comparison."""
        cards = [self.card(each) for each in request["cards"]]
        asked = {"do": "compare", "cards": [card.kept for card in cards], "into": str(self.folder)}
        asked |= checked({name: request[name] for name in ("hooke", "columns")})
        await self.ask("together", asked, sum(card.size for card in cards))
        return self.folder / "comparison.json"

    async def ask(self, holder: str, request: Mapping[str, Any], size: int) -> dict[str, Any]:
        """Return what a process answers; NotTaken if that is an error or a question."""
        found: dict[str, Any] = {}
        try:
            async with contextlib.aclosing(self.children.ask(holder, request, size)) as answers:
                async for answer in answers:
                    found |= answer
        except ProcessEnded as error:
            raise NotTaken(f"{error}.") from error
        if "problem" in found:
            raise NotTaken(_joined(found))
        if "question" in found:
            raise NotTaken("answer the questions on the card first")
        return found

    def _want(self, card: Card) -> None:
        card.keep()
        card.wanted += 1
        if card.task is None:
            card.task = asyncio.create_task(self._work(card))

    async def _work(self, card: Card) -> None:
        """Show a card until nothing on it has changed since."""
        while card.asked != card.wanted and card.id in self.cards:
            card.asked = card.wanted
            self._say(card, stage="waiting", problem="")
            into = card.folder / "results.json"
            request = {"do": "show", "card": {**card.kept}, "into": str(into)}
            try:
                children = self.children.ask(card.id, request, card.size, lambda: self._say(card, stage="reading"))
                async with contextlib.aclosing(children) as answers:
                    async for answer in answers:
                        await self._take(card, answer)
            except ProcessEnded as error:
                self._say(card, stage="failed", problem=f"{error}.")
        card.task = None

    async def _take(self, card: Card, answer: dict[str, Any]) -> None:
        """Take one answer of the process that shows a card."""
        if card.id not in self.cards:
            return
        if "opened" in answer:
            self._say(card, stage="analysing", **answer)
        elif "results" in answer:
            self._say(card, stage="done", why=answer["why"], version=card.state["version"] + 1)
        elif answer.get("archive") and not card.kept.get("unpacked"):
            self._tasks.add(task := asyncio.create_task(self._unpack(card, answer)))
            task.add_done_callback(self._tasks.discard)
        elif "question" in answer:
            fields = {each["name"]: each for each in (*card.kept.get("asked", ()), *answer["question"]["fields"])}
            card.kept["asked"] = [*fields.values()]
            card.keep()
            self._say(card, stage="question", question=answer["question"])
        elif "problem" in answer and card.kept["velocity"]:  # no pair of one format: two recordings
            self._add(*_of_files([Path(card.kept["velocity"])]))
            card.kept["velocity"] = None
            self._want(card)
        elif "problem" in answer:
            self._say(card, stage="failed", problem=_joined(answer))
        else:
            self._say(card, **answer)

    async def _unpack(self, card: Card, otherwise: dict[str, Any]) -> None:
        """Make a card of each file of an archive; if none may be a recording, say what its reader said."""
        place, (files, size) = self._new_folder(), self._room()
        card.kept["unpacked"] = True
        asked = {"do": "unpack", "path": card.kept["path"], "into": str(place), "files": files, "bytes": size}
        try:
            await self.ask("unpack", asked, card.size)
        except NotTaken as error:
            self._say(card, stage="failed", problem=str(error))
            return
        found = [*_recordings(place)]
        if not found or card.id not in self.cards:
            await self._take(card, otherwise)
            return
        self.remove(card.id)
        for kept in found[: MOST_FILES - len(self.cards)]:
            self._add({**kept, "unpacked": True})

    # What pages see.

    def _say(self, card: Card, **state: Any) -> None:
        if card.asked != card.wanted and state.get("stage") in SETTLED:
            state["stage"] = "waiting"  # for what was typed since it was asked
        card.state |= state
        self._change(card)

    def _change(self, card: Card | None = None) -> None:
        """Wake all pages; a card is sent to those that have an earlier revision of it."""
        self.revision += 1
        if card is not None:
            card.revision = self.revision
        self.turned.set()
        self.turned = asyncio.Event()

    def since(self, revision: int) -> list[dict[str, Any]]:
        """Return the messages for a page that has seen everything up to a revision."""
        laws = [{"value": name, "label": words_of(law)} for name, law in LAWS.items()]
        choices = {Missing.UNIT: [*MEASURES], Missing.TIME_UNIT: [*TIMES]}
        reading = [{"name": x.value, "label": label, "choices": choices.get(x, [])} for x, label in LABELS.items()]
        known = {"laws": laws, "reading": reading[:-1]}
        order = {"type": "cards", "order": [*self.cards], "earlier": self.earlier, **known}
        return [order, self._recorder, *(card.message() for card in self.cards.values() if card.revision > revision)]


def _recordings(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield what a card needs to open each recording of a folder."""
    paths = [path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith(".")]
    return _of_files(path for path in paths if path.suffix.lower() != ".toml")


def _of_files(paths: Iterable[Path]) -> Iterator[dict[str, Any]]:
    """Yield a card's name and files, with the velocity file of a position file; no file is opened here."""
    files = {path: path.with_name(_of_velocity(path.name)) for path in paths if not path.is_dir()}
    pairs = {path: other for path, other in files.items() if other != path and other in files}
    for path in files:
        made = path.suffix == ".wire" and path.with_suffix(".h5") in files
        if path not in pairs.values() and not made:
            yield {"name": path.name, "path": str(path), "velocity": str(pairs[path]) if path in pairs else None}


def _of_velocity(name: str) -> str:
    return re.sub("([Pp])osition", lambda found: "velocity" if found[1] == "p" else "Velocity", name)


def _joined(answer: Mapping[str, Any]) -> str:
    """Return a problem and its remedy as one text."""
    problem, remedy = (text[:1].upper() + text[1:] for text in (answer["problem"], answer["remedy"]))
    return f"{problem}. {remedy}." if remedy else f"{problem}."


ShortText = Annotated[str, msgspec.Meta(max_length=100)]
LongText = Annotated[str, msgspec.Meta(max_length=4000)]
FORMS: Mapping[str, Any] = {
    **dict.fromkeys(("from_s", "to_s"), float | None),
    **dict.fromkeys(("law", "accuracy"), ShortText | None),
    "notes": LongText,
    "answers": dict[str, LongText],
    "bench": dict[str, dict[str, ShortText]],
    "scene": dict[str, Any] | None,
    **dict.fromkeys(("rows", "hooke"), list[list[ShortText]]),
    "columns": list[ShortText],
}
"""The form of each field that a page sends."""


def checked(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a page sent; KeyError or ValueError if a field is none of its own, or has another form."""
    return {name: msgspec.convert(value, FORMS[name]) for name, value in fields.items()}
