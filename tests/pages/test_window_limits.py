"""What a window does not take, ends and forgets: too much, too long, hostile files, folders that are a day old."""

from __future__ import annotations

import asyncio
import os
import random
import struct
import time
from collections.abc import Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springmass
from springmass.page.web import window as served
from springmass.page.window import processes
from springmass.page.window.cards import BLANK, Cards
from tests.conformance.test_formats import CASES
from tests.courses import bad_files
from tests.pages.conftest import started
from tests.pages.window import WindowClient, excel, packed, pair, tracker

MEGABYTE = bytes(1 << 20)
HOSTILE = 100 if os.environ.get("SPRINGMASS_EXAMPLES") == "nightly" else 10


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[WindowClient, Path]]:
    """Return a client of a window, and the folder in which its window keeps what is dropped."""
    top = tmp_path_factory.mktemp("window")
    with started(top / "x", "page") as program:
        yield WindowClient(program.address), top / "state" / "springmass" / "window"
        assert "Traceback" not in "".join(program.messages)


def test_a_file_has_at_most_200_mb(client: tuple[WindowClient, Path]) -> None:
    """It is refused in one line as it arrives, and nothing of it stays."""
    window, folder = client
    body = (MEGABYTE for _ in range(201))
    status, said = window.post("/window/files?drop=big&folder=&name=big.csv", body)
    assert status == 409
    assert "at most 200 MB" in str(said)
    assert list(folder.rglob("big*")) == []


def test_an_archive_counts_unpacked(client: tuple[WindowClient, Path]) -> None:
    """One that says it holds 3 GB, and one with 300 files, end as a line; neither is unpacked."""
    window, folder = client
    huge = bytearray(packed({"a.csv": "t,x\n1,2\n"}))
    at = huge.index(b"PK\x01\x02") + 24
    huge[at : at + 4] = struct.pack("<I", 3_000_000_000)
    many = packed({f"{i}.csv": tracker() if i == 0 else "t,x\n" for i in range(300)})
    assert window.drop({"huge.zip": bytes(huge), "many.zip": many}, "zips")[0] == 200
    for card in window.cards():
        assert card["stage"] == "failed"
        assert "exceed 1 GB or 200 files" in card["problem"]
        assert window.do("remove", card=card["id"])[0] == 200
    assert not any(path.suffix == ".csv" for path in folder.rglob("*"))


def test_an_archive_of_recordings_becomes_cards(client: tuple[WindowClient, Path]) -> None:
    """A pair of MotionSensor.vi in it is one card; names with paths stay in the window's folder."""
    window, folder = client
    files = {f"../../{name}": content for name, content in pair().items()} | {"sub/C:\\evil.xlsx": excel()}
    assert window.drop({"all.zip": packed(files)}, "all")[0] == 200
    cards = window.cards()
    assert sorted(card["stage"] for card in cards) == ["done", "question"]
    assert {card["name"] for card in cards} == {"damped_simulated_position.txt", "evil.xlsx"}
    assert len(list(folder.parents[3].rglob("evil.xlsx"))) == 1
    for card in cards:
        window.do("remove", card=card["id"])


def hostile(folder: Path) -> list[tuple[str, bytes]]:
    """Return files that are no recordings, or that were damaged, in an order that mixes them."""
    (folder / "bad").mkdir()
    found = [(Path(name).name, folder.joinpath(name)) for name in bad_files(folder / "bad")]
    files = [(name, path.read_bytes()) for name, path in found if path.is_file() and not path.is_symlink()]
    t = np.arange(300) / 100.0
    chance = random.Random(1)
    zips = {
        "twice.zip": packed({"a.zip": packed({"b.zip": packed({"c.csv": tracker()})})}),
        "names.zip": packed({"a" * 60_000: "1", "\n": "2", " ": "3"}),
        "nothing.zip": packed({}),
        "torn.zip": packed({"a.csv": tracker()})[:-30],
    }
    files += zips.items()
    while len(files) < 100:
        case = CASES[chance.randrange(len(CASES))]
        data = bytearray(case.build(t, np.round(0.2 + 0.05 * np.sin(7.9 * t), 5)))
        for _ in range(chance.randrange(1, 40)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        cut = chance.randrange(len(data) // 2, len(data))
        files.append((f"{len(files)}.dat", bytes(data[:cut])))
    chance.shuffle(files)
    return files


def test_hostile_files_end_as_a_line(client: tuple[WindowClient, Path], tmp_path: Path) -> None:
    """Dropped together, each becomes a card with results, a question, or one line without a traceback."""
    window, _ = client
    files = {f"{i}-{name}": content for i, (name, content) in enumerate(hostile(tmp_path)[:HOSTILE])}
    assert window.drop(files, "hostile")[0] == 200
    cards = window.cards()
    assert len(cards) >= len(files)
    for card in cards:
        assert card["stage"] in ("done", "question", "failed")
        if card["stage"] == "failed":
            assert card["problem"].endswith(".")
            assert not {"\n", "Traceback", "internal error", "--", str(tmp_path)} & {card["problem"]}
            assert "internal error" not in card["problem"]
        window.do("remove", card=card["id"])


def apart(work: Coroutine[Any, Any, Any]) -> Any:
    """Run a coroutine on a thread of its own: the browser of other tests has a running loop on this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, work).result()


def asked(limit_s: float) -> list[dict[str, Any]]:
    """Ask a process of the window for two minutes of a recording."""

    async def ask() -> list[dict[str, Any]]:
        child = await processes.Child.start()
        path = str(springmass.sample_data() / "damped_simulated_position.txt")
        card = {**BLANK, "name": "x", "path": path}
        try:
            return [answer async for answer in child.ask({"do": "show", "card": card, "into": os.devnull}, limit_s)]
        finally:
            await child.close()

    return apart(ask())


def test_a_process_that_takes_too_long_or_too_much_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both are measured from outside; the line says what to do."""
    with pytest.raises(processes.ProcessEnded, match=r"took longer than 0 s; export"):
        asked(0.2)
    monkeypatch.setattr(processes, "MOST_MEMORY", 1 << 20)
    with pytest.raises(processes.ProcessEnded, match="of memory; export"):
        asked(60.0)


def test_the_server_ends_when_its_pages_are_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a while without any; not as long as one is open, however silent, nor while something is recorded."""
    monkeypatch.setattr(served, "DESERTED_S", 2.0)

    async def ends(pages: int, recording: bool) -> bool:
        cards = Cards(tmp_path)
        monkeypatch.setattr(cards.children, "prepare", lambda: None)
        monkeypatch.setattr(type(cards.recorder), "running", recording)
        window, over = served.Window(cards), asyncio.Event()
        window.pages, window.quiet_s = pages, 0.0
        ticking = asyncio.create_task(window.reading(over.set))
        with_end = asyncio.wait_for(over.wait(), 4.0)
        try:
            await with_end
        except TimeoutError:
            return False
        finally:
            ticking.cancel()
            await cards.close()
        return True

    assert [apart(ends(*each)) for each in ((0, False), (1, False), (0, True))] == [True, False, False]


def test_a_window_that_was_killed_is_offered_for_a_day(tmp_path: Path) -> None:
    """With its answers and notes, and then no trace is left; another window lives on; a named file is opened."""
    windows = tmp_path / "state" / "springmass" / "window"
    with started(tmp_path / "x", "page") as program:
        first = WindowClient(program.address)
        assert first.drop({"Messung.xlsx": excel()}, "d")[0] == 200
        (card,) = first.cards()
        first.do("change", card=card["id"], changes={"answers": {"unit": "cm"}, "notes": "third spring"})
        first.cards()
        with started(tmp_path / "x", "page") as other:
            second = WindowClient(other.address)
            second.cards()
            assert second.earlier == []
        program.process.kill()
    (left,) = (path for path in windows.iterdir() if (path / card["id"]).is_dir())
    hour_ago = time.time() - 3600.0
    os.utime(left, (hour_ago, hour_ago))
    with started(tmp_path / "x", "page") as program:
        third = WindowClient(program.address)
        third.cards()
        (offered,) = third.earlier
        assert offered["names"] == ["Messung.xlsx"]
        assert third.do("restore", window=offered["id"])[0] == 200
        (card,) = third.cards()
        assert (card["stage"], card["answers"], card["notes"]) == ("done", {"unit": "cm"}, "third spring")
        assert third.do("restore", window=offered["id"])[0] == 409
        program.process.kill()
    day_ago = time.time() - 25 * 3600.0
    for path in windows.iterdir():
        os.utime(path, (day_ago, day_ago))
    with started(tmp_path / "x", "page", str(springmass.sample_data() / "undamped_simulated_position.txt")) as program:
        (card,) = WindowClient(program.address).cards()
        assert (card["name"], card["stage"]) == ("undamped_simulated_position.txt", "done")
        assert not any(path.suffix == ".xlsx" for path in windows.rglob("*"))
