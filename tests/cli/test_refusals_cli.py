"""Command lines that cannot be: exit code 2, nothing on stdout, and one line that names what is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import MIXED, Cli

RUN, OTHER = "DATA/undamped_simulated_position.txt", "DATA/damped_simulated_position.txt"
BARE = ("--scene", "DATA/undamped.scene.toml")
RECORD = ("record", "--simulate", "--scene", "SCENE", "--sensor", "line-protocol", "-o", "OUT")
SIMULATE = ("simulate", "--scene", "SCENE", "--json")

LINES: list[tuple[tuple[str, ...], str]] = [
    ((), "--help"),
    (("analyze", "x.txt"), "analyse"),
    (("analyse", "x.txt", "--accuracy", "bst"), "best"),
    (("analyse", "x.txt", "--chanel", "y"), "--channel"),
    (("analyse", "x.txt", "--rate-hz", "100", "--rate-hz", "50"), "--rate-hz"),
    (("batch", "x.txt", "-o", "course", "--jobs", "1.5"), "--jobs"),
    (("analyse", "--json", RUN, "--from", "20"), "9.99"),
    (("analyse", "--json", RUN, "--to", "-1"), "9.99"),
    (("analyse", "--json", RUN, "--from", "5", "--to", "4"), "9.99"),
    (("analyse", "--json", RUN, "--mass-kg", "200 q"), "--mass-kg"),
    (("analyse", "--json", RUN, "--mass-kg", "0.2+/--0.1"), "--mass-kg"),
    (("analyse", "--json", RUN, "--mass-kg", "-1"), "mass_kg"),
    (("analyse", "--json", RUN, "--set", "bob.mass=0.2"), "mass_kg"),
    (("analyse", "--json", RUN, "--set", "mass_kg"), "--set"),
    (("compare", RUN), "compare"),
    (("compare", RUN, OTHER), "--scene"),
    (("compare", RUN, OTHER, RUN, *BARE, *BARE), "--scene"),
    (("compare", RUN, OTHER, "--scene", "nowhere.toml"), "nowhere.toml"),
    ((*RECORD, "--option", "colour=red"), "colour"),
    ((*RECORD, "--ruler", "0.4"), "--still"),
    ((*RECORD, "--pre", "1"), "--trigger"),
    ((*RECORD, "--port", "/dev/ttyUSB0"), "--simulate"),
    (("replay", RUN, "--speed=0"), "--speed"),
    (("replay", RUN, "--speed=nan"), "--speed"),
    (("replay", RUN, "--speed=fast"), "--speed"),
    ((*SIMULATE, "--method", "leapfrog"), "forward-euler"),
    ((*SIMULATE, "--dt", "0"), "--dt"),
    ((*SIMULATE, "--tolerance", "-1"), "-1"),
    ((*SIMULATE, "--method", "verlet", "--tolerance", "1e-12"), "1e-12"),
    ((*SIMULATE, "--method", "exact"), "exact"),
    ((*SIMULATE, "--seconds", "1e9"), "steps"),
    ((*SIMULATE, "--seconds", "0.001"), "steps"),
    ((*SIMULATE, "--dt", "1e-200", "--seconds", "1e-199"), "1e-200"),
    (("trade", "--seeds", "0"), "--seeds"),
    (("trade", "--seconds", "-1"), "--seconds"),
    (("trade", "--seconds", "1"), "--seconds"),
]


@pytest.mark.parametrize(("line", "words"), LINES, ids=str)
def test_what_cannot_be_is_one_line(cli: Cli, data: Path, tmp_path: Path, line: tuple[str, ...], words: str) -> None:
    """It is said before anything is written."""
    scene, out = tmp_path / "bench.toml", tmp_path / "run.h5"
    scene.write_text(MIXED)
    places = {"SCENE": str(scene), "OUT": str(out)}
    done = cli(*(places.get(word, word.replace("DATA", str(data))) for word in line))
    assert (done.code, done.out) == (2, "")
    assert words in done.complaint
    assert list(tmp_path.iterdir()) == [scene]
