"""Numerical parameters that studies and tests vary, besides the discretisation and the required accuracy."""

import math
from dataclasses import dataclass, fields
from numbers import Integral, Real
from typing import Any

from linear_bem.errors import InvalidProblem


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
        for field in fields(self):
            value: Any = getattr(self, field.name)
            values: Any = (value,)
            kind: Any = Integral if field.type in ("int", int) else Real
            what, least, most = "a number, not negative and finite", 0.0, math.inf
            if field.name == "more_loads":
                values = value if isinstance(value, tuple | list) else (None,)
                what, least, most = "a tuple of fractions of the load, below 1", math.ulp(0.0), 1.0
            elif kind is Integral:
                what = "a whole number, not negative"
            elif field.name in ("growth", "largest_step", "shortest_step"):
                what, least = "a number greater than 0 and finite", math.ulp(0.0)
            if not all(isinstance(v, kind) and least <= float(v) < most for v in values):
                faults.append(f"numerics.{field.name}: must be {what}, got {value!r}")
        if faults:
            raise InvalidProblem(*faults)


DEFAULT = Numerics()
