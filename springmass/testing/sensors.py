"""The rules for a family of rangefinders, whose encoder is written from the data sheet and checks its decoder."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from acquisition.decoders.decoder import Decoder
from acquisition.decoders.sensor import Sensor
from acquisition.readings import Reading
from pipeline.track import F8
from springmass.testing.demands import demand

N = 24
_ROWS = np.arange(N)
_SEQUENCE = 4_294_967_290 + _ROWS  # wraps midway where the device's counter has 32 bits
_DEVICE_US = 10_000 * _ROWS + 7
_ECHO_US_PER_M = 2e6 / 343.0
_NOISES = (b"MaxSonar-WR PN:7\rv", b"R$FF:\x22\x55", b"\xff" * 9, b"\0" * 9)
_FILLERS = (b"\xff", b"R", b"\0", b"1", b"$", b"\x55\xaa", b"noise")


@dataclass(frozen=True)
class SensorCase:
    """A family with frames of its data sheet and their distances, m, and whether a checksum detects every flip."""

    family: Sensor
    known: Sequence[tuple[bytes, float]] = ()
    checksum: bool = False

    @property
    def distance(self) -> F8:
        """Distances (n,) within the family's range, m; NaN for no target."""
        low, high = self.family.range_m
        return np.where(_ROWS % 7 == 5, np.nan, low + (high - low) * (0.2 + 0.1 * np.sin(1.3 * _ROWS)))

    def frames(self, distance: F8 | None = None) -> list[bytes]:
        """Return the bytes of each reading."""
        demand(self.family.encoder, "give the Sensor an encoder that is written from the data sheet")
        encode = self.family.encoder().encode  # type: ignore[misc]  # there is one, see above
        at = (self.distance if distance is None else distance).tolist()
        return [
            encode(sequence=n, device_us=us, echo_us=_ECHO_US_PER_M * x, distance_m=x, temperature_c=20.0 + n % 5)
            for n, us, x in zip(_SEQUENCE.tolist(), _DEVICE_US.tolist(), at, strict=False)
        ]

    def run(self, *reads: bytes) -> tuple[list[Reading], Decoder]:
        """Feed reads to a fresh decoder; return all it gave, and the decoder."""
        decoder = self.family.decoder()
        return [reading for i, data in enumerate(reads) for reading in decoder.feed(1_000 + i, data)], decoder

    def clean(self) -> list[Reading]:
        """Return the readings of all frames; the first is lost where nothing shows that it came from its beginning."""
        return self.run(b"".join(self.frames()))[0]


def _rows(readings: Sequence[Reading]) -> list[str]:
    """Return every reading without the host's time, comparable bit for bit."""
    return [repr(reading._replace(host_ns=0)) for reading in readings]


def _metres(readings: Sequence[Reading]) -> F8:
    """Return distances, with echo times turned into them as the encoder's were made; NaN for no target."""
    echoes = np.array([reading.echo_us for reading in readings], float)
    return np.where(np.isnan(echoes), [reading.distance_m for reading in readings], echoes / _ECHO_US_PER_M)


def decoded_as_encoded(case: SensorCase) -> None:
    """Distances come back to half the resolution, no target as NaN, the device's counter and time where it has them."""
    readings, decoder = case.run(b"".join(case.frames()))
    lead = N - len(readings)
    demand(lead in (0, 1), f"return one Reading for each sound frame, got {len(readings)} for {N}")
    sent, decoded = case.distance[lead:], _metres(readings)
    demand(
        np.array_equal(np.isnan(decoded), np.isnan(sent)), "return a Reading of NaN for no target, and only for that"
    )
    off, allowed = float(np.nanmax(np.abs(decoded - sent))), case.family.resolution_m / 2 + 1e-9
    demand(off <= allowed, f"decode distances to half of resolution_m, {allowed:g} m, got an error of {off:g} m")
    demand(decoder.pending == 0, f"keep no byte after the last frame, got pending {decoder.pending}")
    demand(lead or not any(decoder.faults.values()), f"count no fault on a sound stream, got {dict(decoder.faults)}")
    timed = 0
    for name, values in (("sequence", _SEQUENCE), ("device_us", _DEVICE_US)):
        numbers = [getattr(reading, name) for reading in readings]
        if set(numbers) != {-1}:
            timed += 1
            same = [number % 2**32 for number in numbers] == (values[lead:] % 2**32).tolist()
            demand(same, f"return the {name} that the encoder wrote, or -1 in every reading")
    demand(timed or not case.family.has_device_time, "return device_us or sequence, or leave has_device_time out")


def frames_of_the_data_sheet(case: SensorCase) -> None:
    """Frames of the data sheet are read as the maker says, and no target as NaN."""
    lead = b"" if len(case.clean()) == N else case.frames()[0]
    for frame, distance in (*case.known, *((frame, math.nan) for frame in case.frames(np.full(4, math.nan)))):
        distances = _metres(case.run(lead + frame)[0])
        same = distances.size == 1 and np.allclose(distances, distance, rtol=1e-12, atol=0, equal_nan=True)
        demand(same, f"read the frame {frame!r} as {distance} m, got {distances.tolist()}")


def cuts_do_not_matter(case: SensorCase) -> None:
    """Cut in two, into single bytes, and at random: the same readings and the same faults."""
    frames, rng = case.frames(), np.random.default_rng(6)
    clean = b"".join(frames)
    dirty = b"".join([frames[0], rng.bytes(9), *frames[1:4], frames[4][1:], *frames[5:8], frames[8][:-2], *frames[9:]])
    long = b"".join([*frames[:3], b"x" * 300, *frames[3:6], b"x" * 300])  # longer than any line, before a frame
    for data in (clean, dirty, long):
        whole, decoder = case.run(data)
        expected = (_rows(whole), dict(decoder.faults), decoder.pending)
        cuts = [[at] for at in range(0, len(data) + 1, 5)] + [list(range(1, len(data)))]
        cuts += [sorted(rng.integers(0, len(data), 9).tolist()) for _ in range(6)]
        for cut in cuts:
            reads = [data[a:b] for a, b in zip([0, *cut], [*cut, len(data)], strict=True)]
            readings, decoder = case.run(*reads)
            same = (_rows(readings), dict(decoder.faults), decoder.pending) == expected
            demand(same, f"decode the same however reads cut the stream; not so in {len(reads)} reads of {data!r:.60}")


def in_step_after_garbage(case: SensorCase) -> None:
    """What came before garbage stands, and from the third frame after it on every one is read as sent.

    Garbage is noise, or a frame that lost a byte; a sensor without marks is flushed after it.
    """
    frames, clean, rng = case.frames(), _rows(case.clean()), np.random.default_rng(0)
    noises = [*_NOISES, *(rng.bytes(size) for size in range(1, 40))]
    noises += [frames[8][:at] + frames[8][at + 1 :] for at in range(len(frames[8]))]
    for at, noise in product((0, 9, N), noises):
        decoder = case.family.decoder()
        before = _rows(decoder.feed(0, b"".join(frames[:at])))
        decoder.feed(1, noise)
        if not case.family.self_framing:
            decoder.flush()
        after = _rows(decoder.feed(2, b"".join(frames[at:])))
        before_noise = max(at - N + len(clean), 0)
        demand(before == clean[:before_noise], f"read the frames before {noise!r} as sent")
        sent = clean[before_noise + 2 :]
        demand(not sent or after[-len(sent) :] == sent, f"read the frames from the third after {noise!r} on as sent")


def flipped_bits(case: SensorCase) -> None:
    """With a checksum nothing that was not sent is read; without, one flip changes at most two readings."""
    data = b"".join(case.frames()[:10])
    sent, most = set(_metres(case.run(data)[0]).tolist()), 0 if case.checksum else 2
    for bit in range(len(data) * 8):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        readings, decoder = case.run(bytes(flipped))
        strange = [x for x in _metres(readings).tolist() if x not in sent and not math.isnan(x)]
        what = f"bit {bit % 8} of byte {bit // 8} in {data!r:.60}"
        demand(len(strange) <= most, f"let a flip of {what} make at most {most} wrong readings, got {strange}")
        noticed = sum(decoder.faults.values()) or decoder.pending or not case.checksum
        demand(noticed, f"count the fault of a frame that fails its check; none is for {what}")


def noise_is_counted(case: SensorCase) -> None:
    """Bytes of noise make no reading; each is counted or held, and a few hundred at most are held."""
    noise = np.random.default_rng(3).bytes(5000)
    readings, decoder = case.run(noise)
    if case.family.self_framing:
        demand(not readings, f"make no reading of noise, or say self_framing=False, got {len(readings)}")
        counted = Counter(decoder.faults)
        number = counted["garbage_bytes"] + counted["blank_line"] + decoder.pending
        demand(number == len(noise), f'count bytes outside frames as "garbage_bytes", got {number} of {len(noise)}')
    for filler in _FILLERS:
        decoder = case.family.decoder()
        for size in [1] * 600 + [4096] * 4:
            decoder.feed(0, (filler * size)[:size])
            demand(decoder.pending <= 512, f"hold at most 512 bytes of {filler!r} without an end")


def begun_frames(case: SensorCase) -> None:
    """A frame has the host time of the read that completed it; a flush forgets and counts one that has begun."""
    frames, decoder, clean = case.frames(), case.family.decoder(), case.clean()
    decoder.flush()
    demand(not any(decoder.faults.values()), "count nothing in a flush() of nothing")
    readings = [*decoder.feed(111, b"".join(frames[:3]) + frames[3][:1])]
    demand(decoder.pending == 1, f"hold the first byte of a frame as pending, got {decoder.pending}")
    readings += decoder.feed(222, frames[3][1:] + frames[4] + frames[5][:1])
    same = [reading.host_ns for reading in readings] == [111] * (3 - N + len(clean)) + [222] * 2
    demand(same, "give each Reading the host_ns of the feed that completed its frame")
    faults = sum(decoder.faults.values())
    decoder.flush()
    counted = decoder.pending == 0 and sum(decoder.faults.values()) > faults
    demand(counted, "discard a frame that has begun in flush(), and count it as a fault")
    demand(_rows(decoder.feed(0, b"".join(frames))) == _rows(clean), "read as a fresh decoder after a flush()")


RULES = (
    decoded_as_encoded, frames_of_the_data_sheet, begun_frames, cuts_do_not_matter, in_step_after_garbage,
    flipped_bits, noise_is_counted,
)  # fmt: skip
