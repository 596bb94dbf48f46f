"""Readers under damaged files of the conformance suite: refused in one line or read truly."""

import re
from itertools import pairwise
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import FormatError
from acquisition.recordings.identify import formats, get_format
from acquisition.recordings.reading import ReadOptions
from acquisition.recordings.recording import Recording
from tests.conformance.test_formats import CASES

NAMES = sorted(each.name for each in formats())
SHORT = np.arange(40) / 100.0


SEEDS = [(case, case.build(SHORT, np.round(0.2 + 0.05 * np.sin(7.9 * SHORT), 5))) for case in CASES]


def read(name: str, data: bytes, options: dict[str, Any]) -> Recording | str:
    """Return the recording, or the message of the refusal."""
    try:
        return get_format(name).read("run.dat", data, ReadOptions.of(options))
    except FormatError as error:
        return str(error)


NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?", re.ASCII)


def number(cell: str) -> float:
    """Return the number that a cell is, with a point or a comma; NaN for any other text."""
    cell = cell.strip(' "\0\x1a')
    return float(cell.replace(",", ".")) if NUMBER.fullmatch(cell) else np.nan


def lines_of(data: bytes) -> list[str]:
    """Return the lines of a text in any encoding whose digits are those of ASCII, UTF-16 among them."""
    return re.split(r"\r\n|\r|\n", data.replace(b"\0", b"").decode("latin-1"))


def printed(data: bytes) -> np.ndarray:
    """Return every number that stands in a text, sorted, with the decimal mark read either way and thousands apart."""
    text = "\n".join([*lines_of(data), data.decode("latin-1")])
    cells = {cell for marks in (r"[;\t\s<>]+", r"[,;\t\s<>]+") for cell in re.split(marks, text)}
    cells |= {cell.replace(mark, "") for cell in cells for mark in "',."}
    found = np.array([number(cell) for cell in cells])
    return np.unique(found[np.isfinite(found)])  # a NaN among them would spoil the order that is searched


def demand_printed_pairs(recording: Recording, data: bytes, sound: np.ndarray) -> None:
    """Demand that each sound value of MotionSensor.vi stands in a line of the file behind its time."""
    pairs = []
    for line in lines_of(data):
        cells = [number(cell) for cell in (*re.findall(r"[^\t ;]+", line), *line.split(","))]
        pairs += [pair for pair in pairwise(cells) if np.isfinite(pair).all()]
    known = np.array(pairs, float).reshape(-1, 2)
    samples = recording.samples
    stated = samples.distance if recording.channel == "distance" else samples.velocity
    assert stated is not None
    for t, value in zip(samples.t[sound], stated[sound], strict=True):
        at = np.abs(known[:, 0] - t) <= 0.00051
        # If most times of a file have fewer digits, the others are placed to that many digits only.
        for digits in range(3):
            at |= np.abs(np.round(known[:, 0], digits) - t) <= 1e-9 * (1 + abs(t))
        assert not np.isfinite(value) or (np.abs(known[at, 1] / 100 - value) <= 1e-12 * (1 + abs(value))).any()


def check(name: str, data: bytes, options: dict[str, Any]) -> Recording | str:
    """Read; hold a recording to its promises, and its values to what is printed."""
    recording = read(name, data, options)
    if isinstance(recording, str):
        assert "\n" not in recording
        return recording
    samples = recording.samples
    assert samples.t.size == samples.distance.size == samples.flags.size
    assert recording.originals[0].data == data
    assert recording.info.rate_hz > 0
    sound = (samples.flags & ~np.uint8(64)) == 0
    assert (np.diff(samples.t[sound]) > 0).all()
    values = samples.distance[sound] if recording.channel != "velocity" else np.empty(0)
    if name in ("arrays", "wav", "tdms", "phyphox", "workbook", "zip", "tracker") or not values.size:
        return recording
    if name == "motion-sensor":
        demand_printed_pairs(recording, data, sound)
    assert np.isfinite(values).all()
    known = printed(data)
    for scale in (1.0, 100.0, 1000.0, 1e6):
        near = known[np.clip(np.searchsorted(known, values * scale), 0, known.size - 1)]
        below = known[np.clip(np.searchsorted(known, values * scale) - 1, 0, known.size - 1)]
        apart = np.minimum(np.abs(near - values * scale), np.abs(below - values * scale))
        if (apart <= 1e-9 * (1 + np.abs(values * scale))).all():
            return recording
    raise AssertionError(f"{name}: a distance stands nowhere in the file: {values[:5]}")


def spoil(data: bytes, faults: list[tuple[str, float, bytes]]) -> bytes:
    """Do faults to a file: what, where as a share of it, and with what."""
    out = bytearray(data)
    for kind, where, what in faults:
        at = int(where * len(out))
        if kind == "insert" or not out:
            out[at:at] = what
        elif kind == "flip":
            out[at] ^= 1 << what[0] % 8
        elif kind == "digit":
            out[at] = 48 + what[0] % 10
        elif kind == "drop":
            del out[at : at + len(what)]
        elif kind == "repeat":
            out[at:at] = out[at : at + 4 * len(what)]
        elif kind == "comma":
            out = out.replace(b".", b",", what[0])
        elif kind == "lines":
            out = out.replace(b"\n", b"\r", what[0])
        else:
            del out[at:]
    return bytes(out)


KINDS = ["insert", "flip", "digit", "drop", "repeat", "comma", "lines", "cut"]
TOKENS = b'\t ; , \n \r\n NaN - 1e5 E-3 0 12.5 " \0 \xff Run#2'.split(b" ")


@st.composite
def spoiled(draw: st.DrawFn) -> tuple[Any, bytes]:
    """Draw a file and damage it a few times."""
    case, data = draw(st.sampled_from(SEEDS))
    what = st.one_of(st.sampled_from(TOKENS), st.binary(min_size=1, max_size=9))
    fault = st.tuples(st.sampled_from(KINDS), st.floats(0, 1, exclude_max=True), what)
    return case, spoil(data, draw(st.lists(fault, max_size=5)))


@given(drawn=spoiled())
def test_a_spoiled_file_is_refused_in_one_line_or_read_truly(drawn: tuple[Any, bytes]) -> None:
    """Whatever happens to it on the way: no exception, and no sound sample that the file does not print."""
    case, data = drawn
    check(case.format, data, dict(case.options))


ANY = st.one_of(
    st.binary(max_size=300),
    st.text(max_size=120).map(str.encode),
    st.lists(st.sampled_from(TOKENS), max_size=60).map(b"".join),
)


@given(name=st.sampled_from(NAMES), data=ANY, stated=st.booleans())
def test_any_bytes_are_refused_in_one_line_or_read(name: str, data: bytes, stated: bool) -> None:
    """Every reader takes any bytes, and tokens that formats are made of, whether or not it would recognise them."""
    assert get_format(name).recognises(data) in (True, False)
    check(name, data, {} if name == "motion-sensor" else {"unit": "m", **({"rate_hz": 50.0} if stated else {})})


def test_xml_that_would_swell_is_refused() -> None:
    """Entities are not expanded."""
    data = b'<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><phyphox><title>&b;</title></phyphox>'
    assert isinstance(read("phyphox", data, {}), str)
