"""What real files of each family do that a careless reader takes at face value, one by one."""

import io
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from acquisition.block import F8
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.identify import get_format, open_recording
from acquisition.recordings.reading import ReadOptions
from acquisition.recordings.recording import Recording
from tests.sampling import sampled

HEAD = ["LabVIEW Measurement", "Writer_Version\t2", "Separator\tTab", "Decimal_Separator\t.", "X_Columns\tOne"]
END = "***End_of_Header***"


def segment(names: str, *facts: str, channels: int = 1) -> list[str]:
    """Return the header of one segment of an LVM file."""
    return [f"Channels\t{channels}", *facts, END, names]


def lvm(*lines: str, mark: str = "\t", encoding: str = "utf-8", **options: str) -> Recording:
    """Read an LVM file of these lines; a unit is said unless told otherwise."""
    data = "\r\n".join(lines).replace("\t", mark).encode(encoding)
    return get_format("lvm").read("run.lvm", data, ReadOptions.of({"unit": "m", **options}))


def codes(recording: Recording) -> set[str]:
    """Return what was seen."""
    return {trap.code for trap in recording.traps}


@pytest.mark.parametrize(("declared", "present"), [(8192, 16384), (1_050_000, 3941)])
def test_lvm_keeps_all_rows_whatever_the_header_declares(declared: int, present: int) -> None:
    """More or fewer rows than ``Samples`` are kept, and it is said."""
    rows = [f"{i * 0.01:.2f}\t{i % 7}.5" for i in range(present)]
    head = segment("X_Value\tPosition", f"Samples\t{declared}", "X0\t0", "Delta_X\t0.01")
    recording = lvm(*HEAD, "Multi_Headings\tNo", END, *head, *rows)
    assert len(recording.samples) == present
    stale = [trap for trap in recording.traps if trap.code == "stale_header"]
    assert [trap.count for trap in stale] == [abs(declared - present)]


def test_lvm_believes_the_column_where_the_header_went_stale() -> None:
    """Rows 5 ms apart under a header that says 19.5 us are 5 ms apart, and it is said."""
    rows = [f"{i * 0.005:.6f}\t1.{i % 10}" for i in range(400)]
    recording = lvm(*HEAD, END, *segment("X_Value\tPosition", "X0\t0", "Delta_X\t1.95E-5"), *rows)
    assert recording.info.rate_hz == 200
    assert "stale_header" in codes(recording)


def test_lvm_takes_the_formula_where_the_column_is_rounded_from_it() -> None:
    """Steps printed as 19 and 20 us are 19.53125 us, as the header says."""
    step = 1.953125e-5
    printed = [f"{i * step:.6f}" for i in range(300)]
    assert {round((float(b) - float(a)) * 1e6) for a, b in pairwise(printed)} == {19, 20}
    head = segment("X_Value\tPosition", "X0\t0.0", "Delta_X\t1.953125E-5")
    recording = lvm(*HEAD, END, *head, *(f"{t}\t1.5" for t in printed))
    assert recording.info.rate_hz == 51200
    np.testing.assert_allclose(recording.samples.t, np.arange(300) * step, rtol=1e-15)
    assert "stale_header" not in codes(recording)


@pytest.mark.parametrize("mark", ["|", ";", ","])
def test_lvm_is_separated_by_whatever_follows_the_tag(mark: str) -> None:
    """``Separator`` may name any character, and separators at the end of a row make no cell."""
    head = [*HEAD[:2], "Separator\tOwn", *HEAD[4:]]
    rows = ["0.00\t1.5\t", "0.01\t1.6\t\t", "0.02\t1.7"]
    recording = lvm(*head, END, *segment("X_Value\tPosition\tComment", "Delta_X\t0.01"), *rows, mark=mark)
    assert recording.samples.distance.tolist() == [1.5, 1.6, 1.7]
    assert recording.malformed_rows == 0


@pytest.mark.parametrize(
    ("date", "start"), [("1903/12/31", ""), ("1904/01/01", ""), ("2023/05/05", "2023-05-05T13:40:37.7")]
)
def test_lvm_of_labviews_zero_has_no_start(date: str, start: str) -> None:
    """A date of 1903 or 1904 is LabVIEW's zero of time."""
    head = segment("X_Value\tPosition", f"Date\t{date}", "Time\t13:40:37.7", "Delta_X\t0.01")
    assert lvm(*HEAD, END, *head, "0.00\t1.5", "0.01\t1.6").start_time == start


def test_tdms_is_scaled_and_placed_as_its_properties_say() -> None:
    """wf_start_offset and wf_increment make the times; a linear scaling makes the values."""
    from nptdms import ChannelObject, TdmsWriter
    from nptdms.types import Uint32

    scaling = {
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5,
        "NI_Scale[0]_Linear_Y_Intercept": 2.0,
        "NI_Scale[0]_Linear_Input_Source": Uint32(0xFFFFFFFF),  # the raw values
    }
    timing = {"wf_increment": 0.02, "wf_start_offset": 1.5, "wf_samples": 4, "unit_string": "m"}
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("G", "x", np.array([0.0, 2.0, 4.0, 6.0]), {**timing, **scaling})])
    recording = get_format("tdms").read("run.tdms", file.getvalue())
    assert recording.samples.distance.tolist() == [2.0, 3.0, 4.0, 5.0]
    np.testing.assert_allclose(recording.samples.t, [1.5, 1.52, 1.54, 1.56], rtol=1e-12)


def test_capstone_decides_decimal_mark_and_exponent_cell_by_cell() -> None:
    """``-8,90E-4`` and a stray ``0.12`` stand in one column of a file with commas."""
    cells = ["0,10", "-8,90E-4", "0.12", "1,3E-1", "0,14"]
    rows = "\r\n".join(f"{i / 100:.2f};{cell}".replace(".", ",", 1) for i, cell in enumerate(cells))
    data = f'\ufeff"Time (s) Run #1";"Position (m) Run #1"\r\n{rows}'.encode()
    recording = get_format("capstone").read("run.csv", data)
    assert recording.samples.distance.tolist() == [0.10, -8.90e-4, 0.12, 0.13, 0.14]


TRUE = 0.01 * np.arange(3000)


def polled(interval_s: float, apart_s: float = 1e-4) -> F8:
    """Stamps of a computer that asks every so often, up to 2 ms late, and reads all that is waiting."""
    burst = np.floor(TRUE / interval_s).astype(np.int64)
    late = 0.002 * np.random.default_rng(4).random(burst[-1] + 1)
    within = np.arange(TRUE.size) - np.searchsorted(burst, burst)
    return np.asarray((burst + 1) * interval_s + late[burst] + apart_s * within)


def written(folder: Path, t: F8, decimals: int) -> Path:
    """Return a recording with these times."""
    path = folder / "times.csv"
    y = 0.4 + 0.03 * np.cos(9.52 * np.arange(t.size) * 0.01)
    rows = (f"{a:.{decimals}f},{b:.5f}" for a, b in zip(t, y, strict=True))
    path.write_text("\n".join(["time (s),distance (m)", *rows, ""]), encoding="utf-8")
    return path


@pytest.mark.parametrize("decimals", [6, 3])
@pytest.mark.parametrize("interval_s", sampled([0.1, 0.035, 0.05, 0.04, 0.16]))
def test_bursts_are_spread_evenly(tmp_path: Path, interval_s: float, decimals: int) -> None:
    """The rate is right to the lateness of the stamps over 30 s, and every sample is kept; a finding says so."""
    found = open_recording(written(tmp_path, polled(interval_s), decimals))
    t = found.samples.t
    assert found.info.rate_hz == pytest.approx(100.0, rel=1e-4)
    assert np.diff(t) == pytest.approx(np.full(2999, 0.01), rel=1e-3)
    assert not found.samples.flags.any()
    assert [trap.code for trap in found.traps if trap.code in ("times_in_bursts", "nominal_clock")] == [
        "times_in_bursts"
    ]


def test_bursts_with_missing_samples_are_asked_about(tmp_path: Path) -> None:
    """Where half a second is missing nobody knows which samples: the rate must be given."""
    t = np.delete(polled(0.05), np.s_[1000:1050])
    path = written(tmp_path, t, 6)
    with pytest.raises(NeedsAnswer):
        open_recording(path)
    assert open_recording(path, ReadOptions(rate_hz=100.0)).info.rate_hz == 100.0


@pytest.mark.parametrize(
    "t",
    [TRUE, TRUE + 0.003 * np.random.default_rng(1).random(TRUE.size), np.delete(TRUE, np.s_[500:1500])],
    ids=["even", "late", "gap"],
)
def test_other_times_are_no_bursts(tmp_path: Path, t: F8) -> None:
    """Even times, late times and a gap are not spread."""
    found = open_recording(written(tmp_path, t, 6))
    assert "times_in_bursts" not in {trap.code for trap in found.traps}
    np.testing.assert_allclose(found.samples.t, t, rtol=0, atol=1e-6)


_VALUES = 1500 + 700 * np.cos(np.arange(200) * 0.1)


def _printed(value: float, group: str, point: str) -> str:
    return f"{value:,.1f}".replace(",", "\0").replace(".", point).replace("\0", group)


@pytest.mark.parametrize(
    ("group", "point"), [(",", "."), (".", ","), (" ", ","), ("'", "."), ("\xa0", ","), ("\u202f", ",")]
)
@pytest.mark.parametrize("heading", sampled(["Zeit (s);Weg (mm)\n", "", "t;x\n"]))
def test_marks_of_thousands_are_refused(tmp_path: Path, group: str, point: str, heading: str) -> None:
    """No way to set thousands apart gives numbers, whichever family reads them."""
    path = tmp_path / "run.csv"
    times = [f"{i / 100:.2f}".replace(".", point) for i in range(_VALUES.size)]
    rows = (f"{t};{_printed(x, group, point)}\n" for t, x in zip(times, _VALUES, strict=True))
    path.write_text(heading + "".join(rows), encoding="utf-8")
    with pytest.raises(FormatError):
        open_recording(path, ReadOptions(unit=None if "(" in heading else "mm"))


def test_thousands_in_quotes_are_refused_next_to_separating_commas(tmp_path: Path) -> None:
    """Excel writes 1328 mm as "1,328" between quotes: read as a decimal it would be a thousand times too small."""
    path = tmp_path / "run.csv"
    path.write_text("t (s),x (mm)\n" + "".join(f'{i / 50:.2f},"{x:,.0f}"\n' for i, x in enumerate(_VALUES)))
    with pytest.raises(FormatError):
        open_recording(path)


def test_a_comma_that_may_be_either_in_all_numbers_is_decimal_and_reported(tmp_path: Path) -> None:
    """Where semicolons separate and no other mark stands in the file."""
    path = tmp_path / "run.csv"
    path.write_text("".join(f"{i};1,{501 + i}\n" for i in range(40)), encoding="utf-8")
    recording = open_recording(path, ReadOptions(unit="m", rate_hz=20.0))
    np.testing.assert_allclose(recording.samples.distance, 1.501 + 1e-3 * np.arange(40))
    assert "decimal_comma" in {trap.code for trap in recording.traps}
