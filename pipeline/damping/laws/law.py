"""What every damping law must offer."""

from __future__ import annotations

from typing import Protocol

from pipeline.track import F8

__all__ = ["Law"]


class Law(Protocol):
    """A damping law; ``theta`` lists its parameters in the order of ``parameters``."""

    @property
    def name(self) -> str:
        """Short name, the key of ``LAWS``."""
        ...

    @property
    def words(self) -> str:
        """What it is called in a sentence."""
        ...

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names, the amplitude at t = 0 first, as "A0"."""
        ...

    @property
    def units(self) -> tuple[str, ...]:
        """Of the parameters."""
        ...

    @property
    def cases(self) -> tuple[str, ...]:
        """Names of the laws that it holds as special cases: at its best it is never worse than they are."""
        ...

    def amplitude(self, t: F8, theta: F8) -> F8:
        """Return (n,) float64, m, at times t (n,) in s."""
        ...

    def jacobian(self, t: F8, theta: F8) -> F8:
        """Return (n, p) float64: derivatives of the amplitude by each parameter."""
        ...

    def both(self, t: F8, theta: F8) -> tuple[F8, F8]:
        """Return amplitude and jacobian, which share most of their work."""
        ...

    def rate(self, amplitude: F8, theta: F8) -> F8:
        """Return -dA/dt, (n,) float64, m/s, at amplitudes (n,) in m."""
        ...

    def rate_jacobian(self, amplitude: F8, theta: F8) -> F8:
        """Return (n, p) float64: derivatives of the rate at amplitudes (n,) in m by each parameter."""
        ...

    def guess(self, t: F8, amplitude: F8) -> F8:
        """Return start values (p,) from points."""
        ...

    def rescaled(self, theta: F8, length_m: float) -> F8:
        """Return the parameters (p,) of the same fall with amplitudes counted in units of ``length_m``."""
        ...
