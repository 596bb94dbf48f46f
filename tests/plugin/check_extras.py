"""The tests of the package; they need springmass and nothing else, and run as a program or by pytest."""

import math

import bench_extras

from springmass.testing import check


def height_log(t, x) -> bytes:
    """Write a height log of these times (s) and distances (m)."""
    rows = (f"{i};{height * 1000:.2f}".replace("nan", "NaN") for i, height in enumerate(x))
    return "\n".join(["Height log, 100 Hz", *rows]).encode()


def test_all() -> None:
    """What the package adds keeps the rules of its kind."""
    check(bench_extras.PLAIN_MILLIMETRES, (b"0253\n", 0.253), (b"0000\n", math.nan))
    check(bench_extras.HEIGHT_LOG, height_log)
    check(bench_extras.THREE_HALVES, {"A0": 0.05, "d": 0.2}, {"A0": 0.002, "d": 3.0})
    check(bench_extras.MIDPOINT)


if __name__ == "__main__":
    test_all()
