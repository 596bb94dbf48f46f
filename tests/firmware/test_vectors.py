"""Firmware, decoder and the page of the protocol say the same: one set of vectors, which stands on that page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from acquisition.decoders.line_protocol import LineProtocolDecoder
from tests.encoders import crc16

from .conftest import ROOT, Emulate

pytestmark = pytest.mark.trials

PAGE = ROOT / "docs" / "reference" / "line-protocol.md"
SCRIPT = (
    (0.5, "?"),
    (4.0, "G2400,3000"),
    (4.5, "G116,2200"),
    (5.0, "G116,25000"),
    (5.4, "hello"),
    (5.6, "Nbench-3"),
    (5.8, "G200,2100"),
    (6.0, "J500"),
    (6.2, "R125"),
)
"""Commands that bring out every line that the firmware knows, with the troubles of :func:`sent_lines`."""


def vectors(page: Path = PAGE) -> list[str]:
    """Return the lines of the page's vectors that the firmware sends: leading zeros, a refusal, identifications."""
    found = re.findall(
        r"^\| `(\$.*?)` \|", page.read_text(encoding="utf-8").partition("\n## Vectors\n")[2], re.MULTILINE
    )
    return [line for line in found if re.match(r"\$(R1,0[0-9]{9},|X1|I1)", line)]


@pytest.fixture
def sent_lines(emulate: Emulate) -> list[str]:
    """Return what the firmware says at a bench where a bob of 0.4 m hangs still, and much goes wrong."""
    run = emulate(
        7.0,
        say=SCRIPT,
        noise=0,
        amplitude=0,
        damping=0,
        rest=0.4,
        temperature=21.3,
        absent="2,2.2",
        gone="2.5,2.6",
        stuck="3,3.5",
    )
    return [line.decode("ascii") for _, line in run.lines]


def test_the_firmware_sends_the_vectors_of_the_page(sent_lines: list[str]) -> None:
    """Each of them, and among them every status, a temperature, both identifications and the refusal."""
    wanted = vectors()
    assert {line.partition("*")[0][-1] for line in wanted if line.startswith("$R1")} == set("ENBCFAS")
    assert sum(line.startswith("$I1") for line in wanted) == 2
    assert "$X1,command*392D" in wanted
    assert [line for line in wanted if f"{line}\n" not in sent_lines] == []


def test_every_line_of_the_firmware_is_of_the_page_s_form_and_decodes_to_its_fields(sent_lines: list[str]) -> None:
    """The page's table of fields as one expression, the checksum bit by bit; the decoder agrees on every field."""
    form = re.compile(
        r"\$(R1,([0-9]{1,10}),([0-9]{1,10}),([0-9]{1,6}\.[0-9]{2})?,(-?[0-9]{1,5})?,([ENBCFAS])"
        r"|I1,[a-z0-9-]{1,32},[0-9]+\.[0-9]+\.[0-9]+,[A-Za-z0-9._-]{0,12},[0-9]+,[0-9]+,[0-9]+,[0-9]+,[01]"
        r"|X1,command)\*([0-9A-F]{4})\n"
    )
    decoder, read, written = LineProtocolDecoder(), [], []
    for line in sent_lines:
        whole = form.fullmatch(line)
        assert whole is not None, line
        assert len(line) <= 97
        assert int(whole[7], 16) == crc16(whole[1].encode("ascii"))
        read += [
            (row.sequence, row.device_us, row.echo_us, row.temperature_c)
            for row in decoder.feed(0, line.encode("ascii"))
        ]
        if whole[2]:
            written.append((whole[2], whole[3], whole[4], whole[5]))
    assert len(read) == len(written) > 600
    for (sequence, device_us, echo_us, celsius), (number, clock, echo, hundredths) in zip(read, written, strict=True):
        assert (sequence, device_us) == (int(number), int(clock))
        assert echo_us == pytest.approx(float(echo or "nan"), nan_ok=True)
        assert celsius == pytest.approx(int(hundredths) / 100 if hundredths else float("nan"), nan_ok=True)
    assert {name: count for name, count in decoder.faults.items() if count} == {
        "refused_command": 1,
        "garbage_bytes": len("$X1,command*392D\n"),
    }
