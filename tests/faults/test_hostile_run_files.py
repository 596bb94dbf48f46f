"""Run files made to harm, behind right digests: an answer or one line of refusal within ten seconds, never another.

The writer here shares no code with the program's: it follows the layout of the reference page, and digests whatever
it is told to write. So checksums say nothing against these files, and types, ranges, sizes and names must.
"""

from __future__ import annotations

import contextlib
import copy
import hashlib
import json
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from springmass.cli import main

FEW, MANY = 120, 1000 if os.environ.get("SPRINGMASS_TRIALS") else 240
FILES = [range(FEW), pytest.param(range(FEW, MANY), marks=pytest.mark.trials)]
SECONDS = 10
ANSWERS = {0, 2, 3}  # done, refused as a scene, refused as an input
PERIOD_S = 0.75
N = 500

HEADER: dict[str, Any] = {
    "schema": 1,
    "info": {
        "kind": "live",
        "name": "COM3",
        "rate_hz": 100.0,
        "sigma_m": 0.0003,
        "quantum_m": None,
        "clock": "device",
        "stated_error_m": None,
    },
    "first": 0,
    "samples": N,
    "originals": [],
    "title": "Bob",
    "channel": "distance",
    "format": "wire",
    "scene": {"bob": {"mass_kg": {"value": 0.2, "u": 0.0001}}, "spring": {"mass_kg": 0.01}},
    "traps": [{"code": "cut_short", "message": "The recording did not end by itself.", "count": 1, "line": None}],
    "malformed_rows": 0,
    "provenance": {
        "software": "springmass",
        "version": "0.1.0",
        "start_time": "2024-05-01T12:00:00Z",
        "configuration": {"a": 1},
        "sensor": {
            "family": "line-protocol",
            "options": {"unit": "us"},
            "calibration": {"speed_of_sound_m_per_s": 343.0, "scale": 1.0, "offset_m": 0.0, "u_scale": 0.001},
        },
    },
    "quantity": "length",
    "unit": "m",
}
ORIGINAL = b"0.01\t0.31\n" * 40

STRANGE: list[Any] = [
    None,
    True,
    "",
    "x",
    "\x1b[2J\x07",
    "‮gnp.exe",
    "$\\frac$",
    "=1+1",
    "a" * 100_000,
    -1,
    0,
    1,
    2**31,
    2**53,
    2**63,
    10**400,
    -1.0,
    0.0,
    1e-300,
    1e-9,
    1e9,
    1e300,
    float("nan"),
    float("inf"),
    float("-inf"),
    [],
    [1],
    ["a", "b"],
    [[]] * 1000,
    {},
    {"a": 1},
    {"value": float("nan"), "u": -1},
    {"mass_kg": 10**300},
    {"": {"": ""}},
]


def samples(n: int = N) -> dict[str, np.ndarray]:
    """Return the arrays of a bob that swings."""
    t = np.arange(n) / 100
    noise = np.random.default_rng(7).normal(0, 3e-4, n)
    distance = 0.5 + 0.05 * np.exp(-0.01 * t) * np.cos(2 * np.pi * t / PERIOD_S) + noise
    return {
        "time": t,
        "distance": distance,
        "quality": np.zeros(n, "|u1"),
        "sequence": np.arange(n, dtype="<u4"),
        "distance_errors": np.full(n, 3e-4, "<f4"),
        "host_mono_ns": (np.arange(n) * 10_000_000 + 5).astype("<i8"),
    }


UNITS = {"time": "s", "distance": "m", "distance_errors": "m", "velocity": "m/s", "host_mono_ns": "ns"}
NAMES = {
    "time": "time since the start of the run",
    "distance": "distance from the sensor",
    "distance_errors": "standard deviation of a distance, as the source knows it",
    "quality": "why a sample may not be taken at face value",
    "velocity": "velocity as the recording states it",
    "sequence": "index of the sample within the run",
    "host_mono_ns": "host's monotonic clock at arrival; -1 where no host was there",
}
FLAGS = "missing false_echo clipped duplicate_time non_monotonic_time malformed gap_before"


def place(name: str) -> str:
    """Return where a column stands."""
    return f"/raw/{name}" if name in {"sequence", "host_mono_ns"} else f"/entry/signal/{name}"


def canonical(value: Any) -> str:
    """Return JSON as the header has it; NaN and infinities as Python would write them."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def put(carrier: Any, name: str, value: Any) -> None:
    """Write an attribute, a text with a fixed length."""
    if isinstance(value, list):
        texts = [text.encode("utf-8", "replace") for text in value]
        carrier.attrs.create(name, np.array(texts, f"S{max([1, *map(len, texts)])}"))
    elif isinstance(value, str):
        data = value.replace("\0", "\ufffd").encode("utf-8", "replace")
        carrier.attrs.create(name, data, dtype=h5py.string_dtype(length=max(1, len(data))))
    else:
        carrier.attrs.create(name, value)


def field(file: Any, path: str, value: Any) -> None:
    """Write a scalar, a text with a fixed length."""
    if isinstance(value, str):
        data = value.encode("utf-8", "replace")
        file.create_dataset(path, data=data, dtype=h5py.string_dtype(length=max(1, len(data))))
    else:
        file.create_dataset(path, data=float(value))


def write(path: Path, header: dict[str, Any], arrays: dict[str, np.ndarray], texts: dict[str, bytes]) -> None:
    """Write a run file of whatever it is told, every digest right, and what other tools see as the header has it."""
    path.unlink(missing_ok=True)
    with h5py.File(path, "w", libver=("v110", "v110")) as file:
        for name, values in arrays.items():
            options: dict[str, Any] = {"fletcher32": True} if values.ndim and values.size else {}
            file.create_dataset(place(name), data=values, **options)
        header = {
            **header,
            "columns": {name: hashlib.sha256(values.tobytes()).hexdigest() for name, values in arrays.items()},
            **header.get("also", {}),
        }
        header.pop("also", None)
        if texts:
            sizes = np.array([len(data) for data in texts.values()], "<u8")
            file["/wire/bytes"] = np.frombuffer(b"".join(texts.values()), "u1")
            file["/wire/record_offset"] = np.cumsum(sizes) - sizes
            file["/wire/record_len"] = sizes
            file["/wire/record_mono_ns"] = np.full(len(sizes), -1, "<i8")
            reported = [
                {"name": name, "size": len(data), "sha256": hashlib.sha256(data).hexdigest()}
                for name, data in texts.items()
            ]
            header["originals"] = header["originals"] or reported
        # What HDF5 cannot hold, or what is no table any more, the header says all the same.
        with contextlib.suppress(TypeError, ValueError, AttributeError, OverflowError, KeyError):
            decorate(file, header, arrays)
        text = header["text"] if "text" in header else canonical(header).encode("ascii")
        file.create_dataset("/entry/provenance/header", data=np.bytes_(text))
        file["/entry/provenance/header"].attrs["sha256"] = np.bytes_(hashlib.sha256(text).hexdigest())


def decorate(file: Any, header: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
    """Write what other tools see, as the header has it."""
    info, provenance = header["info"], header["provenance"]
    root = {"Conventions": "CF-1.11", "NX_class": "NXroot", "default": "entry", "kind": info["kind"]}
    for name, value in root.items():
        put(file, name, value)
    for group in ("/entry", "/entry/instrument", "/entry/provenance", "/raw"):
        file.require_group(group)
    for name, value in {"NX_class": "NXentry", "default": "signal"}.items():
        put(file["/entry"], name, value)
    plot = {"NX_class": "NXdata", "signal": "distance", "axes": ["time"], "kind": info["kind"]}
    plot |= {name: header[name] for name in ("title", "channel", "format") if header[name]}
    if "velocity" in arrays:
        plot["auxiliary_signals"] = ["velocity"]
    for name, value in plot.items():
        put(file["/entry/signal"], name, value)
    put(file["/raw"], "NX_class", "NXcollection")
    put(file["/entry/instrument"], "NX_class", "NXinstrument")
    process = {"NX_class": "NXprocess", "malformed_rows": header["malformed_rows"]}
    process |= {name: provenance[name] for name in ("software", "version", "created_utc") if provenance.get(name)}
    process |= {"configuration": canonical(provenance["configuration"])} if "configuration" in provenance else {}
    process |= {"traps": canonical(header["traps"])} if header["traps"] else {}
    if header["originals"]:
        process["original_sha256"] = [entry["sha256"] for entry in header["originals"]]
        wire = {"NX_class": "NXcollection", "content": "files"}
        wire["record_name"] = [entry["name"] for entry in header["originals"]]
        for name, value in wire.items():
            put(file["/wire"], name, value)
    for name, value in process.items():
        put(file["/entry/provenance"], name, value)
    if header["scene"] is not None:
        file.require_group("/entry/scene")
        put(file["/entry/scene"], "NX_class", "NXcollection")
        put(file["/entry/scene"], "json", canonical(header["scene"]))
    for name in arrays:
        at = file[place(name)]
        put(at, "long_name", NAMES[name])
        if name in UNITS:
            put(at, "units", UNITS[name])
        if name in {"distance", "velocity", "distance_errors"}:
            at.attrs.create("_FillValue", np.array(np.nan, "<f4" if name == "distance_errors" else "<f8"))
        if name == "time":
            put(at, "clock", info["clock"])
            put(at, "epoch", provenance.get("start_time") or "unknown")
        if name == "distance":
            if header.get("quantity"):
                put(at, "quantity", header["quantity"])
            beside = [each for each in ("distance_errors", "quality") if each in arrays]
            put(at, "ancillary_variables", " ".join(beside))
        if name == "quality":
            put(at, "standard_name", "quality_flag")
            at.attrs.create("flag_masks", np.array([1, 2, 4, 8, 16, 32, 64], "u1"))
            put(at, "flag_meanings", FLAGS)
    for path, value in (("/entry/title", header["title"]), ("/entry/start_time", provenance.get("start_time"))):
        if value:
            field(file, path, value)
    for name in ("name", "kind", "clock"):
        if info[name]:
            field(file, f"/entry/instrument/{name}", info[name])
    for name, unit in (("rate_hz", "Hz"), ("quantum_m", "m"), ("sigma_m", "m"), ("stated_error_m", "m")):
        if info.get(name) is not None:
            field(file, f"/entry/instrument/{name}", info[name])
            put(file[f"/entry/instrument/{name}"], "units", unit)


def strange(rng: np.random.Generator) -> Any:
    """Return something that no header should say."""
    return copy.deepcopy(STRANGE[rng.integers(len(STRANGE))])


def paths_of(tree: Any, above: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the path of every value of a header, tables and lists among them."""
    inner = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    result = [(*above, key) for key, _ in inner]
    return result + [path for key, value in inner for path in paths_of(value, (*above, key))]


def in_header(path: Path, rng: np.random.Generator) -> str:
    """One value of the header, or one key, is another: wrong type, out of range, missing, added."""
    header = copy.deepcopy(HEADER)
    every = paths_of(header)
    *above, last = every[rng.integers(len(every))]
    at: Any = header
    for key in above:
        at = at[key]
    kind = rng.integers(4)
    if kind == 0 and isinstance(at, dict):
        del at[last]
    elif kind == 1 and isinstance(at, dict):
        at[str(rng.choice(["", "x", "\x1b]0;x\x07", "__class__", "a" * 5000]))] = strange(rng)
    else:
        at[last] = strange(rng)
    write(path, header, samples(), {})
    return "values"


def in_text(path: Path, rng: np.random.Generator) -> str:
    """The header is no JSON, or JSON made to hurt its reader."""
    plain = canonical({**HEADER, "columns": {}})
    texts = [
        b"",
        b"\0",
        b"\xff\xfe",
        b"null",
        b"[]",
        b"7",
        b'{"schema":1}',
        b"[" * 100_000,
        b'{"schema":1,"a":' * 2000,
        b'{"schema":1,"provenance":' + b'{"a":' * 500 + b"1" + b"}" * 501,
        b'{"schema":' + b"9" * 5000 + b"}",
        b'{"schema":1e999}',
        plain.replace('"rate_hz":100.0', '"rate_hz":1e999').encode(),
        plain.replace('"rate_hz":100.0', '"rate_hz":1.0,"rate_hz":"x"').encode(),
        plain.encode() * 2,
        plain.encode().ljust(3_000_000),
        plain.encode("utf-16"),
    ]
    header = copy.deepcopy(HEADER)
    write(path, {**header, "also": {"text": texts[rng.integers(len(texts))]}}, samples(), {})
    return "values"


def in_values(path: Path, rng: np.random.Generator) -> str:
    """The samples themselves are impossible, digests and all."""
    arrays = samples()
    name = str(rng.choice(["time", "distance", "quality", "host_mono_ns", "distance_errors", "velocity"]))
    if name == "velocity":
        arrays["velocity"] = np.zeros(N)
    values = arrays[name]
    if values.dtype.kind == "f":
        size = [np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-308, 0.0, -0.0, 1e18, 5e-324, 1e12, 1e-12][rng.integers(12)]
    else:
        limits = np.iinfo(values.dtype)
        size = [limits.min, limits.max, 0, limits.max // 2][rng.integers(4)]
    how = rng.integers(4)
    with np.errstate(all="ignore"):
        if how == 0:
            values[:] = size
        elif how == 1:
            values[rng.integers(N, size=int(rng.integers(1, 60)))] = size
        elif how == 2:
            values[:] = values[::-1].copy()
        else:
            values[:] = (values * size).astype(values.dtype)
    write(path, copy.deepcopy(HEADER), arrays, {})
    return "values"


def in_form(path: Path, rng: np.random.Generator) -> str:
    """A column has another type, shape, length or packing than the header's."""
    arrays = samples()
    name = str(rng.choice(list(arrays)))
    values = arrays[name]
    forms: list[Callable[[], np.ndarray]] = [
        lambda: values.astype(values.dtype.newbyteorder(">")),
        lambda: values.astype("<f4") if values.dtype != np.dtype("<f4") else values.astype("<f8"),
        lambda: values.astype("S8"),
        lambda: values.astype("c16"),
        lambda: values.astype(bool),
        lambda: values.reshape(2, -1),
        lambda: values[:-1],
        lambda: np.concatenate([values, values]),
        lambda: values[:0],
        lambda: values[0],
        lambda: values.view("V1"),
        lambda: np.array(list(zip(values, values, strict=True)), [("a", values.dtype), ("b", values.dtype)]),
    ]
    arrays[name] = forms[rng.integers(len(forms))]()
    write(path, copy.deepcopy(HEADER), arrays, {})
    return "same"


def in_size(path: Path, rng: np.random.Generator) -> str:
    """A small file states what would fill the memory."""
    header = copy.deepcopy(HEADER)
    n = int(rng.choice([2**31, 2**32, 2**32 - 1, 10**9]))
    name = str(rng.choice(["distance", "time"]))
    kind = rng.integers(4)
    if kind == 0:
        header["samples"] = n
        write(path, header, samples(), {})
        with h5py.File(path, "r+") as file:
            for each in samples():
                dtype = file[place(each)].dtype
                del file[place(each)]
                file.create_dataset(place(each), (n,), dtype, chunks=(65536,), compression="gzip")
    elif kind == 1:
        write(path, header, samples(), {})
        with h5py.File(path, "r+") as file:
            values = file[place(name)][:]
            del file[place(name)]
            file.create_dataset(place(name), (N,), "<f8", maxshape=(None,), chunks=(2**25,), compression="gzip")
            file[place(name)][:] = values
    elif kind == 2:
        header["originals"] = [{"name": "a", "size": n, "sha256": hashlib.sha256(b"").hexdigest()}]
        write(path, header, samples(), {"a": ORIGINAL})
        with h5py.File(path, "r+") as file:
            del file["/wire/bytes"]
            file.create_dataset("/wire/bytes", (n,), "u1", chunks=(65536,), compression="gzip")
    else:
        write(path, header, samples(), {})
        with h5py.File(path, "r+") as file:
            for i in range(3000):
                file.create_group(f"/entry/extra/{i}")
    return "same"


def everywhere(file: Any) -> list[str]:
    """Return every path of a file."""
    result: list[str] = []
    file.visit(result.append)
    return result


def in_links(path: Path, rng: np.random.Generator) -> str:
    """A name leads out of the file, in a circle, to what is missing, or to something of another kind."""
    write(path, copy.deepcopy(HEADER), samples(), {"run.wire": ORIGINAL})
    pipe, second = path.with_name("pipe"), path.with_name("other.h5")
    if not pipe.exists():
        os.mkfifo(pipe)
        with h5py.File(second, "w") as file:
            file["x"] = samples()["distance"]
            file["s"] = b"secret"
        path.with_name("raw").write_bytes(bytes(N * 8))
    with h5py.File(path, "r+") as file:
        names = everywhere(file)
        name = names[rng.integers(len(names))]
        target = file[name]
        shape = target.shape if isinstance(target, h5py.Dataset) else (N,)
        dtype = target.dtype if isinstance(target, h5py.Dataset) else "<f8"
        beside = rng.random() < 0.2
        if not beside:
            del file[name]
        else:
            name = f"{name}-more" if isinstance(target, h5py.Dataset) else f"{name}/more"
        kind = rng.integers(10)
        if kind == 0:
            file[name] = h5py.SoftLink(str(rng.choice(["/entry", "/nowhere", "..", f"/{name}", "/entry/signal/time"])))
        elif kind in (1, 2):
            where = str(rng.choice([pipe, second, path, "/etc/hostname", "/dev/zero", "nowhere.h5"]))
            file[name] = h5py.ExternalLink(where, str(rng.choice(["/x", "/", "/s"])))
        elif kind in (3, 4):
            layout = h5py.VirtualLayout(shape or (1,), dtype)
            source = h5py.VirtualSource(str(rng.choice([pipe, second, "."])), "x", shape or (1,))
            layout[...] = source[...]
            file.create_virtual_dataset(name, layout)
        elif kind in (5, 6):
            where = str(rng.choice([pipe, path.with_name("raw"), "/etc/passwd", "/dev/zero"]))
            file.create_dataset(name, shape or (1,), dtype, external=[(where, 0, h5py.h5f.UNLIMITED)])
        elif kind == 7:
            file[name] = file["/"]
        elif kind == 8:
            file.create_group(name)
        elif kind == 9 and not beside:
            file[name] = np.dtype("<f8")
    return "same"


def in_attributes(path: Path, rng: np.random.Generator) -> str:
    """An attribute that other tools see is missing, added, or something that HDF5 loses itself in."""
    write(path, copy.deepcopy(HEADER), samples(), {"run.wire": ORIGINAL})
    with h5py.File(path, "r+") as file:
        names = ["/", *everywhere(file)]
        carrier = file[names[rng.integers(len(names))]]
        known = list(carrier.attrs)
        name = known[rng.integers(len(known))] if known and rng.random() < 0.7 else "more"
        values: list[Any] = [
            "free text",
            np.zeros(5000),
            np.bytes_(b"x" * 60_000),
            h5py.Empty("f"),
            np.array([b"a", b"b"]),
            7,
            float("nan"),
            file["/"].ref,
            np.array([(1, 2.0)], [("a", "i4"), ("b", "f8")]),
        ]
        kind = rng.integers(len(values) + 2)
        if name in carrier.attrs:
            del carrier.attrs[name]
        if kind < len(values):
            carrier.attrs[name] = values[kind]
        elif kind == len(values):
            for i in range(500):
                carrier.attrs[f"a{i}"] = i
    return "same"


KINDS = (in_header, in_header, in_text, in_values, in_values, in_form, in_size, in_links, in_links, in_attributes)


def command(rng: np.random.Generator, path: Path) -> list[str]:
    """Return one of the commands that read a run file."""
    out = path.with_name("out")
    scene = path.with_name("scene.toml")
    scene.write_text("[bob]\nmass_kg = 0.2\n", "utf-8")
    choices = [
        ["analyse", "--json"],
        ["analyse", "--json", "--unverified"],
        ["formats"],
        ["replay", "--speed", "max"],
        ["convert", f"{out}.h5", "--overwrite"],
        ["convert", f"{out}.h5", "--overwrite", "--unverified"],
        ["convert", f"{out}.csv", "--overwrite"],
        ["convert", f"{out}.lvm", "--overwrite"],
        ["simulate", "--scene", str(scene), "--json", "--against"],
    ]
    name, *remainder = choices[rng.integers(len(choices))]
    return [name, *remainder, str(path)] if "--against" in remainder else [name, str(path), *remainder]


@pytest.mark.trials
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("files", FILES, ids=["few", "many"])
def test_any_run_file_gets_an_answer(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], answer_within: Callable[[int], Any], files: range
) -> None:
    """Every command answers a hostile file within ten seconds: refused in one line, or with the numbers it holds."""
    path = tmp_path / "run.h5"
    answered = 0
    for number in files:
        rng = np.random.default_rng([14, number])
        make = KINDS[number % len(KINDS)]
        remaining = make(path, rng)
        arguments = command(rng, path)
        with answer_within(SECONDS):
            code = main(arguments)
        output = capsys.readouterr()
        where = (number, make.__name__, arguments, output.err)
        assert code in ANSWERS, where
        assert "Traceback" not in output.err, where
        assert output.err.isascii() or output.err.replace("\n", "").isprintable(), where
        if code:
            assert output.err.splitlines()[-1].startswith("springmass: "), where
        elif arguments[0] == "analyse" and remaining == "same":
            answered += 1
            period = json.loads(output.out)["estimates"]["period"]
            assert abs(period["value"] - PERIOD_S) < 5 * period["u"], where
    assert answered


def test_a_sound_file_of_this_writer_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What the writer here makes, harm aside, verifies: its hostile files are refused for their harm alone."""
    path = tmp_path / "run.h5"
    write(path, copy.deepcopy(HEADER), samples(), {"run.wire": ORIGINAL})
    assert main(["analyse", "--json", str(path)]) == 0
    period = json.loads(capsys.readouterr().out)["estimates"]["period"]
    assert abs(period["value"] - PERIOD_S) < 5 * period["u"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("kind", ["pipe", "socket", "device", "directory"])
def test_what_is_no_regular_file_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], answer_within: Callable[[int], Any], kind: str
) -> None:
    """Run files, logs, recordings and scenes alike: one line that says what it is, and no waiting."""
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
    run = tmp_path / "run.h5"
    write(run, copy.deepcopy(HEADER), samples(), {})
    for arguments in (
        ["analyse", str(path), "--json"],
        ["formats", str(path)],
        ["replay", str(path)],
        ["convert", str(path), str(tmp_path / "out.h5")],
        ["recover", str(path)],
        ["analyse", str(run), "--json", "--scene", str(path)],
        ["simulate", "--scene", str(path)],
        ["batch", "--runs", str(path), "-o", str(tmp_path / "course")],
        ["batch", f"@{path}", "-o", str(tmp_path / "course")],
    ):
        if arguments[0] == "formats" and kind == "directory":
            continue  # which lists what is in a folder
        with answer_within(SECONDS):
            code = main(arguments)
        output = capsys.readouterr()
        assert code in (2, 3), (arguments, output.err)
        demand = f"expected a regular file, got a {kind}"
        if arguments[:2] == ["analyse", str(path)] and kind == "directory":  # a folder without recordings
            demand = "expected a folder with recordings, got none"
        assert demand in output.err
        assert output.err.count("\n") == 1
