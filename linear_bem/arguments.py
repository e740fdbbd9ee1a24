"""What every solver requires of its arguments."""

from numbers import Integral, Real

from linear_bem.errors import InvalidProblem, UnsupportedProblem
from linear_bem.problem import Problem


def require_accuracy(accuracy: float) -> None:
    """Raise `InvalidProblem` for what is no relative accuracy of T."""
    if not (isinstance(accuracy, Real) and 0.0 < accuracy < 1.0):
        raise InvalidProblem(f"accuracy.tangential_force: must be a number between 0 and 1, got {accuracy!r}")


def require_problem(problem: object) -> None:
    """Raise `InvalidProblem` for what is no problem."""
    if not isinstance(problem, Problem):
        raise InvalidProblem(f"problem: must be a Problem, as solve(Problem(layer, balls, load)), got {problem!r:.80}")


def require_supported(problem: Problem) -> None:
    """Raise `InvalidProblem` for what is no problem, `UnsupportedProblem` for an effect that this model lacks."""
    require_problem(problem)
    if problem.finite_strain is not None:
        raise UnsupportedProblem(
            "linear_bem: the effect finite_strain is not part of this model; use finite_strain.solve, or set it to None"
        )


def require_sample(sample: int | None) -> None:
    """Raise `InvalidProblem` for what is no number of balls and not None."""
    if sample is not None and (isinstance(sample, bool) or not (isinstance(sample, Integral) and sample >= 1)):
        raise InvalidProblem(f"sample: must be a whole number of balls, 1 or more, or None, got {sample!r}")
