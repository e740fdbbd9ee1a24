"""How stiff the penalty of each contact is: a fixed multiple of what the layer itself has over one element.

With a softer one deep balls slip off the layer, and the multipliers that make up for it wrinkle the surface;
with a stiffer one the pressure rattles from point to point and Newton's method cycles.
"""

from __future__ import annotations

import math

import numpy as np
from mpi4py import MPI

from finite_strain.model import Model
from linear_bem.closed_forms import indentation_of_layer
from linear_bem.problem import Problem

PENALTY = 8.0
"""Penalty times element size over the contact's own mean stiffness times its radius.

Where contacts are eight elements wide, an augmentation divides the penetration by about 30.
"""
FEWEST_ELEMENTS = 2.5
"""Elements per contact radius that the penalty is fitted to where the mesh has fewer."""
_RADII = np.geomspace(1e-3, 3.0, 80)


class Penalties:
    """Gives the penalty of each ball of a model at an approach; continuous in the approach."""

    def __init__(self, problem: Problem, model: Model) -> None:
        self._problem = problem
        self._balls = model.reduction.balls
        local = [contact.facets_within(_RADII * contact.radius) for contact in model.contacts]
        self._facets = np.array(model.comm.allreduce(np.array(local), op=MPI.SUM))

    def at(self, ball: int, approach: float) -> float:
        """Return the penalty [Pa/m] of a model ball pressed in by an approach [m] > 0."""
        radius = self._balls[ball].radius
        alone = indentation_of_layer(self._problem.layer, self._problem.substrate, radius, approach=approach)
        # with 3/4 it is the contact modulus over the contact radius on a half-space
        stiffness = 0.75 * alone.normal_force / (alone.approach * alone.contact_radius**2)
        facets = self._balls[ball].copies * np.interp(alone.contact_radius / radius, _RADII, self._facets[ball])
        across = math.sqrt(facets / (2.0 * math.pi))  # triangles of half the element size squared
        return PENALTY * max(across, FEWEST_ELEMENTS) * stiffness
