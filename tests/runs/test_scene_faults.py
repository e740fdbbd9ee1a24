"""Several faults at once, files that are no scenes, common slips in TOML, and what models refuse in a scene."""

from __future__ import annotations

from pathlib import Path

import pytest

from linear_bem.errors import InvalidProblem, UnsupportedProblem
from runs.scene.scene_file import InvalidScene, read_scene
from tests.runs.scene_texts import PAIR, faults, write


def test_all_faults_are_reported_at_once(tmp_path: Path) -> None:
    text = PAIR.replace("10 mm", "-10 mm").replace("0.48", "0.6").replace("0.8 cm", "0.7 cm")
    text = text.replace("[balls]", "[balls]\nshap = 1").replace("[load]", '[load]\nforce = "2 N"')
    found = faults(tmp_path, text)
    for word in ("thickness", "poisson", "overlap", "shap", "exactly one"):
        assert sum(word in fault for fault in found) == 1, (word, found)
    assert len(found) == 5


def test_a_misspelt_only_load_key_is_named_beside_the_rule(tmp_path: Path) -> None:
    unknown, rule = faults(tmp_path, PAIR.replace("approach =", "aproach ="))
    assert unknown.startswith('[load] aproach: unknown key; did you mean "approach"?')
    assert "exactly one of approach, force, total_force, got none of them" in rule


def test_a_diameter_gets_the_remedy_and_the_load_no_fault_of_its_own(tmp_path: Path) -> None:
    unknown, missing = faults(tmp_path, PAIR.replace("radius =", "diameter ="))
    assert unknown == "[balls] diameter: unknown key; give radius, half of it"
    assert missing.startswith("[balls] radius: is missing")


def test_a_stand_in_for_a_faulty_key_raises_no_fault_of_its_own(tmp_path: Path) -> None:
    assert len(faults(tmp_path, PAIR.replace('radius = "8 mm"', 'radius = "8 kg"'))) == 1
    assert len(faults(tmp_path, PAIR.replace('positions = [["-8 mm", 0], ["0.8 cm", 0]]', "positions = 3"))) == 1
    (none,) = faults(tmp_path, PAIR.replace('positions = [["-8 mm", 0], ["0.8 cm", 0]]', "positions = []"))
    assert "at least one ball is needed" in none
    three = PAIR.replace('["0.8 cm", 0]', '["0.8 cm", 0], ["30 mm", 0, 1]').replace(
        '"1.5 mm"', '["1 mm", "1 mm", "1 mm"]'
    )
    assert len(faults(tmp_path, three)) == 1


@pytest.mark.parametrize("content", [b"not toml", b"\xff\xfe\x00", b"[layer\n", b"a = 1\na = 2\n", b"[" * 5000])
def test_a_file_that_is_no_toml_is_one_fault(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(content)
    with pytest.raises(InvalidScene, match="is not TOML") as caught:
        read_scene(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('thickness = "10 mm"', "thickness = 10 mm  # thin", 'in quotes: thickness = "10 mm"'),
        ("[load]", '[load]\napproach = "1 mm"', 'reads: approach = "1.5 mm"; a key or a table is given twice'),
        ('thickness = "10 mm"', "thickness = true", 'must be a length: a number in m, or a string such as "10 mm"'),
        ("[load]", '[output]\nfields = "gap"\n[load]', "[output] fields: must be a list, got"),
    ],
)
def test_a_common_slip_gets_its_remedy(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert old in PAIR
    (found,) = faults(tmp_path, PAIR.replace(old, new, 1))
    assert words in found


def test_what_a_model_refuses_names_the_file_and_its_keys(tmp_path: Path) -> None:
    scene = read_scene(write(tmp_path, PAIR))
    refusals = {
        "load.force: needs a force > 0, got 0 N; leave that ball out": r"\[load\] force: needs a force > 0",
        "layer.thickness, balls.positions: too far": r"\[layer\] thickness, \[balls\] positions: too far$",
        f"{scene.path}: [layer]: named already": r"\[layer\]: named already$",
    }
    for text, named in refusals.items():
        with pytest.raises(UnsupportedProblem, match=f"^{scene.path}: {named}"), scene.naming_faults():
            raise UnsupportedProblem(text)


def test_a_byte_order_mark_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbf" + PAIR.encode())
    assert read_scene(path).problem.size >= 1


def test_a_path_that_is_no_file_is_a_fault(tmp_path: Path) -> None:
    write(tmp_path, PAIR)
    with pytest.raises(InvalidScene, match="is a folder"):
        read_scene(tmp_path)
    with pytest.raises(InvalidScene, match=r"does not exist; did you mean .*scene\.toml"):
        read_scene(tmp_path / "scenes.toml")
    with pytest.raises(InvalidScene, match="not a regular file"):
        read_scene(Path("/dev/null"))
    assert issubclass(InvalidScene, InvalidProblem)
