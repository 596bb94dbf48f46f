"""Draw the figures of the documentation through the report's own: `make docs-figures`."""

from __future__ import annotations

from pathlib import Path

from springmass import analyse, load, read_scene, sample_data
from springmass.report.figures import amplitude_figure, render
from springmass.report.simulation_figures import stability_figure

HERE = Path(__file__).resolve().parent


def main(folder: Path = HERE) -> list[Path]:
    """Draw every figure into a folder and return the files."""
    data = sample_data()
    loaded = load(data / "damped_simulated_position.txt", velocity=data / "damped_simulated_velocity.txt")
    analysis = analyse(loaded.track, read_scene(data / "damped.scene.toml"))
    target = folder / "amplitude.svg"
    target.write_bytes(render(amplitude_figure(analysis), "svg"))
    stability = folder / "stability.svg"
    stability.write_bytes(render(stability_figure(), "svg"))
    return [target, stability]


if __name__ == "__main__":
    for written in main():
        print(f"{written.name}: {written.stat().st_size} bytes")
