"""The contact library as its users call it: own strain energy, own indenter, own solver options, functions back."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any

import ufl
from mpi4py import MPI

import finite_strain
from linear_bem import Ball, FiniteStrain, Indenter, Layer, Load, Problem

layer = Layer(young=1.0, poisson=0.3, thickness=1.16)


def psi(F: Any) -> Any:
    """A neo-Hookean solid, as a textbook has it."""
    J, mu = ufl.det(F), layer.shear_modulus
    return mu / 2 * (ufl.tr(F.T * F) - 3) - mu * ufl.ln(J) + layer.lame_first / 2 * (J - 1) ** 2


@dataclass(frozen=True)
class Bowl(Indenter):
    """A paraboloid with its height as an expression."""

    apex_radius = 1.0

    def height(self, x: Any, y: Any) -> Any:
        return (x**2 + y**2) / 2


balls = tuple(Ball((x, 0.0), shape=Bowl()) for x in (-1.0, 1.0))
problem = Problem(layer, balls, Load("approach", (0.1, 0.1)), finite_strain=FiniteStrain(psi))
deepest = []


def inspect(step: Any, functions: dict[str, Any]) -> None:
    deepest.append(MPI.COMM_WORLD.allreduce(float(functions["displacement"].x.array.min()), MPI.MIN))


coarse: dict[str, Any] = {"accuracy": 0.3, "numerics": finite_strain.Numerics(growth=4.0, more_loads=())}
own = finite_strain.solve(problem, solver_options={"pc_type": "lu"}, inspect=inspect, **coarse)
paraboloids = tuple(Ball(ball.position, 1.0, "paraboloid") for ball in balls)
named = finite_strain.solve(replace(problem, balls=paraboloids, finite_strain=FiniteStrain()), **coarse)
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps({"own": own.to_dict(), "named": named.to_dict(), "deepest": deepest}))
