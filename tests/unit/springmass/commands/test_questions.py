"""A question is worded for who asked: the call in Python, or the command line with what was given already."""

import shlex
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import springmass as sm
from acquisition.errors import NeedsAnswer
from springmass.api.questions import as_arguments
from springmass.commands.questions import option_words, quoted

ROWS = "t,x,y\n" + "".join(f"{i / 20},{0.5 + i % 4},{0.25 + i % 3}\n" for i in range(60))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a table whose channel and unit must be named."""
    file = tmp_path / "run.csv"
    file.write_text(ROWS, encoding="utf-8")
    return file


@pytest.mark.parametrize("name", ["load", "analyse"])
def test_python_is_answered_with_the_call_that_reads_the_file(path: Path, name: str) -> None:
    """The message ends in the function that was called, with the arguments given and those that are missing."""
    with pytest.raises(NeedsAnswer) as caught:
        getattr(sm, name)(path, unit="cm")
    call = f'springmass.{name}("{path}", unit="cm", channel="x")'
    assert str(caught.value).endswith(f"? {call}")
    assert eval(call.replace("analyse", "load"), {"springmass": sm}).loaded.channel == "x"


def test_an_answer_that_fits_nothing_is_not_repeated(path: Path) -> None:
    """The call that is suggested holds the channel once, and it is one of the file."""
    with pytest.raises(NeedsAnswer) as caught:
        sm.load(path, channel="z", unit="m")
    assert str(caught.value).endswith(f'springmass.load("{path}", unit="m", channel="x")')


@given(st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1))
def test_any_name_survives_the_shell_and_python(name: str) -> None:
    """What is suggested is taken apart to the very name, whatever signs are in it."""
    words = shlex.split(" ".join(map(quoted, option_words({"channel": name}))))
    assert words in (["--channel", name], [f"--channel={name}"])
    assert eval(f"dict({as_arguments({'channel': name})})") == {"channel": name}
