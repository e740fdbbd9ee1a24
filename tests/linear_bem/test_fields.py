import tracemalloc

import numpy as np
import pytest

from linear_bem import (
    Ball,
    Cone,
    Elastic,
    InvalidProblem,
    Layer,
    Load,
    Problem,
    SurfaceResponse,
    UnsupportedProblem,
    solve_contact,
)
from linear_bem.interaction_energy import energy_force
from linear_bem.layer.interior import half_space_state, interior_state
from linear_bem.layer.response import LayerResponse
from linear_bem.smooth.displacement import zone_displacement
from linear_bem.stress import interior_displacement, stress, vertical_stress


@pytest.fixture(scope="module")
def hertz():
    """One ball on a half-space with contact radius 0.1."""
    return solve_contact(
        Problem(Layer(1.0, 0.3, np.inf), (Ball((0.0, 0.0), 1.0, "paraboloid"),), Load("approach", (0.01,)))
    )


@pytest.fixture(scope="module")
def unlike():
    balls = (Ball((-1.1, 0.0), 1.0, "paraboloid"), Ball((1.1, 0.4), 0.8, "paraboloid"))
    return solve_contact(Problem(Layer(1.0, 0.45, 0.6), balls, Load("approach", (0.02, 0.03)), Elastic(5.0, 0.2)), 1e-6)


def test_pressure_acts_only_inside_the_outline():
    """P, the square of the pressure, of a high degree is positive again in a ring outside the contact of this cone."""
    cone = Ball((0.0, 0.0), shape=Cone(np.radians(20.0), 0.5))
    pressed = solve_contact(Problem(Layer(1.0, 0.3, 1.0), (cone,), Load("approach", (0.1,))))
    radius = np.sqrt(pressed.contacts.contact_areas[0] / np.pi)
    x, y = np.meshgrid(*[np.linspace(-2.0 * radius, 2.0 * radius, 201)] * 2)
    pressure, r = pressed.pressure(x, y), np.hypot(x, y)
    assert np.all(pressure[r > 1.001 * radius] == 0.0)
    assert np.all(pressure[r < 0.999 * radius] > 0.0)
    assert pressure.sum() * (x[0, 1] - x[0, 0]) ** 2 == pytest.approx(pressed.contacts.normal_forces[0], rel=1e-3)


def test_displacement_is_hertz_inside_and_outside_the_contact(hertz):
    a, d = 0.1, 0.01
    inside = np.array([0.0, 0.03, 0.0999])
    outside = np.array([0.1001, 0.101, 0.105, 0.115, 0.14, 0.3, 3.0])
    assert hertz.displacement(inside, 0 * inside) == pytest.approx(d - inside**2 / 2, rel=1e-9)
    s = a / outside
    exact = d / np.pi * ((2 - s**-2) * np.arcsin(s) + np.sqrt(s**-2 - 1))
    assert hertz.displacement(outside, 0 * outside) == pytest.approx(exact, rel=1e-6)


def test_pressure_and_outline_are_hertz(hertz):
    r = np.array([0.0, 0.05, 0.09, 0.11])
    peak = hertz.result().balls[0].peak_pressure
    assert hertz.pressure(r, 0 * r) == pytest.approx(peak * np.sqrt(np.maximum(1 - (r / 0.1) ** 2, 0)), rel=1e-8)
    assert np.hypot(*hertz.outline(0)) == pytest.approx(np.full(64, 0.1), rel=1e-9)


def test_surface_follows_the_balls_inside_both_contacts(unlike):
    for i, ball in enumerate(unlike.problem.balls):
        x, y = unlike.outline(i)
        x, y = 0.3 * ball.position[0] + 0.7 * x, 0.3 * ball.position[1] + 0.7 * y
        depth = unlike.contacts.approaches[i] - ((x - ball.position[0]) ** 2 + (y - ball.position[1]) ** 2) / (
            2 * ball.radius
        )
        assert unlike.displacement(x, y) == pytest.approx(depth, abs=1e-6 * unlike.contacts.approaches[i])


def test_three_routes_to_the_tangential_force_agree(unlike):
    mutual, slope = unlike.contacts.mutual_force, unlike.contacts.slope_force
    size = np.max(np.abs(mutual))
    assert slope == pytest.approx(mutual, abs=1e-6 * size)
    for ball in (0, 1):
        assert energy_force(unlike, ball) == pytest.approx(tuple(mutual[ball]), abs=1e-5 * size)


def test_the_energy_route_holds_for_touching_balls_too():
    balls = (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid"))
    touching = solve_contact(
        Problem(Layer(1.0, 0.48, 1.16), balls, Load("force", (2.66666e-3,) * 2), Elastic(1e3, 0.3)), 1e-6
    )
    mutual = touching.contacts.mutual_force[0, 0]
    assert energy_force(touching, 0)[0] == pytest.approx(mutual, rel=1e-5)


@pytest.mark.parametrize("ball", [2, -1, 0.5])
def test_a_ball_that_is_not_there_has_no_outline_and_no_force(unlike, ball):
    for call in (unlike.outline, lambda ball: energy_force(unlike, ball)):
        with pytest.raises(InvalidProblem, match=f"ball: must be a whole number from 0 to 1, got {ball}"):
            call(ball)
    with pytest.raises(InvalidProblem, match="step: must be a length greater than 0 and finite, or None, got 0 m"):
        energy_force(unlike, 0, 0)


def test_vertical_stress_on_the_axis_is_hertz(hertz):
    peak = hertz.result().balls[0].peak_pressure
    for depth in (0.003, 0.05, 0.3):
        assert vertical_stress(hertz, 0.0, 0.0, depth) == pytest.approx(-peak / (1 + (depth / 0.1) ** 2), rel=1e-6)
    assert vertical_stress(hertz, 0.0, 0.0, 0.0) == pytest.approx(-peak, rel=1e-8)
    assert hertz.pressure(0.2, 0.0) == 0.0


@pytest.mark.parametrize("depth", [0.1, 0.6])
def test_vertical_stress_on_a_plane_carries_the_load(depth):
    problem = Problem(Layer(1.0, 0.45, 0.6), (Ball((0.0, 0.0), 1.0, "paraboloid"),), Load("force", (0.01,)))
    z, w = np.polynomial.legendre.leggauss(300)
    r, w = 10.0 * (1 + z), 10.0 * w
    stress = vertical_stress(solve_contact(problem), r, 0 * r, depth)
    assert np.sum(2 * np.pi * r * stress * w) == pytest.approx(-0.01, rel=1e-6)


def test_states_of_equal_materials_are_the_half_spaces_at_any_depth():
    t, layer = np.geomspace(1e-6, 50, 60), Elastic(1.0, 0.4)
    for depth in (0.0, 0.5, 1.0, 2.5):
        state = half_space_state(layer, depth * t)
        assert state[2] == pytest.approx(-(1 + depth * t) * np.exp(-depth * t), abs=1e-13)
        assert interior_state(layer, layer, t, depth) == pytest.approx(state, abs=1e-12)


@pytest.mark.parametrize("base", [None, Elastic(100.0, 0.3), Elastic(0.01, 0.0)])
@pytest.mark.parametrize("nu", [0.5, 0.3])
def test_states_meet_the_closed_form_of_the_surface_and_have_no_step_where_the_methods_change(nu, base):
    t, layer = np.geomspace(1e-3, 50, 60), Elastic(1.0, nu)
    response = 2.0 * (1.0 - nu) * LayerResponse(layer, base)(t)
    assert interior_state(layer, base, t, 0.0)[1] == pytest.approx(response, rel=1e-10, abs=1e-14)
    before, after = (interior_state(layer, base, np.array([1.0 + s]), 0.7)[:, 0] for s in (-1e-12, 1e-12))
    assert before == pytest.approx(after, rel=1e-10, abs=1e-11)


def huber(r, z, a, peak, nu):
    """Stress under Hertz's pressure: radial, hoop, vertical, shear (z down) [Huber 1904, Ann. Phys. 319, 153]."""
    s = r**2 + z**2 - a**2
    u = 0.5 * (s + np.hypot(s, 2 * a * z))
    ratio, turn = z / np.sqrt(u), np.sqrt(u) / a * np.arctan(a / np.sqrt(u))
    outer = (1 - 2 * nu) / 3 * (a / r) ** 2 * (1 - ratio**3)
    deep = ratio**3 * a**2 * u / (u**2 + a**2 * z**2)
    radial = outer + deep + ratio * (u * (1 - nu) / (a**2 + u) + (1 + nu) * turn - 2)
    hoop = -outer - ratio * (2 * nu + u * (1 - nu) / (a**2 + u) - (1 + nu) * turn)
    shear = -r * z**2 / (u**2 + a**2 * z**2) * a**2 * np.sqrt(u) / (a**2 + u)
    return peak * radial, peak * hoop, -peak * deep, peak * shear


@pytest.mark.parametrize("z", [0.005, 0.05, 0.2])
def test_all_stresses_under_hertz_are_hubers(hertz, z):
    peak = hertz.result().balls[0].peak_pressure
    r, angle = np.array([1e-6, 0.03, 0.095, 0.15, 0.4]), np.array([0.2, 0.7, 2.0, -1.0, 3.0])
    radial, hoop, vertical, shear = huber(r, z, 0.1, peak, 0.3)
    found = stress(hertz, r * np.cos(angle), r * np.sin(angle), z)
    e, f = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    near = {"abs": (5e-5 if z < 0.05 else 3e-6) * peak}  # quadrature over the pressure
    assert np.einsum("ip,ijp,jp->p", e, found[:2, :2], e) == pytest.approx(radial, **near)
    assert np.einsum("ip,ijp,jp->p", f, found[:2, :2], f) == pytest.approx(hoop, **near)
    assert np.einsum("ip,ijp,jp->p", e, found[:2, :2], f) == pytest.approx(0.0 * r, **near)
    assert found[2, 2] == pytest.approx(vertical, **near)
    assert np.einsum("ip,ip->p", e, found[:2, 2]) == pytest.approx(-shear, **near)  # z points up


@pytest.mark.parametrize("depth", [0.1, 0.45, 0.75, 1.5])
def test_stresses_are_in_equilibrium_and_follow_hookes_law(unlike, depth):
    """In the layer and in the substrate, by central differences."""
    solid = unlike.problem.layer if depth < 0.6 else unlike.problem.substrate
    x, y, d = np.array([-1.1, -0.4, 0.9]), np.array([0.1, 0.3, 0.5]), 2e-3

    def derivatives(field):
        steps = [(d, 0, 0), (0, d, 0), (0, 0, d)]
        return [
            (field(unlike, x + a, y + b, depth - c) - field(unlike, x - a, y - b, depth + c)) / (2 * d)
            for a, b, c in steps
        ]

    slopes = np.array(derivatives(interior_displacement))  # [axis, component, point]
    strain = 0.5 * (slopes + slopes.transpose(1, 0, 2))
    hooke = 2 * solid.shear_modulus * strain + solid.lame_first * np.einsum("iip->p", strain) * np.eye(3)[:, :, None]
    found = stress(unlike, x, y, depth)
    size = np.max(np.abs(found))
    # differences of second order over d against a depth of 0.1
    assert found == pytest.approx(hooke, abs=2e-3 * size)
    change = np.array(derivatives(stress))  # [axis, i, j, point]
    assert np.einsum("iijp->jp", change) == pytest.approx(np.zeros((3, 3)), abs=5e-3 * np.max(np.abs(change)))


def test_near_an_edge_the_layers_part_of_the_displacement_takes_few_nodes_and_loses_nothing(unlike, monkeypatch):
    kernel, nodes = unlike.contacts.kernel, unlike.contacts.smooth.nodes[0]
    zone, products, smooth = nodes.zone, [], kernel.smooth
    x, y = (c + 1.03 * (o - c) for c, o in zip(zone.centre, zone.outline(7), strict=True))

    def counted(r):
        products.append(np.size(r))
        return smooth(r)

    monkeypatch.setattr(kernel, "smooth", counted)
    found = zone_displacement(kernel, nodes, x, y)
    assert sum(products) < 7 * 2000
    xi, eta, weights, pressure = zone.quadrature(80, 1500)
    at_x, at_y = zone.points(xi, eta)
    direct = kernel.scaled(np.hypot(x[:, None] - at_x, y[:, None] - at_y)) @ (weights * pressure)
    assert found == pytest.approx(direct, rel=1e-10)


def test_tractions_and_displacements_are_continuous_at_the_bond(unlike):
    x, y, h = np.array([-1.1, 0.0, 1.3]), np.array([0.0, 0.2, 0.5]), unlike.problem.layer.thickness
    above, below = (stress(unlike, x, y, h * (1 + s)) for s in (0.0, 1e-9))
    size = np.max(np.abs(above))
    assert below[2] == pytest.approx(above[2], abs=1e-6 * size)
    assert np.max(np.abs(below[0, 0] - above[0, 0])) > 0.1 * size  # five times as stiff
    above, below = (interior_displacement(unlike, x, y, h * (1 + s)) for s in (0.0, 1e-9))
    assert below == pytest.approx(above, abs=1e-6 * np.max(np.abs(above)))


def test_fields_far_below_a_thin_film_are_those_of_a_half_space(hertz):
    film = Problem(Layer(1.0, 0.3, 1e-4), hertz.problem.balls, hertz.problem.load, Elastic(1.00001, 0.3))
    coated, x = solve_contact(film, 1e-3), np.array([0.0, 0.3, 1.0, 3.0, 10.0])
    for field in (stress, interior_displacement):
        exact = field(hertz, x, 0 * x, 3.0)
        assert field(coated, x, 0 * x, 3.0) == pytest.approx(exact, abs=1e-3 * np.max(np.abs(exact)))


def test_stresses_far_away_in_a_stiff_film_follow_hookes_law():
    ball = Ball((0.0, 0.0), 20.0, "paraboloid")
    film = solve_contact(Problem(Layer(1e3, 0.3, 1.0), (ball,), Load("approach", (0.1,)), Elastic(1.0, 0.3)), 1e-3)
    x = 1e4 * np.array([0.999, 1.0, 1.001])
    before, here, after = interior_displacement(film, x, 0 * x, 0.5)[0]
    found = stress(film, x[1], 0.0, 0.5)
    strains = (after - before) / (x[2] - x[0]) - here / x[1]
    assert found[0, 0] - found[1, 1] == pytest.approx(2 * 1e3 / 2.6 * strains, rel=1e-4)


def test_displacements_far_away_in_a_soft_film_are_those_of_its_base():
    ball = Ball((0.0, 0.0), 20.0, "paraboloid")
    film = solve_contact(Problem(Layer(1e-3, 0.3, 1.0), (ball,), Load("approach", (0.1,)), Elastic(1.0, 0.3)), 1e-3)
    above, below = (interior_displacement(film, 1e4, 0.0, depth) for depth in (1.0 - 1e-6, 1.0 + 1e-6))
    assert above == pytest.approx(below, rel=1e-6, abs=1e-12 * np.max(np.abs(below)))


def test_the_displacement_tends_to_the_surfaces(unlike):
    x, y = np.array([-1.1, 0.0, 2.0]), np.array([0.0, 0.2, 0.5])
    depths = np.array([0.004, 0.008])
    down = [-interior_displacement(unlike, x, y, depth)[2] for depth in depths]
    # linear in the depth next to the surface
    assert 2 * down[0] - down[1] == pytest.approx(unlike.displacement(x, y), rel=2e-3)


def test_depths_without_stress_are_refused(unlike, hertz):
    with pytest.raises(InvalidProblem, match=r"stress: depth must be at least .* got 1e-05 m; go deeper"):
        stress(unlike, 0.0, 0.0, 1e-5)
    rigid = Problem(Layer(1.0, 0.4, 0.3), (Ball((0.0, 0.0), 1.0),), Load("approach", (0.01,)))
    with pytest.raises(InvalidProblem, match=r"depth must be at most 0\.3 m, the base is rigid"):
        vertical_stress(solve_contact(rigid, 1e-2), 0.0, 0.0, 0.31)
    for field in (stress, vertical_stress, interior_displacement):
        with pytest.raises(InvalidProblem, match="depth must be one number, got an array of 2"):
            field(unlike, 0.0, 0.0, np.array([0.0, 0.1]))
    own = SurfaceResponse(1.0, 0.3, 1.0, np.ones_like)
    with pytest.raises(UnsupportedProblem, match=r"needs the materials inside.* give Layer and substrate"):
        stress(solve_contact(Problem(own, rigid.balls, rigid.load), 1e-2), 0.0, 0.0, 0.1)


def test_the_widest_contact_sets_the_least_depth():
    balls = (Ball((0.0, 0.0), 1.0), Ball((8.0, 0.0), 0.01))
    solution = solve_contact(Problem(Layer(1.0, 0.3, 20.0), balls, Load("approach", (0.1, 0.001))), 1e-3)
    wide, narrow = np.sqrt(solution.contacts.contact_areas / np.pi)
    with pytest.raises(InvalidProblem, match="of the widest contact's radius"):
        vertical_stress(solution, 0.0, 0.0, 0.5 * narrow)
    x = np.linspace(0.0, 0.5 * wide, 5)
    below = -vertical_stress(solution, x, 0.0, 0.025 * wide)
    assert below == pytest.approx(solution.pressure(x, 0.0 * x), rel=5e-3)


def test_stress_on_a_grid_meets_polynomials_from_one_cell_on_and_is_refused_above():
    balls = (Ball((0.0, 0.0), 1.0, "paraboloid"), Ball((2.0, 0.0), 1.0, "paraboloid"))
    problem = Problem(Layer(1.0, 0.4, 0.3), balls, Load("force", (0.05, 0.02)))
    grid, smooth = solve_contact(problem, 1e-3), solve_contact(problem, 1e-5)
    cell = max(patch.cell for patch in grid.contacts.patches.patches)
    ball = smooth.result().balls[0]
    r = 1.2 * np.sqrt(ball.contact_area / np.pi) * np.linspace(-1.0, 1.0, 21)
    for depth in (cell, 2.0 * cell):
        stress = [vertical_stress(s, r, 0.3 * r, depth) / ball.peak_pressure for s in (grid, smooth)]
        # pressures that step from cell to cell are felt within a cell or two
        assert stress[0] == pytest.approx(stress[1], abs=0.015 * cell / depth)
    with pytest.raises(InvalidProblem, match=r"one cell of the pressure, got 0\.001 m; go deeper"):
        vertical_stress(grid, 0.0, 0.0, 0.001)
    assert vertical_stress(grid, 0.01, 0.02, 0.0) == -grid.pressure(0.01, 0.02)


def test_a_field_next_to_the_edge_of_a_contact_takes_little_memory():
    contacts = solve_contact(
        Problem(Layer(1.0, 0.48, 1.2), (Ball((0.0, 0.0), 1.0),), Load("approach", (0.1,)))
    ).contacts
    nodes = contacts.smooth.nodes[0]
    x = nodes.zone.reach * np.linspace(1.001, 1.019, 100)
    tracemalloc.start()
    contacts.displacement(x, np.zeros(100))
    assert tracemalloc.get_traced_memory()[1] < 6e7  # 2e8 with all nodes or many points together
    tracemalloc.stop()
