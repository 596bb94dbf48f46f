"""Errors have one root and say what to do; messages go to ``logging``."""

import logging
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import springmass as sm

T = np.arange(1000) / 100
RUN = (T, 0.2 + 0.05 * np.cos(8.3 * T))
# Three samples a period, of which clipped crests leave too few.
FEW = 0.066 + 0.0165 * np.cos(13.8 * np.pi * T[:60] * 5.0 + 2.0) + 2e-4 * np.random.default_rng(2).standard_normal(60)
BENCH = sm.Scene(bob_mass_kg=0.2, spring_constant_n_per_m=14.0, start_displacement_m=0.05)
WRONG: dict[str, Callable[[Path], Any]] = {
    "a file that is not there": lambda folder: sm.load(folder / "nothing.txt"),
    "a unit that nobody stated": lambda folder: sm.load(folder / "plain.csv"),
    "a damaged run file": lambda folder: sm.load(folder / "damaged.h5"),
    "a file that exists": lambda folder: sm.load(RUN).save(folder / "plain.csv"),
    "a folder without a course": sm.results,
    "an unknown key of a scene": lambda _: sm.analyse(RUN, {"bob": {"mass_g": 200}}),
    "a scene that is not there": lambda folder: sm.analyse(RUN, folder / "nothing.toml"),
    "a scene that is a number": lambda _: sm.analyse(RUN, 3),  # type: ignore[arg-type]
    "an unstable step": lambda _: sm.simulate(BENCH, T, method="forward-euler"),
    "too few samples": lambda _: sm.analyse((T[:3], T[:3])),
    "crests cut off in every period": lambda _: sm.analyse((5.0 * T[:60], np.minimum(FEW, 0.0792))),
    "times that run backwards": lambda _: sm.analyse((T[::-1], RUN[1])),
    "two times under other names": lambda _: sm.analyse(
        xr.DataArray(RUN[1], {"t": ("row", RUN[0]), "s": ("row", RUN[0])}, ["row"])
    ),
    "no array": lambda _: sm.analyse(3),  # type: ignore[arg-type]
    "a range without samples": lambda _: sm.analyse(RUN, from_s=99.0),
    "no scene for a simulation": lambda _: sm.simulate(None, T),  # type: ignore[arg-type]
    "a stream without samples": lambda _: sm.Stream().finish(),
    "a missing file with a name like a port's": lambda _: sm.source("comparison.txt"),
    "a bench on a port": lambda _: sm.source(BENCH, sensor="maxbotix"),
    "a bench with another scene": lambda _: sm.source(BENCH, scene=BENCH),
    "a recording at a baud rate": lambda folder: sm.source(folder / "plain.csv", unit="m", baud=9600),
    "a port with a unit": lambda _: sm.source("/dev/nothing", unit="m"),
    "a port in slow motion": lambda _: sm.source("/dev/nothing", speed=0.5),
    "an unknown law": lambda _: sm.analyse(RUN, law="cubic"),
}


@pytest.mark.parametrize("name", WRONG)
def test_every_error_has_one_root_and_a_remedy(name: str, tmp_path: Path) -> None:
    """One line, whose remedy stands in it."""
    rows = "".join(f"{t:.2f},{y:.5f}\n" for t, y in zip(*RUN, strict=True))
    (tmp_path / "plain.csv").write_text(f"time,height\n{rows}")
    content = bytearray(sm.load(RUN).save(tmp_path / "damaged.h5").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (tmp_path / "damaged.h5").write_bytes(content)
    with pytest.raises(sm.Error) as caught:
        WRONG[name](tmp_path)
    assert isinstance(caught.value, ValueError)
    assert caught.value.remedy
    assert str(caught.value).endswith(caught.value.remedy)
    assert "\n" not in str(caught.value)


def test_an_unknown_option_names_the_known_ones() -> None:
    """Among them the one that was mistyped."""
    with pytest.raises(TypeError, match=r"'lwa'.*\blaw\b"):
        sm.analyse(RUN, lwa="linear")  # type: ignore[call-arg]
    with pytest.raises(TypeError, match=r"'unitt'.*\bunit\b"):
        sm.source(BENCH, unitt="m")  # type: ignore[call-arg]


def test_messages_go_to_logging(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """A library prints nothing."""
    path = tmp_path / "run.txt"
    shutil.copy(sm.sample_data() / "undamped_simulated_position.txt", path)
    (tmp_path / "run.txt.about.toml").write_text('notes = ["windy"]\n')
    with caplog.at_level(logging.INFO, "springmass"):
        sm.load(path)
    assert "run.txt.about.toml" in caplog.text
    assert capsys.readouterr() == ("", "")
