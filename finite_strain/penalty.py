"""How stiff the penalty of each contact is: a fixed multiple of what the layer itself has over one element.

Each facet has its own: under a deep ball the finest elements, about its axis, fold where one fits the mean size.
With a softer penalty deep balls slip off the layer, and the multipliers that make up for it wrinkle the surface;
with a stiffer one the pressure rattles from point to point and Newton's method cycles.
"""

from __future__ import annotations

import numpy as np

from finite_strain.model import Model
from linear_bem.closed_forms import indentation_of_layer
from linear_bem.problem import Problem

PENALTY = 8.0
"""Penalty times element size over the contact's own mean stiffness times its radius.

Where contacts are eight elements wide, an augmentation divides the penetration by about 30.
"""
FEWEST_ELEMENTS = 2.5
"""Elements per contact radius that the penalty is fitted to where the mesh has fewer."""


class Penalties:
    """Gives the penalty of each ball of a model at an approach, facet by facet; continuous in the approach."""

    def __init__(self, problem: Problem, model: Model) -> None:
        self._problem = problem
        self._radii = [ball.radius for ball in model.reduction.balls]
        self._contacts = model.contacts

    def at(self, ball: int, approach: float) -> np.ndarray:
        """Return the penalty (facets, 1) [Pa/m] of this rank's facets under a ball at an approach [m] > 0."""
        layer, substrate = self._problem.layer, self._problem.substrate
        alone = indentation_of_layer(layer, substrate, self._radii[ball], approach=approach)
        # with 3/4 it is the contact modulus over the contact radius on a half-space
        stiffness = 0.75 * alone.normal_force / (alone.approach * alone.contact_radius**2)
        # facets are triangles of about half the element size squared
        across = alone.contact_radius / np.sqrt(2.0 * self._contacts[ball].surface.weights.sum(axis=1))
        return np.asarray(PENALTY * stiffness * np.maximum(across, FEWEST_ELEMENTS)[:, None])
