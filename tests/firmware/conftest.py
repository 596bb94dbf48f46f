"""The rangefinder's firmware, built and run under an emulator, with what truly happened beside what it said."""

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from acquisition.block import F8, I8, Block
from acquisition.decoders.line_protocol import FAMILY
from acquisition.live.decoding import SensorChain

ROOT = Path(__file__).resolve().parents[2]
CPU_HZ = 16e6
ELF = "springmass_rangefinder.elf"
NEEDED = {
    "gcc-avr": Path("/usr/bin/avr-g++"),
    "avr-libc": Path("/usr/lib/avr/include/avr/io.h"),
    "arduino-core-avr": Path("/usr/share/arduino/hardware/arduino/avr"),
    "libsimavr-dev": Path("/usr/include/simavr/sim_avr.h"),
    "libelf-dev": Path("/usr/include/libelf.h"),
}


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build firmware and bench; return their folder."""
    absent = [package for package, proof in NEEDED.items() if not proof.exists()]
    absent += [tool for tool in ("make", "cc", "pkg-config") if shutil.which(tool) is None]
    if absent:
        pytest.skip(f"building the firmware needs {', '.join(absent)}; .ci/run installs them")
    folder = tmp_path_factory.mktemp("firmware")
    done = subprocess.run(
        ["make", "-C", ROOT / "firmware", f"BUILD={folder}", "all"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return folder


@dataclass(frozen=True, eq=False)
class Pings:
    """What truly happened, a row for each pulse on TRIG; times in cycles of the processor.

    ``echo_ticks`` is how long ECHO was up, -1 where it did not go up and come down.
    """

    up: I8
    down: I8
    kind: list[str]
    flight_us: F8
    echo_ticks: I8


@dataclass(frozen=True, eq=False)
class Emulated:
    """A run of the firmware: the truth, the lines it sent with the cycle at which each was over, and the end."""

    pings: Pings
    lines: list[tuple[int, bytes]]
    clock_ppm: float
    ram: int
    watchdog: int
    all_sent: bool

    def true_ns(self, cycle: float) -> int:
        """True time of a cycle."""
        return round(cycle / (CPU_HZ * (1.0 + self.clock_ppm * 1e-6)) * 1e9)

    def readings(self) -> list[tuple[int, int, bytes, bytes, bytes]]:
        """Sequence, device us, echo, temperature, status of each reading, split without the decoder."""
        rows = [line[1:-1].partition(b"*")[0].split(b",") for _, line in self.lines if line.startswith(b"$R1,")]
        return [(int(r[1]), int(r[2]), r[3], r[4], r[5]) for r in rows]

    def through_host(self, seed: int) -> tuple[SensorChain, Block]:
        """Return chain and samples as a host makes them of the lines, which come late as USB brings them.

        A frame of the bus a millisecond long, a scheduler's delays, and one read in fifty later by up to 30 ms.
        """
        rng = np.random.default_rng(seed)
        chain = SensorChain(FAMILY)
        n = len(self.lines)
        late_ns = rng.exponential(0.2e6, n) + np.where(rng.random(n) < 0.02, rng.uniform(0.0, 30e6, n), 0.0)
        stamp = 0
        for (cycle, line), late in zip(self.lines, late_ns, strict=True):
            arrived = -(-self.true_ns(cycle) // 1_000_000) * 1_000_000 + int(late)
            stamp = max(stamp, arrived)  # a read that waits holds up those behind it
            chain.take(stamp, line)
        return chain, chain.block()


Emulate = Callable[..., Emulated]


@pytest.fixture
def emulate(built: Path, tmp_path: Path) -> Emulate:
    """Run the firmware for some seconds of its clock; options as the bench takes them, say as (s, command)."""

    def run(seconds: float, *, say: tuple[tuple[float, str], ...] = (), **options: object) -> Emulated:
        log = tmp_path / "bench.log"
        words = [f"--seconds={seconds}", f"--log={log}", *(f"--say={at},{text}" for at, text in say)]
        for name, value in options.items():
            option = "--" + name.replace("_", "-")
            words.append(option if value is True else f"{option}={value}")
        done = subprocess.run([built / "bench", built / ELF, *words], capture_output=True, timeout=1200)
        assert done.returncode == 0, done.stderr.decode(errors="replace")
        _, cycles, _, ram, _, watchdog, _, all_sent = done.stdout.decode("ascii").split()
        assert int(cycles) >= seconds * CPU_HZ * 0.99
        return read_log(log, float(str(options.get("clock_ppm", 0.0))), int(ram), int(watchdog), all_sent == "1")

    return run


def read_log(path: Path, clock_ppm: float, ram: int, watchdog: int, all_sent: bool) -> Emulated:
    """Read what the bench wrote."""
    pulses, lines = [], []
    with path.open(encoding="ascii") as file:
        for row in file:
            word, *fields = row.split()
            if word == "P":
                pulses.append(fields)
            else:
                lines.append((int(fields[0]), bytes.fromhex(fields[1])))
    numbers = np.array([(p[0], p[1], p[4], p[5]) for p in pulses], np.int64).reshape(-1, 4)
    up, down = numbers[:, 2], numbers[:, 3]
    ticks = np.where((up > 0) & (down > 0), down - up, -1)
    flight = np.array([p[3] for p in pulses], np.float64)
    pings = Pings(numbers[:, 0], numbers[:, 1], [p[2] for p in pulses], flight, ticks)
    return Emulated(pings, lines, clock_ppm, ram, watchdog, all_sent)
