"""A medium given by the response of its surface: layers known otherwise, a multilayer by transfer matrices, nu < 0."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import finite_strain
from linear_bem import (
    Ball,
    Elastic,
    FiniteStrain,
    InvalidProblem,
    Layer,
    LayeredKernel,
    Load,
    Problem,
    SurfaceResponse,
    UnsupportedProblem,
    solve,
    solve_point_load,
    uniform_square_displacement,
)
from linear_bem.closed_forms import hertz_force
from linear_bem.layer.response import LayerResponse

PAIR = (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid"))
LOAD = Load("force", (2.66666e-3, 2.66666e-3))


def state_matrix(solid, shear):
    """A of dy/d(k z) = A y, the state and its signs as in `propagator`."""
    nu, s = solid.poisson, shear / solid.shear_modulus
    n, c = nu / (1.0 - nu), (1.0 - 2.0 * nu) / (1.0 - nu)
    return np.array([[0, 1, 0, 2 * s], [-n, 0, c * s, 0], [0, 0, 0, -1], [1 / (1 - nu) / s, 0, n, 0]])


def propagator(solid, x, shear):
    """exp(A x) of the state (2 G k u, 2 G k w, sigma_z, tau) over a depth x/k; z down, u ~ sin kx, w ~ cos kx.

    Equilibrium and Hooke's law in the plane of the wave make A; its eigenvalues are +1 and -1, twice each.
    """
    a = state_matrix(solid, shear)
    x = x[:, None, None]
    up, down = 0.5 * np.exp(0.0 * x), 0.5 * np.exp(-2.0 * x)  # both times exp(-x)
    cosh, sinh = up + down, up - down
    return (
        (cosh - 0.5 * x * sinh) * np.eye(4) + 0.5 * (3.0 * sinh - x * cosh) * a
        + 0.5 * x * sinh * (a @ a) + 0.5 * (x * cosh - sinh) * (a @ a @ a)
    )  # fmt: skip


def transfer(stack, base, thickness):
    """Return G(t), t = k ``thickness``, of layers (solid, depth) from the top down on a base (None: rigid)."""
    shear = stack[0][0].shear_modulus

    def response(t):
        k = np.atleast_1d(np.asarray(t, dtype=float)) / thickness
        z = np.zeros((len(k), 2, 2))
        if base is not None:
            m = propagator(base, np.array([60.0]), shear)[0]  # only growing states are left: they must vanish
            z[:] = -np.linalg.lstsq(m[:, :2], m[:, 2:], rcond=None)[0]
        for solid, depth in reversed(stack):
            e = propagator(solid, k * depth, shear)
            z = np.linalg.solve(e[:, :2, :2] - z @ e[:, 2:, :2], z @ e[:, 2:, 2:] - e[:, :2, 2:])
        return -z[:, 1, 0] / (2.0 * (1.0 - stack[0][0].poisson))

    return response


@pytest.mark.parametrize("nu", [0.48, 0.0, -0.6])
@pytest.mark.parametrize("base", [None, Elastic(30.0, 0.3)])
def test_transfer_matrices_of_one_layer_give_its_closed_form(nu, base):
    solid, t = Elastic(1.0, nu), np.geomspace(1e-2, 20.0, 40)
    assert transfer([(solid, 0.5)], base, 0.5)(t) == pytest.approx(LayerResponse(solid, base)(t), rel=1e-9)


@pytest.mark.parametrize(("nu", "base"), [(0.48, Elastic(1e3, 0.3)), (0.5, None), (0.3, Elastic(1e-2, 0.2))])
@pytest.mark.parametrize("unit", [0.3, 1.16, 20.0])
def test_a_layer_given_as_a_function_is_the_layer(nu, base, unit):
    """Whatever unit its argument is counted in."""
    layer = Layer(1.0, nu, 1.16)
    known = LayerResponse(layer, base)
    own = SurfaceResponse(1.0, nu, unit, lambda t: known(t / unit * 1.16))
    r = np.geomspace(0.01, 100.0, 60)
    ours, kernel = LayeredKernel(own), LayeredKernel(layer, base)
    assert ours.far_ratio == pytest.approx(kernel.far_ratio, abs=1e-5, rel=1e-4)
    assert ours.displacement(r) == pytest.approx(
        kernel.displacement(r), abs=1e-8 * abs(float(kernel.displacement(1.0)))
    )
    under = [uniform_square_displacement(*medium, 20.0, 1.0, [0.0, 30.0]) for medium in ((layer, base), (own, None))]
    assert under[1] == pytest.approx(under[0], abs=2e-8)  # 34 on a half-space
    a, b = solve(Problem(layer, PAIR, LOAD, base)).balls[0], solve(Problem(own, PAIR, LOAD)).balls[0]
    error = a.tangential_force_error + b.tangential_force_error
    assert b.tangential_force[0] == pytest.approx(a.tangential_force[0], rel=1e-6, abs=error)
    assert b.approach == pytest.approx(a.approach, rel=1e-7)


def test_a_response_of_one_is_the_half_space_and_may_have_a_negative_poisson_ratio():
    ball = (Ball((0.0, 0.0), 1.0, "paraboloid"),)
    own = SurfaceResponse(2.0, -0.7, 1.0, np.ones_like)
    found = solve(Problem(own, ball, Load("approach", (0.05,)))).balls[0]
    assert found.normal_force == pytest.approx(hertz_force(0.05, 1.0, own.contact_modulus), rel=1e-6)


def test_two_layers_by_transfer_matrices():
    """Of one material they are one layer; a skin as thick as the contact is wide stiffens, and differs from both."""
    soft, stiff, base = Elastic(1.0, 0.45), Elastic(8.0, 0.3), Elastic(50.0, 0.3)
    same = SurfaceResponse(1.0, 0.45, 0.4, transfer([(soft, 0.4), (soft, 0.8)], base, 0.4))
    found = solve(Problem(same, PAIR, LOAD)).balls[0]
    known = solve(Problem(Layer(1.0, 0.45, 1.2), PAIR, LOAD, base)).balls[0]
    assert found.tangential_force[0] == pytest.approx(known.tangential_force[0], rel=1e-6)

    skin = SurfaceResponse(8.0, 0.3, 0.1, transfer([(stiff, 0.1), (soft, 1.1)], base, 0.1))
    ball = solve(Problem(skin, PAIR, LOAD)).balls[0]
    below = solve(Problem(Layer(1.0, 0.45, 1.2), PAIR, LOAD, base)).balls[0]
    above = solve(Problem(Layer(8.0, 0.3, np.inf), PAIR, LOAD)).balls[0]
    assert above.approach < ball.approach < below.approach
    # far away all act as point loads on the same base
    assert LayeredKernel(skin).displacement(400.0) == pytest.approx(
        (1.0 - base.poisson**2) / (np.pi * base.young * 400.0), rel=1e-3
    )
    law = solve_point_load(Problem(skin, PAIR, LOAD)).balls[0]
    assert law.tangential_force[0] == pytest.approx(ball.tangential_force[0], abs=2.0 * law.tangential_force_error)


def stiffening(z):
    """Four times as stiff in the depth, within 0.3."""
    return Elastic(4.0 - 3.0 * np.exp(-z / 0.3), 0.4)


def graded(count):
    """A stack of layers, each with the modulus at its middle, thin at the top and growing with the depth."""
    edges = 0.02 * np.expm1(np.linspace(0.0, np.log(101.0), count + 1))  # to a depth of 2
    middles = 0.5 * (edges[1:] + edges[:-1])
    return [(stiffening(z), d) for z, d in zip(middles, np.diff(edges), strict=True)]


def test_a_stack_of_layers_tends_to_a_graded_medium():
    """Its response at k = 2 by Riccati's equation of the compliance, Z' = A_dd Z + A_dt - Z (A_td Z + A_tt)."""
    k, shear, base = 2.0, stiffening(0.0).shear_modulus, stiffening(50.0)

    def climbed(z, flat):
        a, compliance = k * state_matrix(stiffening(z), shear), flat.reshape(2, 2)
        right = a[:2, :2] @ compliance + a[:2, 2:] - compliance @ (a[2:, :2] @ compliance + a[2:, 2:])
        return right.ravel()

    m = propagator(base, np.array([60.0]), shear)[0]
    start = -np.linalg.lstsq(m[:, :2], m[:, 2:], rcond=None)[0]
    done = solve_ivp(climbed, (2.0, 0.0), start.ravel(), rtol=1e-10, atol=1e-12)
    exact = -done.y[:, -1].reshape(2, 2)[1, 0] / (2.0 * (1.0 - 0.4))
    # a response is relative to the modulus of its own skin
    errors = [
        abs(transfer(stack, base, 1.0)(k)[0] / stack[0][0].young / exact - 1.0) for stack in map(graded, (8, 16, 32))
    ]
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.2)
    assert errors[2] < 1e-3
    forces = []
    for count in (16, 32):
        stack = graded(count)
        skin = SurfaceResponse(stack[0][0].young, 0.4, stack[0][1], transfer(stack, base, stack[0][1]))
        forces.append(solve(Problem(skin, PAIR, Load("force", (0.02, 0.02))), 1e-3).balls[0])
    assert forces[0].approach == pytest.approx(forces[1].approach, rel=5e-3)
    assert forces[0].tangential_force[0] == pytest.approx(forces[1].tangential_force[0], rel=2e-2)


def test_an_auxetic_layer_on_a_rigid_base_has_the_thin_limit():
    """Winkler's stiffness (1 - nu) E/((1 + nu)(1 - 2 nu) h): Q = pi k R D^2 [Johnson 1985, section 5.8]."""
    nu, h, depth = -0.5, 1e-3, 1e-3
    own = SurfaceResponse(1.0, nu, h, transfer([(Elastic(1.0, nu), h)], None, h), far_ratio=0.0)
    found = solve(Problem(own, (Ball((0.0, 0.0), 1.0, "paraboloid"),), Load("approach", (depth,))), 1e-3).balls[0]
    stiffness = (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu)) / h
    # the edge's correction is of order h/a = 0.02
    assert found.normal_force == pytest.approx(np.pi * stiffness * depth**2, rel=0.05)


@pytest.mark.parametrize(
    ("response", "words"),
    [
        (lambda t: 1.0 + 1.0 / (1.0 + t), "must tend to 1 exponentially"),
        (lambda t: 2.0 + 0.0 * t, "young and poisson must be those at the surface"),
        (
            lambda t: 1.0 - 2.0 * np.exp(-t),
            r"got -0\.003\d* at 0\.69: not positive at \d+ of \d+ arguments between 1e-06 and 0\.69$",
        ),
        (lambda t: 1.0, r"an array of shape"),
        (
            lambda t: np.where(t < 3.0, 0.8 * np.tanh(t), 1.0),
            r"must be continuous, got 0\.796044 below and 1 above 3;",
        ),
    ],
)
def test_what_is_no_response_of_a_surface_is_refused(response, words):
    with pytest.raises(InvalidProblem, match=words):
        LayeredKernel(SurfaceResponse(1.0, 0.3, 1.0, response))


@pytest.mark.parametrize("step", [0.01, 5.0])
def test_a_large_jump_is_named_where_it_is(step):
    with pytest.raises(InvalidProblem, match=f"got {step:g} below and 1 above 3;"):
        LayeredKernel(SurfaceResponse(1.0, 0.3, 1.0, lambda t: np.where(t < 3.0, step, 1.0)))


@pytest.mark.parametrize(("count", "off"), [(1001, 1e-4), (10001, 1e-5)])
def test_kinks_of_a_table_are_no_jumps(count, off):
    t = np.linspace(0.0, 20.0, count)
    exact = LayerResponse(Elastic(1.0, 0.5), None)
    table, leading = exact(t), exact(0.03) / 0.03**3

    def interpolated(asked):  # linear, and the series' leading term at small arguments
        return np.where(asked < 0.03, leading * asked**3, np.interp(asked, t, table))

    balls = tuple(Ball((x, 0.0), 1.0) for x in (-1.0, 1.0))
    forces = [
        solve(Problem(layer, balls, Load("force", (2.67e-3, 2.67e-3)))).balls[0].tangential_force[0]
        for layer in (SurfaceResponse(1.0, 0.5, 1.0, interpolated), Layer(1.0, 0.5, 1.0))
    ]
    assert forces[0] == pytest.approx(forces[1], rel=off)


def test_a_response_lost_in_roundoff_gets_its_arguments_and_a_remedy():
    def lost(t):
        return np.tanh(t) ** 3 - 1e-15

    with pytest.raises(
        InvalidProblem, match=r"between 1e-06 and .*e-06; .* series, or take a Poisson's ratio of 0\.4999"
    ):
        LayeredKernel(SurfaceResponse(1.0, 0.5, 1.0, lost))


@pytest.mark.parametrize("stated", [2.0, 0.3, 1e-3])
def test_a_far_ratio_above_a_response_that_falls_to_0_is_refused(stated):
    with pytest.raises(
        InvalidProblem, match=r"layer\.far_ratio: must be the limit of the response at 0, which falls to"
    ):
        LayeredKernel(SurfaceResponse(1.0, 0.3, 1.0, lambda t: np.tanh(t) ** 2, far_ratio=stated))


def test_contradictions_and_other_models_are_refused():
    own = SurfaceResponse(1.0, 0.3, 1.0, np.ones_like)
    with pytest.raises(InvalidProblem, match=r"finite_strain: needs a layer of a material"):
        Problem(own, PAIR, LOAD, finite_strain=FiniteStrain())
    with pytest.raises(InvalidProblem, match=r"substrate: is part of the response"):
        Problem(own, PAIR, LOAD, Elastic(1.0, 0.3))
    with pytest.raises(InvalidProblem, match=r"layer\.poisson: must lie between -1 and 0\.5, got -1\.2"):
        Problem(dataclasses.replace(own, poisson=-1.2), PAIR, LOAD)
    with pytest.raises(InvalidProblem, match=r"layer\.poisson: must lie between 0 and 0\.5, got -0\.2"):
        Problem(Layer(1.0, -0.2, 1.0), PAIR, LOAD)
    known = LayerResponse(Elastic(1.0, 0.3), Elastic(10.0, 0.3))
    with pytest.raises(InvalidProblem, match=r"layer\.far_ratio: must be the limit of the response at 0"):
        LayeredKernel(SurfaceResponse(1.0, 0.3, 1.0, known, far_ratio=0.5))


def test_finite_elements_refuse_media_without_materials_and_bodies_that_are_cut():
    own = Problem(SurfaceResponse(1.0, 0.3, 1.0, np.ones_like), PAIR, LOAD)
    with pytest.raises(UnsupportedProblem, match=r"layer: small_strain needs a material, .* use linear_bem"):
        finite_strain.plan(own, model="small_strain")
    caps = tuple(dataclasses.replace(ball, asperity=True) for ball in PAIR)
    with pytest.raises(UnsupportedProblem, match=r"balls: small_strain needs whole bodies, .* use linear_bem"):
        finite_strain.plan(Problem(Layer(1.0, 0.3, 1.0), caps, LOAD), model="small_strain")
