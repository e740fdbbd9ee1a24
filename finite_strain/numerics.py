"""Numerical parameters that studies and tests vary, besides the discretisation and the required accuracy."""

import math
from dataclasses import dataclass
from numbers import Integral, Real

from linear_bem.errors import InvalidProblem

_RULES = {
    int: ("a whole number, not negative", lambda v: isinstance(v, Integral) and int(v) >= 0),
    float: ("a number greater than 0 and finite", lambda v: isinstance(v, Real) and 0.0 < float(v) < math.inf),
    tuple: (
        "a tuple of fractions of the load, below 1",
        lambda v: isinstance(v, tuple | list) and all(isinstance(f, Real) and 0.0 < float(f) < 1.0 for f in v),
    ),
}
"""By the type of a parameter's default: the words for a valid value, and their check."""


@dataclass(frozen=True)
class Numerics:
    """Numerical parameters on which a result should not depend; part of a run's key (without DOLFINx).

    Order, fineness, extent and penalty of a mesh are in `Discretisation`; PETSc's options control the linear solver.
    """

    contact_degree: int = 6
    """Degree of the facet quadrature beyond 2p, as the contact pressure has a kink inside a facet.
    A higher degree changes T by less than 0.1 % (`thirdbody study accuracy`)."""
    growth: float = 1.0
    """Growth of element sizes, less one, over that of `meshes.box`; 2 gives equal results (study `stability`)."""
    more_loads: tuple[float, ...] = (0.7, 0.85)
    """Additional load fractions at which discretisations are compared in a run with fewer than three answers: at a
    single load two meshes may agree by chance (`python -m tests.finite_strain.bars`)."""
    largest_step: float = 0.07
    """Largest increment of the approach over the radius; Newton's method converges, even from the undeformed layer.
    The answer does not depend on it (`thirdbody study accuracy`, and the whole load in one step in `stability`)."""
    shortest_step: float = 3e-3
    """Shortest load step over the goal, after eight halvings of a step that did not converge; then the path ends."""
    newton_iterations: int = 25
    """Largest number of Newton iterations per solve (usual: 4 to 7). ``-thirdbody_snes_max_it N`` takes precedence."""
    lagged_iterations: int = 20
    """Krylov iterations in one system from which on the next system gets a new tangent.
    At order 3 (4), a tangent and its factors take the time of 40 (90) iterations."""
    krylov_iterations: int = 40
    """Largest number of Krylov iterations per system; with an earlier tangent, the unconverged result is then used."""

    def __post_init__(self) -> None:
        faults = []
        for name, value in vars(self).items():
            what, holds = _RULES[type(getattr(Numerics, name))]
            if not holds(value):
                faults.append(f"numerics.{name}: must be {what}, got {value!r}")
        if faults:
            raise InvalidProblem(*faults)


DEFAULT = Numerics()
