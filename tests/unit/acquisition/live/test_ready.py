"""Waiting on descriptors: the same over epoll and over what other systems have."""

from __future__ import annotations

import contextlib
import os
import selectors
from collections.abc import Iterator

import pytest

from acquisition.live.ready import Ready

KINDS = ["EpollSelector", "PollSelector", "SelectSelector"]


@pytest.fixture(params=[kind for kind in KINDS if hasattr(selectors, kind)])
def ready(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ready[str]]:
    """Give one that rests on each of the selectors that this system has."""
    monkeypatch.setattr(selectors, "DefaultSelector", getattr(selectors, request.param))
    with contextlib.closing(Ready[str]()) as made:
        yield made


@pytest.fixture
def pipes() -> Iterator[list[tuple[int, int]]]:
    """Give three pipes, each with its reading and its writing end."""
    made = [os.pipe() for _ in range(3)]
    yield made
    for ends in made:
        for end in ends:
            os.close(end)


def test_only_what_has_something_is_ready(ready: Ready[str], pipes: list[tuple[int, int]]) -> None:
    """All that were written to come at once, each with its value, and again until they are read."""
    for name, (read_end, _) in zip("abc", pipes, strict=True):
        ready.add(read_end, name)
    assert ready.wait(0.0) == []
    os.write(pipes[2][1], b"x")
    os.write(pipes[0][1], b"y")
    expected = {(pipes[0][0], "a"), (pipes[2][0], "c")}
    assert set(ready.wait(None)) == set(ready.wait(5.0)) == expected
    os.read(pipes[2][0], 9)
    assert ready.wait(None) == [(pipes[0][0], "a")]


def test_what_was_removed_is_waited_on_no_more(ready: Ready[str], pipes: list[tuple[int, int]]) -> None:
    """Added again it comes with its new value."""
    (read_end, write_end), *_ = pipes
    ready.add(read_end, "old")
    os.write(write_end, b"x")
    ready.remove(read_end)
    assert ready.wait(0.0) == []
    ready.add(read_end, "new")
    assert ready.wait(None) == [(read_end, "new")]


def test_the_end_of_a_stream_is_something_to_read(ready: Ready[str]) -> None:
    """A pipe whose other end was closed is ready: reading it tells that it ended."""
    read_end, write_end = os.pipe()
    ready.add(read_end, "ended")
    os.close(write_end)
    assert ready.wait(None) == [(read_end, "ended")]
    assert os.read(read_end, 9) == b""
    os.close(read_end)


def test_nothing_stays_open() -> None:
    """All descriptors that waiting took are given back."""
    before = os.listdir("/dev/fd")
    for _ in range(5):
        Ready[str]().close()
    assert len(os.listdir("/dev/fd")) == len(before)
