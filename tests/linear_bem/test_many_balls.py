from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import linear_bem.smooth.initial_guess
import linear_bem.smooth.many_balls
import linear_bem.solver
from linear_bem import Ball, Elastic, Layer, LayeredKernel, Load, Problem, solve, solve_contact
from linear_bem.lifted_balls import smooth_state
from linear_bem.smooth.contacts import EVALUATED
from linear_bem.smooth.displacement import DirectSums, zone_displacement
from linear_bem.smooth.initial_guess import first_guess, solve_smooth
from linear_bem.smooth.newton import Nodes
from tests.linear_bem.conftest import PAPER_LOAD
from tests.linear_bem.sampled_scenes import forces, scene


def loads(result):
    return np.array([b.normal_force for b in result.balls])


def block(load, thickness=1.16, count=3):
    xy = [(2.0 * i, 2.0 * j) for i in range(count) for j in range(count)]
    return Problem(Layer(1.0, 0.48, thickness), tuple(Ball(p, 1.0, "paraboloid") for p in xy), load, Elastic(1e3, 0.3))


def test_sweeps_converge_where_the_dent_of_a_soft_base_is_common_to_all_balls():
    # a force that misses its aim moves all others by far more than its own ball
    places, radii = ((1.4, 7.0), (3.1, 4.9), (0.5, 1.4), (1.2, 3.6), (2.7, 0.3)), (1.0, 0.8, 0.6, 0.9, 0.5)
    balls = tuple(Ball(place, radius) for place, radius in zip(places, radii, strict=True))
    problem = Problem(Layer(1.0, 0.0, 0.74), balls, Load("approach", (0.0028,) * 5), Elastic(1.4e-6, 0.0))
    start = first_guess(problem, LayeredKernel.of(problem))
    lines = []
    smooth_state(start, 4, 1e-6, report=lines.append)
    assert sum("change" in line for line in lines) <= 6


def test_sweeps_on_a_soft_base_have_the_matrices_of_the_present_frames():
    # with matrices of earlier frames, the first end in a cycle, and the second lose a contact
    balls = tuple(Ball((2.02 * i, 2.02 * j), 1.0) for i in range(3) for j in range(2))
    few = Problem(Layer(1.0, 0.45, 1.16), balls, Load("total_force", (0.6,)), Elastic(0.02, 0.3))
    lines = []
    smooth_state(first_guess(few, LayeredKernel.of(few)), 2, 1e-6, report=lines.append)
    assert sum("change" in line for line in lines) <= 16
    random = np.random.default_rng(5)
    places = 2.6 * np.argwhere(np.ones((7, 7))) + random.uniform(-0.3, 0.3, (49, 2))
    balls = tuple(Ball(tuple(xy), r) for xy, r in zip(places, random.uniform(0.8, 1.0, 49), strict=True))
    many = Problem(Layer(1.0, 0.45, 1.16), balls, Load("total_force", (0.98,)), Elastic(0.005, 0.3))
    state = first_guess(many, LayeredKernel.of(many))
    for degree, precision, sweeps in ((2, 0.03, 11), (4, 7e-5, 8)):
        lines.clear()
        state = smooth_state(state, degree, precision, report=lines.append)
        assert sum("change" in line for line in lines) <= sweeps


def test_light_contacts_on_the_slopes_of_a_deep_dent_are_found_in_few_sweeps():
    # from contacts at the axes, steps must be short: 15 sweeps; with 300 balls they diverged, and a grid was too large
    random = np.random.default_rng(5)
    places = 2.9 * np.argwhere(np.ones((12, 12))) + random.uniform(-0.4, 0.4, (144, 2))
    balls = tuple(Ball(tuple(xy), r) for xy, r in zip(places, random.uniform(0.8, 1.0, 144), strict=True))
    problem = Problem(Layer(1.0, 0.45, 1.16), balls, Load("total_force", (1.44,)), Elastic(0.002, 0.3))
    lines = []
    solve_smooth(first_guess(problem, LayeredKernel.of(problem)), 2, 0.03, None, lines.append)
    assert sum("change" in line for line in lines) <= 10


def test_the_best_sweep_is_returned_where_the_last_is_not(monkeypatch):
    changes = []

    def rises(history):
        changes[:] = history
        return len(history) > 1 and history[-1] > 1.2 * history[-2]

    monkeypatch.setattr(linear_bem.smooth.many_balls, "stalled", rises)
    problem = block(Load("approach", (0.0125,) * 9))
    state = smooth_state(first_guess(problem, LayeredKernel.of(problem)), 4, 1e-20)
    assert state.smooth.residual == min(changes) < changes[-1]


def test_sweeps_converge_under_bodies_that_a_low_degree_hardly_fits():
    def rounded(x, y):
        return 0.5 * (np.sqrt(x**2 + y**2 + 0.5625) - 0.75)

    balls = tuple(Ball((6.0 * k, 0.0), 1.5, rounded) for k in range(5))
    problem = Problem(Layer(2.0, 0.45, 4.0), balls, Load("approach", (0.5,) * 5))
    state = first_guess(problem, LayeredKernel.of(problem))
    for degree, most in ((2, 8), (4, 12)):
        lines = []
        state = smooth_state(state, degree, 1e-8, report=lines.append)
        assert state.smooth.residual < 1e-8
        assert sum("change" in line for line in lines) <= most


@pytest.mark.parametrize(
    "load",
    [Load("total_force", (9 * PAPER_LOAD,)), Load("force", (PAPER_LOAD,) * 9), Load("approach", (0.0125,) * 9)],
    ids=lambda load: load.kind,
)
def test_sweeps_meet_the_dense_newton_system(load, monkeypatch):
    problem = block(load)
    swept = solve(problem, 1e-5)
    for module in (linear_bem.smooth.initial_guess, linear_bem.solver):
        monkeypatch.setattr(module, "DENSE", 9)
    dense = solve(problem, 1e-5)
    assert swept.solved.iterations != 0
    assert forces(swept) == pytest.approx(forces(dense), abs=1e-9 * np.max(np.abs(forces(dense))))
    assert loads(swept) == pytest.approx(loads(dense), rel=1e-9)


def test_nine_balls_under_a_common_approach_meet_a_sharper_solution():
    problem = block(Load("total_force", (9 * PAPER_LOAD,)))
    quick, sharp = solve(problem, 1e-3), solve(problem, 1e-6)
    assert loads(quick) == pytest.approx(loads(sharp), rel=1e-6)
    assert forces(quick) == pytest.approx(forces(sharp), abs=1e-6 * np.max(np.abs(forces(sharp))))
    approaches = [b.approach for b in quick.balls]
    assert np.ptp(approaches) == 0.0
    assert sum(loads(quick)) == pytest.approx(9 * PAPER_LOAD, rel=1e-12)


def test_in_plane_forces_of_all_balls_cancel():
    for thickness in (1.16, np.inf):
        t = forces(solve(block(Load("approach", (0.05,) * 9), thickness), 1e-3))
        assert np.max(np.abs(t.sum(axis=0))) < 1e-12 * np.max(np.abs(t))


def test_a_dense_random_heap_has_equal_forces_by_both_routes():
    rng = np.random.default_rng(3)
    balls = []
    while len(balls) < 50:
        x, y, r = *rng.uniform(-8.0, 8.0, 2), rng.uniform(0.5, 1.0)
        if all(np.hypot(x - b.position[0], y - b.position[1]) >= 2 * np.sqrt(r * b.radius) for b in balls):
            balls.append(Ball((x, y), r, "paraboloid"))
    result = solve(Problem(Layer(1.0, 0.48, np.inf), tuple(balls), Load("approach", (0.1,) * 50)), 1e-3)
    t = forces(result)
    slope = np.array([b.tangential_force_routes["slope"] for b in result.balls])
    assert np.max(np.abs(t - slope)) < 1e-3 * np.max(np.abs(t))
    assert not result.solved.notes
    assert max(result.solved.certificate.values()) < 1e-3


def test_the_certificate_detects_a_wrong_pressure_under_any_ball():
    contacts = solve_contact(block(Load("force", (PAPER_LOAD,) * 25), count=5), 1e-2).contacts
    assert max(contacts.certificate.values()) < 1e-4
    for k in range(0, 25, 6):
        nodes = list(contacts.smooth.nodes)
        zone = replace(nodes[k].zone, coefficients=1.01 * nodes[k].zone.coefficients)
        nodes[k] = replace(nodes[k], zone=zone, pressure=np.sqrt(1.01) * nodes[k].pressure)
        wrong = replace(contacts, smooth=replace(contacts.smooth, nodes=Nodes.joined(nodes)))
        # half a per cent of the ball's own displacement exceeds the tolerance of an accepted solution
        assert wrong.certificate["gap_in_contact"] > 1e-3
    deeper = replace(contacts, approaches=1.1 * contacts.approaches).certificate
    assert min(deeper[name] for name in ("penetration_outside", "complementarity")) > 1e-2


def test_the_displacement_around_many_balls_has_the_stated_accuracy():
    contacts = solve_contact(block(Load("approach", (0.3,) * 9)), 1e-2).contacts
    nodes = contacts.smooth.nodes
    x = [n.zone.centre[0] + 2.0 * (n.zone.outline(7)[0] - n.zone.centre[0]) for n in nodes]
    y = [n.zone.centre[1] + 2.0 * (n.zone.outline(7)[1] - n.zone.centre[1]) for n in nodes]
    direct = DirectSums(contacts.kernel, nodes, EVALUATED)
    for k in (0, 4):
        one_by_one = sum(zone_displacement(contacts.kernel, n, x[k], y[k]) for n in nodes)
        assert direct.displacement(k, x[k], y[k]) == pytest.approx(one_by_one, rel=EVALUATED)


@pytest.fixture(scope="module")
def uneven():
    """Three unequal balls on a layer, without symmetry."""
    balls = (Ball((-1.1, 0.3), 1.0, "paraboloid"), Ball((1.2, 0.0), 0.7, "sphere"), Ball((0.2, 1.9), 0.9, "paraboloid"))
    return Problem(Layer(1.0, 0.45, 0.9), balls, Load("force", (5e-3, 2e-3, 8e-3)), Elastic(20.0, 0.2))


def test_turning_and_mirroring_a_scene_turns_and_mirrors_the_answer(uneven):
    reference = forces(solve(uneven, 1e-6))
    for angle, flip in ((0.7, 1.0), (2.1, -1.0)):
        c, s = np.cos(angle), np.sin(angle)
        q = np.array([[c, -s], [s, c]]) @ np.diag([1.0, flip])
        balls = tuple(Ball(tuple(q @ b.position), b.radius, b.shape) for b in uneven.balls)
        t = forces(solve(Problem(uneven.layer, balls, uneven.load, uneven.substrate), 1e-6))
        assert t == pytest.approx(reference @ q.T, abs=1e-8 * np.max(np.abs(reference)))


def test_scaling_moduli_and_lengths_scales_the_answer_to_roundoff(uneven):
    base = solve(uneven)
    stiff, large = 7.3e5, 3.1e-3
    layer = Layer(stiff, 0.45, 0.9 * large)
    balls = tuple(Ball((b.position[0] * large, b.position[1] * large), b.radius * large, b.shape) for b in uneven.balls)
    load = Load("force", tuple(q * stiff * large**2 for q in uneven.load.values))
    scaled = solve(Problem(layer, balls, load, Elastic(20.0 * stiff, 0.2)))
    size = stiff * large**2
    assert forces(scaled) / size == pytest.approx(forces(base), abs=1e-11 * np.max(np.abs(forces(base))))
    for a, b in zip(scaled.balls, base.balls, strict=True):
        assert a.approach / large == pytest.approx(b.approach, rel=1e-12)
        assert a.peak_pressure / stiff == pytest.approx(b.peak_pressure, rel=1e-11)
        assert a.contact_area / large**2 == pytest.approx(b.contact_area, rel=1e-11)


def test_a_ball_above_the_surface_that_a_neighbour_lowers_carries_no_load():
    balls = (
        Ball((-1.0, 0.0), 1.0, "paraboloid"),
        Ball((1.0, 0.0), 1.0, "paraboloid"),
        Ball((9.0, 0.0), 1.0, "paraboloid"),
    )
    problem = Problem(Layer(1.0, 0.48, np.inf), balls, Load("approach", (0.1, 1e-3, 0.05)))
    pressed, lifted, far = solve(problem).balls
    assert lifted.normal_force == 0.0
    assert lifted.tangential_force == (0.0, 0.0)
    assert lifted.contact_area == 0.0
    assert pressed.normal_force > far.normal_force > 0.0


def test_an_unloaded_ball_rests_on_the_deformed_surface():
    balls = (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid"))
    problem = Problem(Layer(1.0, 0.48, np.inf), balls, Load("force", (1e-3, 0.0)))
    pressed, resting = solve(problem).balls
    assert resting.normal_force == 0.0
    # the half-space's displacement at distance 2, with a small correction for the inclined surface
    assert resting.approach == pytest.approx((1 - 0.48**2) / np.pi * 1e-3 / 2.0, rel=1e-3)
    assert pressed.normal_force == pytest.approx(1e-3, rel=1e-12)


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
