"""Every format of recordings passes ``springmass.testing``; a new one joins by adding its cases to ``CASES``."""

import io
import json
import tarfile
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from scipy.io import wavfile

from acquisition.recordings.identify import formats, get_format
from springmass.testing import File, check
from tests.sampling import sampled

RATE_HZ = 100.0


@dataclass(frozen=True)
class Case:
    """A file of one format with known content; see :class:`springmass.testing.File`."""

    format: str
    label: str
    build: Callable[[Any, Any], bytes]
    quantum_m: float | None = 1e-5
    offset_known: bool = True
    options: dict[str, Any] = field(default_factory=dict)
    text: bool = True


def rows(t: Any, x: Any, form: str) -> list[str]:
    """Print rows; a NaN is printed as ``NaN``."""
    return [form.format(t=a, x=b).replace("nan", "NaN") for a, b in zip(t, x, strict=True)]


def motion_position(t: Any, x: Any, newline: str = "\r\n", header: int = 2, error: bool = True) -> bytes:
    """Write the MotionSensor.vi position file."""
    columns = "Time (s)\tDistance (cm)" + ("\tDist Error (cm)" if error else "")
    lines = ["Motion Sensor Data File Sep 20, 2018 1:40 PM", columns][2 - header :]
    return newline.join([*lines, *rows(t, x * 100, "{t:.3f}\t{x:.3f}" + ("\t0.239" if error else ""))]).encode()


def motion_velocity(t: Any, x: Any) -> bytes:
    """Write the MotionSensor.vi velocity file."""
    v = np.diff(x, prepend=np.nan) * RATE_HZ * 100
    return "\r\n".join(["velocity Oct 20, 2022", "Time (s)\tVelocity (cm/s)", *rows(t, v, "{t:.3f}\t{x:.3f}")]).encode()


def lvm(t: Any, x: Any, mode: str = "One", mark: str = "\t", point: str = ".") -> bytes:
    """Write LabVIEW Measurement; every number of the formula agrees with the column."""
    name = {"\t": "Tab", ",": "Comma", ";": "Semicolon"}[mark]
    head = [
        "LabVIEW Measurement",
        "Writer_Version\t2",
        f"Separator\t{name}",
        f"Decimal_Separator\t{point}",
        "Multi_Headings\tNo",
        f"X_Columns\t{mode}",
        "***End_of_Header***",
        "",
        "Channels\t1",
        f"Samples\t{t.size}",
        "Date\t1903/12/31",
        "Time\t19:00:00",
        "Y_Unit_Label\tcm",
        "X_Dimension\tTime",
        "X0\t0.0000000000000000E+0".replace(".", point),
        "Delta_X\t0.010000".replace(".", point),
        "***End_of_Header***",
        "X_Value\tPosition\tComment",
    ]
    form = "\t{x:.6f}" if mode == "No" else "{t:.6f}\t{x:.6f}"
    body = [row.replace(".", point) for row in rows(t, x * 100, form)]
    return "\r\n".join([*head, *body]).replace("\t", mark).encode()


def tdms(t: Any, x: Any) -> bytes:
    """Write TDMS with npTDMS."""
    from nptdms import ChannelObject, TdmsWriter

    file = io.BytesIO()
    properties = {"wf_increment": 0.01, "wf_start_offset": 0.0, "wf_samples": x.size, "unit_string": "m"}
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("Measured", "Position", x, properties)])
    return file.getvalue()


def capstone(t: Any, x: Any) -> bytes:
    """Write a Capstone export: two runs, the other shorter, decimal commas."""
    head = '\ufeff"Time (s) Run #1";"Position (mm) Run #1";"Time (s) Run #2";"Position (mm) Run #2"'
    body = [f"{row if i < 200 else ';'};{row}" for i, row in enumerate(rows(t, x * 1000, "{t:.4f};{x:.4f}"))]
    return "\r\n".join([head, *(line.replace(".", ",") for line in body), ""]).encode()


def localised(t: Any, x: Any) -> bytes:
    """Write a localised Capstone export: no units."""
    return "\r\n".join(["tempo;velocità;posizione", *rows(t, x, "{t:.4f};{x:.2f};{x:.5f}"), ""]).encode()


def datastudio(t: Any, x: Any) -> bytes:
    """Write a DataStudio export of two runs."""
    blocks = [
        [f"Position, ChA&B, Run #{run}", "Time ( s )\tPosition ( m )", *rows(t, x + run - 1, "{t:.4f}\t{x:.5f}")]
        for run in (1, 2)
    ]
    return "\r\n".join([*blocks[1], *blocks[0]]).encode()


def vernier(t: Any, x: Any) -> bytes:
    """Write Vernier Format 2."""
    head = ["Vernier Format 2", "Untitled.cmbl 5/5/2019 9:37:43 .", "Run 1", "Time\tPosition", "t\tx", "s\tm", ""]
    return "\r\n".join([*head, *rows(t, x, "{t:.2f}\t{x:.5f}")]).encode()


def logger_pro(t: Any, x: Any) -> bytes:
    """Write a Logger Pro export of the latest run and one before."""
    head = "Latest: Time (s),Latest: Position (m),Run 1: Time (s),Run 1: Position (m)"
    return "\n".join([head, *(f"{row},{row}" for row in rows(t, x, "{t:.2f},{x:.5f}"))]).encode()


def phyphox(t: Any, x: Any, mark: str = ",", newline: str = "\n") -> bytes:
    """Write a phyphox export: the digits of a float, whose step changes with the distance."""
    body = rows(t, x, f"{{t:.9E}}{mark}{{x:.9E}}")
    return newline.join([f'"Time (s)"{mark}"Distance (m)"', *body]).replace("E-0", "E-").replace("E+0", "E").encode()


def phyphox_xml(t: Any, x: Any) -> bytes:
    """Write a phyphox state."""
    lists = [",".join(f"{value:.9E}" for value in each).replace("nan", "NaN").replace("NAN", "NaN") for each in (t, x)]
    containers = "".join(
        f'<container size="0" init="{numbers}">{name}</container>' for name, numbers in zip("tx", lists, strict=True)
    )
    export = '<set name="Raw"><data name="Time (s)">t</data><data name="Distance (m)">x</data></set>'
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<phyphox version="1.7"><title>Sonar</title><data-containers>'
        f"{containers}</data-containers><export>{export}</export></phyphox>"
    ).encode()


def tracker(t: Any, x: Any) -> bytes:
    """Write a Tracker table under the name of the mass."""
    return "\n".join(["masa_A\t\t", "t\tx\ty", *rows(t, x, "{t:.3f}\t1.000000\t{x:.6f}"), ""]).encode()


def columns_with_units(t: Any, x: Any) -> bytes:
    """Write columns under headings with units."""
    return "\n".join(["Zeit (s);Abstand (mm)", *rows(t, x * 1000, "{t:.3f};{x:.2f}")]).replace(".", ",").encode()


def sketch(t: Any, x: Any) -> bytes:
    """Write what a sketch prints for people."""
    return "".join(f"{row}\n" for row in rows(t, 100 * x, "Time: {t:.9f} s, Distance: {x:.3f} cm")).encode()


def bare(t: Any, x: Any, mark: str = " ") -> bytes:
    """Write numbers alone."""
    return "\n".join([*rows(t, x * 100, f"{{t:.3f}}{mark}{{x:.3f}}"), ""]).encode()


def names_alone(t: Any, x: Any, head: str = "# t theta_x", form: str = "{t:.3f} {x:.5f}") -> bytes:
    """Write rows below names behind a comment mark."""
    return "\n".join([head, *rows(t, x, form), ""]).encode()


def oscilloscope(t: Any, x: Any) -> bytes:
    """Write names, units below them, a blank line, decimal commas; times in milliseconds."""
    body = [row.replace(".", ",") for row in rows(t * 1e3, x * 1e3, "{t:.1f}\t0.5\t{x:.2f}")]
    return "\r\n".join(["Zeitachse\tKanal A\tKanal B", "(ms)\t(V)\t(mm)", "", *body]).encode()


def preamble(t: Any, x: Any) -> bytes:
    """Write a logger's preamble, a column of row numbers, and one of words."""
    head = ["%Logger 3", "%Sample rate: 100 Hz", "%Created: Tue, 12 Mar, 2024", "n, state, elapsed [s], position [mm]"]
    body = (f"{i}, ok, {row}" for i, row in enumerate(rows(t, x * 1e3, "{t:.3f}, {x:.2f}")))
    return "\n".join([*head, *body]).encode()


def clock(t: Any, x: Any) -> bytes:
    """Write clock times that pass midnight."""
    total = [86399.5 + float(each) for each in t]
    clock_times = [f"{int(s // 3600) % 24:02d}:{int(s // 60) % 60:02d}:{s % 60:06.3f}" for s in total]
    body = (f"{a};{row}" for a, row in zip(clock_times, rows(t, x, "{x:.5f}"), strict=True))
    return "\n".join(["Chart recorder", "Time;Position (m)", *body]).encode()


def labx(t: Any, x: Any) -> bytes:
    """Write CASSY Lab's XML."""
    described = (("Index", "n", "", range(len(t))), ("Zeit", "t", "s", t), ("Weg", "s_A1", "m", x))
    channels = "".join(
        f"<channels><channel><quantity>{name}</quantity><symbol>{symbol}</symbol><unit>{unit}</unit><values>"
        + "".join(f"<value>{each:.9g}</value>".replace("nan", "NaN") for each in values)
        + "</values></channel></channels>"
        for name, symbol, unit, values in described
    )
    return f'<?xml version="1.0" encoding="utf-8"?><cassylab><allchannels>{channels}</allchannels></cassylab>'.encode()


def lab(t: Any, x: Any) -> bytes:
    """Write CASSY Lab's text: each channel in three lines and one of settings, rows behind their number."""
    settings = "0 60 10 0 1 0 0 1 0 0 0 0 0 0 1 1"
    described = (("Index", "n", ""), ("Zeit", "t", "s"), ("Frequenz", "f", "Hz"), ("Weg", "s_A1", "m"))
    head = [line for each in described for line in (*each, settings)]
    body = (f"{i}\t{row}" for i, row in enumerate(rows(t, x, "{t:.3f}\t{x:.5f}"), 1))
    return "\r\n".join(["CL4", "265 0.1", *head, "4 0 0 3", f"3 {len(t)}", *body]).encode()


def xlsx(t: Any, x: Any) -> bytes:
    """Write a workbook of two sheets, one of them words; numbers as a spreadsheet keeps them."""
    body = "".join(
        f'<row r="{i}"><c r="A{i}"><v>{a!r}</v></c>'
        + ("" if np.isnan(b) else f'<c r="B{i}"><v>{b!r}</v></c>')
        + "</row>"
        for i, (a, b) in enumerate(zip(map(float, t), map(float, x), strict=True), 2)
    )
    return workbook({"Raw": cells("Time (s)", "Distance (m)") + body, "Meta": cells("device", "phone")})


def cells(*words: str) -> str:
    """Write the first row of a sheet, of words."""
    inner = (f'<c r="{chr(65 + i)}1" t="inlineStr"><is><t>{each}</t></is></c>' for i, each in enumerate(words))
    return f'<row r="1">{"".join(inner)}</row>'


def workbook(sheets: dict[str, str]) -> bytes:
    """Write an xlsx of sheets by name, each as the XML of its rows; style 1 is a time of the day."""
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    kinds = "application/vnd.openxmlformats-"
    links = [(f"r{i}", "worksheet", f"worksheets/sheet{i}.xml") for i in range(1, len(sheets) + 1)]
    links.append(("styles", "styles", "styles.xml"))

    def relationships(entries: list[tuple[str, str, str]]) -> str:
        inner = (f'<Relationship Id="{a}" Type="{office}/{b}" Target="{c}"/>' for a, b, c in entries)
        return f'<Relationships xmlns="{package}/relationships">{"".join(inner)}</Relationships>'

    named = (f'<sheet name="{name}" sheetId="{i}" r:id="r{i}"/>' for i, name in enumerate(sheets, 1))
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{package}/content-types">'
        f'<Default Extension="xml" ContentType="application/xml"/>'
        f'<Default Extension="rels" ContentType="{kinds}package.relationships+xml"/>'
        f'<Override PartName="/xl/workbook.xml" ContentType="{kinds}officedocument.spreadsheetml.sheet.main+xml"/>'
        "</Types>",
        "_rels/.rels": relationships([("r", "officeDocument", "xl/workbook.xml")]),
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{office}"><sheets>{"".join(named)}</sheets></workbook>',
        "xl/_rels/workbook.xml.rels": relationships(links),
        "xl/styles.xml": f'<styleSheet xmlns="{main}"><cellXfs count="2"><xf numFmtId="0"/>'
        '<xf numFmtId="21" applyNumberFormat="1"/></cellXfs></styleSheet>',
    }
    for i, rows_of in enumerate(sheets.values(), 1):
        parts[f"xl/worksheets/sheet{i}.xml"] = f'<worksheet xmlns="{main}"><sheetData>{rows_of}</sheetData></worksheet>'
    return packed({name: f'<?xml version="1.0" encoding="UTF-8"?>{text}'.encode() for name, text in parts.items()})


def packed(files: Mapping[str, str | bytes]) -> bytes:
    """Write a zip archive, the same bytes each time."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name, (2024, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def phyphox_zip(t: Any, x: Any) -> bytes:
    """Write phyphox's archive: the data, and two files on the phone."""
    device = b'"property","value"\n"version","1.1.12"\n"accelerometer MaxRange","78.4"\n'
    time = b'"event","experiment time"\n"START",0.0\n"PAUSE",3.0\n'
    return packed({"Raw Data.csv": phyphox(t, x), "meta/device.csv": device, "meta/time.csv": time})


def cmbl(t: Any, x: Any) -> bytes:
    """Write what Logger Pro saves: two data sets of one column of times each."""

    def column(name: str, unit: str, values: Any) -> str:
        cells = "\n".join("" if np.isnan(each) else f"{each:.9g}" for each in values)
        return (
            f"<DataColumn><DataObjectName>{name}</DataObjectName><ColumnUnits>{unit}</ColumnUnits>"
            f"<ColumnCells>\n{cells}\n</ColumnCells></DataColumn>"
        )

    sets = "".join(
        f"<DataSet><DataSetName>{name}</DataSetName>{column('Time', 's', t)}{column('Position', 'm', x + more)}"
        "</DataSet>"
        for name, more in (("Latest", 1.0), ("Run 1", 0.0))
    )
    return f"<Document><Copyright>Vernier Software &#38; Technology</Copyright>{sets}</Document>".encode()


def gambl(t: Any, x: Any) -> bytes:
    """Write what Graphical Analysis saves: the same in a tar archive."""
    data, file = cmbl(t, x), io.BytesIO()
    with tarfile.open(fileobj=file, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        info = tarfile.TarInfo("vstudm/data.udm")
        info.size = len(data)
        archive.addfile(info, io.BytesIO(data))
    return file.getvalue()


def trk(t: Any, x: Any) -> bytes:
    """Write what Tracker saves: pixels of a mass by frame, a stick of 400 pixels a metre, axes turned by 30 degrees."""
    turn, scale = np.deg2rad(30.0), 400.0

    def given(name: str, value: object) -> str:
        return f'<property name="{name}" type="double">{value}</property>'

    def thing(kind: str, inner: str) -> str:
        return f'<object class="org.opensourcephysics.{kind}">{inner}</object>'

    frames = "".join(
        f'<property name="[{i}]" type="object">'
        + thing(
            "cabrillo.tracker.PointMass$FrameData",
            given("x", 500.0 - y * scale * np.sin(turn)) + given("y", 300.0 - y * scale * np.cos(turn)),
        )
        + "</property>"
        for i, y in enumerate(map(float, x))
        if not np.isnan(y)
    )
    axes = "".join(
        given(*each)
        for each in (("xorigin", 500.0), ("yorigin", 300.0), ("angle", 30.0), ("xscale", scale), ("yscale", scale))
    )
    system = thing("media.core.ImageCoordSystem$FrameData", axes)
    mass = '<property name="name" type="string">mass A</property><property name="framedata" type="array">' + frames
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        + thing(
            "cabrillo.tracker.TrackerPanel",
            thing("media.core.VideoClip", given("startframe", 0) + given("starttime", 0.0))
            + thing("media.core.StepperClipControl", given("delta_t", 10.0))
            + thing(
                "media.core.ImageCoordSystem",
                f'<property name="framedata" type="array"><property name="[0]">{system}</property></property>',
            )
            + given("length_unit", "m")
            + thing("cabrillo.tracker.PointMass", mass + "</property>"),
        )
    ).encode()


def npz(t: Any, x: Any) -> bytes:
    """Write two arrays of numpy."""
    content = io.BytesIO()
    np.savez(content, time_s=t, distance_m=x)
    return content.getvalue()


def json_columns(t: Any, x: Any) -> bytes:
    """Write an object of two lists."""
    return json.dumps({"time_s": [float(each) for each in t], "distance_m": [float(each) for each in x]}).encode()


def wav(t: Any, x: Any) -> bytes:
    """Write sound in double precision."""
    content = io.BytesIO()
    wavfile.write(content, round(RATE_HZ), np.asarray(x, np.float64))
    return content.getvalue()


def labchart(t: Any, x: Any) -> bytes:
    """Write one block of LabChart."""
    head = ["Interval=\t0.01 s", "ChannelTitle=\tDistance", "UnitName=\tm"]
    return "\n".join([*head, *rows(t, x, "{t:.3f}\t{x:.5f}"), ""]).encode()


def acqknowledge(t: Any, x: Any) -> bytes:
    """Write text of AcqKnowledge with a column of times."""
    head = ["run.acq", "10 msec/sample", "1 channels", "Distance", "m", "sec\tCH1", f"\t{len(t)}"]
    return "\n".join([*head, *rows(t, x, "{t:.3f}\t{x:.5f}"), ""]).encode()


CASES = [
    Case("arrays", "npz", npz, None, text=False),
    Case("json", "columns", json_columns, None, text=False),
    Case("wav", "double", wav, None, text=False),
    Case("labchart", "times", labchart),
    Case("acqknowledge", "times", acqknowledge),
    Case("motion-sensor", "position", motion_position),
    Case("motion-sensor", "position-LF", lambda t, x: motion_position(t, x, "\n")),
    Case("motion-sensor", "position-no-header", lambda t, x: motion_position(t, x, header=0)),
    Case("motion-sensor", "position-no-error", lambda t, x: motion_position(t, x, error=False)),
    Case("motion-sensor", "position-UTF-16", lambda t, x: motion_position(t, x).decode().encode("utf-16")),
    Case("motion-sensor", "velocity", motion_velocity, quantum_m=None, offset_known=False),
    Case("lvm", "one-tab", lvm),
    Case("lvm", "one-comma", lambda t, x: lvm(t, x, mark=",")),
    Case("lvm", "multi-decimal-comma", lambda t, x: lvm(t, x, "Multi", ";", ",")),
    Case("lvm", "no-times", lambda t, x: lvm(t, x, "No")),
    Case("tdms", "waveform", tdms, None, text=False),
    Case("capstone", "run-2", capstone, options={"run": "Run #2"}),
    Case("capstone", "localised", localised, options={"channel": "posizione", "unit": "m"}),
    Case("datastudio", "second-block", datastudio, options={"run": "Run #1"}),
    Case("vernier", "format-2", vernier),
    Case("logger-pro", "latest", logger_pro, options={"run": "run 1"}),
    Case("table", "phyphox", phyphox, None),
    Case("table", "phyphox-tab-CRLF", lambda t, x: phyphox(t, x, "\t", "\r\n"), None),
    Case("phyphox", "XML", phyphox_xml, None, text=False),
    Case("table", "tracker", tracker, options={"channel": "y", "unit": "m"}),
    Case("workbook", "xlsx", xlsx, text=False),
    Case("zip", "phyphox", phyphox_zip, None, text=False),
    Case("logger-pro", "cmbl", cmbl, None, options={"run": "run 1"}, text=False),
    Case("logger-pro", "gambl", gambl, None, options={"run": "run 1"}, text=False),
    Case("tracker", "trk", trk, None, options={"channel": "y"}, text=False),
    Case("table", "semicolon-comma", columns_with_units),
    Case("cassy", "labx", labx, None, text=False),
    Case("cassy", "lab", lab),
    Case("table", "names-alone", names_alone, options={"unit": "m"}),
    Case("table", "oscilloscope", oscilloscope),
    Case("table", "preamble", preamble),
    Case("table", "clock", clock),
    Case("table", "bare-blanks", bare, options={"unit": "cm"}),
    Case("sketch", "words", sketch, text=False),
    Case("table", "bare-tabs", lambda t, x: bare(t, x, "\t"), options={"unit": "cm"}),
]


# The two first cases of a format always, the others in trials.
PER_FORMAT = [[each for each in CASES if each.format == name] for name in dict.fromkeys(each.format for each in CASES)]
SAMPLED = [
    one for of in PER_FORMAT for one in sampled(pytest.param(case, id=f"{case.format}:{case.label}") for case in of)
]


@pytest.mark.parametrize("case", SAMPLED)
def test_it_keeps_the_rules_for_formats(case: Case) -> None:
    """What its writer wrote is read, and every fault of a file is flagged, counted or refused in one line."""
    check(get_format(case.format), File(case.build, case.options, case.quantum_m, case.offset_known, case.text))


def test_every_format_of_the_registry_has_a_case() -> None:
    """A format without a case is not held to the rules."""
    assert {each.name for each in formats()} == {case.format for case in CASES}
