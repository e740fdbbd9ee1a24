import numpy as np
import pytest
from scipy.special import j1

from linear_bem import Elastic, Layer, LayeredKernel
from linear_bem.grid.periodic import PeriodicPatch
from linear_bem.layer.kernel import smooth_kernel
from linear_bem.layer.response import LayerResponse
from tests.linear_bem import brute_force

MATERIALS = {
    "paper": (0.48, Elastic(1e3, 0.3)),
    "rigid": (0.48, None),
    "incompressible on rigid": (0.5, None),
    "cork on rigid": (0.0, None),
    "hard layer": (0.3, Elastic(1e-2, 0.0)),
    "very soft layer": (0.5, Elastic(1e6, 0.0)),
    "very hard layer": (0.3, Elastic(1e-6, 0.3)),
}


@pytest.mark.parametrize("ratio", [1e-3, 0.3, 5.0, 1e3])
@pytest.mark.parametrize("t", [0.05, 0.7, 3.0])
def test_response_solves_the_layers_boundary_value_problem(ratio, t):
    layer, substrate = Elastic(1.0, 0.4), Elastic(1.0 / ratio, 0.2)
    six_conditions = brute_force.response(layer, substrate, np.array([t]))[0]
    assert LayerResponse(layer, substrate)(t) == pytest.approx(six_conditions, rel=1e-9)


def test_response_of_equal_materials_is_one():
    t = np.geomspace(1e-8, 50, 60)
    assert LayerResponse(Elastic(2.0, 0.3), Elastic(2.0, 0.3))(t) == pytest.approx(np.ones(60), abs=1e-14)


def test_response_tends_to_the_substrate_at_long_and_to_the_layer_at_short_waves():
    g = LayerResponse(Elastic(1.0, 0.48), Elastic(1e3, 0.3))
    compliance = (1 - 0.3**2) / 1e3 / (1 - 0.48**2)
    assert g(1e-9) == pytest.approx(compliance, rel=1e-5)
    assert g.at_zero == pytest.approx(compliance, rel=1e-13)
    assert g(40.0) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("nu", [0.0, 0.006, 0.3, 0.48, 0.5])
def test_a_rigid_base_does_not_give_way_far_from_a_load_at_all(nu):
    assert LayerResponse(Elastic(1.0, nu), None).at_zero == 0.0
    kernel = LayeredKernel(Layer(1.0, nu, 1.0))
    oedometric = (1 + nu) * (1 - 2 * nu) / (1 - nu)
    patch = PeriodicPatch(kernel, (0.0, 0.0), 0.1, 8, 8, (0,))
    displacement = patch.displacement(np.full((8, 8), kernel.singular))
    assert displacement == pytest.approx(oedometric, rel=1e-8, abs=1e-8)


def test_response_of_a_rigid_base_has_the_thin_layers_stiffness():
    t = 1e-4
    nu = 0.3
    winkler = (1 + nu) * (1 - 2 * nu) / (1 - nu) / (2 * (1 - nu**2))
    assert LayerResponse(Elastic(1.0, nu), None)(t) / t == pytest.approx(winkler, rel=1e-3)
    # incompressible: w = p k^2 h^3 / (3 G) for long waves, so G = t^3 * 2 (1 + nu)/3 / (2 (1 - nu^2)) = 2/3 t^3
    assert LayerResponse(Elastic(1.0, 0.5), None)(1e-2) == pytest.approx(2.0 / 3.0 * 1e-6, rel=2e-3)


@pytest.mark.parametrize("name", MATERIALS)
def test_table_meets_the_quadrature(name):
    nu, substrate = MATERIALS[name]
    kernel = LayeredKernel(Layer(1.0, nu, 1.0), substrate)
    response = LayerResponse(Elastic(1.0, nu), substrate)
    rho = np.concatenate([[0.0, 1e-3], np.geomspace(0.03, 3e5, 90)])
    size = (1.0 + response.at_zero) / (1.0 + rho)
    assert np.max(np.abs(kernel.smooth(rho) - smooth_kernel(response, rho)) / size) < 1e-11


@pytest.mark.parametrize("name", ["paper", "incompressible on rigid", "hard layer"])
def test_slope_meets_its_own_transform(name):
    nu, substrate = MATERIALS[name]
    kernel = LayeredKernel(Layer(1.0, nu, 1.0), substrate)
    response = LayerResponse(Elastic(1.0, nu), substrate)
    x, w = np.polynomial.legendre.leggauss(12)
    edges = np.concatenate([2.0 ** np.arange(-30.0, -2.0), np.arange(0.25, 26.0, 0.25)])
    half = 0.5 * np.diff(edges)[:, None]
    t, w = (edges[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()
    for rho in (0.02, 0.4, 1.7, 6.0, 15.0):
        exact = -np.sum(w * t * (response(t) - 1.0) * j1(rho * t))
        assert kernel.smooth_slope(rho) == pytest.approx(exact, abs=1e-9 * (1 + response.at_zero) / (1 + rho) ** 2)


def test_far_field_is_the_substrates():
    kernel = LayeredKernel(Layer(1.0, 0.48, 0.01), Elastic(1e3, 0.3))
    r = 50.0
    assert kernel.displacement(r) == pytest.approx((1 - 0.3**2) / (np.pi * 1e3 * r), rel=1e-4)
    assert kernel.slope(r) == pytest.approx(-(1 - 0.3**2) / (np.pi * 1e3 * r**2), rel=1e-3)


def test_infinite_layer_and_equal_substrate_are_the_half_space():
    for kernel in (
        LayeredKernel(Layer(2.0, 0.3, np.inf), Elastic(1e3, 0.1)),
        LayeredKernel(Layer(2.0, 0.3, 0.5), Elastic(2.0, 0.3)),
    ):
        assert kernel.displacement(1.5) == pytest.approx((1 - 0.09) / (np.pi * 2.0 * 1.5), rel=1e-14)
