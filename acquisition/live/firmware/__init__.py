"""The firmware of the rangefinder, included in this package and built from firmware/springmass_rangefinder.

``make firmware`` builds the hex file, and a test compares the result byte for byte with the file in this folder.
"""

from __future__ import annotations

from pathlib import Path

MODEL = "springmass-rangefinder"
FIRMWARE_VERSION = "2.0.0"
HEX = Path(__file__).with_name("springmass_rangefinder.hex")
BOOTLOADER_BAUDS = (115200, 57600)
"""Baud rates of the bootloaders: first for the Uno and Nanos since 2018, then for older Nanos and most clones."""

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
    """Return the command line that writes the firmware through the bootloader of a board, as a list of arguments."""
    return ["avrdude", "-p", "atmega328p", "-c", "arduino", "-P", port, "-b", str(baud), "-D", "-U", f"flash:w:{HEX}:i"]
