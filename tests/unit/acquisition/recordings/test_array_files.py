"""Arrays, JSON, sound and text of other programs: a file in, samples out; what is no recording is named."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.identify import open_recording
from acquisition.recordings.reading import ReadOptions
from tests.conformance.test_formats import packed
from tests.unit.acquisition.recordings.test_grammars import T, X, holds

Write = Callable[[Path], None]


def npz(path: Path) -> None:
    """Two arrays, and a number beside them."""
    np.savez_compressed(path, time_s=T, x_cm=X, rate_hz=20.0)


def structured(path: Path) -> None:
    """Records with named fields."""
    rows = np.array(list(zip(T, X, strict=True)), [("time_s", "f8"), ("x_cm", "f8")])
    np.save(path, rows)


def matlab(path: Path) -> None:
    """A structure with columns."""
    scipy.io.savemat(path, {"run": {"time_s": T[:, None], "pos_cm": X[:, None], "name": "a"}})


def hdf5(path: Path, userblock_size: int = 0) -> None:
    """A group with units as attributes; one value is the fill value."""
    with h5py.File(path, "w", userblock_size=userblock_size) as file:
        for name, values, unit in (("time", T, "s"), ("position", X, "cm")):
            file[f"run/{name}"] = values
            file[f"run/{name}"].attrs["units"] = unit


def matlab_7(path: Path) -> None:
    """HDF5 behind 512 bytes of text."""
    hdf5(path, 512)
    content = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + content[512:])


def netcdf(path: Path) -> None:
    """Classic netCDF with packed values."""
    with scipy.io.netcdf_file(path, "w") as file:
        file.createDimension("time", T.size)
        for name, values, unit, form in (("time", T, "s", "d"), ("x", np.rint(1000 * X), "cm", "h")):
            variable = file.createVariable(name, form, ("time",))
            variable[:] = values
            variable.units = unit
        variable.scale_factor = np.array([1e-3])


@pytest.mark.parametrize(
    ("name", "write"),
    [
        *(("a.npz", npz), ("a.npy", structured), ("a.mat", matlab), ("b.mat", matlab_7), ("a.nc", netcdf)),
        *(("a.hdf5", hdf5),),
    ],
)
def test_arrays_of_other_programs_are_read(tmp_path: Path, name: str, write: Write) -> None:
    """The times are found by their name, the units by name or attribute."""
    write(tmp_path / name)
    holds(open_recording(tmp_path / name))
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:300])
    with pytest.raises(FormatError):
        open_recording(tmp_path / name)


@pytest.mark.parametrize("array", [np.c_[T, X], np.vstack([T, X])])
def test_a_matrix_has_columns(tmp_path: Path, array: np.ndarray) -> None:
    """Either way round; the unit is asked for."""
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(NeedsAnswer):
        open_recording(tmp_path / "a.npy")
    holds(open_recording(tmp_path / "a.npy", ReadOptions(unit="cm")))


RECORDS = [{"time_s": t, "x_cm": x} for t, x in zip(T.tolist(), X.tolist(), strict=True)]
FORMS: dict[str, Any] = {
    "columns": {"time_s": T.tolist(), "x_cm": X.tolist()},
    "records": RECORDS,
    "texts": [{name: str(value) for name, value in each.items()} for each in RECORDS],
    "inside": {"device": {"name": "a"}, "data": {"samples": RECORDS}},
    "rows under names": {"columns": ["time_s", "x_cm"], "data": np.c_[T, X].tolist()},
    "pairs": np.c_[T, X].tolist(),
    "by index": {"time_s": dict(enumerate(T.tolist())), "x_cm": dict(enumerate(X.tolist()))},
}


@pytest.mark.parametrize("indent", [None, 1])
@pytest.mark.parametrize("form", FORMS)
def test_json_is_read_like_a_table(tmp_path: Path, form: str, indent: int | None) -> None:
    """Lists of times and values, or a list of records, in one line or in many."""
    path = tmp_path / "run.json"
    path.write_text(json.dumps(FORMS[form], indent=indent))
    holds(open_recording(path, ReadOptions.of({"unit": "cm"} if form == "pairs" else {})))


def test_sound_is_plain_numbers(tmp_path: Path) -> None:
    """At the rate of the file."""
    samples = np.rint(1000 * X).astype(np.int16)
    scipy.io.wavfile.write(tmp_path / "a.wav", 20, samples)
    recording = open_recording(tmp_path / "a.wav")
    np.testing.assert_allclose(recording.samples.t, T)
    np.testing.assert_allclose(recording.samples.distance, samples / 32768)


def labchart(times: bool) -> str:
    """Write one block of LabChart."""
    head = "Interval=\t0.05 s\nTimeFormat=\tStartOfBlock\nChannelTitle=\tPosition\tForce\n"
    head += "Range=\t50 cm\t5 N\nUnitName=\tcm\tN\n"
    rows = [(f"{t:.2f}\t" if times else "") + f"{x:.3f}\t{x / 7:.4f}" for t, x in zip(T, X, strict=True)]
    rows[5] += "\t#* start"
    return head + "\n".join([*rows, ""])


@pytest.mark.parametrize("times", [True, False])
def test_text_of_labchart(tmp_path: Path, times: bool) -> None:
    """Each block is a run; names and units are those of its lines."""
    path = tmp_path / "run.txt"
    path.write_text(labchart(times))
    holds(open_recording(path))
    path.write_text(labchart(times) * 3)
    with pytest.raises(NeedsAnswer) as asked:
        open_recording(path)
    assert len(asked.value.question.needs[0].choices) == 3
    holds(open_recording(path, ReadOptions(run="Block 2")))


@pytest.mark.parametrize("text", ["Interval=\t0.05 s\nChannelTitle=\tx\n", "Interval=0.05 s\nChannelTitle=\tx\n0\t1\n"])
def test_labchart_text_that_ends_early_is_refused(tmp_path: Path, text: str) -> None:
    """Lines above the rows without rows, or without the tab behind the interval, are an error of one line."""
    path = tmp_path / "run.txt"
    path.write_text(text)
    with pytest.raises(FormatError):
        open_recording(path)


@pytest.mark.parametrize("mark", ["\t", ","])
@pytest.mark.parametrize("step", ["50 msec/sample", "0.05 sec/sample"])
def test_text_of_acqknowledge(tmp_path: Path, step: str, mark: str) -> None:
    """The numbers of samples above the rows are no row."""
    head = f"bob.acq\n{step}\n2 channels\nDistance\ncm\nForce\nN\n"
    rows = ["CH1\tCH2\t", f"{N_ROWS}\t{N_ROWS}\t", *(f"{x:.3f}\t{x / 7:.4f}\t" for x in X), ""]
    path = tmp_path / "run.txt"
    path.write_text(head + "\n".join(rows).replace("\t", mark))
    holds(open_recording(path))


N_ROWS = T.size


def formulas() -> bytes:
    """Return a workbook that no spreadsheet has opened."""
    rows = "".join(f'<c r="A{i}"><f>B{i}*2</f><v></v></c>' for i in range(1, 40))
    sheet = f"<worksheet><sheetData>{rows}</sheetData></worksheet>"
    return packed({"[Content_Types].xml": "<Types/>", "xl/worksheets/sheet1.xml": sheet})


def two_columns(head: str, values: np.ndarray = X) -> bytes:
    """Return a table whose first column rises evenly."""
    return "\n".join([head, *(f"{t:.2f},{x:.3f}" for t, x in zip(T, values, strict=True)), ""]).encode()


PAGE = b"<html><body><table><tr><td>0.0</td><td>1.0</td></tr></table></body></html>"
EXCEL_2003 = b'<?xml version="1.0"?><Workbook xmlns="urn:schemas-microsoft-com:office:spreadsheet"/>'
NAMED: dict[str, tuple[str, bytes, str]] = {
    "web page": ("a.xls", PAGE, "spreadsheet"),
    "web page of two bytes a letter": ("a.xls", PAGE.decode().encode("utf-16"), "spreadsheet"),
    "Excel 2003": ("a.xls", EXCEL_2003, "xlsx"),
    "parquet": ("a.parquet", b"PAR1" + bytes(100), "parquet"),
    "formulas": ("a.xlsx", formulas(), "formulas without values"),
    "spectrum": ("a.csv", two_columns("Frequency (Hz),Magnitude (m)"), "spectrum"),
    "spectrum with short names": ("a.csv", two_columns("freq,mag"), "spectrum"),
    "spectrum without a name": ("a.csv", two_columns("Hz,PSD"), "spectrum"),
    "autocorrelation": ("a.csv", two_columns("Time shift (s),Autocorrelation of sum"), "autocorrelation"),
    "turning points": ("a.csv", two_columns("t (s),x (cm)", 8 * (-0.99) ** np.arange(T.size)), "turning points"),
}


@pytest.mark.parametrize("kind", NAMED)
def test_what_is_no_recording_is_named(tmp_path: Path, kind: str) -> None:
    """In one line, also if a rate is stated."""
    name, content, word = NAMED[kind]
    (tmp_path / name).write_bytes(content)
    for answers in ({}, {"rate_hz": 100.0, "unit": "1"} if kind == "spectrum" else {}):
        with pytest.raises(FormatError, match=word) as refused:
            open_recording(tmp_path / name, ReadOptions.of(answers))
        assert not isinstance(refused.value, NeedsAnswer)


def test_json_without_times_is_no_recording(tmp_path: Path) -> None:
    """Settings and results in a folder are not taken for recordings."""
    path = tmp_path / "settings.json"
    path.write_text(json.dumps({"name": "a", "rows": [1, 2, 3, 4]}, indent=1))
    with pytest.raises(FormatError, match="JSON without times"):
        open_recording(path)
