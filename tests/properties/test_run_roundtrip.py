"""Whatever goes into a run file comes out bit for bit, or not at all."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from acquisition.block import Block, SourceInfo, concatenate
from acquisition.recordings.recording import FormatIssue, Original
from storage.errors import NotARun, RunDamaged
from storage.run_file.reading import RunFile, open_run
from storage.run_file.writing import write_run
from tests.sampling import sampled
from tests.wire import bits

# Any bit pattern is a float64: NaN payloads, negative zero and subnormal numbers among them. Those beyond the range
# that a run file holds become small by their highest bits.
patterns = st.integers(0, 2**64 - 1)
texts = st.text(max_size=20) | st.sampled_from(["\0", "a\0", "\ud800", "🜁 Träger", "a\nb"])
numbers = st.floats(allow_nan=False, allow_infinity=False)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | numbers | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=8,
)
mappings = st.dictionaries(texts, json_values, max_size=4)


def floats(draw: Any, n: int) -> Any:
    """Draw n float64 of any bit pattern that a run file may hold."""
    drawn = draw(hnp.arrays(np.uint64, n, elements=patterns))
    with np.errstate(invalid="ignore"):  # signalling NaN
        beyond = np.abs(drawn.view(np.float64)) > 1e12
    return np.where(beyond, drawn & np.uint64(0xBFFFFFFFFFFFFFFF), drawn).view(np.float64)


@st.composite
def runs(draw: Any) -> list[Block]:
    """Draw consecutive blocks; each may have a velocity and host times, or not."""
    first = draw(st.integers(0, 2**31))
    blocks = []
    for n in draw(st.lists(st.integers(0, 12), max_size=4)):
        flags = draw(hnp.arrays(np.uint8, n))
        host = draw(st.none() | hnp.arrays(np.int64, n, elements=st.integers(-1, 2**62)))
        velocity = floats(draw, n) if draw(st.booleans()) else None
        blocks.append(Block(first, floats(draw, n), floats(draw, n), flags, host, velocity))
        first += n
    return blocks


infos = st.builds(
    SourceInfo,
    kind=st.sampled_from(["live", "replay", "simulated"]),
    name=texts,
    rate_hz=st.floats(1e-3, 1e6),
    sigma_m=st.none() | st.floats(0, 1),
    quantum_m=st.none() | st.floats(0, 1),
    clock=st.sampled_from(["nominal", "device", "host"]),
    stated_error_m=st.none() | st.floats(0, 1),
)
traps = st.builds(FormatIssue, texts, texts, st.integers(0, 2**40), st.none() | st.integers(1, 2**40))
originals = st.builds(Original, texts, st.binary(max_size=40))


@given(
    blocks=runs(),
    info=infos,
    title=texts,
    scene=st.none() | mappings,
    provenance=mappings,
    seen=st.lists(traps, max_size=3),
    files=st.lists(originals, max_size=3),
)
def test_everything_comes_back_bit_for_bit(
    blocks: list[Block],
    info: SourceInfo,
    title: str,
    scene: dict[str, Any] | None,
    provenance: dict[str, Any],
    seen: list[FormatIssue],
    files: list[Original],
) -> None:
    """Any blocks, texts, scene and files come back as they were, however they are read."""
    whole = bits(concatenate(blocks))
    with tempfile.TemporaryDirectory() as folder:
        path = write_run(
            Path(folder) / "run.h5",
            iter(blocks),
            info,
            originals=files,
            scene=scene,
            title=title,
            traps=seen,
            provenance=provenance,
        )
        with open_run(path) as run:
            assert bits(run.samples()) == whole
            assert (run.info, run.header.title, run.header.scene, run.provenance) == (info, title, scene, provenance)
            assert (run.traps, run.originals()) == (tuple(seen), tuple(files))
            run.verify()


def everything(run: RunFile) -> tuple[Any, ...]:
    """Return all that a run says."""
    return run.header, run.traps, bits(run.samples()), run.originals()


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a small run with everything in it."""
    n = 400
    t, rng = np.arange(n) / 100, np.random.default_rng(5)
    block = Block(0, t, rng.normal(size=n), np.zeros(n, np.uint8), (t * 1e9).astype(np.int64), rng.normal(size=n))
    return write_run(
        tmp_path_factory.mktemp("sound") / "run.h5",
        [block],
        SourceInfo("live", "COM3", 100.0, sigma_m=3e-4),
        originals=[Original("a.txt", rng.bytes(2000))],
        scene={"bob": {"mass_kg": 0.2}},
        title="Träger",
        traps=[FormatIssue("truncated_row", "One row was cut.")],
        provenance={"software": "springmass"},
    )


@pytest.mark.parametrize("seed", sampled(range(8)))
def test_a_flipped_byte_is_found_or_harmless(sound: Path, tmp_path: Path, seed: int) -> None:
    """After any change of one byte the run is refused in one line, or says exactly what it said before."""
    with open_run(sound) as run:
        before = everything(run)
    content, rng = bytearray(sound.read_bytes()), np.random.default_rng(seed)
    refusals = []
    for place in rng.integers(len(content), size=40):
        mask = int(rng.integers(1, 256))
        content[place] ^= mask
        flipped = tmp_path / "flipped.h5"
        flipped.write_bytes(content)
        content[place] ^= mask
        try:
            with open_run(flipped) as run:
                assert everything(run) == before, f"byte {place} ^ {mask}"
        except (RunDamaged, NotARun) as error:
            refusals.append(str(error))
    assert not [text for text in refusals if "\n" in text]
    assert refusals  # the test would be idle if it only ever met unused bytes


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1, exclude_max=True))
def test_a_cut_file_is_refused(sound: Path, tmp_path: Path, share: float) -> None:
    """A run that ends early, wherever, is refused at opening."""
    content = sound.read_bytes()
    cut = tmp_path / "cut.h5"
    cut.write_bytes(content[: int(share * len(content))])
    with pytest.raises((RunDamaged, NotARun)):
        open_run(cut)
