"""Check the wording of all texts: ``python .ci/wording.py [FOLDER ...]``; ``--names`` also lists unclear names.

Two rules can fail the build. Phrases that a reader stumbles over must not occur in strings, docstrings, comments and
pages; each has a plainer form. A sentence of a page has at most 35 words. The list of unclear names is only a report.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

MOST_WORDS = 35
FOLDERS = ("acquisition", "benchmarks", "docs", "pipeline", "sample_data", "springmass", "storage", "tests")
PLAINER = {
    r"(can(not)?|could|may|to) be told( apart)?": "can be distinguished",
    r"tells? (its|their) \w+": "states its ...",
    r"intervals? holds?\b": "intervals cover the truth",
    r"the laws? stands?": "the law is supported",
    r"by what (it|they|is) leaves?": "from the residuals",
    r"changes? (a|no) number": "affects the results",
    r"beside the record(ing)?": "during the recording; next to the file",
    r"(was|were) demanded": "expected X, got Y",
    r"nothing to note": "no warnings",
    r"of (its|their) own\b": "leave it out, or name the thing",
    r"\bas good\b": "equally good",
    r"\bfor good\b": "permanently",
    r"\bat once\b": "immediately; together",
    r"\baltogether\b": "in total",
    r"looks? on\b": "view only",
    r"lets? go of": "releases; discards",
    r"puts? aside": "discards",
    r"\bhush\b": "quiet",
    r"is not what was written": "checksum mismatch",
    r"speaks? (for|against)": "supports; contradicts",
    r"knows? of (itself|each other)": "is correlated",
}
PATTERNS = {re.compile(pattern, re.IGNORECASE): plain for pattern, plain in PLAINER.items()}
UNCLEAR = frozenset(["told", "found", "said", "asked", "least", "left", "away", "one", "other", "most", "kept", "bad"])
EXEMPT = (".ci/wording.py",)


def files(folders: tuple[str, ...]) -> list[Path]:
    """Return the Python files and pages under version control."""
    listed = subprocess.run(["git", "ls-files", "*.py", "*.md"], capture_output=True, text=True, check=True).stdout
    paths = [Path(line) for line in listed.splitlines() if line not in EXEMPT]
    return [path for path in paths if path.parts[0] in folders or (len(path.parts) == 1 and path.suffix == ".md")]


def python_texts(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the line number and text of every string and comment."""
    with tokenize.open(path) as file:
        for token in tokenize.generate_tokens(file.readline):
            if token.type in (tokenize.STRING, tokenize.COMMENT):
                yield token.start[0], token.string


def page_texts(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the line number and text of every paragraph, list item and table cell, without code blocks."""
    block: list[str] = []
    start, fenced = 1, False
    for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        begins = re.match(r"\s*([-*|#>]|\d+\.)\s?", line) is not None
        if block and (fenced or begins or not line.strip()):
            yield start, " ".join(block)
            block = []
        if fenced or line.lstrip().startswith("```") or not line.strip():
            continue
        if line.lstrip().startswith("|"):
            yield from ((number, cell.strip()) for cell in re.split(r"(?<!\\)\|", line) if cell.strip(" -:"))
            continue
        if not block:
            start = number
        block.append(line.strip())
    if block:
        yield start, " ".join(block)


def without_code(text: str) -> str:
    """Return a text in which one word replaces each piece of code, and its words replace each link."""
    return re.sub(r"\]\([^)]*\)", "]", re.sub(r"``?[^`]+``?", "CODE", text))


def phrases(path: Path) -> Iterator[str]:
    """Yield a message for every phrase that has a plainer form."""
    texts = python_texts(path) if path.suffix == ".py" else ((n, without_code(t)) for n, t in page_texts(path))
    for number, text in texts:
        words = re.sub(r"\s+#?\s*", " ", text)
        for pattern, plain in PATTERNS.items():
            if (hit := pattern.search(words)) is not None:
                yield f"{path}:{number}: {hit.group(0)!r} has a plainer form: {plain}"


def long_sentences(path: Path) -> Iterator[str]:
    """Yield a message for every sentence of a page that has too many words."""
    for number, text in page_texts(path):
        for sentence in re.split(r"(?<=[.!?:;])\s+", without_code(text)):
            if (count := len(re.findall(r"[\w'-]*[A-Za-z][\w'-]*", sentence))) > MOST_WORDS:
                yield f"{path}:{number}: a sentence of {count} words, at most {MOST_WORDS}: {sentence[:60]}..."


def unclear_names(paths: list[Path]) -> Counter[str]:
    """Return how many times each unclear name is bound."""
    found: Counter[str] = Counter()
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            name = node.id if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) else ""
            name = node.arg if isinstance(node, ast.arg) else name
            if name in UNCLEAR:
                found[name] += 1
    return found


def main() -> int:
    """Print all failures; return 1 if there are any."""
    names = [word for word in sys.argv[1:] if not word.startswith("-")]
    paths = files(tuple(names) or FOLDERS)
    failures = [line for path in paths for line in phrases(path)]
    failures += [line for path in paths if path.suffix == ".md" for line in long_sentences(path)]
    print("\n".join(failures) or "wording: nothing to change")
    if "--names" in sys.argv:
        for name, count in unclear_names([path for path in paths if path.suffix == ".py"]).most_common():
            print(f"{count:5d} {name}")
    return int(bool(failures))


if __name__ == "__main__":
    raise SystemExit(main())
