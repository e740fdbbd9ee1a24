"""Scenes: units, defaults, effects, and every fault named at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from linear_bem import (
    Ball,
    Elastic,
    FiniteStrain,
    Layer,
    Load,
    Ogden,
    Problem,
)
from linear_bem.law import LAWS, Law
from runs.models import MODELS
from runs.process.json_values import as_given
from runs.scene.balls import SHAPE_KEYS
from runs.scene.effects import EFFECTS, Effect
from runs.scene.messages import RARER_EXAMPLES
from runs.scene.scene_file import read_scene
from tests.runs.scene_texts import PAIR, faults, write

SLIDING = '[reciprocation]\namplitude = "80 mm"\ncycles = 5\nfriction = 0.1\n'


def test_units_become_si(tmp_path: Path) -> None:
    problem = read_scene(write(tmp_path, PAIR)).problem
    assert problem.layer == Layer(pytest.approx(57.4e3), 0.48, pytest.approx(0.01))
    assert problem.balls == (
        Ball((pytest.approx(-0.008), 0.0), 0.008, "sphere"),
        Ball((pytest.approx(0.008), 0.0), 0.008, "sphere"),
    )
    assert problem.load == Load("approach", (0.0015, 0.0015))


@pytest.mark.parametrize("young", ['"57.4 kilopascal"', '"0.0574 N/mm^2"', '"57400 N / m**2"', '"57.4e3Pa"', "57400"])
def test_units_may_be_compound(young: str, tmp_path: Path) -> None:
    text = PAIR.replace('"57.4 kPa"', young)
    assert read_scene(write(tmp_path, text)).problem.layer.young == pytest.approx(57.4e3)


def test_absent_tables_are_absent_effects(tmp_path: Path) -> None:
    scene = read_scene(write(tmp_path, PAIR))
    assert scene.effects == ()
    assert scene.problem.substrate is None
    assert scene.problem.finite_strain is None
    assert scene.tangential_force is None
    assert scene.title == "scene"


def test_tables_name_effects_accuracy_and_title(tmp_path: Path) -> None:
    more = '[substrate]\nyoung = "1 GPa"\npoisson = 0.3\n[finite_strain]\n[accuracy]\ntangential_force = 0.05\n'
    scene = read_scene(write(tmp_path, f'title = "A pair"\n{PAIR}{more}'))
    assert scene.effects == ("substrate", "finite_strain")
    assert scene.problem.substrate == Elastic(1e9, 0.3)
    assert scene.problem.finite_strain == FiniteStrain("neo_hookean")
    assert scene.tangential_force == 0.05
    assert scene.title == "A pair"


def test_a_law_takes_its_own_numbers(tmp_path: Path) -> None:
    law = '[finite_strain]\nlaw = "ogden"\nexponents = [1.3, -2]\nweights = [0.9, 0.1]\n'
    problem = read_scene(write(tmp_path, f"{PAIR}{law}")).problem
    assert problem.finite_strain == FiniteStrain(Ogden((1.3, -2.0), (0.9, 0.1)))


def test_a_law_without_numbers_is_no_other_law(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Plain(Law):
        name = "plain"

    monkeypatch.setitem(LAWS, "plain", Plain)
    effect = read_scene(write(tmp_path, f'{PAIR}[finite_strain]\nlaw = "plain"\n')).problem.finite_strain
    assert effect is not None
    assert type(effect.chosen) is Plain


@pytest.mark.parametrize(
    ("load", "fractions"),
    [
        ('approach = "1.5 mm"', None),
        ('approach = "1.5 mm"\nsteps = ["0.3 mm", 7.5e-4]', (0.2, 0.5, 1.0)),
        ('force = ["2 N", "2 N"]\nsteps = ["500 mN", "2 N"]', (0.25, 1.0)),
        ('total_force = "4 N"\nsteps = [1]', (0.25, 1.0)),
        ('approach = ["1 mm", "2 mm"]\nsteps = [0.5]', (0.5, 1.0)),
    ],
)
def test_load_steps_are_fractions_that_end_in_full_load(
    load: str, fractions: tuple[float, ...] | None, tmp_path: Path
) -> None:
    steps = read_scene(write(tmp_path, PAIR.replace('approach = "1.5 mm"', load))).steps
    assert steps == (None if fractions is None else pytest.approx(fractions))


def test_load_steps_of_unlike_loads_are_plain_fractions(tmp_path: Path) -> None:
    unlike = PAIR.replace('approach = "1.5 mm"', 'approach = ["1 mm", "2 mm"]\nsteps = ["0.5 mm"]')
    (fault,) = faults(tmp_path, unlike)
    assert "[load] steps: must hold values between 0 and 1, fractions of the unlike loads (" in fault
    assert fault.endswith("write steps = [0.25, 0.5]")
    advised = read_scene(write(tmp_path, unlike.replace('["0.5 mm"]', "[0.25, 0.5]")))
    assert advised.steps == (0.25, 0.5, 1.0)
    assert not any("steps" in note for note in advised.doubts)


def test_lists_hold_one_value_per_ball(tmp_path: Path) -> None:
    text = PAIR.replace('radius = "8 mm"', 'radius = ["8 mm", "4 mm"]').replace(
        'approach = "1.5 mm"', 'force = ["2 N", 0.5]'
    )
    problem = read_scene(write(tmp_path, text)).problem
    assert [ball.radius for ball in problem.balls] == [0.008, 0.004]
    assert problem.load == Load("force", (2.0, 0.5))


def test_a_total_force_is_one_value_for_all_balls(tmp_path: Path) -> None:
    problem = read_scene(write(tmp_path, PAIR.replace('approach = "1.5 mm"', 'total_force = "3 N"'))).problem
    assert problem.load == Load("total_force", (3.0,))


def test_an_infinite_layer_survives_json(tmp_path: Path) -> None:
    scene = read_scene(write(tmp_path, PAIR.replace('thickness = "10 mm"', "thickness = inf")))
    assert scene.problem.layer.thickness == float("inf")
    given = as_given(scene.data)["layer"]["thickness"]
    again = read_scene(write(tmp_path, PAIR.replace('"10 mm"', f'"{given}"')))
    assert again.problem == scene.problem


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('thickness = "10 mm"', 'thickness = "-10 mm"', ["[layer] thickness", "greater than 0", '"-10 mm"', "example"]),
        ("poisson = 0.48", "poisson = 0.6", ["[layer] poisson", "between 0 and 0.5", "0.6"]),
        ("poisson = 0.48", 'poisson = "0.48"', ["[layer] poisson", "plain number"]),
        ("poisson = 0.48", 'poisson = "0,48"', ["[layer] poisson", "plain number; write decimals with a point"]),
        (
            'young = "57.4 kPa"',
            'young = "57 k Pa"',
            ["[layer] young", '"k Pa" is not a unit (did you mean "kPa"?), got'],
        ),
        (
            'radius = "8 mm"',
            'radius = "8 mm"\nfinite_strain = true',
            ["it is a table of its own: write [finite_strain]"],
        ),
        ('young = "57.4 kPa"', 'young = "1 kg m"', ["[layer] young", '"kg m" is of dimension']),
        ('young = "57.4 kPa"', 'young = "5 Pa s"', ["[layer] young", '"Pa s" is of dimension']),
        ("poisson = 0.48", "poisson = nan", ["[layer] poisson", "not nan"]),
        ("poisson = 0.48", "poisson = true", ["[layer] poisson", "plain number", "true"]),
        ("poisson = 0.48", "", ["[layer] poisson", "missing"]),
        ('young = "57.4 kPa"', 'young = "57.4 mm"', ["[layer] young", "must be a pressure", "is a length"]),
        ('young = "57.4 kPa"', 'young = "57.4 kFoo"', ["[layer] young", '"kFoo" is not a unit']),
        (
            'young = "57.4 kPa"',
            'young = "57.4 mpa"',
            ["[layer] young", '"mpa" is not a unit (did you mean "MPa"?), got'],
        ),
        ('approach = "1.5 mm"', 'approach = "1.5 mpa"', ["[load] approach", '"mpa" is not a unit, got']),
        ('young = "57.4 kPa"', 'young = "57.4"', ["[layer] young", "with its unit"]),
        ('young = "57.4 kPa"', 'young = "__import__(1)"', ["[layer] young", "must be a pressure"]),
        ('young = "57.4 kPa"', 'young = "9 Pa**9**9**9"', ["[layer] young", "must be a pressure"]),
        ("[layer]", "[layer]\nthicknes = 3", ["[layer] thicknes", 'did you mean "thickness"']),
        ("[layer]", "[layer]\nradius = 3", ["[layer] radius", "belongs in [balls]"]),
        ("[load]", "[accuracy]\ntolerance = 0.1\n[load]", ["[accuracy] tolerance", "[accuracy] tangential_force is"]),
        ("[load]", "[finite_strain.ogden]\na = 1\n[load]", ["[finite_strain] ogden", 'write law = "ogden"']),
        ("[layer]", "[lair]\na = 1\n[layer]", ["lair", 'did you mean "layer"']),
        ("[layer]", "layers = 3\n[layer]", ["layers", 'did you mean "layer"']),
        ("[layer]", "substrate = 3\n[layer]", ["[substrate]", "must be a table", "3"]),
        ("[layer]", "title = 3\n[layer]", ["title", "must be a string", "3"]),
        ("[load]", '[load]\nforce = "2 N"', ["[load]", "exactly one", "approach, force"]),
        ('approach = "1.5 mm"', "", ["[load]", "exactly one", "none of them"]),
        ('approach = "1.5 mm"', 'approach = ["1 mm", "1 mm", "1 mm"]', ["[load] approach", "needs 2 value(s), got 3"]),
        ('approach = "1.5 mm"', 'total_force = ["1 N", "1 N"]', ["[load] total_force", "must be one value, a force"]),
        ('approach = "1.5 mm"', 'approach = ["1 mm", "1 N"]', ["[load] approach", "value 1", "is a force"]),
        ('approach = "1.5 mm"', "approach = 0", ["[load] approach", "pressed in"]),
        ('approach = "1.5 mm"', "force = -1", ["[load] force", "negative"]),
        ('approach = "1.5 mm"', "total_force = [1, 1]", ["[load] total_force", "must be one value"]),
        ('radius = "8 mm"', 'radius = ["8 mm"]', ["[balls] radius", "one per ball (2), got 1"]),
        ('radius = "8 mm"', "radius = 0", ["[balls] radius:", "greater than 0"]),
        ('"0.8 cm"', '"0.7 cm"', ["[balls] positions", "overlap", "move them apart"]),
        ('["0.8 cm", 0]', '["0.8 cm"]', ["[balls] positions", "[x, y] pairs"]),
        ("[load]", 'shape = "torus"\n[load]', ["[balls] shape", '"sphere", "paraboloid", "ellipsoid"', '"torus"']),
        ('radius = "8 mm"', "", ["[balls] radius", "is missing", 'radius = "8 mm"']),
        ('radius = "8 mm"', 'shape = "punch"\nradius = "8 mm"', ["[balls] edge_radius", "missing", '"0.5 mm"']),
        (
            'radius = "8 mm"',
            'radius = "8 mm"\ntip_radius = "1 mm"',
            [
                "[balls] tip_radius",
                'shape = "sphere"',
                "takes radius",
                '"1 mm"',
                'leave it out, or take shape = "cone"',
            ],
        ),
        (
            'radius = "8 mm"',
            'shape = "cone"\nslope = "20 deg"\ntip_radius = "1 mm"\nradius = "8 mm"',
            [
                "[balls] radius",
                'shape = "cone"',
                "slope and tip_radius",
                '"8 mm"',
                '"sphere" or "paraboloid" or "punch"',
            ],
        ),
        (
            'radius = "8 mm"',
            'shape = "cone"\nslope = 20\ntip_radius = "1 mm"',
            ["[balls] slope", "between 0 and 90 deg", "20", '"20 deg" in a scene'],
        ),
        (
            'radius = "8 mm"',
            'shape = "cone"\nslope = "20 mm"\ntip_radius = "1 mm"',
            ["[balls] slope", "must be an angle", "a length", '"20 deg"'],
        ),
        (
            'radius = "8 mm"',
            'shape = "ellipsoid"\nsemi_axes = ["8 mm", "6 mm"]',
            ["[balls] semi_axes", "list of three lengths", '["8 mm", "6 mm", "8 mm"]'],
        ),
        (
            'radius = "8 mm"',
            'shape = ["cone", "torus"]\nradius = "8 mm"',
            ["[balls] shape: value 1: must be", f'or "{[*SHAPE_KEYS][-1]}", got', '["cone", "torus"]'],
        ),
        (
            'radius = "8 mm"',
            'shape = ["sphere", "sphere", "sphere"]\nradius = "8 mm"',
            ["[balls] shape: needs one name or one per ball (2), got 3"],
        ),
        (
            'radius = "8 mm"',
            'shape = ["sphere", "punch"]\nradius = "8 mm"',
            ['[balls] edge_radius: is missing, which shape = "punch" takes', 'edge_radius = "0.5 mm"'],
        ),
        (
            'radius = "8 mm"',
            'shape = ["sphere", "punch"]\nradius = "8 mm"\nedge_radius = "1 mm"\nslope = "20 deg"',
            [
                '[balls] slope: is not for shape = "sphere" or "punch", which takes radius and edge_radius',
                '"20 deg"',
                'leave it out, or take shape = "cone"',
            ],
        ),
        (
            'radius = "8 mm"',
            'shape = ["punch", "cone"]\nradius = ["8 mm", "7 mm"]\nedge_radius = "1 mm"\n'
            'slope = "20 deg"\ntip_radius = "1 mm"',
            ['[balls] radius: needs one value or one per ball of "punch" (1), got 2'],
        ),
        (
            'radius = "8 mm"',
            'shape = ["sphere", "cone"]\nradius = "8 mm"\nslope = ["95 deg"]\ntip_radius = "1 mm"',
            ["[balls] slope of ball 1: must lie between 0 and 90 deg"],
        ),
        (
            'radius = "8 mm"',
            'shape = "punch"\nradius = "8 mm"\nedge_radius = "9 mm"',
            ["[balls] edge_radius", "not be larger than the punch", '"9 mm"', "0.008 m"],
        ),
        ('approach = "1.5 mm"', 'approach = "12 mm"', ["rigid base, 10 mm, got 12 mm; reduce"]),
        ("[load]", "[load]\nsteps = 1", ["[load] steps", "must be a list", '["0.5 mm", "1 mm"]']),
        ("[load]", "[load]\nsteps = []", ["[load] steps", "greater than 0 and rise", "none"]),
        ("[load]", '[load]\nsteps = ["1 mm", "0.5 mm"]', ["[load] steps", "rise", "got 1 mm, 0.5 mm; list small"]),
        ("[load]", '[load]\nsteps = ["1 mm", "2 mm"]', ["[load] steps", "not exceed", "1.5 mm, got 2 mm", "drop"]),
        ("[load]", '[load]\nsteps = ["1 N"]', ["[load] steps", "values of approach", "a length", "a force"]),
        ("[load]", '[finite_strain]\nlaw = "hook"\n[load]', ["[finite_strain] law", "neo_hookean", "hook"]),
        ("[load]", '[finite_strain]\nlaw = "NeoHooke"\n[load]', ["[finite_strain] law", 'mean "neo_hookean"?']),
        ("poisson = 0.48", "poisson = -0.3", ["[layer] poisson", "between 0 and 0.5", "SurfaceResponse"]),
        ("[load]", '[finite_strain]\nlaw = "gent"\n[load]', ["[finite_strain] limit", "missing", "limit = 30"]),
        ("[load]", "[finite_strain]\nlimit = 9\n[load]", ["[finite_strain] limit", "not a number", "no numbers"]),
        ("[load]", '[finite_strain]\nlaw = "gent"\nlimit = -9\n[load]', ["[finite_strain] limit", "than 0", "-9"]),
        (
            "[load]",
            '[finite_strain]\nlaw = "yeoh"\nratios = [1, "2"]\n[load]',
            ["[finite_strain] ratios", "number 1: must be a plain number"],
        ),
        (
            'approach = "1.5 mm"',
            f'force = "1 N"\n{SLIDING}',
            ["the plate's height is fixed", "not force", "prints the one D of all balls under total_force"],
        ),
        ("[load]", "[accuracy]\ntangential_force = 2\n[load]", ["[accuracy] tangential_force", "above 0 and below 1"]),
        (
            "[load]",
            f"{SLIDING}ensemble = 3.0\n[load]",
            ["[reciprocation] ensemble: must be a whole number, got 3.0; for"],
        ),
        ("[load]", f"{SLIDING}ensemble = 0\n[load]", ["[reciprocation] ensemble: must be at least 1, got 0; for"]),
        ("[load]", f"{SLIDING}seed = -1\n[load]", ["[reciprocation] seed: must be at least 0, got -1; for"]),
    ],
)
def test_a_fault_names_table_key_rule_and_value(old: str, new: str, words: list[str], tmp_path: Path) -> None:
    assert old in PAIR
    found = faults(tmp_path, PAIR.replace(old, new, 1))
    assert len(found) == 1, found
    for word in words:
        assert word in found[0]


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=list(EFFECTS))
def test_an_effect_of_the_registry_is_whole(effect: Effect) -> None:
    table = effect.table.model_validate(dict(effect.example))
    rarer = RARER_EXAMPLES.get(effect.name, {})
    assert {*effect.example, *rarer} == set(effect.table.model_fields)  # a valid value of every key
    assert effect.words
    assert effect.without
    if effect.part is not None:  # a field of the problem, and a model that has it
        assert type(effect.part(table)).__name__ in str(Problem.__dataclass_fields__[effect.name].type)
        assert any(effect.name in model.effects for model in MODELS.values())
