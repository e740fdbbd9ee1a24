"""Many unlike balls: sums over near pairs and a mesh, and the accuracy that a sample of balls shows.

The small scenes here take every path of large ones: more than a hundred contacts are judged by a sample, and the mesh
is used from a few hundred.
"""

import importlib
import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse.linalg
from scipy.spatial import cKDTree

import linear_bem.memory
import linear_bem.touching
from linear_bem import (
    Ball,
    Elastic,
    Ellipsoid,
    InvalidProblem,
    Layer,
    LayeredKernel,
    Load,
    Problem,
    report,
    sampled_solution,
    solve,
    solve_contact,
)
from linear_bem.error_estimate import felt
from linear_bem.errors import NotConverged, TooLarge
from linear_bem.far_field import coupled_system, pairs_and_mesh
from linear_bem.far_field.coupled_system import solve_coupled
from linear_bem.far_field.pairs_and_mesh import FarField, PointInfluence
from linear_bem.lifted_balls import smooth_state
from linear_bem.profiles import height
from linear_bem.smooth import exact_sample
from linear_bem.smooth.displacement import DirectSums
from linear_bem.smooth.exact_sample import sample_error
from linear_bem.smooth.newton import NodeStack, Rule, solve_zones
from linear_bem.smooth.own_equations import OwnEquations
from linear_bem.smooth.tangential_forces import SUMMED, half_space_pulls, layer_pulls
from linear_bem.smooth.zone_stack import ZoneStack
from tests.linear_bem.random_balls import direct

BASES = {"half-space": (np.inf, None), "rigid base": (6.0, None), "elastic base": (2.0, Elastic(10.0, 0.3))}


def scattered(count, side, seed=1, low=0.6, high=1.0):
    """Centres and radii of balls that do not overlap, at random."""
    rng = np.random.default_rng(seed)
    centres, radii = np.empty((0, 2)), np.sort(rng.uniform(low, high, count))[::-1]
    for k in range(count):
        while True:
            place = rng.uniform(0.0, side, 2)
            if np.all(np.hypot(*(centres - place).T) >= 1.001 * (radii[:k] + radii[k])):
                break
        centres = np.vstack([centres, place])
    return centres, radii


def scene(load, base="rigid base", count=105, seed=1):
    centres, radii = scattered(count, 2.4 * np.sqrt(count), seed)
    balls = tuple(
        Ball((x, y), r, ("sphere", "paraboloid")[k % 2]) if k % 15 else Ball((x, y), shape=Ellipsoid((r, 0.9 * r, r)))
        for k, ((x, y), r) in enumerate(zip(centres.tolist(), radii.tolist(), strict=True))
    )
    thickness, substrate = BASES[base]
    values = {"approach": (0.1,) * count, "total_force": (0.02 * count,)}
    values["force"] = tuple(np.linspace(0.01, 0.03, count).tolist())
    return Problem(Layer(1.0, 0.48, thickness), balls, Load(load, values[load]), substrate)


def forces(result):
    return np.array([b.tangential_force for b in result.balls])


def errors(result):
    return np.array([b.tangential_force_error for b in result.balls])


@pytest.mark.parametrize("base", BASES)
def test_near_pairs_and_mesh_add_up_to_the_kernel(base):
    thickness, substrate = BASES[base]
    kernel = LayeredKernel(Layer(1.0, 0.48, thickness), substrate)
    rng = np.random.default_rng(2)
    points, loads = rng.uniform(0.0, 100.0, (2500, 2)), rng.uniform(0.5, 1.0, 2500)
    for precision, error in ((1e-5, 3e-6), (1e-7, 3e-7)):
        field = FarField.of(kernel, points, np.array(0.0), precision)
        assert (field.mesh is not None) == (len(field.first) < 2500 * 2499 // 2) or base == "rigid base"
        chosen = np.arange(0, 2500, 50)
        r = np.hypot(*(points[chosen, None] - points).transpose(2, 0, 1))
        r[np.arange(len(chosen)), chosen] = np.inf
        direct = kernel.scaled(r) @ loads
        found = PointInfluence(field, points) @ loads
        # the unit is the displacement of one load at one spacing of the mesh
        spacing = field.mesh.meshes[0].spacing[0] if field.mesh is not None else 1.0
        assert np.max(np.abs(found[chosen] - direct)) * spacing < 5.0 * error


def test_the_coupled_system_is_solved_with_the_mesh_as_without():
    rng = np.random.default_rng(4)
    points = rng.uniform(0.0, 80.0, (1500, 2))
    kernel = LayeredKernel(Layer(1.0, 0.48, np.inf))
    field = FarField.of(kernel, points, np.array(0.0), 1e-7)
    assert field.mesh is not None
    compliance, right = rng.uniform(5.0, 9.0, 1500), rng.uniform(0.5, 1.0, 1500)
    free = rng.uniform(size=1500) < 0.8
    influence = PointInfluence(field, points)
    loads = solve_coupled(influence, compliance, right, free)
    assert np.all(loads[~free] == 0.0)
    residual = compliance * loads + influence @ loads - right
    assert np.max(np.abs(residual[free])) < 1e-8


def test_conjugate_gradients_run_under_every_scipy(monkeypatch):
    def newer(a, b, x0=None, *, rtol=1e-5, atol=0.0, maxiter=None, M=None, callback=None):
        asked.append(rtol)
        return b, 0

    asked = []
    with monkeypatch.context() as patched:
        patched.setattr(scipy.sparse.linalg, "cg", newer)
        module = importlib.reload(coupled_system)
        points = np.stack([np.arange(700.0), np.zeros(700)], axis=1)
        influence = PointInfluence(
            FarField.of(LayeredKernel(Layer(1.0, 0.3, np.inf)), points, np.array(0.0), 1e-5), points
        )
        module.solve_coupled(influence, np.ones(700), np.ones(700), np.ones(700, dtype=bool))
    importlib.reload(coupled_system)
    assert asked == [coupled_system.RESIDUAL]


def test_the_scale_of_the_forces_is_within_five_per_cent_of_the_whole_sum():
    rng = np.random.default_rng(5)
    points, loads = rng.uniform(0.0, 90.0, (SUMMED + 500, 2)), rng.uniform(0.5, 1.0, SUMMED + 500)
    kernel = LayeredKernel(Layer(1.0, 0.48, np.inf))
    r = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
    np.fill_diagonal(r, np.inf)
    whole = loads * (kernel.singular / (r + 1.0) ** 2 @ loads)
    assert half_space_pulls(kernel, points, loads, softest=1.0) == pytest.approx(whole, rel=0.05)


@pytest.mark.parametrize(
    ("load", "base"), [("approach", "half-space"), ("force", "rigid base"), ("total_force", "elastic base")]
)
def test_a_sampled_solution_meets_a_sharper_one_within_its_stated_error(load, base):
    problem = scene(load, base)
    quick, sharp = solve(problem, 1e-3), solve(problem, 1e-4)
    assert quick.solved.accuracy["reached"] <= 1e-3
    assert 16 < len(quick.solved.accuracy["sample"]) < problem.size
    difference = np.max(np.abs(forces(quick) - forces(sharp)), axis=1)
    assert np.all(difference <= errors(quick) + errors(sharp))
    largest = np.max(np.abs(forces(sharp)))
    assert np.max(difference) < 1e-3 * largest
    assert np.max(np.abs(forces(quick).sum(axis=0))) < 1e-3 * largest
    assert [b.normal_force for b in quick.balls] == pytest.approx([b.normal_force for b in sharp.balls], rel=1e-4)
    for name in ("normal_force", "approach"):
        for here, there in zip(quick.balls, sharp.balls, strict=True):
            known = here.errors[name] + there.errors[name] + 1e-9 * abs(getattr(there, name))
            assert abs(getattr(here, name) - getattr(there, name)) <= known
    if load == "total_force":
        assert sum(b.normal_force for b in quick.balls) == pytest.approx(problem.load.values[0], rel=1e-8)


@pytest.fixture(scope="module")
def meshed():
    """Enough balls of revolution for the mesh."""
    problem = scene("approach", "half-space", 240)
    balls = tuple(b if isinstance(b.shape, str) else Ball(b.position, b.radius) for b in problem.balls)
    problem = replace(problem, balls=balls)
    solution = solve_contact(problem, 1e-3)
    assert FarField.of(solution.contacts.kernel, problem.positions, np.array(0.6), 1e-5).mesh is not None
    return problem, solution


@pytest.mark.slow
def test_three_hundred_random_balls_agree_with_the_sum_over_all_pairs():
    # other loads, more balls: `python -m tests.linear_bem.random_balls direct 1000 force rigid`
    found = direct(300, "total_force", "elastic")
    assert found["over the bar"] <= 1.0
    assert found["T"] < 1e-4
    assert found["Q"] < 1e-5


def test_direct_sums_over_all_others_give_the_same_forces_on_every_ball(meshed):
    _, solution = meshed
    contacts = solution.contacts
    direct = DirectSums(contacts.kernel, contacts.smooth.nodes, 1e-7)
    found = np.array([direct.force(k, n) for k, n in enumerate(contacts.smooth.nodes)])
    difference = np.max(np.abs(found - contacts.mutual_force), axis=1)
    assert np.all(difference <= solution.tangential_force_error)
    # the mesh: 1e-6 Q^2 / H^2 per pair, and pairs to 1e-5 of their displacement
    assert np.max(difference) < 3e-5 * np.max(np.abs(contacts.mutual_force))


def test_in_plane_forces_cancel_with_the_mesh_too(meshed):
    force = meshed[1].contacts.mutual_force
    assert np.max(np.abs(force.sum(axis=0))) < 1e-12 * np.max(np.abs(force))


def test_shifting_and_turning_many_balls_changes_nothing_beyond_the_stated_error(meshed):
    problem, solution = meshed
    here = solution.result()
    c, s = np.cos(0.7), np.sin(0.7)
    q = np.array([[c, -s], [s, c]])
    moved = tuple(replace(b, position=tuple(q @ b.position + (13.0, -7.0))) for b in problem.balls)
    there = solve(replace(problem, balls=moved), 1e-3)
    difference = np.max(np.abs(forces(here) @ q.T - forces(there)), axis=1)
    assert np.all(difference <= errors(here) + errors(there))


def test_forces_and_approaches_of_two_loads_are_reciprocal():
    problem = scene("approach", "elastic base")
    apart, neighbours = cKDTree(problem.positions).query(problem.positions, 2)
    a, b = neighbours[np.argmin(apart[:, 1])]
    loads = []
    for pressed in ((), (a,), (b,)):
        values = [0.1 + 1e-3 * (k in pressed) for k in range(problem.size)]
        loads.append(np.array([b.normal_force for b in solve(problem.with_load("approach", values), 1e-3).balls]))
    none, first, second = loads
    # Betti: dQ_b/dD_a = dQ_a/dD_b; a step of 1 % of D, and forces to 3e-5 of the largest
    assert (first - none)[b] == pytest.approx((second - none)[a], rel=0.05)
    assert abs((first - none)[b]) > 2e-4 * np.max(none)


def test_balls_that_the_others_lift_off_carry_nothing_and_do_not_touch():
    problem = scene("approach", "half-space", 180)
    rng = np.random.default_rng(6)
    problem = problem.with_load("approach", rng.uniform(-0.005, 0.15, problem.size).tolist())
    solution = solve_contact(problem, 1e-3)
    lifted = np.flatnonzero(solution.contacts.normal_forces == 0.0)
    assert len(solution.contacts.touching) > 100
    assert lifted.size > 10
    for i in lifted:
        x, y = (np.array([c]) for c in problem.balls[i].position)
        assert solution.displacement(x, y)[0] > problem.load.values[i] - 1.1e-4 * 0.15


def test_a_sample_without_a_solution_leaves_the_error_unbounded_and_says_so(monkeypatch):
    def lost(contacts, report):
        sample = sample_error(contacts, report)
        return replace(sample, tangential_force=np.full(len(sample.places), np.inf))

    problem = scene("approach", "half-space", 110)
    lifted = problem.with_load("approach", (*[0.1] * 109, -0.1))
    monkeypatch.setattr(sampled_solution, "sample_error", lost)
    result = solve(lifted, 1e-2)
    assert result.solved.accuracy["reached"] == np.inf
    assert result.balls[0].tangential_force_error == np.inf
    assert result.balls[-1].tangential_force_error == 0.0
    assert "is estimated to inf" in result.solved.notes[0]


@pytest.mark.parametrize(("load", "adds"), [("approach", True), ("force", False)])
def test_what_a_ball_alone_is_off_in_force_is_part_of_the_error_of_its_pull(monkeypatch, load, adds):
    def off(contacts, report):
        sample = sample_error(contacts, report)
        return replace(sample, normal_force=sample.normal_force + 1e-6)

    problem = scene(load, "half-space")
    known = solve(problem, 1e-2)
    monkeypatch.setattr(sampled_solution, "sample_error", off)
    pull = [np.hypot(*b.tangential_force) / b.normal_force for b in known.balls]
    more = errors(solve(problem, 1e-2)) - errors(known)
    assert more == pytest.approx(sampled_solution.UNSAMPLED * 1e-6 * np.array(pull) * adds, rel=0.1, abs=1e-12)


def test_a_ball_far_from_all_others_has_its_pull_within_the_stated_error():
    problem = scene("approach", "half-space", 240)
    balls = tuple(b if isinstance(b.shape, str) else Ball(b.position, b.radius) for b in problem.balls)
    far = replace(balls[100], position=(3e7, -2e6))
    problem = replace(problem, balls=(*balls[:100], far, *balls[101:]))
    # a smaller force than the others', so that it is not part of the sample
    solution = solve_contact(problem.with_load("approach", [0.1] * 100 + [0.05] + [0.1] * 139), 1e-3)
    contacts = solution.contacts
    assert 100 not in contacts.sample
    assert FarField.of(contacts.kernel, contacts.problem.positions, np.full(240, 0.6), 1e-5).mesh is not None
    direct = DirectSums(contacts.kernel, contacts.smooth.nodes, 1e-9).force(100, contacts.smooth.nodes[100])
    assert np.max(np.abs(direct - contacts.mutual_force[100])) <= solution.tangential_force_error[100]


def test_pairs_are_sharper_at_the_second_degree(monkeypatch):
    asked = []

    def noted(problem, kernel, degree, start, precision, pairs, report):
        asked.append((degree, pairs))
        return smooth_state(problem, kernel, degree, start, precision, pairs, report)

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

    def noted(problem, kernel, degree, start, precision, pairs, report):
        asked.append((degree, pairs))
        return smooth_state(problem, kernel, degree, start, precision, pairs, report)

    monkeypatch.setattr(sampled_solution, "smooth_state", noted)
    places = scattered(105, 2.8 * np.sqrt(105), low=1.0)[0]
    balls = tuple(Ball((x, y), 1.0) for x, y in places.tolist())
    result = solve(Problem(Layer(1.0, poisson, 0.2), balls, Load("approach", (depth,) * 105)), 1e-3)
    assert [d for d, _ in asked] == [degree]
    assert (asked[0][1] < 2e-5) == sharper
    assert np.max(errors(result)) < 1e-3 * np.max(np.abs(forces(result)))


def test_the_sample_has_the_balls_that_are_deepest_for_their_size():
    places, radii = scattered(105, 20.0, low=0.1)
    balls = tuple(Ball((x, y), r) for (x, y), r in zip(places.tolist(), radii.tolist(), strict=True))
    contacts = solve_contact(Problem(Layer(1.0, 0.48, np.inf), balls, Load("total_force", (3.0,))), 1e-3).contacts
    steep = [n.zone.reach / radii[k] for k, n in zip(contacts.touching, contacts.smooth.nodes, strict=True)]
    assert set(np.argsort(steep)[-4:].tolist()) <= set(contacts.sample)


@pytest.mark.parametrize("load", ["approach", "force"])
def test_balls_of_the_sample_solved_together_are_those_solved_one_by_one(monkeypatch, load):
    def one_by_one(kernel, shapes, zones, approaches, groups, tolerance, *, apart):
        assert apart
        if len(zones) > 1:
            raise NotConverged("together")
        return solve_zones(kernel, shapes, zones, approaches, groups, 1e-8)

    contacts = solve_contact(scene(load, "elastic base", 110), 1e-3).contacts
    together = sample_error(contacts)
    monkeypatch.setattr(exact_sample, "sweep_zones", one_by_one)
    alone = sample_error(contacts)
    largest = np.max(np.abs(contacts.mutual_force))
    assert together.tangential_force == pytest.approx(alone.tangential_force, abs=1e-7 * largest)
    assert together.normal_force == pytest.approx(alone.normal_force, abs=1e-9)
    assert together.settled == pytest.approx(alone.settled, abs=1e-7)


def test_few_nodes_in_a_contact_give_the_step_of_all_quadrature_points(monkeypatch):
    contacts = solve_contact(scene("force", "elastic base", 110), 1e-3).contacts
    zones = NodeStack.joined(contacts.smooth.nodes).zones
    zones.coefficients[0, 0] -= 0.1 * np.max(np.abs(zones.coefficients[0]))  # its edge passes between the nodes
    rule, targets = Rule.of(zones, contacts.kernel.thickness), []
    nodes, half_space = NodeStack.of(zones, rule), ZoneStack.half_space

    def noted(zones, xi, *rest):
        targets.append((len(zones), xi.shape[1]))
        return half_space(zones, xi, *rest)

    monkeypatch.setattr(ZoneStack, "half_space", noted)
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


def test_every_step_is_reported_and_a_report_may_end_the_solution():
    class Enough(Exception):
        pass

    lines = []

    def note(text):
        lines.append(text)
        if "sweep 2" in text:
            raise Enough

    with pytest.raises(Enough):
        solve(scene("force"), 1e-3, note)
    assert lines[0] == "105 ball(s): first guess"
    assert len(lines) == 3


def test_every_long_phase_reports_its_parts(monkeypatch):
    clock = itertools.count(0.0, 10.0)  # as on a very slow machine
    monkeypatch.setattr(report.time, "monotonic", lambda: next(clock))
    lines = []
    solve(scene("approach", "half-space", 110), 1e-2, lines.append)
    for phase in (
        "first guess: coupled point loads",
        "degree 4: 0 of ",
        "degree 4, sweep 1: 110 of 110 contacts alone",
        "T: 0 of ",
        "direct sums: equivalent loads",
        "residuals: 5 of ",
        "5 of ",
        "T: 60 of 110 slope integrals",
    ):
        assert any(line.startswith(phase) for line in lines), phase


def test_parts_are_reported_so_long_after_the_last_line_of_any_kind(monkeypatch):
    clock, lines = [0.0], []
    monkeypatch.setattr(report.time, "monotonic", lambda: clock[0])
    whole = report.Timed(lines.append)
    one, other = report.seldom(whole, "one: "), report.seldom(whole, "other: ")
    for passed, say, text in (
        (1.5, one, "dropped"),
        (1.5, other, "said"),
        (1.5, one, "dropped"),
        (0.1, whole, "step"),
        (1.5, one, "dropped"),
        (1.0, one, "said"),
    ):
        clock[0] += passed
        say(text)
    assert lines == ["other: said", "step", "one: said"]


def test_direct_sums_serve_residuals_and_sample_alike(monkeypatch):
    made = []

    class Counted(DirectSums):
        def __init__(self, *given):
            made.append(1)
            super().__init__(*given)

    monkeypatch.setattr("linear_bem.smooth.contacts.DirectSums", Counted)
    monkeypatch.setattr("linear_bem.smooth.exact_sample.DirectSums", Counted, raising=False)
    assert solve(scene("force", "half-space"), 1e-2).solved.unknowns == 15 * 105
    assert len(made) == 1


def thin(count, load="force", base=None, thickness=0.3, depth=0.03):
    """Balls on a layer so thin that T is a small part of what a half-space would transmit."""
    centres, radii = scattered(count, 2.4 * np.sqrt(count), 5)
    balls = tuple(Ball((x, y), r) for (x, y), r in zip(centres.tolist(), radii.tolist(), strict=True))
    depths = depth * radii
    weights = np.random.default_rng(2).uniform(0.5, 1.5, count)
    values = {"approach": depths, "force": np.sqrt(radii * depths**3) * weights}
    return Problem(Layer(1.0, 0.48, thickness), balls, Load(load, tuple(values[load].tolist())), base)


@pytest.mark.parametrize("load", ["force", "approach"])
@pytest.mark.parametrize("base", [None, Elastic(1000.0, 0.3)], ids=["rigid", "elastic"])
def test_a_thin_layer_takes_no_higher_degree_than_its_error_asks_for(monkeypatch, load, base):
    problem = thin(150, load, base)
    quick = solve(problem, 1e-3)
    assert quick.solved.unknowns == 15 * problem.size
    assert not quick.solved.notes
    monkeypatch.setattr(pairs_and_mesh, "RULES", ())
    monkeypatch.setattr(sampled_solution, "DEGREES", (8,))
    sharp = solve(problem, 1e-5)
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


@pytest.mark.parametrize("base", [*BASES, "soft base"])
def test_pulls_without_cancellation_bound_those_of_point_loads(base):
    thickness, substrate = {**BASES, "soft base": (0.5, Elastic(0.05, 0.3))}[base]
    kernel = LayeredKernel(Layer(1.0, 0.48, thickness), substrate)
    rng = np.random.default_rng(2)
    for count in (300, SUMMED + 100):
        points, loads = 2.0 * rng.uniform(0.0, np.sqrt(count), (count, 2)), rng.uniform(0.5, 1.0, count)
        r = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
        np.fill_diagonal(r, np.inf)
        with np.errstate(invalid="ignore"):
            slope = np.where(np.isfinite(r), np.abs(kernel.scaled_slope(np.minimum(r, 1e9))), 0.0)
        sums = kernel.singular * loads * (slope @ loads)
        found = layer_pulls(kernel, points, loads, 1e-6)
        assert np.all(found >= 0.95 * sums)
        # where |dK/dr| r^2 falls throughout, the sum is exact
        assert base in ("rigid base", "elastic base") or found == pytest.approx(sums, rel=0.15)
        assert np.all(layer_pulls(kernel, points, loads, 0.2) >= 0.95 * found)


def test_a_problem_that_does_not_fit_the_memory_is_refused_with_its_size(monkeypatch):
    monkeypatch.setattr(linear_bem.memory, "free_memory", lambda: 1e7)
    with pytest.raises(TooLarge, match=r"105 balls needs about 0.0137 GB of memory, and 0.01 GB are free"):
        solve(scene("force"), 1e-3)


def test_pairs_of_asperities_are_not_searched_for_overlaps(monkeypatch):
    monkeypatch.setattr(linear_bem.touching, "touching_distance", lambda a, b: pytest.fail("a pair was compared"))
    caps = tuple(Ball((x, y), 5.0, asperity=True) for x, y in np.random.default_rng(7).uniform(0.0, 1.0, (50, 2)))
    assert Problem(Layer(1.0, 0.3, 5.0), caps, Load("total_force", (1e-3,))).size == 50


def test_the_pressure_of_many_contacts_is_the_sum_over_all(meshed):
    _, solution = meshed
    x, y = np.meshgrid(np.linspace(0.0, 8.0, 30), np.linspace(0.0, 8.0, 30))
    every = sum(n.zone.pressure(x, y) for n in solution.contacts.smooth.nodes) / solution.contacts.kernel.singular
    assert np.max(every) > 0.0
    assert solution.pressure(x, y) == pytest.approx(every, rel=1e-12)


def test_overlaps_among_many_balls_are_found():
    balls = [Ball((2.0 * i, 2.0 * j), 1.0) for i in range(40) for j in range(40)]
    balls[1234] = Ball((balls[1233].position[0], balls[1233].position[1] + 1.5), 1.0)
    balls.append(Ball((-30.0, 0.0), 20.0, "paraboloid"))
    with pytest.raises(InvalidProblem) as fault:
        Problem(Layer(1.0, 0.3, 1.0), tuple(balls), Load("total_force", (1.0,)))
    assert [line.split(" overlap")[0] for line in fault.value.faults] == [
        "balls.positions: balls 1233 and 1234",
    ]


def test_a_sample_of_given_size_judges_fewer_balls():
    problem = scene("approach", count=25)
    found = solve_contact(problem, 1e-3, sample=4).result()
    assert 4 <= len(found.solved.accuracy["sample"]) <= 4 + 5  # at equal steps, and one by each measure
    exact = forces(solve(problem, 1e-5))
    assert np.max(np.abs(forces(found) - exact)) < 1e-3 * np.max(np.hypot(*exact.T))
