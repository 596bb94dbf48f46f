"""Word the answer to a reader's question as a Python call."""

from collections.abc import Mapping

from acquisition.recordings.questions import Question


def as_arguments(answers: Mapping[str, object]) -> str:
    """Return keyword arguments of :func:`springmass.load` as Python source text."""
    return ", ".join(f"{name}={_literal(value)}" for name, value in answers.items())


def for_python(question: Question, function: str, given: Mapping[str, object]) -> str:
    """Return the Python call that answers a question."""
    kept = {name: value for name, value in given.items() if name not in question.missing}
    words = (_literal(question.path), as_arguments(kept), as_arguments(question.examples))
    return f"{function}({', '.join(filter(None, words))})"


def _literal(value: object) -> str:
    if isinstance(value, bool | int | float):
        return repr(value)
    text = str(value)
    return repr(text) if '"' in text or "\\" in text or not text.isprintable() else f'"{text}"'
