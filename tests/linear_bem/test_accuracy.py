import numpy as np
import pytest

import linear_bem.grid.contacts
from linear_bem import Ball, Elastic, Layer, Load, Periodic, Problem, solve, solve_contact
from linear_bem.grid.contacts import GridContacts
from linear_bem.smooth import newton
from linear_bem.smooth.contacts import SmoothContacts

CASES = {
    "paper": (Layer(1.0, 0.48, 1.16), Elastic(1e3, 0.3), 2.66666e-3, 2.0),
    "heavy": (Layer(1.0, 0.48, np.inf), None, 0.3, 2.0),
    "incompressible": (Layer(1.0, 0.5, 0.5), None, 1e-2, 2.2),
    "close to a change of sign": (Layer(1.0, 0.48, 1.6977), Elastic(1e3, 0.3), 2.66666e-3, 2.0),
}


def problem_of(name):
    layer, substrate, force, distance = CASES[name]
    balls = (Ball((0.0, 0.0), 1.0, "paraboloid"), Ball((distance * 0.6, distance * 0.8), 1.0, "paraboloid"))
    return Problem(layer, balls, Load("force", (force, force)), substrate)


@pytest.fixture(scope="module")
def exact():
    return {name: np.array(solve(problem_of(name), 1e-8).balls[0].tangential_force) for name in CASES}


@pytest.mark.parametrize("wanted", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("name", CASES)
def test_the_requested_accuracy_is_reached_and_the_estimate_covers_the_error(name, wanted, exact):
    result = solve(problem_of(name), wanted)
    ball = result.balls[0]
    error = np.max(np.abs(np.array(ball.tangential_force) - exact[name]))
    assert error <= ball.tangential_force_error
    if name != "close to a change of sign":
        assert not result.solved.notes
        assert ball.tangential_force_error <= wanted * np.max(np.abs(exact[name]))


def test_near_a_change_of_sign_a_note_states_the_error_relative_to_t_itself():
    problem = problem_of("close to a change of sign")
    ball, notes = (result := solve(problem, 1e-4)).balls[0], result.solved.notes
    assert ball.tangential_force_error > 1e-4 * np.hypot(*ball.tangential_force)
    assert "close to zero" in notes[0]
    assert f"{max(b.tangential_force_error for b in result.balls):.1e} N" in notes[0]
    # the requested accuracy relative to T itself is reached
    assert not solve(problem, 1e-2).solved.notes


@pytest.mark.parametrize("kind", ["approach", "force"])
def test_small_newton_steps_keep_their_matrix_and_give_the_same_digits(kind, monkeypatch):
    renewed, displacement = [], newton.own_displacement

    def noted(kernel, nodes, rule, renew=True):
        renewed.append(renew)
        return displacement(kernel, nodes, rule, renew)

    monkeypatch.setattr(newton, "own_displacement", noted)
    balls = (Ball((-0.8, 0.0), 0.6), Ball((1.0, 0.2), 1.0))
    problem = Problem(Layer(1.0, 0.48, 1.16), balls, Load(kind, (0.05, 0.12)), Elastic(1e3, 0.3))
    quick = solve_contact(problem, 1e-4)
    kept, renewed[:] = renewed[:], []
    monkeypatch.setattr(newton, "SETTLED", 0.0)
    full = solve_contact(problem, 1e-4)
    assert all(renewed)
    assert len(kept) == len(renewed)
    assert sum(kept) < 0.75 * len(kept)
    size, error = full.contacts.normal_forces, full.tangential_force_error
    assert np.all(np.abs(quick.contacts.mutual_force - full.contacts.mutual_force) <= 0.01 * error[:, None])
    assert quick.tangential_force_error == pytest.approx(error, rel=0.05)
    assert quick.contacts.normal_forces == pytest.approx(size, rel=1e-9)
    assert quick.contacts.approaches == pytest.approx(full.contacts.approaches, rel=1e-9)
    for name, errors in full.errors.items():
        assert quick.errors[name] == pytest.approx(errors, rel=0.05, abs=1e-12)


def test_more_accuracy_takes_more_unknowns():
    problem = problem_of("heavy")
    assert solve(problem, 1e-6).solved.unknowns > solve(problem, 1e-2).solved.unknowns


def test_a_note_states_that_the_requested_accuracy_is_not_reached(monkeypatch):
    monkeypatch.setattr(linear_bem.grid.contacts, "MOST_CELLS", 20_000)
    problem = problem_of("paper")
    thin = Problem(Layer(1.0, 0.48, 0.01), problem.balls, problem.load, problem.substrate)
    solution = solve_contact(thin, 1e-8)
    assert isinstance(solution.contacts, GridContacts)
    assert "1.0e-08 was asked for" in solution.notes[0]
    assert "1.0e-08 was asked for" in solution.result().solved.notes[0]


def test_a_stricter_accuracy_is_never_answered_less_accurately(monkeypatch):
    monkeypatch.setattr(linear_bem.grid.contacts, "MOST_CELLS", 20_000)
    rounded = lambda x, y: 0.5 * (np.sqrt(x**2 + y**2 + 0.5625) - 0.75)  # noqa: E731
    balls = (Ball((-3.0, 0.0), 1.5, rounded), Ball((3.0, 0.0), 3.0))
    pair = Problem(Layer(2.0, 0.45, 4.0), balls, Load("approach", (0.5, 0.5)))
    usual, strict = solve(pair, 1e-4), solve(pair, 1e-8)
    assert not usual.solved.notes
    assert "1.0e-08 was asked for" in strict.solved.notes[0]
    assert strict.balls[0].tangential_force_error <= usual.balls[0].tangential_force_error
    assert strict.balls[0].errors["normal_force"] <= 1e-4 * strict.balls[0].normal_force
    monkeypatch.setattr(linear_bem.grid.contacts, "MOST_CELLS", 500)  # no grid resolves the contacts
    assert solve(pair, 1e-8).balls == strict.balls


def test_a_cell_is_answered_by_polynomials_at_any_accuracy():
    balls = (Ball((0.0, 0.0), 3.0), Ball((7.0, 0.0), 3.0))
    cell = Problem(Layer(2.0, 0.45, 4.0), balls, Load("approach", (0.9, 0.9)), periodic=Periodic((16.0, 12.0)))
    (note,) = (n for n in solve(cell, 1e-8).solved.notes if "asked for" in n)
    assert "highest usable degree" in note


def test_with_one_grid_only_the_difference_of_the_routes_is_the_error_estimate(monkeypatch):
    monkeypatch.setattr(linear_bem.grid.contacts, "MOST_CELLS", 3_000)
    problem = problem_of("paper")
    thin = Problem(Layer(1.0, 0.48, 0.01), problem.balls, problem.load, problem.substrate)
    result = solve(thin, 1e-4)
    assert "only one grid fits" in result.solved.notes[0]
    assert np.isfinite(result.balls[0].tangential_force_error)
    assert result.balls[0].tangential_force_error > 0.0


def test_polynomials_answer_where_the_grids_of_wide_contacts_do_not_fit(monkeypatch):
    pair = (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid"))
    problem = Problem(Layer(1.0, 0.3, 0.5), pair, Load("approach", (0.15, 0.15)))
    assert isinstance((by_grid := solve_contact(problem, 1e-2)).contacts, GridContacts)
    monkeypatch.setattr(linear_bem.grid.contacts, "MOST_CELLS", 100)
    found = solve_contact(problem, 1e-2)
    assert isinstance(found.contacts, SmoothContacts)
    assert found.contacts.normal_forces == pytest.approx(by_grid.contacts.normal_forces, rel=1e-3)
