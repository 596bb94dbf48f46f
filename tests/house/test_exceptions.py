"""Every exception of the project survives the way from a worker's process to the one that reports it."""

from __future__ import annotations

import importlib
import inspect
import pickle
import pkgutil
from dataclasses import fields, is_dataclass
from enum import Enum
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
import pytest

from acquisition.recordings.questions import Question
from failure import Error

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


def value_of(hint: Any, name: str) -> Any:
    """Return a value of an annotated type; an unknown type fails the test, and has to be added here."""
    kind, among = get_origin(hint), get_args(hint)
    if kind in (Union, UnionType):  # the member that says most, and never None
        return value_of(max(among, key=lambda each: is_dataclass(each) or 0.5 * (each in (int, str))), name)
    if kind is Literal:
        return among[0]
    if kind is tuple:
        return tuple(value_of(each, name) for each in among if each is not ...)
    if kind is np.ndarray:
        return np.array([1.5, -2.0])
    if isinstance(hint, type) and issubclass(hint, Enum):
        return list(hint)[-1]
    if is_dataclass(hint) and isinstance(hint, type):
        hints = get_type_hints(hint)
        given = [each.name for each in fields(hint) if each.init and each.default is not None]  # nests without end
        return hint(**{name: value_of(hints[name], name) for name in given})
    return {str: f"{name} größer 1", int: 3, float: 0.25, bool: True, object: f"{name} of any kind"}[hint]


def made(cls: type[Exception]) -> Exception:
    """Return an exception with a value for each parameter of its constructor."""
    if any(cls.__init__ is plain.__init__ for plain in (Exception, ValueError, KeyError, ArithmeticError, Error)):
        return cls("run.h5: what is wrong")
    hints = get_type_hints(cls.__init__, localns={"Question": Question})
    positional, named = [], {}
    for name, parameter in list(inspect.signature(cls.__init__).parameters.items())[1:]:
        value = value_of(hints[name], name)
        if parameter.kind is parameter.KEYWORD_ONLY:
            named[name] = value
        else:
            positional.append(value)
    return cls(*positional, **named)


def as_plain(value: Any) -> Any:
    """Return a value whose equality is one truth."""
    return value.tolist() if isinstance(value, np.ndarray) else value


@pytest.mark.parametrize("cls", exceptions(), ids=lambda cls: f"{cls.__module__}.{cls.__qualname__}")
def test_an_exception_survives_pickling(cls: type[Exception]) -> None:
    """Class, message and fields are those that were sent."""
    sent = made(cls)
    got = pickle.loads(pickle.dumps(sent))
    assert type(got) is cls
    assert str(got) == str(sent) != ""
    assert [as_plain(each) for each in got.args] == [as_plain(each) for each in sent.args]
    assert {name: as_plain(each) for name, each in vars(got).items()} == {
        name: as_plain(each) for name, each in vars(sent).items()
    }
