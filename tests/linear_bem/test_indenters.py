"""Indenters against Sneddon's integrals, Hertz's ellipse, and their own derivatives and gaps."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from linear_bem import (
    Ball,
    Cone,
    ContactSequence,
    Elastic,
    Ellipsoid,
    InvalidProblem,
    Layer,
    LayeredKernel,
    Load,
    Paraboloid,
    Problem,
    Punch,
    Sphere,
    UnsupportedProblem,
    solve,
    solve_contact,
    solve_point_load,
)
from linear_bem.dual import slope
from linear_bem.grid.contacts import GridContacts
from linear_bem.smooth.initial_guess import first_guess

HALF_SPACE = Layer(1.0, 0.3, np.inf)
MODULUS = HALF_SPACE.contact_modulus
BODIES = [Paraboloid(2.0), Sphere(2.0), Ellipsoid((1.5, 0.8, 1.1)), Cone(0.4, 0.3), Punch(1.2, 0.25)]
ROUND = [body for body in BODIES if not isinstance(body, Ellipsoid)]


def single(body, load, accuracy=1e-4):
    return solve(Problem(HALF_SPACE, (Ball((0.0, 0.0), shape=body),), load), accuracy).balls[0]


def profile_slope(body):
    """df/dr of a body of revolution, independent of `Indenter.height`."""
    match body:
        case Paraboloid(radius=R):
            return lambda r: r / R
        case Sphere(radius=R):
            return lambda r: r / math.sqrt(R * R - r * r)
        case Cone(slope=angle, tip_radius=R):
            s = math.tan(angle)
            return lambda r: s * r / math.sqrt(r * r + (s * R) ** 2)
        case Punch(radius=a, edge_radius=e):
            return lambda r: 0.0 if r < a - e else (r - a + e) / math.sqrt(max(e * e - (r - a + e) ** 2, 1e-300))


def sneddon(body, radius):
    """Approach and force for a contact radius: D = int f' a/sqrt(a^2 - r^2) dr, Q = 2 E* int f' r^2/sqrt(a^2 - r^2) dr.

    [Sneddon 1965, Int. J. Eng. Sci. 3, 47]; r = a sin(t).
    """
    f = profile_slope(body)
    start = math.asin((body.radius - body.edge_radius) / radius) if isinstance(body, Punch) else 0.0
    deep = quad(lambda t: f(radius * math.sin(t)) * radius, start, 0.5 * math.pi, epsabs=1e-13, epsrel=1e-11)[0]
    load = quad(lambda t: f(radius * math.sin(t)) * (radius * math.sin(t)) ** 2, start, 0.5 * math.pi, epsabs=1e-13)[0]
    return deep, 2.0 * MODULUS * load


@pytest.mark.parametrize("body", ROUND, ids=repr)
def test_bodies_of_revolution_meet_sneddons_integrals(body):
    radius = 1.1 if isinstance(body, Punch) else 0.6
    approach, force = sneddon(body, radius)
    found = single(body, Load("approach", (approach,)))
    assert found.normal_force == pytest.approx(force, rel=3e-4)
    assert found.contact_area == pytest.approx(math.pi * radius**2, rel=0.01)
    assert single(body, Load("force", (force,))).approach == pytest.approx(approach, rel=3e-4)


def test_a_cone_tends_to_sneddons_as_its_tip_grows_sharp():
    """Q = 2/pi E* D^2 / tan(slope) [Sneddon 1965]; a tip of radius R leaves a share that falls like R."""
    angle, approach = 0.3, 0.1
    sharp = 2.0 / math.pi * MODULUS * approach**2 / math.tan(angle)
    off = [single(Cone(angle, tip), Load("approach", (approach,))).normal_force / sharp - 1.0 for tip in (1e-2, 1e-3)]
    assert 0.0 < off[1] < 2.5e-3
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.1)


def test_a_punch_tends_to_the_flat_one_as_its_edge_grows_sharp():
    """Q = 2 a E* D [Johnson 1985, eq. 3.36]."""
    approach = 0.1
    sharp = 2.0 * MODULUS * approach
    off = [1.0 - single(Punch(1.0, e), Load("approach", (approach,)), 1e-2).normal_force / sharp for e in (0.03, 0.01)]
    assert 0.0 < off[1] < 6e-3
    assert off[1] < 0.3 * off[0]


def test_a_punch_on_a_thin_layer_is_nearly_in_plain_compression():
    layer = Layer(1.0, 0.2, 0.02)
    ball = Ball((0.0, 0.0), shape=Punch(1.0, 0.01))
    force = solve(Problem(layer, (ball,), Load("approach", (1e-3,))), 1e-2).balls[0].normal_force
    oedometric = layer.young * 0.8 / (1.2 * 0.6)
    # the edge's correction is of the order of the thickness
    assert force == pytest.approx(oedometric * math.pi * 1e-3 / 0.02, rel=0.04)


def test_the_apex_of_an_ellipsoid_is_hertzs_ellipse():
    """At small loads x^2/2 R_x + y^2/2 R_y of radii a^2/c and b^2/c: `test_hard_cases` compares that with Hertz."""
    a, b, c = 1.5, 0.8, 1.1
    body, force = Ellipsoid((a, b, c)), Load("force", (1e-5,))
    found = single(body, force)
    apex = Ball((0.0, 0.0), body.apex_radius, lambda x, y: 0.5 * c * (x**2 / a**2 + y**2 / b**2))
    hertz = solve(Problem(HALF_SPACE, (apex,), force)).balls[0]
    assert found.approach == pytest.approx(hertz.approach, rel=5e-4)
    assert found.contact_area == pytest.approx(hertz.contact_area, rel=1e-3)


def test_an_ellipsoid_of_equal_axes_is_the_sphere():
    for accuracy in (1e-2, 1e-5):
        ball = single(Ellipsoid((1.0, 1.0, 1.0)), Load("approach", (0.2,)), accuracy)
        assert ball.normal_force == pytest.approx(single(Sphere(1.0), Load("approach", (0.2,))).normal_force, rel=1e-6)


@pytest.mark.parametrize("body", BODIES, ids=repr)
def test_the_slope_is_that_of_the_height(body):
    rng = np.random.default_rng(3)
    r, angle = 0.75 * rng.random(40), 2.0 * np.pi * rng.random(40)
    x, y, h = r * np.cos(angle), r * np.sin(angle), 1e-6
    fx, fy = slope(body, x, y)
    assert fx == pytest.approx((body.height(x + h, y) - body.height(x - h, y)) / (2 * h), abs=1e-8)
    assert fy == pytest.approx((body.height(x, y + h) - body.height(x, y - h)) / (2 * h), abs=1e-8)
    none = slope(body, np.zeros(1), np.zeros(1))
    assert none[0] == none[1] == 0.0


@pytest.mark.parametrize("body", BODIES, ids=repr)
def test_the_gap_vanishes_on_the_surface_and_falls_by_one_at_the_apex(body):
    rng = np.random.default_rng(4)
    x, y = 0.7 * (2.0 * rng.random((2, 40)) - 1.0)
    z = body.height(x, y)
    assert body.gap(x, y, z) == pytest.approx(0.0, abs=1e-8)
    assert np.all(body.gap(x, y, z - 1e-3) > 0.0)
    assert np.all(body.gap(x, y, z + 1e-3) < 0.0)
    assert (body.gap(0.0, 0.0, 1e-4) - body.gap(0.0, 0.0, -1e-4)) / 2e-4 == pytest.approx(-1.0, abs=1e-4)


@pytest.mark.parametrize("body", [body for body in ROUND if math.isfinite(body.reach)], ids=repr)
def test_nothing_beyond_the_edge_is_touched(body):
    over = body.reach * np.array([1.01, 1.5, 3.0])
    heights = body.height(over, 0.0)
    edge = body.height(body.reach, 0.0)
    # steeper than the flank of 45 degrees that any neighbouring point of the surface could follow
    assert np.all(heights > edge + over - body.reach)


def test_a_gap_is_a_distance_where_the_body_has_one():
    assert Sphere(2.0).gap(3.0, 0.0, 2.0) == pytest.approx(1.0)
    assert Ellipsoid((2.0, 2.0, 2.0)).gap(3.0, 0.0, 2.0) == pytest.approx(1.0)
    punch = Punch(1.0, 0.2)
    assert punch.gap(1.5, 0.0, 3.0) == pytest.approx(0.5)
    assert punch.gap(0.8 + 0.3, 0.0, 0.2 - 0.4) == pytest.approx(0.3)
    assert punch.gap(0.0, 0.0, 0.7) == pytest.approx(-0.7)


@pytest.mark.parametrize("body", BODIES, ids=repr)
def test_the_form_language_takes_the_same_lines_and_differentiates_them(body):
    mesh = pytest.importorskip("dolfinx.mesh")  # newer versions of UFL refuse a cell without a mesh
    import ufl  # noqa: PLC0415
    from mpi4py import MPI  # noqa: PLC0415
    from ufl.algorithms import expand_derivatives  # noqa: PLC0415

    place = ufl.SpatialCoordinate(mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1))
    at = ufl.variable(place)
    f, g = body.height(at[0], at[1]), body.gap(at[0], at[1], at[2])
    df = expand_derivatives(ufl.diff(f, at))
    dg = expand_derivatives(ufl.diff(g, at))
    for x, y, z in ((0.0, 0.0, 0.0), (0.3, -0.2, 0.05), (-0.5, 0.4, -0.1), (1.1, 0.0, 0.2)):
        assert f((x, y, z)) == pytest.approx(float(body.height(x, y)), rel=1e-12, abs=1e-15)
        assert g((x, y, z)) == pytest.approx(float(body.gap(x, y, z)), rel=1e-12, abs=1e-15)
        fx, fy = slope(body, np.array([x]), np.array([y]))
        assert [df[0]((x, y, z)), df[1]((x, y, z))] == pytest.approx([fx[0], fy[0]], rel=1e-9, abs=1e-12)
        assert np.all(np.isfinite([dg[k]((x, y, z)) for k in range(3)]))


def test_two_punches_and_two_cones_push_each_other_by_equal_and_opposite_forces():
    for body, layer in ((Punch(1.0, 0.1), Layer(1.0, 0.48, 1.0)), (Cone(0.3, 0.5), Layer(1.0, 0.48, 1.0))):
        balls = tuple(Ball((x, 0.0), shape=body) for x in (-1.2, 1.2))
        problem = Problem(layer, balls, Load("approach", (0.05, 0.05)), Elastic(1e3, 0.3))
        contacts = solve_contact(problem, 1e-2)
        left, right = contacts.result().balls
        assert isinstance(contacts.contacts, GridContacts) or not isinstance(body, Punch)
        assert left.tangential_force[0] == pytest.approx(-right.tangential_force[0], rel=1e-6)
        slopes = left.tangential_force_routes["slope"][0]
        assert abs(left.tangential_force[0] - slopes) < 0.1 * abs(left.tangential_force[0])


@pytest.mark.parametrize("body", [Cone(0.3, 0.1), Punch(1.0, 0.1)], ids=repr)
def test_the_point_load_law_refuses_what_does_not_grow_like_a_ball(body):
    balls = tuple(Ball((x, 0.0), shape=body) for x in (-1.2, 1.2))
    with pytest.raises(UnsupportedProblem, match=r"balls.shape: .* got .*\(.*; use linear_bem"):
        solve_point_load(Problem(HALF_SPACE, balls, Load("approach", (0.05, 0.05))))


def test_sequences_take_every_body():
    for body in (Cone(0.4, 1.0), Punch(1.0, 0.2)):
        balls = tuple(Ball((x, 0.0), shape=body) for x in (-1.5, 1.5))
        problem = Problem(Layer(1.0, 0.48, 4.0), balls, Load("approach", (0.05, 0.05)))
        found = ContactSequence(1e-2).solve(problem).normal_forces[0]
        assert found == pytest.approx(solve(problem, 1e-2).balls[0].normal_force, rel=1e-2)


def test_a_ball_takes_its_radius_from_its_shape():
    assert Ball((0.0, 0.0), shape=Cone(0.3, 0.2)).radius == 0.2
    assert Ball((0.0, 0.0), shape=Ellipsoid([2.0, 1.0, 4.0])).radius == 0.5
    assert Ball((0.0, 0.0), shape=Punch(1.0, 0.2)).radius == 1.0
    assert Ball((0.0, 0.0), 1.0).shape == "sphere"
    same = (Ball((0.0, 0.0), 1.0), Ball((0.0, 0.0), shape=Sphere(1.0)))
    forces = [solve(Problem(HALF_SPACE, (ball,), Load("approach", (0.1,)))).balls[0].normal_force for ball in same]
    assert forces[0] == forces[1]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sphere(0.0), "balls.radius: must be greater than 0 and finite, got 0.0 m"),
        (lambda: Cone(1.6, 0.1), "balls.slope: must lie between 0 and 90 deg"),
        (lambda: Cone(0.3, 0.0), "balls.tip_radius: must be greater than 0, got 0 m; a sharp tip has no finite"),
        (lambda: Ellipsoid((1.0, 1.0)), "balls.semi_axes: must be three lengths"),
        (lambda: Punch(1.0, 0.0), "balls.edge_radius: must be greater than 0.*take a small one"),
        (lambda: Punch(1.0, 1.1), "balls.edge_radius: must not be larger than the punch"),
        (lambda: Problem(HALF_SPACE, (Ball((0.0, 0.0)),), Load("force", (1.0,))), "balls.radius.0.: must be greater"),
        (
            lambda: Problem(HALF_SPACE, (Ball((0.0, 0.0), 1.0, Cone(0.3, 0.2)),), Load("force", (1.0,))),
            "must be 0.2 m, which the shape states, got 1 m; leave it out",
        ),
        (
            lambda: Problem(HALF_SPACE, (Ball((0.0, 0.0), 1.0, 3),), Load("force", (1.0,))),
            "must be a name, an indenter",
        ),
    ],
)
def test_an_invalid_body_is_refused_with_key_rule_and_value(make, words):
    with pytest.raises(InvalidProblem, match=words):
        make()


@pytest.mark.parametrize(
    ("body", "apart"),
    [(Punch(1.0, 0.1), 2.0), (Ellipsoid((0.5, 2.0, 1.0)), 1.0), (Sphere(1.0), 2.0)],
)
def test_bodies_stand_no_closer_than_they_are_wide(body, apart):
    def pair(distance):
        balls = (Ball((0.0, 0.0), shape=body), Ball((distance, 0.0), shape=body))
        return Problem(HALF_SPACE, balls, Load("force", (1.0, 1.0)))

    pair(apart)
    with pytest.raises(InvalidProblem, match="overlap"):
        pair(0.99 * apart)


def test_an_own_profile_in_another_unit_than_its_radius_is_doubted() -> None:
    def noted(shape) -> list[str]:
        problem = Problem(HALF_SPACE, (Ball((0.0, 0.0), 2e-3, shape),), Load("approach", (1e-4,)))
        return [note for note in solve(problem).solved.notes if "contact radius of ball" in note]

    def ends(x, y):  # a table that knows no more than this
        if np.max(x**2 + y**2) > 1e-6:
            raise ValueError("outside the table")
        return (x**2 + y**2) / 4e-3

    assert noted(lambda x, y: (x**2 + y**2) / 4e-3) == noted(ends) == []
    (note,) = noted(lambda x, y: (x**2 + y**2) / 4.0)  # its radius of curvature is 2 m
    assert "of ball 0, 0.0141 m, exceeds the ball's radius, 0.002 m; unless intended, check the units" in note
    (note,) = noted(lambda x, y: (x**2 + y**2) / 4e-6)
    assert "of ball 0, 1.41e-05 m, is less than 1/3 of its approach" in note
    balls = (Ball((200.0, 0.0), 1.0, lambda x, y: 200.0 * (x**2 + y**2)), Ball((0.0, 0.0), 8.0))
    far = Problem(Layer(1.0, 0.3, 0.5), balls, Load("approach", (0.12, 0.3)), Elastic(0.2, 0.3))
    # only the other ball dents the base
    assert any("of ball 0, 0.0167 m, is less than 1/3" in note for note in solve(far, 1e-2).solved.notes)
    balls = (Ball((0.0, 0.0), 1.0, lambda x, y: (x**2 + y**2) / 2.0), Ball((2.0, 0.0), 1.0))
    lifted = solve(Problem(HALF_SPACE, balls, Load("approach", (0.01, 0.3))), 1e-2)
    assert lifted.balls[0].normal_force == 0.0
    assert not any("contact radius" in note for note in lifted.solved.notes)


def test_a_pointed_own_profile_is_said_to_have_no_peak_pressure() -> None:
    for profile, is_pointed in (
        (lambda x, y: 0.3 * np.hypot(x, y), True),
        (lambda x, y: np.sqrt(1e-8 + 0.09 * (x**2 + y**2)) - 1e-4, False),
    ):
        problem = Problem(HALF_SPACE, (Ball((0.0, 0.0), 1.0, profile),), Load("approach", (0.1,)))
        assert any("peak pressure has no limit" in note for note in solve(problem, 1e-2).solved.notes) == is_pointed


def test_the_first_guess_within_the_flat_end_of_a_punch_is_a_circle():
    bodies = {0.0: Punch(0.75, 0.08), 1.3: Punch(0.5, 0.25)}
    balls = tuple(Ball((x, 0.0), shape=body, asperity=True) for x, body in bodies.items())
    problem = Problem(Layer(1.0, 0.45, 4.0), balls, Load("total_force", (2e-3,)))
    zone = first_guess(problem, LayeredKernel.of(problem)).zones[0]
    assert 0.6 < zone.radius == zone.reach < 0.67
