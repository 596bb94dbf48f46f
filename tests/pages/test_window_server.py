"""The server of the window: who may change something, what it takes, and where it keeps it."""

from __future__ import annotations

import json
import re
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import springmass
from tests.pages.conftest import started
from tests.pages.window import WindowClient, pair, tracker


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[WindowClient, Path]]:
    """Return a client of a window, and the folder in which its window keeps what is dropped."""
    top = tmp_path_factory.mktemp("window")
    with started(top / "x", "page") as program:
        yield WindowClient(program.address), top / "state" / "springmass" / "window"


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
        assert (
            main(
                [
                    "analyse",
                    position,
                    "--velocity",
                    velocity,
                    "--json",
                    "--mass-kg",
                    typed,
                    "--set",
                    "disc.diameter_m=10.2 cm",
                ]
            )
            == 0
        )
        assert shown == json.loads(capsys.readouterr().out)["estimates"]
    window.do("remove", card=card["id"])


def test_recordings_dropped_together_are_all_read(client: tuple[WindowClient, Path]) -> None:
    """Each by a process of its own."""
    window, _ = client
    assert window.drop({f"{name}.txt": tracker() for name in "abc"}, "three")[0] == 200
    cards = window.cards()
    assert [card["stage"] for card in cards] == ["question"] * 3
    for card in cards:
        window.do("remove", card=card["id"])


def test_what_is_dropped_is_for_its_user_alone(client: tuple[WindowClient, Path]) -> None:
    """The folder has the mode 0700, and so has every folder in it; no name of a file leads out of it."""
    window, folder = client
    for i, name in enumerate(
        ("../../evil.csv", "/etc/evil.csv", "..\\evil.csv", ".hidden.csv", "..", "a/../../evil.csv")
    ):
        assert window.drop({name: "t,x\n1,2\n"}, f"n{i}")[0] == 200
    cards = window.cards()
    assert len(cards) == 6
    folders = [path for path in folder.rglob("*") if path.is_dir()]
    assert folders
    assert {stat.S_IMODE(path.stat().st_mode) for path in (folder, *folders)} == {0o700}
    evil = list(folder.parents[3].rglob("*evil*"))
    assert len(evil) == 4
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
