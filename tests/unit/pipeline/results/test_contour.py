"""The region of two parameters of a damping law, against another program's."""

import lmfit
import numpy as np
import pytest
from scipy.stats import chi2

from pipeline.analyse import analyse
from pipeline.options import Options
from pipeline.track import Track


def power(t: np.ndarray, start: float, c: float, n: float) -> np.ndarray:
    """Return amplitudes that fall by c times their n-th power."""
    return np.asarray((start ** (1.0 - n) - (1.0 - n) * c * t) ** (1.0 / (1.0 - n)))


def test_a_bent_contour_is_that_of_lmfit() -> None:
    """On the profile's border conf_interval2d finds the same chi-square; the ellipse's ends are elsewhere."""
    t = np.arange(3000) / 100
    swing = power(t, 0.05, 0.1, 1.15) * np.cos(8.0 * t)
    noise = 2e-3 * np.random.default_rng(2).standard_normal(t.size)
    result = analyse(Track.from_arrays(t, 0.3 + swing + noise), options=Options(laws=("power",)))
    found = result.contour((0.6827, 0.9545))
    assert found is not None
    assert found.names == ("c", "n")
    assert found.profiles is not None

    kept, fit = result.damping.scatter.kept, result.damping.best
    at, y, u = result.motion.windows.t[kept], result.motion.windows.amplitude[kept], result.damping.scatter.u[kept]

    def residual(params: lmfit.Parameters) -> np.ndarray:
        return (power(at - result.damping.t0, *params.valuesdict().values()) - y) / u

    start = lmfit.create_params(**dict(zip(fit.joint.names, fit.joint.values, strict=True)))
    fitter = lmfit.Minimizer(residual, start)
    best = fitter.minimize()
    # lmfit's scale of u is chi-square alone; ours has the correlation of neighbouring windows too.
    wider = fit.joint["n"].u / best.params["n"].stderr

    def rise(point: np.ndarray) -> float:
        limits = [(value, value) for value in point.tolist()]
        *_, sigma = lmfit.conf_interval2d(fitter, best, "c", "n", 1, 1, limits)
        return float(sigma[0, 0] / wider)

    for share, border in zip((0.6827, 0.9545), found.profiles, strict=True):
        assert [rise(point) for point in border[:48:6]] == pytest.approx([chi2.ppf(share, 2) ** 0.5] * 8, rel=0.01)
    ends = found.ellipses[1][[int(np.argmax(found.ellipses[1][:, 1])), int(np.argmin(found.ellipses[1][:, 1]))]]
    assert max(rise(point) for point in ends) > 1.2 * chi2.ppf(0.9545, 2) ** 0.5
