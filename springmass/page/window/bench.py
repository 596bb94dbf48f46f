"""The bench as a form: what is typed becomes a scene; what is wrong or perhaps a slip is named beside its field."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from pipeline.bench.plausible import slips
from pipeline.bench.scene import BENCH_KEYS, PLACES, POSITIONS, Scene
from pipeline.bench.typed import scales_of
from pipeline.errors import SceneError
from springmass.typeset import page_unit

FIELDS: Mapping[str, tuple[str, str]] = {
    "bob.mass_kg": ("g", "Everything that hangs on the spring, a disc included. It gives k."),
    "spring.mass_kg": ("g", "Weigh it alone. About a third of it swings along with the bob."),
    "disc.diameter_m": ("cm", "A disc on the bob makes drag. Its size gives Re and the drag."),
    "air.temperature_c": ("C", "It sets the speed of sound, and so the scale of a rangefinder."),
    "air.pressure_pa": ("hPa", "Where you are, not reduced to sea level. Empty means 1013 hPa."),
    "air.relative_humidity": ("%", "It changes the speed of sound a little. Empty means 50 %."),
    "pendulum.length_m": ("cm", "From the pivot to the middle of the bob. It gives g."),
    "sensor.clock_ppm": ("ppm", "How much the clock of the sensor is wrong; 0 ± 20 if it may be 20 ppm."),
}
"""First unit and explanation of every quantity of the form, by table and key of a scene."""
SENSOR_PLACE = "sensor.position"
_UNIT_WORDS = {"C": "°C", "F": "°F"}
_COMMA = re.compile(r"(?<=\d),(?=\d)")
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}(?!\d)")


def scene_of(before: Scene, typed: Mapping[str, Any]) -> tuple[Scene, dict[str, str]]:
    """Return a scene with the values that were typed, and why some cannot be taken; an empty one is left out."""
    scene, errors = before, dict[str, str]()
    for name, cell in typed.items():
        table, _, key = name.partition(".")
        tables = scene.to_mapping()
        tables.setdefault(table, {}).pop(key, None)
        if text := _written(cell):
            tables[table][key] = text
        try:
            scene = Scene.from_mapping({each: content for each, content in tables.items() if content})
        except SceneError as error:
            errors[name] = str(SceneError(error.problem, error.remedy))
    return scene, errors


def _written(cell: Mapping[str, str]) -> str:
    """Return value, u and unit as one text; a comma is a decimal mark unless it could separate thousands."""
    text, u = (
        part if _THOUSANDS.fullmatch(part) else _COMMA.sub(".", part)
        for part in (cell.get(name, "").strip() for name in ("text", "u"))
    )
    return " ".join(filter(None, (f"{text}+/-{u}" if u else text, cell.get("unit", "")))) if text else ""


def form_of(scene: Scene, typed: Mapping[str, Any], errors: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return the fields of the form, filled with what was typed, or else with the scene."""
    doubts = {".".join(PLACES[slip.attribute]): slip.words for slip in slips(scene)}
    fields: list[dict[str, Any]] = []
    for name, (unit, words) in FIELDS.items():
        table, _, key = name.partition(".")
        quantity = BENCH_KEYS[table, key]
        scales = {each: scale for each, scale in scales_of(quantity.unit).items() if each != "degC" and each != "degF"}
        shown = {"text": "", "u": "", "unit": unit}
        if (known := getattr(scene, quantity.attribute)) is not None:
            scale = scales[unit]
            value, u = (known.value - scale.zero) / scale.factor, known.u / scale.factor
            shown |= {"text": f"{value:.10g}", "u": f"{u:.6g}" if u else ""}
        units = [{"value": each, "label": _UNIT_WORDS.get(each) or page_unit(each)} for each in scales]
        about = {
            "name": name,
            "label": f"{quantity.label[:1].upper()}{quantity.label[1:]}",
            "help": words,
            "units": units,
        }
        wrong = {"error": errors.get(name, ""), "doubt": doubts.get(name, "")}
        fields.append(about | shown | typed.get(name, {}) | wrong)
    place = scene.sensor_position or ""
    return [*fields, {"name": SENSOR_PLACE, "label": "Place of the sensor", "choices": POSITIONS, "text": place}]
