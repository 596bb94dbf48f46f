"""Draw how the rangefinder is wired: `make docs-figures`. Pins and parts as `springmass firmware` names them."""

from __future__ import annotations

from pathlib import Path

HERE = Path(__file__).resolve().parent
WIDTH, HEIGHT = 760, 450
BLACK, RED, BLUE, GREEN, ORANGE = "#222222", "#c0392b", "#0072b2", "#1b7f5c", "#b35900"
BOARD, MODULE, THERMOMETER = (40, 60, 210, 370), (520, 60, 200, 190), (520, 310, 200, 120)


def box(place: tuple[int, int, int, int], title: str, subtitle: str) -> str:
    """Return a part with its name."""
    x, y, width, height = place
    middle = x + width / 2
    return (
        f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="8" fill="#f4f6f8" stroke="{BLACK}"/>'
        f'<text x="{middle}" y="{y - 28}" text-anchor="middle" class="title">{title}</text>'
        f'<text x="{middle}" y="{y - 10}" text-anchor="middle" class="small">{subtitle}</text>'
    )


def pin(x: int, y: int, name: str, *, left: bool) -> str:
    """Return a pin on the left or right side of a part, its name inside."""
    anchor, shift = ("start", 14) if left else ("end", -14)
    return (
        f'<circle cx="{x}" cy="{y}" r="5" fill="white" stroke="{BLACK}" stroke-width="1.5"/>'
        f'<text x="{x + shift}" y="{y + 5}" text-anchor="{anchor}">{name}</text>'
    )


def wire(colour: str, *points: tuple[int, int]) -> str:
    """Return a wire through points."""
    path = " ".join(f"{x},{y}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="3" stroke-linejoin="round"/>'


def joint(colour: str, x: int, y: int) -> str:
    """Return a point at which wires meet."""
    return f'<circle cx="{x}" cy="{y}" r="4.5" fill="{colour}"/>'


def drawing() -> str:
    """Return the SVG."""
    right, left = BOARD[0] + BOARD[2], MODULE[0]
    vcc, gnd, trig, echo, dq = 100, 220, 140, 180, 370
    parts = [
        box(BOARD, "Arduino Uno or Nano", "ATmega328P, 16 MHz, 5 V"),
        box(MODULE, "HC-SR04", "faces the bob"),
        box(THERMOMETER, "DS18B20, optional", "flat side towards you: GND, DQ, VDD"),
        wire(RED, (right, vcc), (left, vcc)),
        wire(BLUE, (right, trig), (left, trig)),
        wire(GREEN, (right, echo), (left, echo)),
        wire(BLACK, (right, gnd), (left, gnd)),
        # The thermometer's supply branches off the module's; the resistor lies between 5 V and DQ.
        wire(RED, (330, vcc), (330, 335), (left, 335)),
        joint(RED, 330, vcc),
        wire(ORANGE, (right, dq), (left, dq)),
        wire(BLACK, (290, gnd), (290, 405), (left, 405)),
        joint(BLACK, 290, gnd),
        wire(RED, (430, 335), (430, 340)),
        joint(RED, 430, 335),
        f'<rect x="421" y="340" width="18" height="24" fill="white" stroke="{BLACK}" stroke-width="1.5"/>',
        wire(ORANGE, (430, 364), (430, dq)),
        joint(ORANGE, 430, dq),
        '<text x="412" y="357" text-anchor="end" class="small">4.7 kΩ</text>',
    ]
    for y, name in ((vcc, "5V"), (trig, "D9"), (echo, "D8"), (gnd, "GND"), (dq, "D2")):
        parts.append(pin(right, y, name, left=False))
    for y, name in ((vcc, "VCC"), (trig, "TRIG"), (echo, "ECHO"), (gnd, "GND"), (335, "VDD"), (dq, "DQ"), (405, "GND")):
        parts.append(pin(left, y, name, left=True))
    parts.append('<text x="60" y="410" class="small">USB to the computer</text>')
    style = "text{font:16px sans-serif;fill:#222222}.title{font-weight:bold}.small{font-size:13px;fill:#444444}"
    title = "Wiring: TRIG of the HC-SR04 on D9, ECHO on D8, 5 V and ground; DQ of a DS18B20 on D2 with 4.7 kΩ to 5 V"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        f'role="img"><title>{title}</title><style>{style}</style>'
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def main(folder: Path = HERE) -> Path:
    """Write the drawing into a folder and return its file."""
    target = folder / "wiring.svg"
    target.write_text(drawing(), encoding="utf-8")
    return target


if __name__ == "__main__":
    main()
