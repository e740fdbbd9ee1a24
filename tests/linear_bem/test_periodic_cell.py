"""Contacts in a cell that repeats: fields, loads and errors, also against balls alone in the plane."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from linear_bem import (
    Ball,
    ContactSequence,
    Elastic,
    InvalidProblem,
    Layer,
    LayeredKernel,
    Load,
    Periodic,
    Problem,
    Punch,
    SurfaceResponse,
    UnsupportedProblem,
    energy_force,
    solve_contact,
    solve_point_load,
    solver,
    stress,
)
from linear_bem.layer.response import LayerResponse
from linear_bem.lifted_balls import nearest, smooth_state
from linear_bem.smooth import contacts
from linear_bem.smooth.displacement import AT_ONCE, LatticeRest
from linear_bem.smooth.initial_guess import first_guess

BASES = {"rigid base": None, "soft base": Elastic(5.0, 0.3), "stiff base": Elastic(1e9, 0.3)}
LAYER = Layer(1.0, 0.4, 1.5)
OEDOMETRIC = 1.5 * 1.4 * 0.2 / 0.6  # compression of the layer per mean pressure
PLACES = ((0.0, 0.0), (1.95, 0.3), (0.8, 1.9))
RADII = (1.0, 0.9, 0.7)
LENGTHS = (4.6, 4.4)
FORCES = (0.1, 0.08, 0.05)
ACCURACY = 1e-3


def cell(load, base="rigid base", lengths=LENGTHS):
    balls = tuple(Ball(place, radius) for place, radius in zip(PLACES, RADII, strict=True))
    return Problem(LAYER, balls, load, BASES[base], periodic=Periodic(lengths))


def lattice(columns, load, base, distance=2.4):
    places = [(distance * (k + 0.3), 0.0) for k in range(columns)]
    periodic = Periodic((columns * distance, distance))
    return Problem(LAYER, tuple(Ball(p, 1.0) for p in places), load, BASES[base], periodic=periodic)


def test_sweeps_of_a_high_degree_settle_as_precisely_as_asked():
    problem = cell(Load("approach", (0.3, 0.3, 0.25)), "stiff base")
    state = first_guess(problem, LayeredKernel.of(problem))
    for degree in (8, 10, 12):
        state = smooth_state(state, degree, 1e-9, 1e-9)
        assert state.smooth.residual < 1e-9


def numbers(solution):
    balls = solution.result().balls
    forces = np.array([b.tangential_force for b in balls])
    return forces, np.array([[b.approach, b.normal_force, b.contact_area, b.peak_pressure] for b in balls])


@pytest.fixture(scope="module")
def under_forces():
    return {base: solve_contact(cell(Load("force", FORCES), base), ACCURACY) for base in BASES}


@pytest.mark.parametrize("base", BASES)
def test_the_mean_displacement_is_that_of_the_mean_pressure(base, under_forces):
    count = 20
    x, y = np.meshgrid(*((np.arange(count) + 0.5) / count * length for length in LENGTHS))
    w = under_forces[base].displacement(x, y)
    mean = sum(FORCES) / np.prod(LENGTHS)
    # sums over cells of the size of a contact's radius leave 4e-3; without the wave k = 0 the mean would vanish
    assert float(np.mean(w)) == pytest.approx(OEDOMETRIC * mean, rel=6e-3)
    again = under_forces[base].displacement(x[3] + LENGTHS[0], y[3] - 2.0 * LENGTHS[1])
    np.testing.assert_allclose(again, w[3], atol=1e-6 * np.max(w))
    x, y = np.meshgrid(*((np.arange(200) + 0.5) / 200 * length for length in LENGTHS))
    assert float(np.mean(under_forces[base].pressure(x, y))) == pytest.approx(mean, rel=2e-3)


def test_on_a_response_over_a_base_that_yields_approaches_are_measured_from_the_surface(under_forces):
    response = LayerResponse(LAYER, BASES["soft base"])
    layer = SurfaceResponse(LAYER.young, LAYER.poisson, LAYER.thickness, response)
    found = solve_contact(replace(cell(Load("force", FORCES)), layer=layer), ACCURACY)
    compressed = OEDOMETRIC * sum(FORCES) / np.prod(LENGTHS)
    above = under_forces["soft base"].contacts.approaches - found.contacts.approaches
    assert above == pytest.approx(compressed * np.ones(3), rel=1e-5)


@pytest.mark.parametrize("substrate", [None, Elastic(5.0, 0.3)])
def test_the_displacement_far_from_all_balls_is_that_of_the_nearest_images(substrate):
    # the cell is wide against the range of the near part: the image across the edge acts there
    lengths, place = np.array((10.0, 8.0)), np.array((3.0, 1.0))
    problem = Problem(
        replace(LAYER, thickness=0.5), (Ball(tuple(place), 1.0),), Load("approach", (0.05,)), substrate,
        periodic=Periodic(tuple(lengths)),
    )  # fmt: skip
    solution = solve_contact(problem, ACCURACY)
    away = np.array([(-0.3, 0.0), (-0.9, -0.4), (-1.6, 0.7), (0.0, -0.8), (-4.0, -3.0)])
    here, mirrored = (solution.displacement(*(place + sign * away).T) for sign in (1.0, -1.0))
    np.testing.assert_allclose(here, mirrored, atol=1e-6 * 0.05)
    # one point alone and all together sum over other images
    np.testing.assert_allclose(solution.displacement(*(place + away[1])), here[1], atol=1e-6 * 0.05)


def test_the_lattices_share_of_a_field_takes_memory_for_a_part_of_its_points(under_forces):
    contacts = under_forces["soft base"].contacts
    nodes = contacts.smooth.nodes
    rest = LatticeRest(contacts.kernel, nodes, 1e-4)
    assert rest.mesh is not None
    taken, values = [], []
    for count in (AT_ONCE, 4 * AT_ONCE):
        x = np.linspace(-1.0, 1.0, count)
        tracemalloc.start()
        values.append(rest.displacement(x, 0.0 * x, nodes)[[0, -1]])
        taken.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert taken[1] < 2.0 * taken[0]
    assert values[0] == pytest.approx(values[1], rel=1e-12)


def test_a_cell_is_the_middle_of_a_large_free_lattice():
    shifts = [(0, 0), *((m, n) for m in range(-2, 3) for n in range(-2, 3) if m or n)]
    balls = tuple(
        Ball((x + m * LENGTHS[0], y + n * LENGTHS[1]), radius)
        for m, n in shifts
        for (x, y), radius in zip(PLACES, RADII, strict=True)
    )
    thin = Layer(1.0, 0.4, 0.5)
    periodic = replace(cell(Load("force", FORCES)), layer=thin)
    free = Problem(thin, balls, Load("force", FORCES * len(shifts)))
    found = []
    for problem in (periodic, free):  # the same degree: only the images differ, which end at 16 thicknesses
        kernel = LayeredKernel.of(problem)
        contacts = smooth_state(first_guess(problem, kernel), 4, 1e-8)
        found.append((contacts.mutual_force[:3], contacts.approaches[:3], contacts.contact_areas[:3]))
    (force, *state), (wanted, *others) = found
    np.testing.assert_allclose(force, wanted, atol=1e-6 * np.max(np.abs(wanted)))
    np.testing.assert_allclose(state, others, rtol=1e-6)


@pytest.mark.parametrize("base", BASES)
def test_t_in_a_cell_adds_up_to_zero_by_both_formulas(base, under_forces):
    solution = under_forces[base]
    force, _ = numbers(solution)
    largest = float(np.max(np.abs(force)))
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * largest)
    np.testing.assert_allclose(solution.contacts.slope_force, force, atol=1e-3 * largest)
    # recomputed around every ball, by sums over images and a mesh that the solver does not use
    assert max(solution.contacts.certificate.values()) < 2e-4


def test_a_stiff_base_is_a_rigid_one(under_forces):
    stiff, rigid = (numbers(under_forces[base]) for base in ("stiff base", "rigid base"))
    np.testing.assert_allclose(stiff[0], rigid[0], atol=1e-6 * np.max(np.abs(rigid[0])))
    np.testing.assert_allclose(stiff[1], rigid[1], rtol=1e-6)


@pytest.mark.parametrize("kind", ["approach", "total_force"])
def test_every_load_gives_the_same_state(kind, under_forces):
    base = under_forces["soft base"]
    approaches, forces = numbers(base)[1][:, :2].T
    values = tuple(approaches) if kind == "approach" else (float(np.sum(forces)),)
    if kind == "total_force":
        held = solve_contact(cell(Load("approach", (approaches[0],) * 3), "soft base"), ACCURACY)
        values = (float(np.sum(numbers(held)[1][:, 1])),)
        base = held
    again = solve_contact(cell(Load(kind, values), "soft base"), ACCURACY)
    largest = np.max(np.abs(numbers(base)[0]))
    np.testing.assert_allclose(numbers(again)[0], numbers(base)[0], atol=2e-5 * largest)
    np.testing.assert_allclose(numbers(again)[1], numbers(base)[1], rtol=2e-5)


@pytest.mark.parametrize("base", ["rigid base", "soft base"])
def test_a_lattice_has_no_t_and_two_cells_are_one(base):
    one, two = (solve_contact(lattice(n, Load("approach", (0.06,) * n), base), ACCURACY) for n in (1, 2))
    (force, state), (forces, states) = numbers(one), numbers(two)
    np.testing.assert_allclose(np.concatenate([force, forces]), 0.0, atol=1e-8 * state[0, 1])
    np.testing.assert_allclose(states, np.tile(state, (2, 1)), rtol=1e-6)
    assert not one.notes


def test_a_contact_too_wide_for_a_cell_is_named():
    problem = replace(cell(Load("approach", (0.1, 0.1, 0.1))), layer=replace(LAYER, thickness=0.15))
    with pytest.raises(UnsupportedProblem, match=r"radius up to 2.\d layer thicknesses, possible up to 1.5.*less deep"):
        solve_contact(problem, ACCURACY)


def test_an_unloaded_ball_rests_on_the_surface_of_the_cell():
    solution = solve_contact(cell(Load("force", (0.1, 0.08, 0.0)), "soft base"), ACCURACY)
    resting = solution.result().balls[2]
    below = solution.displacement(np.array([PLACES[2][0]]), np.array([PLACES[2][1]]))
    assert resting.normal_force == 0.0
    assert resting.approach == pytest.approx(float(below[0]), rel=0.05)  # it leans on the slope, not on the axis


def test_the_force_by_energy_is_that_of_the_formulas_for_balls_given_by_images():
    problem = cell(Load("approach", (0.1, 0.08, 0.05)), "soft base")
    first, second, third = problem.balls
    far = replace(second, position=(second.position[0] + 90 * LENGTHS[0], second.position[1]))
    solution = solve_contact(replace(problem, balls=(first, far, third)), 1e-6)
    force = numbers(solution)[0]
    assert energy_force(solution, 1) == pytest.approx(tuple(force[1]), abs=1e-4 * float(np.max(np.abs(force))))


def test_the_error_of_t_holds_for_what_the_sums_over_images_leave_out():
    """T changed by up to 3 times its stated error between the accuracies, as the sums became more precise."""
    places, radii = ((0.0, 0.0), (1.329, 0.107), (2.093, -0.638)), (0.585, 0.745, 0.32)
    balls = tuple(Ball(place, radius, "paraboloid") for place, radius in zip(places, radii, strict=True))
    load, base = Load("approach", (6.433e-3,) * 3), Elastic(0.0563, 0.0329)
    scene = Problem(Layer(1.0, 0.5, 0.08413), balls, load, base, periodic=Periodic((3.67589121, 3.30707716)))
    found, exact = solve_contact(scene, 1e-4), solve_contact(scene, 1e-6)
    off = np.max(np.abs(found.contacts.mutual_force - exact.contacts.mutual_force), axis=1)
    assert np.all(off <= found.tangential_force_error)


def test_balls_given_by_images_many_cells_away_have_the_same_state_and_errors():
    problem = lattice(12, Load("force", tuple(0.02 * (1.0 + 0.3 * np.sin(np.arange(12.0))))), "soft base")
    moves = {3: (30, -20), 7: (-1, 2)}
    away = {i: np.array(problem.periodic.lengths) * move for i, move in moves.items()}
    balls = list(problem.balls)
    for i, shift in away.items():
        balls[i] = replace(balls[i], position=tuple((balls[i].position + shift).tolist()))
    inside, outside = (
        solve_contact(case, ACCURACY, sample=4) for case in (problem, replace(problem, balls=tuple(balls)))
    )
    for one, other, given in zip(inside.result().balls, outside.result().balls, balls, strict=True):
        assert other.position == given.position
        assert other.tangential_force == pytest.approx(one.tangential_force, abs=1e-9 * 0.02)
        assert other.tangential_force_error == pytest.approx(one.tangential_force_error, rel=1e-3)
        assert [other.errors[name] for name in one.errors] == pytest.approx(list(one.errors.values()), rel=1e-3)
    for i in range(12):
        there, here = np.array(outside.outline(i)).T, np.array(inside.outline(i)).T
        assert there == pytest.approx(here + away.get(i, 0.0), abs=1e-6)
    peak = outside.pressure(*balls[3].position)
    assert peak == pytest.approx(inside.result().balls[3].peak_pressure, rel=1e-3)


@pytest.mark.parametrize(("length", "x"), [(2.6, 7.8), (1.2, -3.6), (1.3, 3.9)])
def test_a_ball_whole_cells_away_from_the_origin_is_at_the_origin(length, x):
    # in floating point these are not whole cells: L floor(x / L) exceeds x
    ball = Ball((x, 0.5 * length), 0.5)
    problem = Problem(LAYER, (ball,), Load("approach", (0.01,)), periodic=Periodic((length, length)))
    assert 0.0 <= problem.in_cell().positions[0, 0] < length


def test_the_sample_has_the_balls_that_nearly_meet_across_the_edge():
    # of twelve balls 1 and 2 are small and nearly meet, while 4 and 5 have the largest T, force and contact
    places = [(2.5 + 5.0 * i, 2.5 + 5.0 * j) for i in range(4) for j in range(3)]
    places[2], places[5] = (2.5, 8.52), (7.5, 11.0)
    radii, forces = np.ones(12), np.full(12, 0.02)
    radii[1:3], forces[1:3], forces[4:6] = 0.5, 0.01, 0.15
    samples = []
    for shift in (0.0, -8.0):
        balls = tuple(Ball((x, y + shift), r) for (x, y), r in zip(places, radii, strict=True))
        problem = Problem(LAYER, balls, Load("force", tuple(forces)), periodic=Periodic((20.0, 15.0)))
        samples.append(solve_contact(problem, ACCURACY, sample=4).contacts.sample)
    assert {1, 2} & set(samples[0])
    assert samples[0] == samples[1]


def test_many_balls_in_a_cell_are_known_by_a_sample(monkeypatch):
    # 3 x 3 x 3 = 27 balls count as many and are judged by a sample, the three of one cell by their neighbouring degrees
    for module in (solver, contacts):
        monkeypatch.setattr(module, "CHECKED", 20)
    many = [(x + m * LENGTHS[0], y + n * LENGTHS[1]) for m in range(3) for n in range(3) for x, y in PLACES]
    balls = tuple(Ball(p, r) for p, r in zip(many, RADII * 9, strict=True))
    problem = Problem(
        LAYER, balls, Load("force", FORCES * 9), BASES["soft base"],
        periodic=Periodic((3 * LENGTHS[0], 3 * LENGTHS[1])),
    )  # fmt: skip
    large = solve_contact(problem, ACCURACY)
    small = solve_contact(cell(Load("force", FORCES), "soft base"), 1e-5)
    assert len(large.accuracy["sample"]) < 27
    force = numbers(small)[0]
    largest = float(np.max(np.abs(force)))
    np.testing.assert_allclose(numbers(large)[0], np.tile(force, (9, 1)), atol=1e-3 * largest)
    # the stated error holds
    assert np.max(np.abs(numbers(large)[0] - np.tile(force, (9, 1)))) <= np.max(large.tangential_force_error)


@pytest.mark.parametrize(
    ("places", "lengths", "expected"),
    [
        (((0.0, 0.0),), (5.0, 3.0), [3.0]),
        (((0.0, 0.0), (4.0, 0.0)), (9.0, 2.5), [2.5, 2.5]),
        (((0.5, 0.0), (9.5, 20.0)), (10.0, 10.0), [1.0, 1.0]),
    ],
    ids=["own image", "own image before the next ball", "image of the next ball"],
)
def test_the_next_axis_may_be_that_of_an_image(places, lengths, expected):
    balls = tuple(Ball(place, 1.0, asperity=True) for place in places)
    problem = Problem(LAYER, balls, Load("force", (0.01,) * len(balls)), periodic=Periodic(lengths))
    assert nearest(problem) == pytest.approx(expected)
    assert nearest(replace(problem, periodic=None, balls=balls[:1], load=Load("force", (0.01,)))) == [np.inf]


def test_what_has_no_cell_refuses_it(under_forces):
    problem = cell(Load("force", FORCES))
    with pytest.raises(UnsupportedProblem, match="point_load: the effect periodic is not part"):
        solve_point_load(problem)
    with pytest.raises(UnsupportedProblem, match="not in a cell that repeats"):
        stress(under_forces["rigid base"], 0.0, 0.0, 0.5)
    flat = replace(problem, balls=(Ball((0.0, 0.0), shape=Punch(1.0, 0.1)),), load=Load("force", (0.01,)))
    with pytest.raises(UnsupportedProblem, match="periodic: the contacts did not converge as smooth pressures"):
        solve_contact(flat)
    sequence = ContactSequence().solve(problem)
    force, _ = numbers(under_forces["rigid base"])
    np.testing.assert_allclose(sequence.tangential_force, force, atol=1e-2 * np.max(np.abs(force)))


@pytest.mark.parametrize(
    ("places", "lengths", "says"),
    [
        (((0.0, 0.0),), (1.9, 5.0), r"periodic\.lengths\[0\]: ball 0 overlaps its own image: they need at least 2 m"),
        (
            ((0.0, 0.0), (4.0, 0.0)),
            (5.0, 5.0),
            "overlap by 1 m across the cell's edge: their axes are 1 m apart",
        ),
        (((0.0, 0.0),), (0.0, 5.0), "must be two lengths greater than 0"),
        (((0.0, 0.0),), (np.inf, 5.0), "must be two lengths greater than 0 and finite, got inf m and 5 m$"),
        (((0.0, 0.0),), (), r"must be two lengths in metres, along x and y, such as .*, got \(\)$"),
        (((0.0, 0.0),), (True, True), r"must be two lengths in metres, .*, got \(True, True\)$"),
        (((0.0, 0.0),), (5.0, 5.0, 5.0), r"must be two lengths in metres, .*, got \(5.0, 5.0, 5.0\)$"),
    ],
)
def test_faults_of_a_cell_are_named(places, lengths, says):
    balls = tuple(Ball(p, 1.0) for p in places)
    with pytest.raises(InvalidProblem, match=says):
        Problem(LAYER, balls, Load("force", (0.01,) * len(balls)), periodic=Periodic(lengths))
