"""The words for quantities, times, uncertainties and missing values in headings and cells; a language is added here.

Patterns are searched in headings; :func:`words` give sets of whole words in lower case.
"""

from __future__ import annotations

import re


def words(text: str) -> frozenset[str]:
    """Return the words in a text."""
    return frozenset(text.split())


def _pattern(text: str) -> re.Pattern[str]:
    return re.compile(text, re.IGNORECASE)


# Times

TIME_WORDS = words(
    "time times t ts epoch elapsed timestamp datetime seconds sec secs seg millis milliseconds ms msec micros "
    "microseconds us µs μs usec nanos nanoseconds ns zeit uhrzeit tempo tempi temps tiempo tiempos tijd tid czas čas "
    "aika idő zaman время 时间 時間 시간 hora heure ora saat الوقت زمان waktu χρόνος"
)
BESIDE_TIME = words(
    "axis value stamp data set run latest elapsed relative absolute since start velocity acceleration raw sensor gps "
    "system rel abs"
)
"""Words that may accompany the word for time in a time column's name; other words denote, for example, a period."""
NEUTRAL = _pattern(
    r"|x|(?-i:t)|x[-_ ]?(axis|value|achse)|(column|col|spalte|colonna|columna|var|field|unnamed:)[-_ ]?\d+"
)
"""Names that do not prevent a column from being read as the times."""
SPAN = _pattern(r"^(?-i:T)\b|^[Ττ]|period|durat|dauer|half|halb|interval|tau|delay|[dΔ]t|mean|10")
"""Names of durations, which are not times of samples."""
AM = _pattern(
    r"(?<![^\W\d_])"
    r"(?:a\.? ?m\.?|de\.|öö|дп|לפנה״צ"
    r"|ap\.|πμ|π\.μ\.|ص|ق\.ظ\.|上午|午前|早上|오전|sa|fm|f\.m\.|dop\.|vm\.?|vorm\.)(?![^\W\d_])"
)
PM = _pattern(
    r"(?<![^\W\d_])"
    r"(?:p\.? ?m\.?|du\.|ös|пп|אחה״צ"
    r"|ip\.|μμ|μ\.μ\.|م|ب\.ظ\.|下午|午後|晚上|오후|ch|em|e\.m\.|odp\.|nm\.?|nachm\.)(?![^\W\d_])"
)
"""Words for the halves of the day; the word for the second half is looked for first."""
MONTHS = tuple(
    words(stems)
    for stems in (
        "jan gen ene янв січ ιαν oca sty led tammi jän كانون يناير जन בינו ژانویه ian яну јан",
        "feb fév fev фев лют φεβ şub lut úno helmi فبراير फ़र בפבר فوریه veebr фебр",
        "mar mär mrt мар бер μαρ bře maalis مارس मार्च במרץ maart márc",
        "apr avr abr апр кві απρ nis kwi dub huhti ápr أبريل अप्रैल באפר آوریل",
        "may mai mei mag maj máj мая май тра μαΐ μαϊ μάι kvě touko مايو मई במאי مه",
        "jun juin giu июн чер ιουν haz cze čvn červn kesä jún يونيو जून ביונ ژوئن iun юни јун",
        "jul juil lug июл лип ιουλ tem lip čvc červenec heinä júl يوليو जुल ביול ژوئیه iul юли јул červenc",
        "aug ago aoû aou авг сер αυγ ağu sie srp elo أغسطس अग באוג اوت agu",
        "sep set сен вер σεπ eyl wrz zář syys szep سبتمبر सित בספט سپتامبر",
        "oct okt ott out окт жов οκτ eki paź říj loka أكتوبر अक्टू באוק اکتبر",
        "nov noi ноя лис νοέ νοε kas lis marras نوفمبر नव בנוב نوامبر ное",
        "dec dez déc dic дек гру δεκ ara gru pro joulu ديسمبر दिस בדצמ دسامبر des dis дец",
    )
)
"""Stems of the names of the twelve months; the longest that fits decides."""

# Row numbers and uncertainties

NUMBERED = _pattern(r".*(index|sample|frame|number|count|row|seq)s?")
INDEX = frozenset(("", *words("n i nr no index sample samples frame row step id count #")))
UNCERTAINTIES = _pattern(
    r".*\b(u?n?certain\w*|err\w*|sigma|std|incert\w*|unsicher\w*|fehler|sd)\b.*|[dδΔσu][_ ]?[a-zθφ]|[a-zθφ]'|[\d.,]+"
)

# Quantities

_PLACE = r"(?<![^\W\d_])(dist|pos|abst|weg|height|höhe|altura|rang|auslenk|elong|displ|[xyz](?![^\W_])|ang)"
POSITION_WORDS = _pattern(rf"{_PLACE}|winkel|theta|θ|phi|φ")
OSCILLATES = _pattern(
    rf"{_PLACE}|(?<![^\W\d_])(winkel|theta|θ|phi|φ|gyr|rot|vel|acc|beschl|versn|force|kraft|volt|spannung|ch\d|signal|"
    r"ampl|echo)|column \d"
)
DERIVED = _pattern(r"abs|magnitude|total|betrag|norm|fft|command|setpoint|soll|error|status|sum")
ACCELERATION = _pattern(r"acc|beschl|versn|g[-_ ]?f|^a(?![^\W\d_])|^a[xyz](?![^\W_])")
UNIT_OF_NAME = (
    (_pattern(r"gyr|omega|ω|ang\w*[ _.]*(vel|speed|ges)|winkelges|^g[xyz](?![^\W_])"), "rad/s"),
    (_pattern(rf"{ACCELERATION.pattern}|^ac[xyz]"), "m/s2"),
    (_pattern(r"vel|speed|^(?-i:v)(?![^\W\d_])|^(?-i:v)[xyz](?![^\W_])|geschw"), "m/s"),
    (_pattern(r"theta|θ|phi|φ|(?<![^\W\d_])(ang|rad)|winkel|rotat|roll|pitch|yaw"), "rad"),
    (_pattern(r"volt|^V(?![^\W\d_])|spannung|^ch|signal|tens|^ai?\d|ampl"), "V"),
    (_pattern(r"force|kraft|forza|fuerza"), "N"),
)
"""What a channel without a unit probably measures: the unit that a question gives as its example."""
FREQUENCY = _pattern(
    r"^(freq\w*|frequen[zc]\w*|fréquence|frecuencia|częstotliwość|частота|频率|周波数|hz|khz|f|omega|ω)$"
)
AUTOCORRELATION = _pattern(r"auto[-_ ]?[ck]orr|korrelation|\blag\b|time shift|zeitversch")
"""Names of a frequency, against which spectra are tabulated, and of autocorrelations and their shifts of time."""
MOTION = words(
    "position velocity acceleration posizione velocità velocita accelerazione ort weg geschwindigkeit beschleunigung "
    "vitesse accélération posición velocidad aceleración 位置 速度 加速度"
)
"""Headings of a localised export without units."""

# Cells

LOST = words(
    "na n/a #n/a #na null none nil inf infinity infinite ol o.l o.l. 0l over overrange overload overflow overld ovld "
    "ovrflw ovfl under underrange underflow outofrange #value! #div/0! #ref! #num! #null! #name? missing invalid "
    "lost timeout"
)
"""Words in a column of numbers that an instrument or a sheet writes where it has no number."""
LABEL = words(
    "sensor sensors channel probe device source quantity variable field series parameter topic id name key signal "
    "metric tag label kanal größe messgröße sonde capteur canal grandeur variable magnitud entity node station"
)
"""Words in the heading of a column that tells rows of several sensors or quantities apart."""
ANY_VALUE = frozenset(("", *words("value values _value reading result wert messwert valeur valor valore data")))
"""Names of a column whose rows are of several quantities."""
