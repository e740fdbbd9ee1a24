"""Problems made in Python: values that are not numbers, or too small, are refused at construction."""

import pytest

from linear_bem import Ball, FiniteStrain, InvalidProblem, Layer, Load, Problem, solve

LAYER, BALLS, LOAD = Layer(2.0, 0.3, 1.0), (Ball((0.0, 0.0), 3.0),), Load("force", (0.1,))


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"layer": Layer("1 MPa", 0.3, 1.0)}, r"layer\.young: must be a number, got '1 MPa'"),
        ({"load": Load("force", 0.1)}, r"load\.force: must be a tuple of numbers, got 0\.1"),
        ({"balls": (Ball((-1, 0, 0), 1),)}, r"balls\.positions\[0\]: must be two numbers, x and y, got \(-1, 0, 0\)"),
        ({"balls": (Ball((0.0, 0.0), "1 mm"),)}, r"balls\.radius\[0\]: must be a number"),
        ({"finite_strain": FiniteStrain("ogden")}, r'finite_strain\.law: must be one of neo_hookean, got "ogden"'),
        ({"load": Load("approach", (1e-300,))}, r"load\.approach\[0\]: must be at least 3e-12, or 0, got 1e-300"),
        ({"load": Load("force", (1e-20,))}, r"load\.force\[0\]: must be at least 1\.8e-17, or 0, got 1e-20"),
    ],
)
def test_invalid_values_are_refused_with_their_key(parts, words):
    with pytest.raises(InvalidProblem, match=words):
        Problem(**({"layer": LAYER, "balls": BALLS, "load": LOAD} | parts))


def test_a_note_is_given_for_an_approach_as_large_as_the_thickness():
    layer = Layer(1.0, 0.3, 10.0)
    for approach, noted in ((2.0, False), (15.0, True)):
        notes = solve(Problem(layer, (Ball((0.0, 0.0), 20.0),), Load("approach", (approach,))), 1e-2).solved.notes
        assert any("of the layer's thickness" in note for note in notes) == noted
