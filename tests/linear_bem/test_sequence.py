"""Scenes solved one from the other: the same results as cold, and a cold solution where scenes are not near."""

from dataclasses import replace

import numpy as np
import pytest

from linear_bem import (
    Ball,
    Cone,
    ContactSequence,
    Elastic,
    FiniteStrain,
    InvalidProblem,
    Layer,
    Load,
    Periodic,
    Problem,
    Punch,
    UnsupportedProblem,
    solve,
    solve_contact,
)
from linear_bem.sequence.contact_sequence import nearby_forces
from linear_bem.sequence.linearised import LinearisedContacts

ACCURACY = 1e-2


def block(shift, load, shape="sphere", thickness=8.0, substrate=None):
    """Nine balls 2.4 radii apart, each moved by its own share of ``shift``."""
    way = np.random.default_rng(1).uniform(-1.0, 1.0, (9, 2))
    xy = np.array([(2.4 * i, 2.4 * j) for i in range(3) for j in range(3)]) + shift * way
    return Problem(Layer(1.0, 0.48, thickness), tuple(Ball(tuple(p), 1.0, shape) for p in xy), load, substrate)


LOADS = [Load("approach", (0.5,) * 9), Load("force", (0.3,) * 9), Load("total_force", (3.0,))]


@pytest.mark.parametrize("load", LOADS, ids=lambda load: load.kind)
def test_warm_answers_equal_cold_ones_within_the_accuracy(load):
    sequence = ContactSequence(ACCURACY)
    assert sequence.solve(block(0.0, load)).cold
    for shift in (0.02, 0.08):
        state = sequence.solve(block(shift, load))
        assert not state.cold
    cold = solve(block(0.08, load), 1e-3)
    t = np.array([b.tangential_force for b in cold.balls])
    error = np.max(np.abs(state.tangential_force - t), axis=1)
    assert np.max(error) <= ACCURACY * np.max(np.abs(t))
    assert np.all(error <= state.tangential_force_error)
    assert state.normal_forces == pytest.approx([b.normal_force for b in cold.balls], rel=ACCURACY)
    assert state.approaches == pytest.approx([b.approach for b in cold.balls], rel=ACCURACY)
    assert state.gap_in_contact < ACCURACY


@pytest.mark.parametrize(
    ("other", "layer", "approaches"),
    [
        pytest.param(Ball((2.3, 0.0), 0.8), Layer(1.0, 0.48, 2.0), (0.2, 0.05), id="distant"),
        pytest.param(Ball((4.0, 0.0), 0.5), Layer(1.0, 0.0, 2.0), (0.14, 0.1), id="hardly any T"),
        pytest.param(Ball((2.0, 0.0), shape=Cone(0.5, 0.02)), Layer(1.0, 0.48, 8.0), (0.462, 0.0475), id="light"),
    ],
)
def test_the_error_of_t_holds_for_distant_and_lightly_pressed_bodies(other, layer, approaches):
    scene = Problem(layer, (Ball((0.0, 0.0), 1.0, "paraboloid"), other), Load("approach", approaches))
    state, truth = ContactSequence(ACCURACY).solve(scene), solve_contact(scene, 1e-6).contacts
    error = np.max(np.abs(state.tangential_force - truth.mutual_force), axis=1)
    assert np.all(error <= state.tangential_force_error)


def test_a_scene_with_a_periodic_cell_is_not_solved_from_one_without():
    sequence, scene = ContactSequence(ACCURACY), block(0.0, LOADS[0])
    sequence.solve(scene)
    assert sequence.solve(replace(scene, periodic=Periodic((9.0, 9.0)))).cold


def test_small_moves_need_no_new_linearisation(monkeypatch):
    sequence = ContactSequence(ACCURACY)
    sequence.solve(block(0.0, LOADS[0]))
    calls = []
    plain = LinearisedContacts.__init__
    monkeypatch.setattr(LinearisedContacts, "__init__", lambda self, *a: (calls.append(1), plain(self, *a))[1])
    for shift in np.linspace(0.0, 0.02, 5):
        sequence.solve(block(shift, LOADS[0]))
    assert not calls
    sequence.solve(block(0.3, LOADS[0]))
    assert calls


def test_other_bodies_are_solved_cold():
    sequence = ContactSequence(ACCURACY)
    load = Load("approach", (0.05,) * 9)
    sequence.solve(block(0.0, load))
    assert sequence.solve(block(0.0, load, thickness=2.0)).cold
    assert sequence.solve(block(0.0, load, thickness=2.0, substrate=Elastic(3.0, 0.3))).cold
    assert sequence.solve(block(0.0, load, shape="paraboloid")).cold
    assert sequence.solve(block(0.0, Load("force", (1e-3,) * 9), shape="paraboloid")).cold


def test_the_effect_finite_strain_is_refused_as_by_solve():
    scene = replace(block(0.0, LOADS[0]), finite_strain=FiniteStrain())
    for call in (solve, ContactSequence(ACCURACY).solve):
        with pytest.raises(UnsupportedProblem, match="finite_strain is not part of this model"):
            call(scene)


@pytest.mark.parametrize("accuracy", [5.0, 0.0, "1e-2"])
def test_an_accuracy_that_is_none_is_refused_as_by_solve(accuracy):
    with pytest.raises(InvalidProblem, match="must be a number between 0 and 1, got"):
        ContactSequence(accuracy)


def test_a_ball_that_gains_or_loses_contact_is_detected():
    def scene(approach):
        pair = (Ball((0.0, 0.0), 1.0, "paraboloid"), Ball((2.5, 0.0), 1.0, "paraboloid"))
        return Problem(Layer(1.0, 0.48, np.inf), pair, Load("approach", (0.1, approach)))

    sequence = ContactSequence(ACCURACY)
    for approach in (1e-4, 0.02, 1e-4):
        state = sequence.solve(scene(approach))
        full = solve(scene(approach), 1e-4)
        assert state.normal_forces == pytest.approx([b.normal_force for b in full.balls], rel=ACCURACY)
        assert (state.normal_forces[1] > 0.0) == (approach > 1e-3)


def test_a_ball_that_a_bulge_touches_and_a_punch_that_touches_at_its_edge_are_detected():
    def bulge(place, depth):
        balls = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.0), 1.0), Ball((0.0, place), 1.0))
        return Problem(Layer(1.0, 0.48, 1.16), balls, Load("approach", (0.3, 0.3, depth)))

    def punch(depth):
        balls = (Ball((0.0, 0.0), 1.0), Ball((2.2, 0.0), shape=Punch(1.0, 0.1)))
        return Problem(Layer(1.0, 0.48, 8.0), balls, Load("approach", (0.48, depth)))

    for lifted, touching in ((punch(-0.1), punch(0.028)), (bulge(2.01, -0.0143), bulge(2.0, -0.0116))):
        sequence = ContactSequence(ACCURACY)
        assert sequence.solve(lifted).normal_forces[-1] == 0.0
        assert sequence.solve(touching).normal_forces[-1] > 1e-5


def test_merging_contacts_are_solved_cold():
    def scene(distance):
        pair = (Ball((0.0, 0.0), 1.0, "paraboloid"), Ball((distance, 0.0), 1.0, "paraboloid"))
        return Problem(Layer(1.0, 0.48, np.inf), pair, Load("force", (12.0, 12.0)))

    sequence = ContactSequence(ACCURACY)
    states = [sequence.solve(scene(d)) for d in (2.0, 2.01)]
    assert all(s.cold for s in states)
    assert states[1].tangential_force[0, 0] == pytest.approx(-states[1].tangential_force[1, 0], rel=1e-6)


@pytest.mark.parametrize("load", [Load("approach", (0.1, 0.1)), Load("force", (0.02, 0.03))], ids=lambda v: v.kind)
def test_forces_next_to_a_solution_are_those_of_a_solution_of_their_own(load):
    def pair(factor):
        balls = (Ball((-factor, 0.0), 1.0), Ball((factor, 0.0), 1.0))
        return Problem(Layer(factor, 0.45, 1.5 * factor), balls, load, Elastic(50.0, 0.3))

    near, there = solve_contact(pair(1.05), 1e-5), pair(1.055)
    wanted = solve_contact(there, 1e-5).contacts.mutual_force
    assert nearby_forces(near, there) == pytest.approx(wanted, abs=1e-5 * np.max(np.abs(wanted)))


def test_there_are_no_forces_next_to_a_solution_on_grids_or_of_a_sample_or_where_contacts_merge_open_or_close():
    def pair(depth):
        balls = tuple(Ball((x, 0.0), 1.0, "paraboloid") for x in (-1.0, 1.0))
        return Problem(Layer(1.0, 0.48, np.inf), balls, Load("approach", (depth, depth)))

    assert nearby_forces(solve_contact(pair(4.0), 1e-2), pair(4.0)) is None
    assert nearby_forces(solve_contact(pair(0.3), 1e-2), pair(4.0)) is None
    assert nearby_forces(solve_contact(pair(0.3), 1e-2, sample=1), pair(0.31)) is None

    def beside(low):
        balls = (*(Ball((x, 0.0), 1.0) for x in (-1.2, 1.2)), Ball((0.0, 3.0), 1.0, asperity=True))
        return Problem(Layer(1.0, 0.45, 1.5), balls, Load("approach", (0.1, 0.1, low)))

    for before, after in ((-0.01, 0.01), (0.01, -0.01)):
        assert nearby_forces(solve_contact(beside(before), 1e-3), beside(after)) is None


def test_there_are_no_forces_next_to_a_solution_of_other_balls_loads_or_models():
    def pair(load, size=2, **effects):
        balls = tuple(Ball((2.2 * i, 0.0), 1.0) for i in range(size))
        return Problem(Layer(1.0, 0.45, 1.5), balls, load, **effects)

    force = Load("force", (0.02, 0.0))
    near = solve_contact(pair(force), 1e-3)
    assert nearby_forces(near, pair(force)) is not None
    for other in (
        pair(Load("force", (0.02, 0.02))), pair(Load("total_force", (0.02,))), pair(Load("force", (0.02,)), 1),
        pair(force, finite_strain=FiniteStrain()),
    ):  # fmt: skip
        assert nearby_forces(near, other) is None
