import numpy as np
import pytest

from linear_bem import Elastic, InvalidProblem, Layer
from linear_bem import closed_forms as cf

# F/F_Hertz and a^2/(R D) of a paraboloid on a bonded layer, from an independent Fredholm solution
FREDHOLM = {
    (0.5, 0.1): (1.1291, 1.0836),
    (0.5, 1.0): (5.1154, 1.9867),
    (0.5, 5.0): (173.7059, 3.1343),
    (0.48, 0.5): (2.0684, 1.5013),
    (0.48, 2.0): (13.1757, 2.2505),
    (0.48, 5.0): (57.1545, 2.4173),
    (0.3, 0.5): (1.7170, 1.3650),
    (0.3, 5.0): (14.3749, 1.9266),
}


@pytest.mark.parametrize("case", FREDHOLM)
def test_estimate_on_a_bonded_layer_keeps_its_stated_error(case):
    nu, chi = case
    ratio, area = FREDHOLM[case]
    layer, radius, approach = Layer(1.0, nu, 1.0), chi**2 * 1e4, 1e-4
    s = cf.indentation_of_layer(layer, None, radius, approach=approach)
    assert s.normal_force == pytest.approx(ratio * cf.hertz_force(approach, radius, layer.contact_modulus), rel=0.01)
    assert s.contact_radius == pytest.approx(np.sqrt(area * radius * approach), rel=0.06)


def test_estimate_meets_the_thin_and_the_thick_limits():
    nu = 0.3
    thin, thick = Layer(1.0, nu, 1e-3), Layer(1.0, nu, 1e4)
    s = cf.indentation_of_layer(thin, None, 1.0, approach=1e-3)
    assert s.normal_force == pytest.approx(cf.bonded_compressible_force(1e-3, 1.0, thin), rel=0.05)
    s = cf.indentation_of_layer(Layer(1.0, 0.5, 1e-3), None, 1.0, approach=1e-3)
    assert s.normal_force == pytest.approx(cf.bonded_incompressible_force(1e-3, 1.0, Layer(1, 0.5, 1e-3)), rel=0.05)
    for layer in (thick, Layer(1.0, nu, np.inf)):
        s = cf.indentation_of_layer(layer, Elastic(5.0, 0.1), 1.0, approach=1e-2)
        assert s.normal_force == pytest.approx(cf.hertz_force(1e-2, 1.0, layer.contact_modulus), rel=1e-3)
    film = cf.indentation_of_layer(Layer(1.0, nu, 1e-9), Elastic(5.0, 0.1), 1.0, approach=1e-2)
    none = cf.indentation_of_layer(Layer(1.0, nu, 0.0), Elastic(5.0, 0.1), 1.0, approach=1e-2)
    for s in (film, none):
        assert s.normal_force == pytest.approx(cf.hertz_force(1e-2, 1.0, Elastic(5.0, 0.1).contact_modulus), rel=1e-3)


def test_estimate_answers_the_same_from_approach_force_and_radius():
    layer, substrate = Layer(2e6, 0.45, 3e-3), Elastic(1e9, 0.3)
    s = cf.indentation_of_layer(layer, substrate, 8e-3, approach=2e-4)
    for given in ("normal_force", "contact_radius"):
        again = cf.indentation_of_layer(layer, substrate, 8e-3, **{given: getattr(s, given)})
        assert again.approach == pytest.approx(2e-4, rel=1e-9)
    with pytest.raises(InvalidProblem, match="exactly one"):
        cf.indentation_of_layer(layer, substrate, 8e-3)


def test_estimate_takes_whole_numbers_of_any_size():
    real = cf.indentation_of_layer(Layer(1.0, 0.3, 3.0), None, 1.0, approach=0.1)
    whole = cf.indentation_of_layer(Layer(1, 0.3, 3 * 10**7), None, 10**7, approach=10**6)  # h^3 is no 64-bit integer
    assert whole.normal_force / 1e14 == pytest.approx(real.normal_force, rel=1e-9)


def test_hertz_is_consistent():
    d, r, e = 1e-3, 0.02, 3e6
    q, a = cf.hertz_force(d, r, e), cf.hertz_contact_radius(d, r)
    assert cf.hertz_approach(q, r, e) == pytest.approx(d, rel=1e-14)
    assert cf.hertz_peak_pressure(q, a) == pytest.approx(2 * e / np.pi * np.sqrt(d / r), rel=1e-14)


def test_sneddon_sphere_tends_to_hertz_and_has_the_published_series():
    d, q = cf.sneddon_sphere(0.5, 1.0, 1.0)
    series = 1 - d / 10 - d**2 / 840 + 11 * d**3 / 15120 + 1357 * d**4 / 6652800
    assert q / cf.hertz_force(d, 1.0, 1.0) == pytest.approx(series, rel=1e-6)


def test_finite_strain_fits_meet_an_independent_finite_element_solution():
    # axisymmetric neo-Hookean finite elements, nu = 0.4999, D = 0.3 R
    e = 1.0 / 0.75
    hertz = cf.hertz_force(0.3, 1.0, e)
    assert cf.long_force(0.3, 1.0, Elastic(1.0, 0.5), 1.0) / hertz == pytest.approx(2.0773, rel=0.01)
    assert cf.long_force(0.3, 1.0, Elastic(1.0, 0.5), 2.0) / hertz == pytest.approx(1.3229, rel=0.01)
    with pytest.warns(UserWarning, match=r"R/h = 0\.1"):
        cf.long_force(0.01, 1.0, Elastic(1.0, 0.5), 10.0)
