"""Linear algebra keeps to one thread inside an analysis, and only there."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from pipeline.analyse import analyse
from pipeline.damping.laws.of_function import make_law
from pipeline.numerics.threads import one_thread
from pipeline.options import Options
from pipeline.track import Track

T = np.arange(1000) / 100.0
Y = 0.2 + 0.05 * np.cos(8.3 * T) + 3e-4 * np.random.default_rng(1).standard_normal(T.size)


def pools() -> set[int]:
    """Return the numbers of threads of the linear algebra libraries that are loaded."""
    found = [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]
    assert len(found) >= 2  # numpy's and scipy's
    return set(found)


@pytest.fixture
def two_threads() -> Iterator[None]:
    """Give linear algebra two threads, whatever the environment says."""
    with one_thread:
        pass  # loads scipy's library too
    before = threadpool_limits(2, user_api="blas")
    with threadpool_limits():
        pass  # leaves it to other threads to set the number
    yield
    before.restore_original_limits()


@pytest.mark.usefixtures("two_threads")
def test_an_analysis_runs_on_one_thread() -> None:
    """The pool has one thread while a law of the user is fitted, and the two it had before afterwards."""
    seen: list[set[int]] = []

    def falling(t: np.ndarray, start: float, d: float) -> np.ndarray:
        if not seen:  # looking takes a while
            seen.append(pools())
        return start * np.exp(-d * t)

    law = make_law("own", falling, {"d": (0, -1)}, lambda _, a: (a[0], 0.01))
    seen.clear()
    analyse(Track.from_arrays(T, Y), options=Options(laws=(law,)))
    assert seen == [{1}]
    assert pools() == {2}


@pytest.mark.usefixtures("two_threads")
def test_the_last_analysis_to_end_puts_the_pool_back() -> None:
    """Of two analyses side by side, the first to end does not free the other's pool, and the last restores it."""
    begun, may_end = threading.Event(), threading.Event()

    @one_thread
    def other() -> None:
        begun.set()
        may_end.wait()

    thread = threading.Thread(target=other)
    with one_thread:
        thread.start()
        begun.wait()
    assert pools() == {1}
    may_end.set()
    thread.join()
    assert pools() == {2}
