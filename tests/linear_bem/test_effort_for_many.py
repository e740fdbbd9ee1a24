"""What a solution of many balls computes: degrees, sweeps, sharpness of pairs, nodes in a contact, sums once."""

from dataclasses import replace

import numpy as np
import pytest

from linear_bem import Ball, Elastic, Layer, Load, Problem, sampled_solution, solve, solve_contact
from linear_bem.error_estimate import felt
from linear_bem.far_field import pairs_and_mesh
from linear_bem.lifted_balls import smooth_state
from linear_bem.profiles import height
from linear_bem.sampled_solution import sample_error
from linear_bem.smooth.displacement import DirectSums
from linear_bem.smooth.newton import Nodes, Rule
from linear_bem.smooth.own_equations import OwnEquations
from linear_bem.smooth.zone import Zone
from tests.linear_bem.sampled_scenes import errors, forces, scattered, scene, thin


def test_pairs_are_sharper_at_the_second_degree(monkeypatch):
    asked = []

    def noted(start, degree, precision, pairs, report):
        asked.append((degree, pairs))
        return smooth_state(start, degree, precision, pairs, report)

    def off(contacts, report):
        sample = sample_error(contacts, report)
        return replace(sample, tangential_force=sample.tangential_force + 1.0) if len(asked) == 1 else sample

    monkeypatch.setattr(sampled_solution, "smooth_state", noted)
    monkeypatch.setattr(sampled_solution, "sample_error", off)
    solve(scene("force"), 1e-3)
    assert asked == [(4, pytest.approx(1e-4)), (6, pytest.approx(5e-6))]


@pytest.mark.parametrize(
    ("depth", "poisson", "degree", "sharper"), [(0.035, 0.48, 6, False), (0.02, 0.48, 4, False), (0.02, 0.3, 4, True)]
)
def test_wide_contacts_begin_at_degree_six_and_small_forces_with_sharper_pairs(
    monkeypatch, depth, poisson, degree, sharper
):
    asked = []

    def noted(start, degree, precision, pairs, report):
        asked.append((degree, pairs))
        return smooth_state(start, degree, precision, pairs, report)

    monkeypatch.setattr(sampled_solution, "smooth_state", noted)
    places = scattered(105, 2.8 * np.sqrt(105), low=1.0)[0]
    balls = tuple(Ball((x, y), 1.0) for x, y in places.tolist())
    result = solve(Problem(Layer(1.0, poisson, 0.2), balls, Load("approach", (depth,) * 105)), 1e-3)
    assert [d for d, _ in asked] == [degree]
    assert (asked[0][1] < 2e-5) == sharper
    assert np.max(errors(result)) < 1e-3 * np.max(np.abs(forces(result)))


@pytest.mark.parametrize("base", [None, Elastic(1000.0, 0.3)], ids=["rigid", "elastic"])
def test_a_thin_layer_takes_no_higher_degree_than_its_error_asks_for(monkeypatch, base):
    at_approach = thin(105, "approach", base)
    with monkeypatch.context() as patch:
        patch.setattr(pairs_and_mesh, "RULES", ())
        patch.setattr(sampled_solution, "DEGREES", (6,))
        sharp = solve(at_approach, 1e-5)
    at_force = replace(at_approach, load=Load("force", tuple(ball.normal_force for ball in sharp.balls)))
    for problem in (at_approach, at_force):  # the same state
        quick = solve(problem, 1e-3)
        assert quick.solved.unknowns == 15 * problem.size
        assert not quick.solved.notes
        difference = np.max(np.abs(forces(quick) - forces(sharp)), axis=1)
        assert np.all(difference <= errors(quick))
        assert np.max(difference) < 1e-3 * np.max(np.abs(forces(sharp)))


def test_sweeps_go_on_at_their_degree_until_the_pull_is_settled(monkeypatch):
    problem = thin(110)
    monkeypatch.setattr(sampled_solution, "SWEPT", 20.0)
    contacts = solve_contact(problem, 1e-3).contacts
    assert contacts.smooth.nodes[0].zone.degree == 4
    left = contacts.smooth.residual * np.max(felt(contacts))
    assert left <= 0.5e-3 * np.max(np.abs(contacts.mutual_force))


def test_few_nodes_in_a_contact_give_the_step_of_all_quadrature_points(monkeypatch):
    contacts = solve_contact(scene("force", "elastic base", 110), 1e-3).contacts
    zones = Nodes.joined(list(contacts.smooth.nodes)).zone
    zones.coefficients[0, 0] -= 0.1 * np.max(np.abs(zones.coefficients[0]))  # its edge passes between the nodes
    rule, targets = Rule.of(zones, contacts.kernel.thickness), []
    nodes, half_space = Nodes.of(zones, rule), Zone.half_space

    def noted(zones, xi, *rest):
        targets.append((len(zones), xi.shape[1]))
        return half_space(zones, xi, *rest)

    monkeypatch.setattr(Zone, "half_space", noted)
    profile = np.array([height(b)(x, y) for b, x, y in zip(contacts.problem.balls, nodes.x, nodes.y, strict=True)])
    given = nodes, np.zeros_like(nodes.x), profile, nodes.forces, np.ones(110, dtype=bool)
    all_points = OwnEquations(contacts.kernel, rule, 1e-9).step(*given)
    assert {points for _, points in targets} == {nodes.x.shape[1]}
    targets.clear()
    few = OwnEquations(contacts.kernel, rule, 1e-5).step(*given)
    assert sum(balls for balls, points in targets if points < nodes.x.shape[1] / 2) == 109
    assert sum(balls for balls, points in targets if points == nodes.x.shape[1]) == 1
    size = np.max(np.abs(zones.coefficients), axis=1)
    assert np.max(np.abs(few.changes - all_points.changes) / size[:, None]) < 5e-6
    assert few.approaches == pytest.approx(all_points.approaches, rel=1e-7)
    assert few.compliances == pytest.approx(all_points.compliances, rel=1e-6)


def test_direct_sums_serve_residuals_and_sample_alike(monkeypatch):
    made = []

    class Counted(DirectSums):
        def __init__(self, *given):
            made.append(1)
            super().__init__(*given)

    monkeypatch.setattr("linear_bem.smooth.contacts.DirectSums", Counted)
    monkeypatch.setattr("linear_bem.sampled_solution.DirectSums", Counted, raising=False)
    assert solve(scene("force", "half-space"), 1e-2).solved.unknowns == 15 * 105
    assert len(made) == 1
