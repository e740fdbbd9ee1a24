"""The text of a scene that tests vary, and the faults of a scene."""

from pathlib import Path

import pytest

from runs.scene.scene_file import InvalidScene, read_scene

PAIR = """
[layer]
thickness = "10 mm"
young = "57.4 kPa"
poisson = 0.48
[balls]
radius = "8 mm"
positions = [["-8 mm", 0], ["0.8 cm", 0]]
[load]
approach = "1.5 mm"
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def faults(folder: Path, text: str) -> tuple[str, ...]:
    with pytest.raises(InvalidScene) as caught:
        read_scene(write(folder, text))
    return caught.value.faults
