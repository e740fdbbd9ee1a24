"""Bodies of one's own: profiles and heights in numpy, their exact slopes and answers, and what they must not be."""

import math
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import pytest
from scipy.optimize import brentq

from linear_bem import (
    Ball,
    Indenter,
    InvalidProblem,
    Layer,
    LayeredKernel,
    Load,
    Problem,
    solve,
    solve_contact,
    solve_height_field,
)
from linear_bem.dual import slope
from linear_bem.grid.contacts import GridContacts, grid_levels
from linear_bem.smooth.initial_guess import first_guess

HALF_SPACE = Layer(1.0, 0.3, np.inf)


@pytest.mark.parametrize(("exponent", "height"), [(0.75, 0.3), (2.0, 1.0), (4.0, 1.0)])
@pytest.mark.filterwarnings("error")
def test_power_laws_of_any_exponent_are_solved_and_a_tighter_accuracy_is_no_worse(exponent, height):
    """f = c (x^2 + y^2)^n against [Sneddon 1965]; n = 3/4 overflowed, n = 2 was worse at 1e-6 than at 1e-2."""
    power, approach = 2.0 * exponent, 0.05
    ratio = math.sqrt(math.pi) * math.gamma(0.5 * power + 1.0) / math.gamma(0.5 * power + 0.5)
    radius = brentq(lambda a: height * ratio * a**power - approach, 1e-3, 10.0)
    force = 2.0 * HALF_SPACE.contact_modulus * approach * radius * power / (power + 1.0)
    body = Ball((0.0, 0.0), 1.0, lambda x, y: height * (x * x + y * y) ** exponent)
    problem = Problem(HALF_SPACE, (body,), Load("approach", (approach,)))
    off = [abs(solve(problem, wanted).balls[0].normal_force / force - 1.0) for wanted in (1e-2, 1e-4, 1e-6)]
    assert off[0] < 1e-3
    assert max(off[1:]) < 1e-4
    assert max(off[1:]) < max(1.1 * off[0], 1e-7)


@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_a_long_roller_that_is_flat_along_its_axis_has_patches_of_its_own_length(angle):
    def roller(x, y):
        along, across = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
        return across**2 + (along / 4.0) ** 8

    layer, approach, cell = Layer(1.0, 0.3, 2.0), 0.02, 0.01
    problem = Problem(layer, (Ball((0.0, 0.0), 0.5, roller),), Load("approach", (approach,)))
    on_patch = list(islice(grid_levels(first_guess(problem, LayeredKernel.of(problem))), 4))[-1]
    x, y = (cell * (np.arange(count) - 0.5 * (count - 1)) for count in (600, 40))
    turned = roller(np.cos(angle) * x[:, None] - np.sin(angle) * y, np.sin(angle) * x[:, None] + np.cos(angle) * y)
    force = solve_height_field(layer, None, turned, cell, approach=approach).normal_force
    assert on_patch.normal_forces[0] == pytest.approx(force, rel=0.03)


def test_a_body_of_ones_own_is_refused_with_what_it_lacks():
    class Bare(Indenter):
        pass

    with pytest.raises(InvalidProblem, match=r"balls\.shape: Bare must define apex_radius.*got none; add"):
        Ball((0.0, 0.0), shape=Bare())
    with pytest.raises(InvalidProblem, match=r"balls\.shape: Bare must define height\(x, y\).*got none; add"):
        Bare().height(0.0, 0.0)


def test_heights_of_numpy_functions_have_exact_slopes():
    def height(x, y):
        r2 = x**2 + y**2
        waves = np.cos(2.0 * x) * np.sin(y) + np.tan(0.3 * x) - 2.0 / (1.0 + y)
        return np.exp(-r2) + np.log(1.0 + r2) + np.sqrt(2.0 + x) + np.cosh(x) * np.tanh(y) - np.sinh(y) + waves

    class Body(Indenter):
        apex_radius = 1.0

        def height(self, x, y):
            return height(x, y)

    x, y, step = np.array([0.3, -0.2, 0.0]), np.array([0.1, 0.4, 0.0]), 1e-20
    by_x, by_y = (height(x + 1j * step, y).imag / step, height(x, y + 1j * step).imag / step)  # complex steps: exact
    assert slope(Body(), x, y) == (pytest.approx(by_x, rel=1e-13), pytest.approx(by_y, rel=1e-13))


def test_a_height_of_numpy_functions_gives_the_answer_of_the_same_body():
    class Bowl(Indenter):
        apex_radius = 1.0

        def height(self, x, y):
            r2 = x**2 + y**2
            return np.sqrt(1.0 + r2 + 0.25 * r2**2) - np.cos(x) ** 2 - np.sin(x) ** 2

    def left(shape):
        balls = tuple(Ball((x, 0.0), 1.0, shape) for x in (-1.5, 1.5))
        return solve(Problem(HALF_SPACE, balls, Load("approach", (0.05, 0.05)))).balls[0]

    own, named = left(Bowl()), left("paraboloid")
    assert own.normal_force == pytest.approx(named.normal_force, rel=1e-9)
    assert own.tangential_force[0] == pytest.approx(named.tangential_force[0], rel=1e-7)


def steep(x, y):
    return 1.3 * (x**2 + y**2)


@pytest.mark.parametrize(
    "load", [Load("approach", (0.1, 0.05)), Load("force", (0.05, 0.03)), Load("total_force", (0.08,))]
)
def test_a_whole_number_as_radius_gives_the_answer_of_the_real_number(load):
    whole, real = (
        solve(Problem(Layer(1.0, 0.3, 3.0), tuple(Ball(at, radius, steep) for at in ((0, 0), (3, 0))), load), 1e-2)
        for radius in (1, 1.0)
    )
    for ball, known in zip(whole.balls, real.balls, strict=True):
        assert ball.normal_force == known.normal_force
        assert ball.tangential_force == known.tangential_force


class Kinked(Indenter):
    """r^2 / 2 with a kink at a radius, beyond which it is ``outer`` r^2 more."""

    apex_radius = 1.0

    def __init__(self, kink, outer):
        self.kink, self.outer = kink, outer

    def height(self, x, y):
        inner = 0.5 * (x**2 + y**2)
        more = inner + self.outer * (x**2 + y**2 - self.kink**2)
        return np.maximum(inner, more) if self.outer > 0.0 else np.minimum(inner, more)


def single(body, approach, accuracy=1e-2):
    return solve(Problem(HALF_SPACE, (Ball((0.0, 0.0), 1.0, body),), Load("approach", (approach,))), accuracy).balls[0]


@pytest.mark.parametrize("kink", [0.1, 0.2, 0.28, 0.31])
@pytest.mark.parametrize("outer", [0.05, 0.5])
def test_a_kink_that_sticks_out_meets_sneddons_integrals(kink, outer):
    """f' = r, and (1 + 2 outer) r beyond the kink; r = a sin(t) [Sneddon 1965]."""
    radius = 0.3
    start = math.acos(min(kink / radius, 1.0)) if kink < radius else 0.0  # of the outer part, from the edge inwards
    depth = radius**2 + 2.0 * outer * radius**2 * math.sin(start)
    outside = radius**4 * (math.sin(start) - math.sin(start) ** 3 / 3.0)
    force = 2.0 * HALF_SPACE.contact_modulus * (radius**3 * 2.0 / 3.0 + 2.0 * outer * outside / radius)
    found = single(Kinked(kink, outer), depth)
    assert found.normal_force == pytest.approx(force, rel=3e-4)
    assert found.contact_area == pytest.approx(math.pi * radius**2, rel=0.02)
    assert abs(found.normal_force - force) <= found.errors["normal_force"]
    assert abs(found.contact_area - math.pi * radius**2) <= found.errors["contact_area"]


@pytest.mark.parametrize("outer", [-0.1, -0.2, -0.3])
def test_a_kink_that_goes_in_next_to_the_edge_is_not_overlooked(outer):
    """The contact of the inner part alone ends at 0.2, the kink lies at 0.202: a hundredth of it further out."""
    body, approach, n = Kinked(0.202, outer), 0.04, 256
    x = (np.arange(n) - 0.5 * (n - 1)) / n
    reference = solve_height_field(HALF_SPACE, None, body.height(x[:, None], x[None, :]), 1.0 / n, approach=approach)
    assert single(body, approach).normal_force == pytest.approx(reference.normal_force, rel=6e-4)


def test_the_pull_of_two_kinked_bodies_is_known_to_its_stated_error():
    balls = tuple(Ball((x, 0.0), 1.0, Kinked(0.1, 0.05)) for x in (-1.0, 1.0))
    problem = Problem(Layer(1.0, 0.45, 1.5), balls, Load("approach", (0.1, 0.1)))
    known, quick = (solve(problem, accuracy).balls[0] for accuracy in (1e-3, 1e-2))
    assert abs(quick.tangential_force[0] - known.tangential_force[0]) < quick.tangential_force_error
    assert quick.tangential_force[0] == pytest.approx(known.tangential_force[0], rel=2e-3)


def test_a_flattened_body_is_solved_on_grids():
    class Flattened(Indenter):
        apex_radius = 1.0

        def height(self, x, y):
            return np.maximum(0.5 * (x**2 + y**2) - 0.01, 0.0)

    flat = solve_contact(Problem(HALF_SPACE, (Ball((0.0, 0.0), shape=Flattened()),), Load("approach", (0.03,))), 1e-2)
    assert isinstance(flat.contacts, GridContacts)
    # between the whole paraboloid at the depths that it has below and above the cut
    low, high = (single("paraboloid", depth).normal_force for depth in (0.03, 0.04))
    assert low < flat.contacts.normal_forces[0] < high


class Jumping(Indenter):
    apex_radius = 1.0

    def height(self, x, y):
        return np.where(x > 0.1, 0.1, 0.0) + 0.5 * (x**2 + y**2)


class PowerOfPower(Indenter):
    apex_radius = 1.0

    def height(self, x, y):
        return 2.0 ** (x**2 + y**2) - 1.0


class NoExpression(Indenter):
    apex_radius = 1.0

    def height(self, x, y):
        return 0.0


class Raised(Indenter):
    apex_radius = 1.0

    def height(self, x, y):
        return 0.1 + 0.5 * (x**2 + y**2)


class Hollow(Indenter):
    apex_radius = 1.0

    def height(self, x, y):
        return x**2 - 0.5 * y**2


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (Jumping(), r"Jumping\.height must be an expression of .*np\.where may jump: write a kink by np\.maximum"),
        (PowerOfPower(), r"PowerOfPower\.height must be an expression of"),
        (NoExpression(), r"NoExpression\.height must be an expression of"),
        (Raised(), r"Raised\.height must be 0 at the axis.*got 0\.1 m"),
        (Hollow(), r"Hollow\.height must have its lowest point at the axis.*got -0\.005 m near it"),
    ],
)
def test_an_own_height_that_models_cannot_take_is_a_named_fault(body, says):
    balls = tuple(Ball((x, 0.0), shape=body) for x in (-1.0, 1.0))
    with pytest.raises(InvalidProblem, match=says) as found:
        Problem(HALF_SPACE, balls, Load("force", (0.1, 0.1)))
    assert len(found.value.args) == 1  # once for both balls


def test_a_fault_inside_an_own_height_stays_as_it_is():
    class Faulty(Indenter):
        apex_radius = 1.0

        def height(self, x, y):
            return (x**2 + y**2) / "2"

    with pytest.raises(TypeError, match="divide"):
        Problem(HALF_SPACE, (Ball((0.0, 0.0), shape=Faulty()),), Load("force", (0.1,)))


def test_a_field_may_not_hide_the_property_of_its_name():
    with pytest.raises(TypeError, match="make apex_radius a property or a constant"):

        class Hidden(Indenter):
            apex_radius: float


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("approaches", [(0.3, 0.3), (0.3, -0.002)])
def test_a_profile_without_height_beyond_its_equator_is_the_sphere(approaches):
    problem = Problem(
        Layer(1.0, 0.45, 1.0), tuple(Ball((x, 0.0), 1.0) for x in (-1.1, 1.1)), Load("approach", approaches)
    )
    own = tuple(replace(ball, shape=lambda x, y: 1.0 - np.sqrt(1.0 - x**2 - y**2)) for ball in problem.balls)
    for mine, sphere in zip(solve(replace(problem, balls=own), 1e-2).balls, solve(problem, 1e-2).balls, strict=True):
        assert mine.normal_force == pytest.approx(sphere.normal_force, rel=1e-6)
        error = mine.tangential_force_error  # T_y is 0 but for the residual of the solution
        assert mine.tangential_force == pytest.approx(sphere.tangential_force, rel=1e-3, abs=error)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("beyond", [np.nan, 5.0, 500.0])
def test_a_contact_may_reach_the_edge_beyond_which_its_body_has_no_height(beyond):
    nearly_flat = Ball((0.0, 0.0), 1.0, lambda x, y: np.where(x * x + y * y < 0.09, 1e-3 * (x * x + y * y), beyond))
    found = solve(Problem(HALF_SPACE, (nearly_flat,), Load("force", (0.03,))), 1e-2).balls[0]
    depth = 0.03 / (2.0 * 0.3 * HALF_SPACE.contact_modulus)  # a flat punch, Johnson 1985, section 3.4
    assert abs(found.approach - depth) < found.errors["approach"] + 1e-3 * 0.3**2


@dataclass(frozen=True)
class Trough(Indenter):
    """A body with two curvatures, turned about its axis."""

    across: float
    turn: float
    ratios = ("turn",)
    apex_radius = 1.0

    def height(self, x, y):
        c, s = math.cos(self.turn), math.sin(self.turn)
        return (c * x + s * y) ** 2 / (2.0 * self.across) + (c * y - s * x) ** 2 / 2.0


def test_fields_of_an_own_body_that_are_no_lengths_may_be_any_finite_numbers():
    ahead, back, level = (single(Trough(0.5, turn), 0.02, 1e-4).normal_force for turn in (0.4, -0.4, 0))
    assert ahead == pytest.approx(level, rel=1e-4)
    assert back == pytest.approx(ahead, rel=1e-9)
    with pytest.raises(InvalidProblem, match=r"^balls\.turn: must be a finite number, got nan$"):
        Trough(0.5, math.nan)
    with pytest.raises(
        InvalidProblem, match=r"^balls\.across: must be greater .* got -0\.5 m; name a field that is no l"
    ):
        Trough(-0.5, 0.4)
