"""One ball on a bonded layer against an independent Fredholm solution of the axisymmetric problem."""

import numpy as np
import pytest

from linear_bem import Ball, Layer, Load, Problem, solve
from linear_bem.closed_forms import hertz_force

# (nu, sqrt(R D)/h): force over Hertz's, a^2/(R D); five and four to five figures given
PARABOLOID = {
    (0.5, 0.1): (1.1291, 1.0836),
    (0.5, 1.0): (5.1154, 1.9867),
    (0.5, 2.0): (18.3687, 2.4863),
    (0.5, 5.0): (173.7059, 3.1343),
    (0.48, 1.0): (4.5370, 1.8998),
    (0.48, 5.0): (57.1545, 2.4173),
    (0.3, 0.5): (1.7170, 1.3650),
    (0.3, 5.0): (14.3749, 1.9266),
}
# D/R on a layer h = R, nu = 0.4999: force over the paraboloid's, a/R
SPHERE = {
    0.05: (1.3339, 0.2433),
    0.1: (1.5285, 0.3542),
    0.2: (1.8590, 0.5141),
    0.3: (2.1420, 0.6324),
    0.4: (2.3844, 0.7243),
    0.5: (2.5884, 0.7965),
}


@pytest.mark.parametrize("case", PARABOLOID)
def test_a_paraboloid_on_a_bonded_layer_meets_the_fredholm_solution(case):
    poisson, chi = case
    force, area = PARABOLOID[case]
    layer, radius, approach = Layer(1.0, poisson, 1.0), chi**2 * 1e4, 1e-4
    result = solve(Problem(layer, (Ball((0.0, 0.0), radius, "paraboloid"),), Load("approach", (approach,))))
    ball = result.balls[0]
    assert not result.solved.notes
    # the table's last digit, or the default accuracy of forces
    assert ball.normal_force / hertz_force(approach, radius, layer.contact_modulus) == pytest.approx(force, rel=1e-4)
    assert ball.contact_area / (np.pi * radius * approach) == pytest.approx(area, rel=4e-3)


@pytest.mark.parametrize("approach", SPHERE)
def test_a_sphere_on_a_bonded_layer_meets_the_fredholm_solution(approach):
    force, radius = SPHERE[approach]
    layer = Layer(1.0, 0.4999, 1.0)
    result = solve(Problem(layer, (Ball((0.0, 0.0), 1.0, "sphere"),), Load("approach", (approach,))))
    ball = result.balls[0]
    assert len(result.solved.notes) == (approach > 0.25)  # that strains are large
    assert ball.normal_force / hertz_force(approach, 1.0, layer.contact_modulus) == pytest.approx(force, rel=2e-4)
    assert np.sqrt(ball.contact_area / np.pi) == pytest.approx(radius, rel=3e-3)
