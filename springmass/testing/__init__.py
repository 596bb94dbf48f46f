"""The conformance suite for what another package adds: a sensor, a format, a damping law or an integrator."""

from itertools import product
from typing import Any

from acquisition.decoders.sensor import Sensor
from acquisition.recordings.recording import Format
from pipeline.damping.laws import Law
from pipeline.simulation import Integrator
from springmass.testing import formats, integrators, laws, sensors
from springmass.testing.formats import File

__all__ = ["File", "check"]


def check(extension: Sensor | Format | Law | Integrator, *examples: Any, checksum: bool = False) -> None:
    """Hold an extension to every rule of its kind, in a test of your package.

    Parameters
    ----------
    extension : Sensor, Format, Law or Integrator
        An object as :mod:`springmass.extend` describes it.
    *examples
        For a sensor: frames of its data sheet with their distances in m, ``(b":0253,CA\\n", 0.253)``; NaN for no
        target. For a format: functions from times (s) and distances (m) to the bytes of a file, or :class:`File`. For
        a law: its parameters, ``{"A0": 0.05, "d": 0.2}``. For an integrator: ``Problem`` objects, or none.
    checksum : bool
        Whether the frames of a sensor carry a checksum, which must detect every flipped bit.

    Raises
    ------
    AssertionError
        With one line for each broken rule, which says what to do.
    TypeError
        If the extension is of no kind, or if a format or a law has no example.
    """
    rules: tuple[Any, ...]
    cases: list[tuple[Any, ...]]
    if isinstance(extension, Sensor):
        kind, rules, cases = "sensor", sensors.RULES, [(sensors.SensorCase(extension, examples, checksum),)]
    elif isinstance(extension, Integrator):
        kind, rules, cases = "method", integrators.RULES, [(extension, examples or integrators.PROBLEMS)]
    elif isinstance(extension, Law):
        kind, rules, cases = "law", laws.RULES, [laws.case_of(extension, each) for each in examples]
    elif isinstance(extension, Format):
        kind, rules, cases = (
            "format",
            formats.RULES,
            [(formats.Case(extension, each if isinstance(each, File) else File(each)),) for each in examples],
        )
    else:
        raise TypeError(f"expected a Sensor, Format, Law or Integrator, got {extension!r:.80}")
    if not cases:
        raise TypeError(f"{kind} {extension.name}: give an example to check(), as its docstring says")
    failures: dict[str, Exception | None] = {}
    for rule, case in product(rules, cases):
        message, raised = "", None
        try:
            rule(*case)
        except AssertionError as error:
            message = str(error)
        except Exception as error:
            message, raised = f"handle what raises {type(error).__name__} in {rule.__name__}: {error}", error
        if message:
            failures[f"{kind} {extension.name}: {' '.join(message.split())}"] = raised
    if failures:
        raise AssertionError("\n".join(failures)) from next(filter(None, failures.values()), None)
