"""What an author may get wrong is found, in one line that says what to do."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquisition.recordings.reading import ReadOptions
from springmass import extend
from springmass.extend import FramedDecoder, LineSplitter, OneStep, Reading, Sensor, acceleration, make_law
from springmass.testing import File, check
from tests.plugin import bench_extras as right


def height_log(t: Any, x: Any) -> bytes:
    """Write a height log."""
    rows = (f"{i};{at:.2f}".replace("nan", "NaN") for i, at in enumerate(1000 * x))
    return "\n".join(["Height log, 100 Hz", *rows]).encode()


def failures(*arguments: Any, **options: Any) -> list[str]:
    """Return the lines of the failure."""
    with pytest.raises(AssertionError) as caught:
        check(*arguments, **options)
    return str(caught.value).splitlines()


class Careless(FramedDecoder):
    """Takes any digits, counts nothing, and gives 0 m for no target."""

    def __init__(self) -> None:
        super().__init__(LineSplitter(b"\n", 32, {"garbage_bytes": 0, "bad_frame": 0}))

    def reading(self, host_ns: int, frame: bytes) -> Reading | None:
        """Return a distance."""
        return Reading(host_ns, distance_m=int(frame) / 1000)


SENSORS: dict[str, tuple[Sensor, dict[str, Any]]] = {
    "Reading of NaN for no target": (replace(right.PLAIN_MILLIMETRES, decoder=Careless), {}),
    "handle what raises ValueError": (replace(right.PLAIN_MILLIMETRES, decoder=Careless), {}),
    "half of resolution_m": (replace(right.PLAIN_MILLIMETRES, resolution_m=1e-5), {}),
    "let a flip of": (right.PLAIN_MILLIMETRES, {"checksum": True}),
    "leave has_device_time out": (replace(right.PLAIN_MILLIMETRES, has_device_time=True), {}),
    "give the Sensor an encoder": (replace(right.PLAIN_MILLIMETRES, encoder=None), {}),
}


@pytest.mark.parametrize("message", SENSORS)
def test_a_sensor(message: str) -> None:
    """A decoder that raises or takes nothing for 0 m, a wrong resolution, and promises that do not hold."""
    family, options = SENSORS[message]
    lines = failures(family, **options)
    assert any(message in line for line in lines)
    assert all(line.startswith("sensor plain-millimetres: ") for line in lines)


def test_a_frame_of_the_data_sheet() -> None:
    """It is not what the decoder makes of it."""
    assert failures(right.PLAIN_MILLIMETRES, (b"0253\n", 0.254)) == [
        "sensor plain-millimetres: read the frame b'0253\\n' as 0.254 m, got [0.253]"
    ]


class InCentimetres:
    """A height log, read by someone who takes its numbers for centimetres and drops its last row."""

    name, title = "height-log", "a height log"

    def recognises(self, head: bytes) -> bool:
        """Take any text."""
        return head.isascii()

    def read(self, path: str, data: bytes, reading: ReadOptions) -> Any:
        """Return ten times the distances."""
        found = right.HEIGHT_LOG.read(path, data, reading)
        return replace(found, samples=replace(found.samples, distance=10 * found.samples.distance), originals=())


def test_a_format() -> None:
    """A wrong unit, an original that is lost, and a format that claims everything."""
    lines = failures(InCentimetres(), File(height_log, quantum_m=1e-5))
    for message in ("return the distances of the file in m", "return False from recognises"):
        assert any(message in line for line in lines)


LAWS: dict[str, Callable[[], Any]] = {
    "exponents of its Unit": lambda: make_law("mine", right.falling, {"d": (-1, -1)}, right.first_guess),
    "begin at A0": lambda: make_law(
        "mine", lambda t, A0, d: right.falling(t + 1, A0, d), {"d": (-1 / 2, -1)}, right.first_guess
    ),
    "let the amplitude fall by": lambda: make_law(
        "mine", lambda t, A0, d: A0 * np.exp(-d * t**2), {"d": (0, -2)}, lambda _, a: (a[0], 1e-4)
    ),
    "a law of yours needs a new name": lambda: make_law("power", right.falling, {"d": (-1 / 2, -1)}, right.first_guess),
    "guess values from which": lambda: make_law("mine", right.falling, {"d": (-1 / 2, -1)}, lambda *_: (1e9, 1e9)),
}


@pytest.mark.parametrize("message", LAWS)
def test_a_law(message: str) -> None:
    """A wrong unit, a start beside A0, a rate that depends on the time, a taken name, and no guess."""
    assert any(message in line for line in failures(LAWS[message](), {"A0": 0.05, "d": 0.2}))


def test_an_integrator() -> None:
    """An order that it does not have, and energy for a bob at rest."""

    def leaping(equation: Any, h: float) -> Any:
        a = acceleration(equation)
        return lambda y, v: (y + h * v + 1e-9, v + h * a(y, v))

    lines = failures(OneStep("leaping", "leaping", 2, leaping))
    assert any("state the order of its error" in line for line in lines)
    assert any("leave a bob at rest" in line for line in lines)


def test_what_is_no_extension_is_refused() -> None:
    """As is a law or a format without an example, or an example without a coefficient."""
    with pytest.raises(TypeError, match="expected a Sensor, Format, Law or Integrator, got 3"):
        check(3)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="give an example"):
        check(right.THREE_HALVES)
    with pytest.raises(AssertionError, match="a number for d"):
        check(right.THREE_HALVES, {"A0": 0.05})


@pytest.mark.parametrize(("earlier", "name"), [("Family", "Sensor"), ("Trap", "FormatIssue")])
def test_an_earlier_name_is_imported_with_a_warning(earlier: str, name: str) -> None:
    """A package written for 0.3 gets the class itself, and the name that it has now."""
    with pytest.warns(DeprecationWarning, match=name):
        found = getattr(extend, earlier)
    assert found is getattr(extend, name)
