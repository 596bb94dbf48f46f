"""Every exception of the project survives the way from a worker's process to the one that reports it."""

import importlib
import inspect
import pickle
import pkgutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.errors import NeedsAnswer
from acquisition.recordings.identify import open_recording

PACKAGES = ("acquisition", "failure", "pipeline", "storage", "springmass")


def exceptions() -> list[type[Exception]]:
    """Return every exception class that a module of the project defines."""
    found = {}
    for package in PACKAGES:
        top = importlib.import_module(package)
        for each in pkgutil.walk_packages(top.__path__, f"{package}."):
            if each.name.endswith("__main__"):  # runs the program
                continue
            module = importlib.import_module(each.name)
            for cls in vars(module).values():
                if isinstance(cls, type) and issubclass(cls, BaseException) and cls.__module__ == module.__name__:
                    found[f"{cls.__module__}.{cls.__qualname__}"] = cls
    return [found[name] for name in sorted(found)]


def made(cls: type[Exception], folder: Path) -> Exception:
    """Return an exception with a value for each parameter of its constructor."""
    if cls is NeedsAnswer:
        (folder / "run.csv").write_text("".join(f"{i / 10},{i % 3}\n" for i in range(50)))
        with pytest.raises(NeedsAnswer) as caught:
            open_recording(folder / "run.csv")
        return caught.value
    positional: list[Any] = []
    named = {}
    for parameter in list(inspect.signature(cls.__init__).parameters.values())[1:]:
        value = 3 if "int" in str(parameter.annotation) else f"{parameter.name} größer 1"
        if parameter.kind is parameter.KEYWORD_ONLY:
            named[parameter.name] = value
        elif parameter.kind is not parameter.VAR_KEYWORD:
            positional.append(value)
    return cls(*positional, **named)


@pytest.mark.parametrize("cls", exceptions(), ids=lambda cls: f"{cls.__module__}.{cls.__qualname__}")
def test_an_exception_survives_pickling(cls: type[Exception], tmp_path: Path) -> None:
    """Class, message and fields are those that were sent."""
    sent = made(cls, tmp_path)
    got = pickle.loads(pickle.dumps(sent))
    assert type(got) is cls
    assert str(got) == str(sent) != ""
    assert got.args == sent.args
    np.testing.assert_equal(vars(got), vars(sent))
