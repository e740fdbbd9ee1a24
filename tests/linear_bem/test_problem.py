"""Problems made in Python: values that are not numbers, or too small, are refused at construction."""

import itertools
import math
from dataclasses import fields, replace

import numpy as np
import pytest

import linear_bem.touching
from linear_bem import (
    Ball,
    Cone,
    Elastic,
    FiniteStrain,
    InvalidProblem,
    Layer,
    Load,
    Periodic,
    Problem,
    Result,
    energy_force,
    solve,
    solve_contact,
    solve_height_field,
    solve_point_load,
)
from linear_bem.depth import LARGE_STRAIN, depth_faults, overlap_note
from linear_bem.problem import PARTS

LAYER, BALLS, LOAD = Layer(2.0, 0.3, 1.0), (Ball((0.0, 0.0), 3.0),), Load("force", (0.1,))


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"layer": Layer("1 MPa", 0.3, 1.0)}, r"layer\.young: must be a number, got '1 MPa'"),
        ({"load": Load("force", 0.1)}, r"load: must be Load\(kind, values\) with a tuple .*, got 'force', 0\.1"),
        (
            {"load": Load((0.1,), "force")},
            r"load: must be Load\(kind, values\) .*, got \(0\.1,\), 'force'",
        ),
        ({"load": Load("total_force", 1.0)}, r'a tuple of numbers, such as Load\("total_force", \(1\.0,\)\), got'),
        ({"load": Load("total_force", (1.0, 1.0))}, r"needs 1 value\(s\), got 2; force takes one per ball"),
        ({"substrate": Layer(4.0, 0.3, 1.0)}, r"substrate: must be a half-space, .*, got a layer 1 m thick; a Surface"),
        ({"balls": (Ball((-1, 0, 0), 1),)}, r"balls\.positions\[0\]: must be two numbers, x and y, got \(-1, 0, 0\)"),
        ({"balls": Ball((0.0, 0.0), 1.0)}, r"balls: must be a tuple of Ball, .* as \(Ball\(...\),\), got Ball"),
        ({"balls": (1.0,)}, r"balls: must be a tuple of Ball, .* got \(1\.0,\)"),
        ({"balls": (Ball((0.0, 0.0), "1 mm"),)}, r"balls\.radius\[0\]: must be a number"),
        ({"finite_strain": FiniteStrain("gum")}, r'finite_strain\.law: must be one of neo_hookean, .*, got "gum"'),
        ({"finite_strain": FiniteStrain("gent")}, r'finite_strain\.limit: is missing for law "gent"'),
        (
            {"periodic": (10.0, 10.0)},
            r"periodic: must be Periodic such as Periodic.*, got \(10\.0, 10\.0\)",
        ),
        ({"load": Load("approach", (1e-300,))}, r"load\.approach\[0\]: must be at least 3e-12, or 0, got 1e-300"),
        ({"load": Load("approach", (1e300,))}, r"load\.approach\[0\]: must be at most 3e\+09, got 1e\+300"),
        ({"load": Load("force", (1e300,))}, r"load\.force\[0\]: must be at most 1\.8e\+19, got 1e\+300"),
        ({"layer": Layer(-1.0, 0.3, 1.0)}, r"^layer\.young: must be greater than 0 and finite, got -1 Pa$"),
        ({"layer": "rubber"}, r"layer: must be Layer such as Layer\(.*\), got 'rubber'"),
        ({"load": (0.1,)}, r"load: must be Load such as Load\(.*\), got \(0\.1,\)"),
        ({"substrate": 1e9}, r"substrate: must be Elastic such as"),
        ({"layer": Layer(1.0, 0.3, True)}, "layer.thickness: must be a number, got True"),
        ({"finite_strain": True}, r"finite_strain: must be FiniteStrain such as FiniteStrain\(\), got True"),
        ({"elements": "mixed"}, r"elements: must be Elements such as"),
        ({"load": Load("force", (1e-20,))}, r"load\.force\[0\]: must be at least 1\.8e-17, or 0, got 1e-20"),
    ],
)
def test_invalid_values_are_refused_with_their_key(parts, words):
    with pytest.raises(InvalidProblem, match=words):
        Problem(**({"layer": LAYER, "balls": BALLS, "load": LOAD} | parts))


@pytest.mark.parametrize("accuracy", ["1e-3", 0.0, math.nan, None])
def test_an_accuracy_that_is_none_is_refused(accuracy):
    with pytest.raises(InvalidProblem, match=r"accuracy.*must be a number between 0 and 1"):
        solve(Problem(LAYER, BALLS, LOAD), accuracy)


def test_a_note_is_given_for_an_approach_as_large_as_the_thickness():
    layer = Layer(1.0, 0.3, 10.0)
    for approach, noted in ((2.4, False), (2.6, True)):
        notes = solve(Problem(layer, (Ball((0.0, 0.0), 20.0),), Load("approach", (approach,))), 1e-2).solved.notes
        assert any("of the layer's thickness" in note for note in notes) == noted
        assert any("finite_strain solves approaches up to about 0.9 of it" in note for note in notes) == noted


def test_an_approach_through_a_layer_to_a_rigid_base_is_refused_once():
    balls, layer = (Ball((0.0, 0.0), 20.0), Ball((60.0, 0.0), 20.0)), Layer(1.0, 0.3, 10.0)
    said = r"^load\.approach\[1\]: must be less than the thickness of a layer on a rigid base, 10 m, got 12 m; reduce"
    through = Problem(layer, balls, Load("approach", (10.0, 12.0)))
    with pytest.raises(InvalidProblem, match=said) as caught:
        solve(through)
    assert len(caught.value.faults) == 1
    one = Load("approach", (12.0, 0.0))
    solve(Problem(layer, balls, one, Elastic(1e3, 0.3)), 1e-2)  # which may deform
    solve(Problem(Layer(1.0, 0.3, math.inf), balls, one), 1e-2)


def test_a_force_that_presses_through_a_layer_on_a_rigid_base_is_refused():
    pair = (Ball((-60.0, 0.0), 20.0), Ball((60.0, 0.0), 20.0))
    layer, said = (
        Layer(1.0, 0.3, 10.0),
        r"must press a ball less deep than 2 times the thickness of the layer on a rigid",
    )
    for load, ball in ((Load("force", (1.0, 1e4)), 1), (Load("total_force", (2e4,)), 0)):
        match = rf"^load\.{load.kind}.*{said} base, 10 m, got \d0000 N, under which ball {ball} is pressed"
        with pytest.raises(InvalidProblem, match=match):
            solve(Problem(layer, pair, load))
        assert not depth_faults(Problem(layer, pair, load, Elastic(1e5, 0.3)))  # is noted, as for approaches
    for load in (Load("force", (1e7, 1.0)), Load("approach", (2e3, 1.0))):
        with pytest.raises(InvalidProblem, match=rf"^load\.{load.kind}\[0\]: must .* 100 times .* radius, 20 m, got"):
            solve(Problem(Layer(1.0, 0.3, math.inf), pair, load))


def test_a_force_is_not_refused_for_what_the_base_gives_or_another_ball_bears():
    layer, light = Layer(1.0, 0.3, 0.05), (Ball((0.0, 0.0), 1.0),)
    assert not depth_faults(Problem(layer, light, Load("force", (6.0,)), Elastic(1.0, 0.3)))
    assert depth_faults(Problem(layer, light, Load("force", (6.0,))))
    unlike = (Ball((0.0, 0.0), 10.0), Ball((20.0, 0.0), 0.05))  # a common approach: the small ball bears a hundredth
    assert not depth_faults(Problem(Layer(1.0, 0.3, 1.0), unlike, Load("total_force", (10.0,))))
    assert depth_faults(Problem(Layer(1.0, 0.3, 1.0), unlike, Load("total_force", (300.0,))))


def test_a_base_that_sinks_under_many_balls_is_no_depth_of_the_layer_or_of_a_ball():
    def lattice(n, force, layer, base):
        places = [(2.2 * i, 2.2 * j) for i in range(n) for j in range(n)]
        return Problem(layer, tuple(Ball(p, 1.0) for p in places), Load("force", (force,) * n * n), base)

    sunk = solve(lattice(3, 0.05, Layer(1.0, 0.4, 3.0), Elastic(0.01, 0.3)), 1e-2)
    assert sunk.balls[0].approach > 1.7
    assert not sunk.solved.notes
    thin = solve_point_load(lattice(7, 0.02, Layer(1.0, 0.4, 0.5), Elastic(0.3, 0.3)))
    assert thin.balls[24].approach > 0.5 * 0.5
    assert not thin.solved.notes
    deep = solve(
        Problem(Layer(1.0, 0.4, 8.0), (Ball((0.0, 0.0), 1.0),), Load("force", (4.0,)), Elastic(0.7, 0.3)), 1e-2
    )
    assert "of its ball's radius: small strain" in deep.solved.notes[0]  # the base's dent is its own
    film = Problem(Layer(1.0, 0.3, 0.05), (Ball((0.0, 0.0), 1.0, "paraboloid"),), Load("approach", (50.0,)))
    assert "50 of its ball's radius" in solve(replace(film, substrate=Elastic(1.0, 0.3)), 1e-2).solved.notes[-1]


@pytest.mark.parametrize("given", ["pair.toml", LAYER, [Problem(LAYER, BALLS, LOAD)]])
def test_what_is_no_problem_is_refused(given):
    for call in (solve, solve_contact, solve_point_load):
        with pytest.raises(InvalidProblem, match=r"problem: must be a Problem, as solve\(Problem\("):
            call(given)


def test_a_load_may_be_an_array():
    balls = tuple(Ball((x, 0.0), 1.0) for x in (-2.0, 2.0))
    assert Problem(LAYER, balls, Load("approach", np.full(2, 0.1))).load == Load("approach", (0.1, 0.1))


def test_positions_may_be_arrays_of_whole_numbers_which_may_change_afterwards():
    places = np.array([(0, 0), (3, 0)])
    scene = Problem(LAYER, tuple(Ball(place, np.int64(1)) for place in places), Load("force", (0.01, 0.02)))
    places[1] = 4
    assert scene == replace(scene, balls=(Ball((0, 0), 1), Ball((3, 0), 1)))
    for found in (solve(scene, 1e-2), solve_point_load(scene)):
        assert Result.from_json(found.to_json()) == found


def test_a_depth_that_is_found_has_an_energy_and_its_derivative():
    balls = tuple(Ball((x, 0.0), 8.0, "paraboloid") for x in (0.0, 40.0))
    found = solve_contact(Problem(Layer(1.0, 0.3, 10.0), balls, Load("force", (350.0, 350.0))))
    assert np.max(found.contacts.approaches) > 10.0
    pull = energy_force(found, 0)[0]
    assert pull == pytest.approx(found.contacts.mutual_force[0, 0], rel=1e-5)


def test_the_note_on_depth_is_the_same_for_every_cell_of_a_lattice():
    noted = []
    for n in (1, 2):
        places = [(2.6 * i, 2.6 * j) for i in range(n) for j in range(n)]
        balls = tuple(Ball(place, 1.0) for place in places)
        lattice = Problem(
            Layer(1.0, 0.3, 0.5), balls, Load("approach", (0.36,) * n * n), Elastic(8.0, 0.3),
            periodic=Periodic((2.6 * n, 2.6 * n)),
        )  # fmt: skip
        noted.append([note for note in solve(lattice, 1e-2).solved.notes if note.startswith(LARGE_STRAIN)])
    assert len(noted[0]) == 1
    assert noted[0] == noted[1]


def test_a_depth_that_neither_layer_nor_base_can_give_is_noted_first():
    ball, layer = (Ball((0.0, 0.0), 20.0),), Layer(1.0, 0.3, 10.0)
    for base in (None, Elastic(1e3, 0.3)):
        deep = solve(Problem(layer, ball, Load("force", (3e3,)), base), 1e-2)
        assert deep.balls[0].approach > 10.0
        assert "deeper than layer and base can give: check the load and its unit" in deep.solved.notes[0]
    soft = solve(Problem(Layer(1e3, 0.3, 10.0), ball, Load("approach", (15.0,)), Elastic(1.0, 0.3)), 1e-2)
    assert not any("of the layer's thickness" in note for note in soft.solved.notes)  # the base deforms


def test_an_approach_beyond_the_radius_of_its_ball_is_noted_once():
    """With forces in N on balls in mm the layer may be thick enough for any depth: the ball is not."""
    pair = (Ball((-30.0, 0.0), 20.0), Ball((30.0, 0.0), 20.0))
    for depth, noted in ((20.0, False), (40.0, True)):
        notes = solve(Problem(Layer(1.0, 0.3, math.inf), pair, Load("approach", (depth, 1.0))), 1e-2).solved.notes
        assert [note for note in notes if "of its ball's radius" in note] == [note for note in notes if noted][:1]
        assert not noted or "the largest approach is 2 of its ball's radius" in notes[0]
    deep = solve(Problem(Layer(1.0, 0.3, 10.0), pair[:1], Load("force", (3e3,))), 1e-2).solved.notes
    assert [note for note in deep if "check the load and its unit" in note] == [deep[0]]
    assert "0.9 ball radii" not in deep[0]


def test_asperities_may_stand_closer_than_their_radii_and_whole_balls_may_not():
    """Caps of R = 10 at a spacing of 5: apart they are any two contacts, merged they are the lower of both surfaces."""
    xy, layer = ((-2.5, 0.0), (2.5, 0.0)), Layer(1.0, 0.3, math.inf)
    said = r"overlap by 15 m: .* 5 m apart, .* need at least 20 m; caps .* asperity=True"
    with pytest.raises(InvalidProblem, match=said):
        Problem(layer, tuple(Ball(p, 10.0) for p in xy), Load("approach", (0.1, 0.1)))
    caps = tuple(Ball(p, 10.0, "paraboloid", asperity=True) for p in xy)
    apart = solve(Problem(layer, caps, Load("approach", (0.1, 0.1))))
    scaled = tuple(Ball((0.4 * x, y), 4.0, "paraboloid", asperity=True) for x, y in xy)
    same = solve(Problem(layer, scaled, Load("approach", (0.04, 0.04)))).balls[0]
    assert 0.4**2 * apart.balls[0].normal_force == pytest.approx(same.normal_force, rel=1e-6)
    assert apart.balls[0].tangential_force[0] > 0.0

    merged = solve(Problem(layer, caps, Load("approach", (1.0, 1.0))), 1e-3)
    cell = 13.0 / 256
    x = cell * (np.arange(256) - 127.5)
    lower = np.minimum((x - 2.5) ** 2, (x + 2.5) ** 2)[:, None] / 20.0 + x**2 / 20.0
    field = solve_height_field(layer, None, lower, cell, approach=1.0)
    assert sum(ball.normal_force for ball in merged.balls) == pytest.approx(field.normal_force, rel=1e-3)


def test_asperities_are_refused_at_finite_strain():
    caps = (Ball((0.0, 0.0), 10.0, asperity=True),)
    with pytest.raises(InvalidProblem, match="finite_strain: bodies must be whole"):
        Problem(LAYER, caps, LOAD, finite_strain=FiniteStrain())


def test_pairs_of_asperities_are_not_searched_for_overlaps(monkeypatch):
    monkeypatch.setattr(linear_bem.touching, "touching_distance", lambda a, b: pytest.fail("a pair was compared"))
    caps = tuple(Ball((x, y), 5.0, asperity=True) for x, y in np.random.default_rng(7).uniform(0.0, 1.0, (50, 2)))
    assert Problem(Layer(1.0, 0.3, 5.0), caps, Load("total_force", (1e-3,))).size == 50


@pytest.mark.parametrize("periodic", [None, Periodic((4.0, 4.0))])
def test_no_two_bodies_stand_on_one_axis(periodic):
    def made(x, **body):
        balls = tuple(Ball((at, 1.0), **body) for at in (0.0, 2.0, x))
        return Problem(LAYER, balls, Load("approach", (0.1, 0.1, 0.05)), periodic=periodic)

    for body in ({"radius": 1.0, "asperity": True}, {"shape": Cone(0.3, 0.1)}):
        with pytest.raises(InvalidProblem, match="balls 0 and 2 must not stand on one axis; move one of them"):
            made(1e-12 if periodic is None else 4.0 - 1e-12, **body)
        assert made(1e-3, **body).size == 3


def test_overlaps_among_many_balls_are_found():
    balls = [Ball((2.0 * i, 2.0 * j), 1.0) for i in range(40) for j in range(40)]
    balls[1234] = Ball((balls[1233].position[0], balls[1233].position[1] + 1.5), 1.0)
    balls.append(Ball((-30.0, 0.0), 20.0, "paraboloid"))
    with pytest.raises(InvalidProblem) as fault:
        Problem(Layer(1.0, 0.3, 1.0), tuple(balls), Load("total_force", (1.0,)))
    assert [line.split(" overlap")[0] for line in fault.value.faults] == [
        "balls.positions: balls 1233 and 1234",
    ]


@pytest.mark.parametrize("cell", [None, (12.0, 15.0)])
def test_overlaps_of_unlike_balls_are_those_of_all_pairs(cell):
    rng, lengths = np.random.default_rng(0), None if cell is None else np.array(cell)
    for _ in range(40):
        x, radii = rng.uniform(0.0, 12.0, (8, 2)), np.exp(rng.uniform(-3.0, 1.5, 8))
        overlaps = []
        for i, j in itertools.combinations(range(8), 2):
            apart = x[i] - x[j] if lengths is None else x[i] - x[j] - lengths * np.round((x[i] - x[j]) / lengths)
            overlaps.append((2.0 * math.sqrt(radii[i] * radii[j]) - math.hypot(*apart), i, j))
        by, i, j = max(overlaps)
        bodies = {k: ("sphere", radius) for k, radius in enumerate(radii.tolist())}
        said = linear_bem.touching.overlap_faults(bodies, x, lengths)
        assert len(said) == (by > 0.0)
        assert not said or said[0].startswith(f"balls.positions: balls {i} and {j} overlap by {by:.3g} m")


def test_a_large_ball_among_many_small_ones_is_compared_with_each_once(monkeypatch):
    compared, touching_distance = [], linear_bem.touching.touching_distance
    monkeypatch.setattr(
        linear_bem.touching, "touching_distance", lambda *pair: compared.append(1) or touching_distance(*pair)
    )
    places = [(25.0 + 1.1 * i, 1.1 * j) for i in range(20) for j in range(20)]
    Problem(
        Layer(1.0, 0.3, 5.0), (Ball((0.0, 0.0), 200.0), *(Ball(p, 0.5) for p in places)), Load("force", (1e-3,) * 401)
    )
    assert len(compared) == 400


def test_bodies_are_placed_elsewhere_one_place_for_each() -> None:
    pair = Problem(LAYER, (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0)), Load("approach", (0.1, 0.2)))
    there = pair.at(np.array([[0.0, 3.0], [4.0, 0.0]]))
    assert there == replace(
        pair, balls=tuple(replace(b, position=p) for b, p in zip(pair.balls, [(0.0, 3.0), (4.0, 0.0)], strict=True))
    )
    for places in ([(0.0, 0.0)], [(0.0, 0.0, 0.0), (4.0, 0.0, 0.0)]):
        with pytest.raises(InvalidProblem, match=r"positions: must have shape \(2, 2\)"):
            pair.at(places)
    with pytest.raises(InvalidProblem, match="overlap"):
        pair.at([(0.0, 0.0), (1.0, 0.0)])


def test_the_type_of_every_part_is_checked() -> None:
    assert {"balls", *PARTS} == {part.name for part in fields(Problem)}


def test_unlike_balls_that_meet_as_one_is_pressed_deeper_are_noted() -> None:
    balls = Ball((0.0, 0.0), 5.0), Ball((12.65, 0.0), 8.0)  # resting, they touch at 2 sqrt(40) = 12.649

    def said(*approaches: float, pair: tuple[Ball, ...] = balls) -> list[str]:
        notes = solve(Problem(Layer(1.0, 0.3, 40.0), pair, Load("approach", approaches)), 1e-2).solved.notes
        return [note for note in notes if "pass through each other" in note]

    assert not said(1.0, 1.0)
    assert not said(2.0, 0.1)  # further apart
    (note,) = said(0.1, 2.0)  # the larger one is deeper: their centres are nearly level
    away = 13.0 - math.hypot(12.65, (8.0 - 2.0) - (5.0 - 0.1))
    assert note.startswith(f"balls 0 and 1 pass through each other by {away:.2g} m")
    equal = Ball((0.0, 0.0), 5.0), Ball((10.0, 0.0), 5.0)
    assert not said(0.1, 2.0, pair=equal)
    caps = tuple(replace(ball, asperity=True) for ball in balls)
    assert not said(0.1, 2.0, pair=caps)
    for start in (10.0, 35.0):  # inside the cell, and across its edge
        placed = tuple(replace(ball, position=((ball.position[0] + start) % 40.0, 10.0)) for ball in balls)
        cell = Problem(Layer(1.0, 0.3, 40.0), placed, Load("approach", (0.1, 2.0)), periodic=Periodic((40.0, 40.0)))
        assert overlap_note(cell, np.array([0.1, 2.0]))[0].split(",")[0] == note.split(",")[0]
