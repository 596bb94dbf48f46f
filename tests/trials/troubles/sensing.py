"""Troubles of a sensor: it cuts off, smooths, holds, counts in steps, hums, mistakes its echoes."""

import math

import numpy as np

from tests.trials.troubles.motion import F8
from tests.trials.troubles.record import Bench, Record, kind


def _report_twin(seed: int) -> Record:
    """Seven periods of a lab report: at the far end every crest is cut off by the echo of a fixed object."""
    b = Bench(seed, "report", seconds=5.1, sigma_m=0.069e-3, omega=2 * math.pi / 0.7253, amplitude=0.0714, gamma=0.003)
    x = b.motion.position(b.t)
    level = 0.0714 * math.cos(math.pi / 4.0)
    crest = np.floor((b.t - b.motion.turns[0][0]) / 0.7253 + 0.25).astype(int)
    crest -= crest.min()
    # Levels of 31.97 to 32.25 cm, some crests flipping between two.
    levels = b.rng.uniform(-1.4e-3, 1.4e-3, (crest.max() + 1, 2))
    levels[:, 1] = np.where(b.rng.random(crest.max() + 1) < 0.5, levels[:, 0], levels[:, 1])
    second = np.repeat(b.rng.random(b.t.size // 8 + 1) < 0.5, 8)[: b.t.size].astype(int)
    plateau = level + levels[crest, second]
    cut = x > plateau
    y = np.where(cut, plateau + 0.05e-3 * b.rng.standard_normal(b.t.size), x + b.noise())
    near = np.convolve(cut, np.ones(5), "same") > 0
    smooth = np.convolve(y, [0.25, 0.5, 0.25], "same")
    edge = near & (np.abs(np.gradient(cut.astype(float))) > 0)
    y[1:-1] = np.where(edge, smooth, y)[1:-1]
    return b.record(0.3211 - level + y, "period", "amplitude", "damping_rate", offset=0.3211 - level)


def _clipped(
    seed: int,
    *,
    far: float | None = None,
    near: float | None = None,
    wander_m: float = 0.0,
    rounded_m: float = 0.0,
    until_s: float = math.inf,
    gamma: float = 0.012,
    seconds: float = 20.0,
    noisy: bool = False,
) -> Record:
    """Cut at a share of the amplitude at the start; with plateaus that wander, round off, or end with the crests."""
    b = Bench(seed, f"clip {far} {near} {wander_m} {rounded_m} {until_s}", seconds=seconds, gamma=gamma)
    x, a = b.motion.position(b.t), b.motion.amplitude(0.0)
    turn = np.searchsorted(b.motion.turns[0], b.t)
    levels = wander_m * b.rng.uniform(-1.0, 1.0, turn.max() + 2)
    y = x + b.noise()
    for share, side in ((far, 1.0), (near, -1.0)):
        if share is None:
            continue
        level = share * a + levels[turn + (side > 0)]
        over = side * x - level
        cut = (over > 0) & (b.t < until_s)
        # A rounded plateau still rises, the less the farther the bob is beyond it.
        bulge = rounded_m * np.tanh(np.maximum(over, 0.0) / max(3.0 * rounded_m, 1e-9))
        own = b.noise() if noisy else 0.03e-3 * b.rng.standard_normal(b.t.size)
        y = np.where(cut, side * (level + bulge) + own, y)
    return b.record(b.rest_m + y)


def _saturated(seed: int) -> Record:
    """Beyond its range the sensor gives its greatest distance."""
    b = Bench(seed, "saturated")
    y = b.distance() + b.noise()
    return b.record(np.minimum(y, b.rest_m + 0.75 * b.motion.amplitude(0.0)))


def _smoothed(seed: int, how: str, length: float, sigma_m: float = 3e-4) -> Record:
    """What a sensor gives that smooths what it measures, from the time on when its memory is full."""
    b = Bench(seed, f"{how} {length}", seconds=22.0, sigma_m=sigma_m)
    y = b.distance() + b.noise()
    if how == "lag":
        # A first-order lag, exact for a straight line between samples.
        share = 1.0 - math.exp(-1.0 / (b.rate_hz * length))
        held, out = y[0], np.empty_like(y)
        for k, value in enumerate(y):
            held += share * (value - held)
            out[k] = held
    else:
        size = int(length)
        windows = np.lib.stride_tricks.sliding_window_view(np.concatenate([np.full(size - 1, y[0]), y]), size)
        out = windows.mean(1) if how == "mean" else np.median(windows, 1)
    keep = b.t >= 2.0
    # The phase is late by the filter's delay; amplitude and damping are the bob's at that moment within u.
    return b.record(out[keep], t=b.t[keep])


def _stepped(seed: int, step_m: float, *, hold_hz: float | None = None, sigma_m: float = 3e-4) -> Record:
    """Distances in steps, and new ones only so often."""
    b = Bench(seed, f"steps {step_m} {hold_hz}", sigma_m=sigma_m, seconds=30.0)
    k = np.arange(b.t.size)
    if hold_hz is not None:
        fresh = np.floor(b.t * hold_hz + 1e-9)
        k = np.searchsorted(fresh, fresh)
    y = (b.distance() + b.noise())[k]
    return b.record(np.round(y / step_m) * step_m if step_m else y)


def _rarely(seed: int, a_period: float) -> Record:
    """So many samples a period."""
    b = Bench(seed, f"rare {a_period}", seconds=60.0, rate_hz=8.3 / (2.0 * math.pi) * a_period, omega=8.3)
    return b.record(b.distance() + b.noise())


def _scaled(seed: int, how: str, size: float) -> Record:
    """A scale that is not straight."""
    b = Bench(seed, f"scale {how} {size}")
    x, a = b.motion.position(b.t), b.motion.amplitude(0.0)
    # True where the bob hangs still, and ever farther off away from there.
    bent = x + size * x**2 / a if how == "square" else a * np.tanh(size * x / a) / size
    return b.record(b.rest_m + bent + b.noise())


def _mirror(seed: int, how: str, share: float) -> Record:
    """An echo by way of a wall that moves with the bob, heard when it is near one end."""
    b = Bench(seed, f"mirror {how} {share}")
    x, level = b.motion.position(b.t), share * b.motion.amplitude(0.0)
    beyond = x > level
    seen = {"detour": x + 0.004, "image": 2.0 * level - x, "slow": level + 0.5 * (x - level)}[how]
    return b.record(b.rest_m + np.where(beyond, seen, x) + b.noise())


def _hum(seed: int, size_m: float, *, still: bool) -> Record:
    """Mains hum in the distances, of a bob that swings or hangs still."""
    b = Bench(seed, f"hum {size_m} {still}", rate_hz=120.0)
    hum = size_m * np.sin(2 * math.pi * 50.0 * b.t + b.rng.uniform(0, 6))
    if still:
        return Record(t=b.t, y=b.rest_m + hum + b.noise(), truth={"offset": b.rest_m})
    return b.record(b.distance() + hum + b.noise())


def _hum_and_clip(seed: int) -> Record:
    """Mains hum near half the sampling rate, and crests cut off at the near end."""
    b = Bench(seed, "hum and clip", seconds=30.0)
    y = b.distance() + 2e-3 * np.sin(2 * math.pi * 49.98 * b.t + b.rng.uniform(0, 6)) + b.noise()
    level = b.rest_m - 0.8 * b.bob.amplitude
    return b.record(np.maximum(y, level + 1e-4 * b.rng.standard_normal(b.t.size)))


def _growing_noise(seed: int) -> Record:
    """Noise that grows steeply with the distance."""
    b = Bench(seed, "growing noise")
    d = b.distance()
    return b.record(d + b.noise() * np.exp((d - b.rest_m) / 0.02))


def _coloured(seed: int, rho: float) -> Record:
    """Noise of which every sample remembers the one before."""
    b = Bench(seed, f"coloured {rho}", seconds=30.0)
    white = b.rng.standard_normal(b.t.size + 500)
    noise = np.empty_like(white)
    last = 0.0
    for k, value in enumerate(white):
        last = noise[k] = rho * last + math.sqrt(1.0 - rho * rho) * value
    return b.record(b.distance() + 1e-3 * noise[500:])


def _heavy_tails(seed: int) -> Record:
    """Noise with the tails of Student's t of three degrees of freedom."""
    b = Bench(seed, "tails")
    return b.record(b.distance() + 3e-4 * b.rng.standard_t(3, b.t.size))


def _many_periods(seed: int) -> Record:
    """Well over a thousand periods of a bob that is hardly damped."""
    b = Bench(seed, "many", seconds=1200.0, rate_hz=20.0, gamma=4e-4, beta=0.01)
    return b.record(b.distance() + b.noise())


def _quiet_at_rest(seed: int) -> Record:
    """Hours of a finely stepped sensor whose noise does not reach over one step once the bob hangs still."""
    b = Bench(seed, "day", seconds=900.0, rate_hz=10.0, omega=4.2, gamma=0.012, sigma_m=3e-6)
    t = np.arange(10 * 3600 * 2) / 10.0
    x = np.where(t < 890.0, b.motion.position(t), 0.0)
    y: F8 = b.rest_m + x + b.noise(t.size)
    return b.record(np.round(y / 43e-6) * 43e-6, "period", "offset", "amplitude", "damping_rate", t=t)


KINDS = (
    kind("clipped: the report's own", "clipped", _report_twin, cure=True),
    kind("clipped: far end", "clipped", _clipped, far=0.8, cure=True),
    kind("clipped: near end, slightly", "clipped", _clipped, near=0.97, cure=True),
    kind("clipped: far end, noisy plateau", "clipped", _clipped, far=0.8, noisy=True, cure=True),
    kind("clipped: wandering", "clipped", _clipped, far=0.8, wander_m=1.5e-3, cure=True),
    kind("clipped: rounded", "clipped", _clipped, far=0.8, rounded_m=1.5e-3, cure=True),
    kind("clipped: both ends", "clipped", _clipped, far=0.8, near=0.75, cure=True),
    kind("clipped: both, wandering", "clipped", _clipped, far=0.8, near=0.8, wander_m=1.5e-3, cure=True),
    kind("clipped: both, rounded", "clipped", _clipped, far=0.8, near=0.8, rounded_m=1.5e-3, cure=True),
    kind("clipped: first cycles only", "clipped", _clipped, far=0.85, gamma=0.02, seconds=60.0, cure=True),
    kind("clipped: obstacle removed at 5 s", "clipped", _clipped, far=0.7, until_s=5.0, cure=True),
    kind("clipped: range of the sensor", "clipped", _saturated, cure=True),
    kind("smoothed: mean of 5", "smoothed", _smoothed, "mean", 5),
    kind("smoothed: mean of 15", "smoothed", _smoothed, "mean", 15),
    kind("smoothed: mean of 15, 2.39 mm", "smoothed", _smoothed, "mean", 15, 2.39e-3),
    kind("smoothed: mean of 31", "smoothed", _smoothed, "mean", 31),
    kind("smoothed: median of 9", "smoothed", _smoothed, "median", 9),
    kind("smoothed: median of 25", "smoothed", _smoothed, "median", 25),
    kind("smoothed: lag of 0.03 s", "smoothed", _smoothed, "lag", 0.03),
    kind("smoothed: lag of 0.2 s", "smoothed", _smoothed, "lag", 0.2),
    kind("held: 10 Hz in steps of 1 cm", "held", _stepped, 0.01, hold_hz=10.0),
    kind("held: 20 Hz, 1 mm", "held", _stepped, 0.001, hold_hz=20.0),
    kind("held: 25 Hz", "held", _stepped, 0.0, hold_hz=25.0),
    kind("steps: 1 mm", "quantised", _stepped, 0.001, sigma_m=1e-4, cure=True),
    kind("steps: 3 mm", "quantised", _stepped, 0.003, cure=True),
    kind("steps: 1 cm", "quantised", _stepped, 0.01),
    kind("steps: 1 inch", "quantised", _stepped, 0.0254),
    kind("rare: 3.4 a period", "few_samples", _rarely, 3.4),
    kind("rare: 2.3 a period", "few_samples", _rarely, 2.3),
    kind("rare: 1.6 a period", "few_samples", _rarely, 1.6),
    kind("scale: bent by 5 %", "scale", _scaled, "square", 0.05),
    kind("scale: bent by 1 %", "scale", _scaled, "square", 0.01),
    kind("scale: levels off", "scale", _scaled, "tanh", 0.4),
    kind("mirror: detour near one end", "mirror", _mirror, "detour", 0.6),
    kind("mirror: image near one end", "mirror", _mirror, "image", 0.8),
    kind("mirror: half speed near one end", "mirror", _mirror, "slow", 0.5),
    kind("hum: of a still bob", "hum", _hum, 0.5e-3, still=True),
    kind("hum: of a still bob, 3 mm", "hum", _hum, 3e-3, still=True),
    kind("hum: beside the motion", "hum", _hum, 0.5e-3, still=False, cure=True),
    kind("hum: and crests cut off", "hum_and_clip", _hum_and_clip),
    kind("noise: grows with distance", "noise", _growing_noise, cure=True),
    kind("noise: correlated, 0.9", "correlated", _coloured, 0.9),
    kind("noise: correlated, 0.98", "correlated", _coloured, 0.98),
    kind("noise: heavy tails", "noise", _heavy_tails, cure=True),
    kind("rest: hours, between two steps", "hours", _quiet_at_rest),
    kind("long: 1,600 periods", "nothing", _many_periods, cure=True),
)
