"""The server of the window: who may change something, what it takes and ends, and where it keeps what it is given."""

import asyncio
import json
import os
import random
import re
import stat
import struct
import time
from collections.abc import Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import springmass
from springmass.page.web import window as served
from springmass.page.window import processes
from springmass.page.window.cards import BLANK, Cards
from tests.courses import bad_files
from tests.pages.conftest import started
from tests.pages.window import WindowClient, excel, packed, pair, tracker

MEGABYTE = bytes(1 << 20)
HOSTILE = 100 if os.environ.get("SPRINGMASS_EXAMPLES") == "nightly" else 4


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[WindowClient, Path]]:
    """Return a client of a window, and the folder in which its window keeps what is dropped."""
    top = tmp_path_factory.mktemp("window")
    with started(top / "x", "page") as program:
        yield WindowClient(program.address), top / "state" / "springmass" / "window"
        assert "Traceback" not in "".join(program.messages)


def test_only_the_window_itself_changes_something(client: tuple[WindowClient, Path]) -> None:
    """A request without its cookie, its origin or its header is refused; so is what is no request of the window."""
    window, _ = client
    body = json.dumps({"do": "examples"}).encode()
    for left_out in ({"Cookie": None}, {"Origin": None}, {"X_Springmass": None}, {"Origin": "http://evil.example"}):
        assert window.post("/window/do", body, **left_out)[0] == 403
        assert window.post("/window/files?drop=a&folder=&name=x", b"1", **left_out)[0] == 403
    for strange in (b"", b"[]", b'"x"', b"{}", b'{"do": "rm"}', b'{"do": "change", "card": "x"}', b"[" * 5000, b"\xff"):
        assert window.post("/window/do", strange)[0] in (400, 409)
    assert window.post("/window/files?drop=a", b"1")[0] == 400
    assert window.post("/window/do", b" " * 300_000)[0] == 400
    assert window.cards() == []


def test_the_page_runs_no_inline_script(client: tuple[WindowClient, Path]) -> None:
    """Its policy allows files of its own alone, and it has none but such."""
    window, _ = client
    answered = window.get("/")
    assert answered.headers["Content-Security-Policy"].startswith("default-src 'self';")
    text = (Path(__file__).parents[2] / "springmass" / "page" / "static" / "window.html").read_text("utf-8")
    assert re.findall(r"<script(?! src=)|<style| on\w+=| style=", text) == []


def test_numbers_are_those_of_the_command_line(client: tuple[WindowClient, Path], capsys: Any) -> None:
    """To the last digit: of a pair of files with a typed mass, and again with another one."""
    from springmass.cli import main

    window, folder = client
    assert window.drop(pair(), "pair")[0] == 200
    (card,) = window.cards()
    for mass, u in (("217.6", "0.05"), ("218,1", "0,1")):
        bench = {
            "bob.mass_kg": {"text": mass, "u": u, "unit": "g"},
            "disc.diameter_m": {"text": "10.2", "u": "", "unit": "cm"},
        }
        assert window.do("change", card=card["id"], changes={"bench": bench})[0] == 200
        (card,) = window.cards()
        shown = json.loads(next(folder.glob(f"*/{card['id']}/results.json")).read_text())["estimates"]
        position, velocity = (str(next(folder.glob(f"*/*/{name}"))) for name in pair())
        typed = f"{mass}+/-{u} g".replace(",", ".")
        capsys.readouterr()
        words = ("--mass-kg", typed, "--set", "disc.diameter_m=10.2 cm")
        assert main(["analyse", position, "--velocity", velocity, "--json", *words]) == 0
        assert shown == json.loads(capsys.readouterr().out)["estimates"]
    window.do("remove", card=card["id"])


def test_what_is_dropped_is_for_its_user_alone(client: tuple[WindowClient, Path]) -> None:
    """The folder has the mode 0700, and so has every folder in it; no name of a file leads out of it."""
    window, folder = client
    for i, name in enumerate(("../../evil.csv", "..\\evil.csv", "..")):
        assert window.drop({name: "t,x\n1,2\n"}, f"n{i}")[0] == 200
    cards = window.cards()
    assert len(cards) == 3
    folders = [path for path in folder.rglob("*") if path.is_dir()]
    assert folders
    assert {stat.S_IMODE(path.stat().st_mode) for path in (folder, *folders)} == {0o700}
    evil = list(folder.parents[3].rglob("*evil*"))
    assert len(evil) == 2
    assert all(path.parent.name.startswith("files-") for path in evil)
    for card in cards:
        assert window.do("remove", card=card["id"])[0] == 200
    assert not any(path.is_file() for path in folder.rglob("files-*/*"))


def test_a_scene_is_dropped_too(client: tuple[WindowClient, Path]) -> None:
    """It fills the form of the recordings that fell with it, in the units of the form; two scenes are refused."""
    window, _ = client
    data = springmass.sample_data()
    scenes = {name: (data / name).read_bytes() for name in ("damped.scene.toml", "undamped.scene.toml")}
    assert window.drop({**pair(), "damped.scene.toml": scenes["damped.scene.toml"]}, "scene")[0] == 200
    (card,) = window.cards()
    shown = {field["name"]: (field["text"], field.get("u"), field.get("unit")) for field in card["form"]}
    assert shown["bob.mass_kg"] == ("217.6", "0.05", "g")
    assert shown["disc.diameter_m"] == ("10.2", "0.05", "cm")
    assert shown["sensor.position"] == ("below", None, None)
    status, said = window.drop(scenes, "scenes")
    assert (status, said["refused"].count("2 scenes were dropped")) == (409, 1)
    window.do("remove", card=card["id"])


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
    rows = "".join(f"{0.1 * i:.1f},{i % 7}\n" for i in range(40))
    many = packed({f"{i}.csv": f"t (s),x (m)\n{rows}" for i in range(300)})
    assert window.drop({"huge.zip": bytes(huge), "many.zip": many}, "zips")[0] == 200
    for card in window.cards():
        assert card["stage"] == "failed"
        assert re.search("exceed 1 GB or 200 files|got 1 of 3000000000 bytes", card["problem"])
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
    """Return files that are no recordings, in an order that mixes them."""
    (folder / "bad").mkdir()
    found = [(Path(name).name, folder.joinpath(name)) for name in bad_files(folder / "bad")]
    files = [(name, path.read_bytes()) for name, path in found if path.is_file() and not path.is_symlink()]
    zips = {
        "twice.zip": packed({"a.zip": packed({"b.zip": packed({"c.csv": tracker()})})}),
        "names.zip": packed({"a" * 60_000: "1", "\n": "2", " ": "3"}),
        "nothing.zip": packed({}),
        "torn.zip": packed({"a.csv": tracker()})[:-30],
    }
    files += zips.items()
    random.Random(1).shuffle(files)
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


def asked(limit_s: float, into: Path) -> list[dict[str, Any]]:
    """Ask a process of the window for two minutes of a recording."""

    async def ask() -> list[dict[str, Any]]:
        child = await processes.Child.start()
        path = str(springmass.sample_data() / "damped_simulated_position.txt")
        card = {**BLANK, "name": "x", "path": path}
        try:
            return [answer async for answer in child.ask({"do": "show", "card": card, "into": str(into)}, limit_s)]
        finally:
            child.end()

    return apart(ask())


def test_a_process_that_takes_too_long_or_too_much_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both are measured from outside; the line says what to do."""
    with pytest.raises(processes.ProcessEnded, match=r"took longer than 0 s; export"):
        asked(0.01, tmp_path / "x")
    monkeypatch.setattr(processes, "MOST_MEMORY", 1 << 20)
    with pytest.raises(processes.ProcessEnded, match="of memory; export"):
        asked(60.0, tmp_path / "x")


def test_the_server_ends_when_its_pages_are_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a while without any; not as long as one is open, however silent, nor while something is recorded."""
    monkeypatch.setattr(served, "DESERTED_S", 0.5)

    async def ends(pages: int, recording: bool) -> bool:
        cards = Cards(tmp_path)
        monkeypatch.setattr(cards.children, "prepare", lambda: None)
        monkeypatch.setattr(type(cards.recorder), "running", recording)
        window, over = served.Window(cards), asyncio.Event()
        window.pages, window.quiet_s = pages, 0.0
        ticking = asyncio.create_task(window.reading(over.set))
        try:
            await asyncio.wait_for(over.wait(), 2.5 if pages or recording else 60.0)
        except TimeoutError:
            return False
        finally:
            ticking.cancel()
            cards.close()
        return True

    assert [apart(ends(*each)) for each in ((0, False), (1, False), (0, True))] == [True, False, False]


def test_a_window_that_was_killed_is_offered_for_a_day(client: tuple[WindowClient, Path]) -> None:
    """With its answers and notes, and then no trace is left; a window that lives on is not offered."""
    living, windows = client
    assert living.drop({"x.txt": tracker()}, "living")[0] == 200
    out = windows.parents[2] / "x"
    with started(out, "page") as program:
        first = WindowClient(program.address)
        assert first.drop({"Messung.xlsx": excel()}, "d")[0] == 200
        (card,) = first.cards()
        first.do("change", card=card["id"], changes={"answers": {"unit": "cm"}, "notes": "third spring"})
        first.cards()
        program.process.kill()
    (left,) = (path for path in windows.iterdir() if (path / card["id"]).is_dir())
    hour_ago = time.time() - 3600.0
    os.utime(left, (hour_ago, hour_ago))
    with started(out, "page") as program:
        again = WindowClient(program.address)
        again.cards()
        (offered,) = again.earlier
        assert offered["names"] == ["Messung.xlsx"]
        assert again.do("restore", window=offered["id"])[0] == 200
        (card,) = again.cards()
        assert (card["stage"], card["answers"], card["notes"]) == ("done", {"unit": "cm"}, "third spring")
        assert again.do("restore", window=offered["id"])[0] == 409
        program.process.kill()
