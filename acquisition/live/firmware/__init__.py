"""The firmware of the rangefinder that is part of the package: built from firmware/springmass_rangefinder.

It provides the path of the hex file, its version and its wiring as text. ``make firmware`` builds the hex file, and a
test compares it with the one here, byte for byte.
"""

from __future__ import annotations

from pathlib import Path

__all__ = ["BAUDS", "HEX", "MODEL", "VERSION", "WIRING", "avrdude_arguments"]

MODEL = "springmass-rangefinder"
VERSION = "2.0.0"
HEX = Path(__file__).with_name("springmass_rangefinder.hex")
BAUDS = (115200, 57600)
"""Speeds of the bootloaders: the first for the Uno and Nanos since 2018, the second for older Nanos and most clones."""

WIRING = """\
Arduino Uno or Nano (ATmega328P, 16 MHz, 5 V)     HC-SR04
  5V  ------------------------------------------  VCC
  GND ------------------------------------------  GND
  D9  ------------------------------------------  TRIG
  D8  ------------------------------------------  ECHO

If wanted, a DS18B20 thermometer, flat side towards you:
  GND ------------------------------------------  left
  D2  --------------+---------------------------  middle
  5V  -- 4.7 kOhm --+
  5V  ------------------------------------------  right
"""


def avrdude_arguments(port: str, baud: int) -> list[str]:
    """Return the command, as a list of arguments, that writes the firmware through the bootloader of a board."""
    return ["avrdude", "-p", "atmega328p", "-c", "arduino", "-P", port, "-b", str(baud), "-D", "-U", f"flash:w:{HEX}:i"]
