"""Firmware, decoder and the page of the protocol say the same: one set of vectors, which stands on that page."""

import re

import pytest

from .conftest import ROOT, Emulate

pytestmark = pytest.mark.trials

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
"""Commands that bring out every line that the firmware knows, with the troubles of the bench."""


def test_the_firmware_sends_the_vectors_of_the_page(emulate: Emulate) -> None:
    """Each of them, of a bob of 0.4 m that hangs still while much goes wrong.

    Among them are every status, a temperature, both identifications and the refusal.
    """
    still = {"noise": 0, "amplitude": 0, "damping": 0, "rest": 0.4, "temperature": 21.3}
    run = emulate(7.0, say=SCRIPT, **still, absent="2,2.2", gone="2.5,2.6", stuck="3,3.5")
    sent_lines = [line.decode("ascii") for _, line in run.lines]
    page = (ROOT / "docs" / "reference" / "line-protocol.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\$.*?)` \|", page.partition("\n## Vectors\n")[2], re.MULTILINE)
    # Those that the firmware sends: with leading zeros, a refusal, and identifications.
    wanted = [line for line in rows if re.match(r"\$(R1,0[0-9]{9},|X1|I1)", line)]
    assert {line.partition("*")[0][-1] for line in wanted if line.startswith("$R1")} == set("ENBCFAS")
    assert sum(line.startswith("$I1") for line in wanted) == 2
    assert "$X1,command*392D" in wanted
    assert [line for line in wanted if f"{line}\n" not in sent_lines] == []
