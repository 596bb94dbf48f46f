"""Lines as sketches print them: the distance that is in them, or what the user is asked."""

import math
from typing import Any

import numpy as np
import pytest

from acquisition.decoders.registry import describe_bytes, get_family
from acquisition.live.decoding import SensorChain
from storage.wire_log.records import SensorEntry
from storage.wire_log.wire_samples import chain_of

READ: list[tuple[str, float]] = [
    ("Distance: 26.9 cm", 0.269),
    ("26.87cm", 0.2687),
    ("Time:0\tDist:26.87", 0.2687),
    ("10.58in, 26.87cm", 0.2687),
    ("10in, 26cm", 0.26),
    ("(19.124,)", 0.19124),
    ("[19.124]", 0.19124),
    ("b'26.9'", 0.269),
    ("t=512 d=27,10", 0.271),
    ("t=512 d=27.10", 0.271),
    ("Ping: 26cm", 0.26),
    ("Range Valid: 269 mm", 0.269),
    ("VL53L0X Range Valid: 269 mm", 0.269),
    ("Distance in CM: 12.5", 0.125),
    ("Distance in Inches: 10", 0.254),
    ("Distance (mm): 269", 0.269),
    ("Dist(cm)=12,5", 0.125),
    ("distanceCm: 26.9", 0.269),
    ("cm=26.9", 0.269),
    ('{"distance": 26.9, "unit": "cm"}', 0.269),
    ('{"distance":269,"unit":"mm"}', 0.269),
    ('{"millis":512,"distance_mm":269}', 0.269),
    ('{"t":512,"d":26.9}', 0.269),
    ("dist:12.3,setpoint:10", 0.123),
    ("setpoint:10 dist:12.3", 0.123),
    ("26.9 cm;max=400cm", 0.269),
    ("Distancia: 26,9 cm", 0.269),
    ("La distancia es: 26 cm", 0.26),
    ("Abstand: 26,9 cm", 0.269),
    ("Entfernung 269 mm", 0.269),
    ("Distância = 26.9 cm", 0.269),
    ("A distância é de 26 centímetros", 0.26),
    ("Hauteur : 26,9 cm", 0.269),
    ("12:34:56.789 -> 26.9 cm", 0.269),
    ("12:34:56.789 -> Distance: 26,9 cm", 0.269),
    ("12:34:56.789 -> 26,87 cm", 0.2687),
    ("2024-05-03T12:34:56.789Z,26.9", 0.269),
    ("Sensor 1: 26.9 cm", 0.269),
    ("Reading 12: 26.9 cm", 0.269),
    ("HC-SR04: 26.9cm", 0.269),
    ("US-100 269 mm", 0.269),
    ("Object detected at 26.9 cm!", 0.269),
    ("The distance is 26.9.", 0.269),
    ("26.9 cm 21.5 C", 0.269),
    ("Humidity: 40 %, Temp: 21.5 C, Distance: 26.9", 0.269),
    ("Echo: 1560 us, Distance: 26.9 cm", 0.269),
    ("velocity: 12 cm/s, distance: 26.9 cm", 0.269),
    ("Range Status: 0 Range: 269 mm", 0.269),
    ("Signal: 3.2 MCPS, Range: 269 mm", 0.269),
    ("0.269 m", 0.269),
    ("out of range", math.nan),
    ("Distance: Out of range (> 400 cm)", math.nan),
    ("65535 TIMEOUT", math.nan),
    ("Distance: -1 cm", math.nan),
    ("Ping: 0cm", math.nan),
]
STATED: list[tuple[dict[str, Any], str, float]] = [
    ({"column": 1, "time": 0, "time_unit": "ms"}, "0;27,10", 0.271),
    ({"time": 0, "time_unit": "ms"}, "512;27,10", 0.271),
    ({"column": 1, "separator": ";"}, "512;26,9", 0.269),
    ({"column": 1}, "512\t26,9", 0.269),
    ({"column": 1}, "512, 26.9 cm", 0.269),
    ({"column": 1}, "Distance: 26.9 cm", 0.269),
    ({"column": 1}, "Range: 269 mm", 0.269),
    ({"column": "Right"}, "Left: 26.9 cm Right: 30.1 cm", 0.301),
    ({"column": "distance"}, "Distance (mm): 269", 0.269),
    ({"separator": "space"}, "26,87 cm", 0.2687),
    ({"unit": "in"}, "10.58in, 26.87cm", 0.268732),
]


@pytest.mark.parametrize(("options", "line", "distance"), [*(({}, *each) for each in READ), *STATED], ids=str)
def test_the_distance_of_a_line_is_read(options: dict[str, Any], line: str, distance: float) -> None:
    """By its name, by its unit, because it is alone, or because its column is stated."""
    data = f"begun before\r\nDistance: 1 m\r\n{line}\r\n".encode() if math.isnan(distance) else f"\n{line}\r\n".encode()
    readings = get_family("text-lines").decoder(**options).feed(0, data)
    np.testing.assert_allclose(readings.distance_m[-1:], [distance], rtol=1e-12)
    assert len(readings) == 1 + math.isnan(distance)


def lines(template: str) -> bytes:
    """Return lines of a sketch in which a clock counts and a distance swings."""
    rows = (template.format(t=50 * i, d=26.0 + 5.0 * math.cos(0.4 * i)) for i in range(40))
    return ("begun\r\n" + "\r\n".join(rows) + "\r\n").encode()


@pytest.mark.parametrize(
    ("template", "distance"),
    [
        ("{t};{d:.2f}", "1"),
        ("{t},{d:.2f}", "1"),
        ("{t} {d:.2f} 21", "1"),
        ("{d:.2f}\t{t}", "0"),
        ("Left: {d:.2f} cm Right: {d:.2f} cm 0", "1"),
    ],
)
def test_lines_of_several_numbers_are_quoted_and_asked_about(template: str, distance: str) -> None:
    """No reading; what is to be typed names a column that does not count."""
    data = lines(template)
    assert len(get_family("text-lines").decoder().feed(0, data)) == 0
    guess = describe_bytes(data)
    assert "\n" not in guess.looks
    options = dict(guess.alternatives[0])
    assert options["column"] == distance
    assert len(get_family("text-lines").decoder(**options).feed(0, data)) == 40


def test_two_groups_of_digits_with_a_comma_are_no_distance_until_it_is_said_what_the_comma_is() -> None:
    """Either option that is offered reads the lines."""
    data = b"\n26,87 cm\n26,07 cm\n"
    offered = describe_bytes(data).alternatives
    read = [get_family("text-lines").decoder(**options).feed(0, data).distance_m.tolist() for options in offered]
    assert read == [pytest.approx([0.2687, 0.2607]), pytest.approx([0.87, 0.07])]


@pytest.mark.parametrize("column", [5, "height"])
def test_a_column_that_is_not_there_is_named_with_those_that_are(column: int | str) -> None:
    """Not as lines that look right."""
    said = describe_bytes(lines("{t};{d:.2f}"), {"column": column}).looks
    assert f"column {column}" in said
    assert "1950" in said


def test_a_lone_number_that_counts_evenly_is_never_a_distance_for_long() -> None:
    """A sketch that prints its clock gives missing samples, and the sensor says why; a swing does not."""
    chain = SensorChain(get_family("text-lines"))
    chain.feed(0, b"\n" + b"".join(b"%d\n" % (i * 5) for i in range(300)))
    last = chain.feed(1, b"".join(b"%d\n" % (1500 + i * 5) for i in range(10)))
    assert np.isnan(last.distance).all()
    assert "counts evenly" in chain.status.complaint
    swing = SensorChain(get_family("text-lines"), options={"unit": "mm"})
    block = swing.feed(0, b"\n" + b"".join(b"%.0f\n" % (260 - 60 * math.cos(0.02 * i)) for i in range(400)))
    assert np.isfinite(block.distance).all()


@pytest.mark.parametrize(
    ("line", "step_m"),
    [("26.90 cm", 1e-4), ("269 mm", 1e-3), ("0.2690 m", 1e-4), ("26,9 cm x", 1e-3), ("10.59 in", 2.54e-4)],
)
def test_the_resolution_is_that_of_the_digits(line: str, step_m: float) -> None:
    """Not one of the family."""
    chain = SensorChain(get_family("text-lines"))
    chain.feed(0, b"\n" + b"".join(f"{line}\n".encode() for _ in range(5)))
    assert chain.info("port").quantum_m == pytest.approx(step_m)


def test_a_log_that_states_no_column_is_read_by_its_first_one() -> None:
    """As earlier versions read it; a log of this version states ``auto``."""
    old, new = SensorEntry(0, "text-lines"), SensorEntry(0, "text-lines", options={"column": "auto"})
    assert chain_of(old).feed(0, b"\n26.9;21.5\n").distance.tolist() == [0.269]
    assert chain_of(new).feed(0, b"\n26.9;21.5\n").distance.size == 0
