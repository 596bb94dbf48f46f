"""The numbers of one line of text as sketches print them, and which of them is the distance.

A number has the words before it (its label) and the unit that is printed with it. The distance is the number whose
label names a distance or that has a unit of length; without either it is the only number of the line.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from acquisition.units import MEASURES, SPELLINGS

LENGTHS_M = {unit: 10.0 ** MEASURES[unit].power * MEASURES[unit].factor for unit in ("m", "cm", "mm", "in")}
TIMES_US = {"us": 1.0, "ms": 1e3, "s": 1e6}

_OTHERS = {
    "C": "c degc °c celsius",
    "other": "f degf °f % v mv hz khz mhz pa hpa kpa mbar bar deg rad g kg n ft feet foot yd lux lx db dbm rpm baud",
}
UNIT_OF_WORD = {
    **{form: unit for unit in (*LENGTHS_M, *TIMES_US) for word in SPELLINGS[unit] for form in (word, f"{word}s")},
    **{unit: unit for unit in (*LENGTHS_M, *TIMES_US)},
    **{word: unit for unit, words in _OTHERS.items() for word in words.split()},
}
"""Units by the words for them; ``other`` is a unit of something else, so its number is no distance."""

# Words before a number, as beginnings or whole.
_DISTANCE = re.compile(
    r"(?:dist|range|abstand|entfernung|afstand|avst|height|höhe|hoehe|altura|hauteur|pos|ping|length|länge|laenge|"
    r"odleg|vzd|távol|uzakl|расст|距离|距離).*|[dxy]|weg"
)
_BESIDE = re.compile(  # beside a distance, and perhaps with its unit
    r"(?:status|err|fehler|setpoint|soll|target|limit|thresh|offset|sigma|signal|maxim|minim).*|max|min|ambient|rate|std"
)
_OTHER = re.compile(
    r"(?:time|tiempo|temp|zeit|tijd|millis|micros|humid|feucht|press|druck|count|index|sample|muestra|baud|version|volt|"
    r"batt|echo|duration|dauer|duraci|puls|speed|veloc|geschw|accel|force|angle|winkel|light|delay).*|"
    r"[tnivcs]|nr|no|id|seq|line|port|us|ms"
)

# float() alone would also accept "nan", "inf" and "1_0". Digits of a word, a version or an address are not a number.
_NUMBER = {
    mark: re.compile(
        rf"(?<![\w.])(?<![\w.][+-])[+-]?(?:[0-9]{{1,15}}(?:[{mark}]([0-9]{{0,12}}))?|[{mark}]([0-9]{{1,12}}))"
        rf"(?:[eE]([+-]?[0-9]{{1,2}}))?(?![0-9_]|[{mark}]+[0-9]|[A-Za-z]+[0-9])"
    )
    for mark in ".,"
}
UPTIME = "time since start:"
_CONTROL = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|[@-Z\\-_])")
_ESP_LOG = re.compile(r"^[EWIDV] \((?:(\d{1,10})|(\d\d:\d\d:\d\d\.\d{3}))\) (?=[\w.-]+: )", re.ASCII | re.MULTILINE)
_STAMP = re.compile(r"(?<![\w.])\d{1,4}([-/.])\d{1,2}\1\d{1,4}(?![\d.])|\d{1,2}:\d\d:\d\d(?:[.,:]\d+)?", re.ASCII)
_AFTER = re.compile(r"[ ]?[\"')\]]?[,;]?[ \"']?(°?[^\W\d_]+|%)(?![^\W\d_]|[\"')\] ]*[:=])(/?)")
_WORD = re.compile(r"[A-Z]?[^\W\d_A-Z]+|[^\W\d_a-z]+|%")
_LAST_BREAK = re.compile(r".*[,;|\t{}]", re.DOTALL)
_SURE_UNIT = re.compile(r"(?<![^\W_])(mm|cm)(?![\w/])", re.IGNORECASE)


class Number(NamedTuple):
    """A number of a line: value, step of its last digit, place, the text and words before it, its unit or nothing."""

    value: float
    step: float
    start: int
    before: str
    label: tuple[str, ...]
    unit: str

    @property
    def is_distance(self) -> bool:
        """Whether the words before it name a distance."""
        return self._says(_DISTANCE) and not self._says(_BESIDE)

    @property
    def is_other(self) -> bool:
        """Whether its unit or the words before it say that it is no distance."""
        if self._says(_BESIDE):
            return True
        if self.unit:
            return self.unit not in LENGTHS_M
        return not self.is_distance and self._says(_OTHER)

    def _says(self, words: re.Pattern[str]) -> bool:
        return any(words.fullmatch(word) for word in self.label)


def uncoloured(text: str) -> str:
    """Return text without the colours of a terminal, and with the times of a log of ESP-IDF in words.

    Such a line is ``I (4140) hcsr04: Distance: 27.17 cm``, with the milliseconds since the start of the board, or with
    its clock.
    """
    bare = _CONTROL.sub("", text) if "\x1b" in text else text
    return _ESP_LOG.sub(lambda match: f"{UPTIME} {match[1]} ms, " if match[1] else f"{match[2]} ", bare)


def has_decimal_comma(text: str, separator: str = "") -> bool | None:
    """Return whether commas between digits are decimal commas; None if nothing shows it.

    They are if something else separates the numbers, and they are not in a line with decimal points. Two groups of
    digits with nothing but a comma between them are one number behind a name or a clock time.
    """
    if separator == "," or not re.search(r"[0-9],[0-9]", text):
        return False
    bare = _STAMP.sub(_blank, text)
    if re.search(r"[0-9]\.[0-9]", bare):
        return False
    if separator or any(mark in text for mark in ";|\t"):
        return True
    if re.search(r"[0-9],[0-9]+,[0-9]|(?<![0-9]),(?=\S)|,(?=[^\s0-9])", bare):
        return False
    matches = list(_NUMBER[","].finditer(bare))
    if len(matches) > 1:
        return True
    return True if matches and bare[: matches[0].start()].strip() else None


def numbers(text: str, *, decimal_comma: bool = False, colon_separates: bool = False) -> list[Number]:
    """Return the numbers of a line; those of clock times and dates are left out.

    A number before a colon or an equals sign belongs to the name of the next one, unless a colon separates columns.
    """
    bare = _STAMP.sub(_blank, text) if ":" in text or "-" in text or "/" in text or text.count(".") > 1 else text
    mark = "," if decimal_comma else "."
    line_of_numbers: list[Number] = []
    end = 0
    for match in _NUMBER[mark].finditer(bare):
        after = bare[match.end() : match.end() + 40]
        if not colon_separates and re.match(r"[\"' ]*[:=]", after):
            continue
        before = _LAST_BREAK.sub("", bare[end : match.start()])
        label = tuple(word.casefold() for word in _WORD.findall(before))
        digits = len(match[1] or match[2] or "") - int(match[3] or 0)
        word = _AFTER.match(after)
        unit = UNIT_OF_WORD.get(word[1].casefold(), "") if word else ""
        if word and unit and word[2]:
            unit = "other"  # cm/s
        end = match.end() + (word.end() if word and unit else 0)
        unit = unit or (UNIT_OF_WORD.get(label[-1], "") if label else "")
        line_of_numbers.append(
            Number(float(match[0].replace(",", ".")), 10.0**-digits, match.start(), before, label, unit)
        )
    return line_of_numbers


def find_distance(text: str, candidates: Sequence[Number], unit: str = "") -> Number | None:
    """Return the number of a line that is the distance, with its unit if one is printed; None if that is not clear.

    With a stated unit, which may be ``us`` for echo times, numbers with another unit do not count.
    """
    if unit == "us":
        candidates = [number for number in candidates if number.unit in ("us", "") and "s" not in number.label]
        return candidates[0] if len(candidates) == 1 else None
    open_ = [
        each for each in candidates if not each.is_other and not (unit and each.unit in LENGTHS_M and each.unit != unit)
    ]
    with_unit = [each for each in open_ if each.unit]
    named = [each for each in open_ if each.is_distance]
    named = [each for each in named if each.unit] or named
    choice = named or with_unit or open_
    if not choice:
        return None
    best = min(choice, key=lambda each: each.step * LENGTHS_M.get(each.unit, 1.0))
    if not all(each is best or _agree(best, each) for each in choice):
        return None
    if not (best.unit or unit):
        words = {word.casefold() for word in _SURE_UNIT.findall(text)}
        best = best._replace(unit=words.pop() if len(words) == 1 else "")
    return best


def _agree(first: Number, second: Number) -> bool:
    """Return whether two numbers are the same distance in two units; two in one unit are of two sensors."""
    if not first.unit or not second.unit or first.unit == second.unit:
        return False
    a, b = LENGTHS_M[first.unit], LENGTHS_M[second.unit]
    return abs(first.value * a - second.value * b) <= first.step * a + second.step * b


def _blank(match: re.Match[str]) -> str:
    return " " * len(match[0])
