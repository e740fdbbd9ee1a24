import pytest

from linear_bem import Ball, Elastic, Layer, Load, Problem

PAPER_LOAD = 2.66666e-3


@pytest.fixture
def paper_pair():
    """The paper's two balls in units R = 1, E1 = 1: thickness, distance and load may be changed."""

    def build(thickness=1.16, distance=2.0, load=None, **layer):
        solid = {"young": 1.0, "poisson": 0.48, **layer}
        balls = (Ball((-0.5 * distance, 0.0), 1.0, "paraboloid"), Ball((0.5 * distance, 0.0), 1.0, "paraboloid"))
        return Problem(
            Layer(solid["young"], solid["poisson"], thickness),
            balls,
            load or Load("force", (PAPER_LOAD, PAPER_LOAD)),
            Elastic(1e3, 0.3),
        )

    return build
