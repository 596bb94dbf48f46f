"""Run files that were changed, and what is no file at all: one line of refusal at once, never a wrong number."""

import os
import shutil
import socket
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from springmass import sample_data
from springmass.cli import main

SECONDS = 10
DISTANCE, TIME, QUALITY = (f"/entry/signal/{name}" for name in ("distance", "time", "quality"))
HEADER, ORIGINALS = "/entry/provenance/header", "/wire/bytes"
Within = Callable[[int], AbstractContextManager[None]]
Harm = Callable[[Any, Path], object]


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run file as `convert` makes it."""
    path = tmp_path_factory.mktemp("sound") / "run.h5"
    assert main(["convert", str(sample_data() / "undamped_simulated_position.txt"), str(path)]) == 0
    return path


def names_of(file: Any, name: str) -> list[str]:
    """Return every name of an array: other programs find the columns at the top of the file as well."""
    return [name, *(each for each in file if file[each] == file[name])]


def taken(file: Any, name: str) -> list[str]:
    """Take an array away; return every name that it had."""
    names = names_of(file, name)
    for each in names:
        del file[each]
    return names


def put(name: str, make: Callable[[Any], Any]) -> Harm:
    """Return a function that puts another array in place of one, made of it; its attributes stay."""

    def harm(file: Any, _: Path) -> None:
        values, attributes, names = file[name][()], dict(file[name].attrs), taken(file, name)
        made = file.create_dataset(name, data=make(values), fletcher32=values.ndim > 0 or None)
        made.attrs.update(attributes)
        for each in names[1:]:
            file[each] = made

    return harm


def edited(values: Any) -> Any:
    """Return an array of which one value is off by a little."""
    values = values.copy()
    values[values.size // 2] += values.dtype.type(1e-6 if values.dtype.kind == "f" else 1)
    return values


def linked(name: str, *, elsewhere: bool) -> Harm:
    """Return a function that puts a link in place of a name, to the same content in this file or in another."""

    def harm(file: Any, folder: Path) -> None:
        with h5py.File(folder / "elsewhere.h5", "w") as second:
            file.copy(name, second, "x")
        aside = (names_of(file, name)[1:] or ["aside"])[0]
        if aside == "aside":
            file[aside] = file[name]
        del file[name]
        second = h5py.ExternalLink(str(folder / "elsewhere.h5"), "/x")
        file[name] = second if elsewhere else h5py.SoftLink(f"/{aside}")

    return harm


def outside(file: Any, folder: Path) -> None:
    """Have the distances stand in a file next to this one."""
    values, names = file[DISTANCE][:], taken(file, DISTANCE)
    (folder / "raw").write_bytes(values.tobytes())
    file.create_dataset(DISTANCE, values.shape, "<f8", external=[(str(folder / "raw"), 0, h5py.h5f.UNLIMITED)])
    file[names[1]] = file[DISTANCE]


def zeroed(file: Any, _: Path) -> None:
    """Have the disk lose a chunk of the distances: zeros have the checksum zero."""
    chunk = file[DISTANCE].id.get_chunk_info(0)
    file[DISTANCE].id.write_direct_chunk(chunk.chunk_offset, bytes(chunk.size))


def without(name: str) -> Harm:
    """Return a function that takes a name away."""
    return lambda file, _: taken(file, name)


def huge(file: Any, _: Path) -> None:
    """Have a small file state more distances than the memory holds."""
    names = taken(file, DISTANCE)
    file[names[1]] = file.create_dataset(DISTANCE, (2**40,), "<f8", chunks=(65536,), compression="gzip")


HARM: dict[str, Harm] = {
    "a distance": put(DISTANCE, edited),
    "a soft link to the distances": linked(DISTANCE, elsewhere=False),
    "an external link to the distances": linked(DISTANCE, elsewhere=True),
    "a time": put(TIME, edited),
    "a flag": put(QUALITY, edited),
    "the distances backwards": put(DISTANCE, lambda values: values[::-1].copy()),
    "distances of another type": put(DISTANCE, lambda values: values.astype("<f4")),
    "one distance less": put(DISTANCE, lambda values: values[:-1]),
    "distances in two rows": put(DISTANCE, lambda values: values.reshape(2, -1)),
    "distances that are words": put(DISTANCE, lambda values: values.astype("S8")),
    "no distances": without(DISTANCE),
    "a lost chunk of distances": zeroed,
    "no signal": without("/entry/signal"),
    "no header": without(HEADER),
    "an empty header": put(HEADER, lambda _: np.bytes_(b"")),
    "a header that is no JSON": put(HEADER, lambda _: np.bytes_(b"[" * 100_000)),
    "another title in the header": put(HEADER, lambda text: np.bytes_(bytes(text).replace(b'"title":', b'"titel":'))),
    "a soft link to the header": linked(HEADER, elsewhere=False),
    "an external link to the header": linked(HEADER, elsewhere=True),
    "distances in another file": outside,
    "an external link to the signal": linked("/entry/signal", elsewhere=True),
    "more distances than the memory holds": huge,
    "a byte of the original": put(ORIGINALS, edited),
}


@pytest.mark.parametrize("name", HARM)
def test_a_changed_run_file_is_refused_in_one_line(
    sound: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], answer_within: Within, name: str
) -> None:
    """Values, links, forms and the header: exit code 3 and a line with the file's name; nothing is written."""
    path = tmp_path / "run.h5"
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        HARM[name](file, tmp_path)
    capsys.readouterr()
    command = ["convert", str(path), str(tmp_path / "out.txt")] if "original" in name else ["analyse", str(path)]
    with answer_within(SECONDS):
        assert main([*command, *(["--json"] if command[0] == "analyse" else [])]) == 3
    output = capsys.readouterr()
    (line,) = output.err.splitlines()
    assert line.startswith(f"springmass: {path}: ")
    assert line.isprintable()
    assert not output.out
    assert not (tmp_path / "out.txt").exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "directory"])
def test_what_is_no_regular_file_is_refused_at_once(
    sound: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], answer_within: Within, kind: str
) -> None:
    """Run files, logs, recordings and scenes alike: one line that names it, and no waiting."""
    path = tmp_path / "thing"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(path))
    elif kind == "device":
        path = Path("/dev/zero")
    else:
        path.mkdir()
    capsys.readouterr()
    for command in (
        ["analyse", path, "--json"],
        ["convert", path, tmp_path / "out.h5"],
        ["recover", path],
        ["analyse", sound, "--json", "--scene", path],
        ["simulate", "--scene", path],
        ["batch", "--runs", path, "-o", tmp_path / "course"],
    ):
        with answer_within(SECONDS):
            assert main([str(word) for word in command]) in (2, 3), command
        (line,) = capsys.readouterr().err.splitlines()
        assert str(path) in line
