"""The paper's pair of balls and other balls at finite strain, varied by the studies; dimensionless: R = E1 = 1."""

from collections.abc import Sequence

from linear_bem.problem import Ball, Elastic, FiniteStrain, Layer, Load, Problem

THIN, THICK = 1.16, 6.0
"""Thickness over R of the paper's separation case and of its attraction case."""
POISSON, STIFF = 0.48, Elastic(1e3, 0.3)
"""Poisson's ratio of the layer, and the substrate."""
PAPER_LOAD = 2.66666e-3
"""The paper's normal force on each ball, over E1 R^2."""


def pair(
    approach: float | Sequence[float], thickness: float = THIN, *, distance: float = 2.0, poisson: float = POISSON,
    substrate: Elastic | None = STIFF, shape: str = "sphere",
) -> Problem:  # fmt: skip
    """Return two balls ``distance`` apart at finite strain; a single approach applies to both."""
    balls = [Ball((side * distance / 2.0, 0.0), 1.0, shape) for side in (-1.0, 1.0)]
    return pressed(balls, approach, thickness, poisson, substrate)


def pressed(
    balls: Sequence[Ball], approach: float | Sequence[float], thickness: float = THIN, poisson: float = POISSON,
    substrate: Elastic | None = None,
) -> Problem:  # fmt: skip
    """Return balls at finite strain; a single approach applies to all, the base is rigid without a substrate."""
    depths = (approach,) * len(balls) if isinstance(approach, int | float) else tuple(approach)
    return Problem(Layer(1.0, poisson, thickness), tuple(balls), Load("approach", depths), substrate, FiniteStrain())


def as_seen_by(model: str, problem: Problem) -> Problem:
    """Return the problem that ``model`` can solve: without finite strain unless the model has it."""
    if model == "finite_strain":
        return problem
    return Problem(problem.layer, problem.balls, problem.load, problem.substrate)
