"""Numbers of a scene that are finite and absurd: one clear fault each."""

from __future__ import annotations

from pathlib import Path

import pytest

from runs.scene.scene_file import InvalidScene, read_scene

LAYER = """
[layer]
thickness = "10 mm"
young = "1 MPa"
poisson = 0.48
"""
REST = """
[balls]
radius = "8 mm"
positions = [["-8 mm", 0], ["8 mm", 0]]
[load]
approach = "1.5 mm"
[periodic]
lengths = ["100 mm", "60 mm"]
"""
SCENE = f"""{LAYER}
[substrate]
young = "1 GPa"
poisson = 0.3
{REST}"""
DRIFT = f"""{LAYER}{REST}
[rolling_resistance]
share = 1e-3
[reciprocation]
amplitude = "80 mm"
cycles = 50
friction = 0.1
"""


@pytest.mark.parametrize(
    ("text", "old", "new", "words"),
    [
        (
            SCENE,
            '"10 mm"',
            '"1e300 mm"',
            ["[layer] thickness: must be at most 8e+06 m", 'written "1e300 mm"', "take inf"],
        ),
        (SCENE, '"10 mm"', '"1e308 km"', ["[layer] thickness: must be a length below 1.8e308 m"]),
        (SCENE, '"10 mm"', "1" + "0" * 400, ["[layer] thickness: must be a number below 1.8e308"]),
        (SCENE, '"10 mm"', "1" + "0" * 5000, ["is not TOML: Exceeds the limit"]),
        (DRIFT, "friction = ", "seed = 1" + "0" * 400 + "\nfriction = ", ["seed: must be a whole number below 2^63"]),
        (DRIFT, 'radius = "8 mm"', "radius = []", ["[balls] radius: needs one value or one per ball (2), got 0"]),
        (SCENE, '"1 MPa"', '"1e200 GPa"', ["[layer] young: must be at most 1e+30 Pa"]),
        (SCENE, '"1 GPa"', "1e-300", ["[substrate] young: must be at least 0.001 Pa, 1e-09 of the layer's"]),
        (SCENE, '"8 mm"', "1e-300", ["[balls] radius: must be at least 1e-30 m, got 1e-300 m; check its unit"]),
        (SCENE, '"-8 mm"', "-1e200", ["[balls] positions of ball 0: must be at most 8e+06 m"]),
        (
            DRIFT,
            "friction = ",
            "tolerance = 1e-300\nfriction = ",
            ["[reciprocation] tolerance: must lie between 1e-09 radii, to which contacts are held, and 0.01, got 1e-3"],
        ),
        (
            DRIFT.replace("friction = ", "tolerance = 1e-9\nfriction = "),
            '"-8 mm"',
            '"1000 km"',
            ["must lie between 2.8e-08 radii, the roundoff of the positions, and 0.01, got 1e-09; for example tol"],
        ),
        (DRIFT, "friction = ", "tolerance = 0.1\nfriction = ", ["must lie between 1e-09 radii", "got 0.1"]),
        (SCENE, '"60 mm"', "1e300", ["[periodic] lengths[1]: must be at most 8e+09 mm", "leave periodic out"]),
        (SCENE, '"1.5 mm"', "1e300", ["[load] approach: must be at most 8e+06"]),
        (
            DRIFT,
            'approach = "1.5 mm"',
            "approach = 0.5",
            [
                "[load] approach: must be less than the thickness of a layer on a rigid base, 10 mm, got 500 mm; ",
                'a bare number is in metres: write "0.5 mm" if it is in mm',
            ],
        ),
        (
            DRIFT,
            '"1.5 mm"',
            '["1 mm", "12 mm"]',
            ["[load] approach of ball 1: must be less", "got 12 mm; reduce the approach"],
        ),
        (DRIFT, '"60 mm"', "1e300", ["[periodic] lengths: must be at most 8e+09 mm"]),
        (DRIFT, '"80 mm"', '"1e300 m"', ["[reciprocation] amplitude: must be at most 1e+30 m, got 1e+300 m"]),
        (DRIFT, "0.1", "1e-300", ["[reciprocation] friction: must be at least 1e-30, got 1e-300; check"]),
        (DRIFT, "50", "1e300", ["[reciprocation] cycles: must be at most 1e+30"]),
        (DRIFT, "1e-3", "1e300", ["[rolling_resistance] share: must be at most 1e+30"]),
    ],
)
@pytest.mark.filterwarnings("error")
def test_an_absurd_number_is_one_clear_fault(text: str, old: str, new: str, words: list[str], tmp_path: Path) -> None:
    assert old in text
    scene = tmp_path / "scene.toml"
    scene.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InvalidScene) as caught:
        read_scene(scene)
    assert "\n" not in caught.value.faults[0]
    for word in words:
        assert word in caught.value.faults[0]


def test_an_own_image_is_named_with_the_side_of_the_cell(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.replace('"60 mm"', '"10 mm"'), encoding="utf-8")
    with pytest.raises(InvalidScene) as caught:
        read_scene(scene)
    assert caught.value.faults[0].startswith("[periodic] lengths[1]: ball 0 overlaps its own image")


def test_stand_ins_for_faulty_balls_are_no_fault_of_their_own(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.replace('radius = "8 mm"', "").replace('"10 mm"', "1e4"), encoding="utf-8")
    with pytest.raises(InvalidScene) as caught:
        read_scene(scene)
    assert len(caught.value.faults) == 1
    assert "[balls] radius" in caught.value.faults[0]
