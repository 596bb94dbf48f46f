"""Sources of blocks, live and replayed through one interface, and simulations as the command makes them."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w

import springmass as sm
from acquisition.block import concatenate
from acquisition.clock import SystemClock
from acquisition.decoders.registry import get_family
from acquisition.simulated import VirtualPort, VirtualRangefinder, VirtualSensor
from springmass.cli import main
from springmass.simulations.bench import bench_position

DATA = sm.sample_data()
BENCH = {
    "bob": {"mass_kg": {"value": 0.2, "u": 5e-5}},
    "spring": {"mass_kg": 0.01, "constant_n_per_m": {"value": 14.0, "u": 0.01}},
    "start": {"displacement_m": 0.05},
    "damping": {"gamma_per_s": 0.01},
}


def test_a_replay_is_kept_losslessly(tmp_path: Path) -> None:
    """Its blocks are the samples of the recording; its run file gives the same numbers and holds the original."""
    path = DATA / "damped_simulated_position.txt"
    with sm.source(path, speed=math.inf) as bench:
        bench.record(tmp_path / "again.h5")
        blocks = list(bench)
    whole = sm.load(path)
    np.testing.assert_array_equal(np.concatenate([block.distance for block in blocks]), whole.loaded.samples.distance)
    again = sm.analyse(tmp_path / "again.h5")
    assert again.result["estimates"] == whole.result["estimates"]
    assert again.loaded.originals == whole.loaded.originals
    with pytest.raises(sm.Error, match="no such file"):
        sm.source("missing.txt")
    with sm.source(path) as bench, pytest.raises(sm.Error, match="exists"):
        bench.record(tmp_path / "again.h5")


def test_an_empty_recording_has_no_samples(tmp_path: Path) -> None:
    """None are made up from its scene."""
    loaded = sm.load(DATA / "damped_simulated_position.txt").loaded
    nothing = sm.Run(replace(loaded, recording=replace(loaded.recording, samples=concatenate(()))))
    path = sm.Run(nothing.loaded, sm.Scene.from_mapping(BENCH)).save(tmp_path / "empty.h5")
    with sm.source(path, speed=math.inf) as bench:
        assert [len(block) for block in bench] == []


def test_a_simulated_bench_swings_without_end(tmp_path: Path) -> None:
    """What was recorded of it gives the spring constant of its scene."""
    with sm.source(BENCH, speed=math.inf) as bench:
        bench.record(tmp_path / "bench.h5")
        for block in bench:
            if block.t[-1] > 60.0:
                break
    run = sm.analyse(tmp_path / "bench.h5", BENCH)
    assert run.loaded.info.kind == "simulated"
    assert abs(run["k"].value - 14.0) < 3.0 * run["k"].u < 0.1


def test_a_port_is_a_source_like_any_other(tmp_path: Path) -> None:
    """Its sensor is found by what it sends, and every byte from ``record`` on becomes a run file."""
    scene, path = sm.Scene.from_mapping(BENCH), tmp_path / "live.h5"
    finder = VirtualRangefinder(bench_position(scene), VirtualSensor(rate_hz=100.0), np.random.default_rng(0))
    with VirtualPort(get_family("line-protocol"), finder, SystemClock(), seconds=60.0) as port:
        port.start()
        with sm.source(port.path, scene=scene) as bench:
            bench.record(path)
            seen = 0
            for block in bench:
                seen += len(block)
                if seen >= 100:
                    break
    run = sm.load(path)
    assert len(run.loaded.samples) >= seen
    assert run.scene == scene
    assert not path.with_suffix(".wire").exists()


def test_a_simulation_is_that_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same motion, error, method and band."""
    scene = tmp_path / "bench.toml"
    scene.write_text(tomli_w.dumps(BENCH))
    assert main(["simulate", "--scene", str(scene), "--seconds", "20", "--json"]) == 0
    command = json.loads(capsys.readouterr().out)
    motion = sm.simulate(scene, np.arange(2001) * 0.01)
    assert motion.attrs["method"] == command["method"]
    assert motion.attrs["error"] == pytest.approx(command["predicted_error"])
    assert float(motion.u_displacement.max()) == pytest.approx(
        command["band"]["displacement_half_width_68_m"], rel=1e-6
    )


def test_a_step_of_ones_own_is_a_method() -> None:
    """Written out, symplectic Euler is the one that ships; its error is of first order."""

    def step(y, v, h, a):  # type: ignore[no-untyped-def]
        v = v + h * a(y, v)
        return y + h * v, v

    t = np.arange(0, 10, 0.001)
    mine, built_in = sm.simulate(BENCH, t, method=step), sm.simulate(BENCH, t, method="symplectic-euler")
    np.testing.assert_allclose(mine.displacement, built_in.displacement, atol=1e-12)
    for wrong, said in ((t[::-1], "equally spaced"), (t + 1.0, "from 0"), (t[:1], "equally spaced")):
        with pytest.raises(sm.Error, match=said):
            sm.simulate(BENCH, wrong)
