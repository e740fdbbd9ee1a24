"""Small-strain contact of rigid balls with a layered half-space: the boundary element model (numpy and scipy only).

>>> from linear_bem import Ball, Elastic, Layer, Load, Problem, solve
>>> pair = (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid"))
>>> scene = Problem(Layer(1.0, 0.48, 1.16), pair, Load("force", (2.66666e-3,) * 2), Elastic(1e3, 0.3))
>>> print(f"{solve(scene).balls[0].tangential_force[0]:.4e}")
-1.1613e-07
"""

from linear_bem.errors import InvalidProblem, NotConverged, ThirdBodyError, TooLarge, UnsupportedProblem
from linear_bem.grid.height_field import contact_area_curve, solve_height_field
from linear_bem.grid.height_field_contact import HeightFieldContact
from linear_bem.grid.topography import read_heights
from linear_bem.indenter import Cone, Ellipsoid, Indenter, Paraboloid, Punch, Sphere
from linear_bem.interaction_energy import elastic_energy, energy_force
from linear_bem.law import Gent, Hyperfoam, MooneyRivlin, NeoHookean, Ogden, Yeoh
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.layer.rectangle_load import deepest_bulge, uniform_square_displacement
from linear_bem.point_load import solve_point_load
from linear_bem.problem import Ball, Elastic, Elements, FiniteStrain, Layer, Load, Periodic, Problem, SurfaceResponse
from linear_bem.result import BallResult, Result
from linear_bem.sequence.contact_sequence import ContactSequence, SequenceState
from linear_bem.solution import Solution
from linear_bem.solver import solve, solve_contact
from linear_bem.stress import interior_displacement, stress, vertical_stress

__all__ = [
    "Ball",
    "BallResult",
    "Cone",
    "ContactSequence",
    "Elastic",
    "Elements",
    "Ellipsoid",
    "FiniteStrain",
    "Gent",
    "HeightFieldContact",
    "Hyperfoam",
    "Indenter",
    "InvalidProblem",
    "Layer",
    "LayeredKernel",
    "Load",
    "MooneyRivlin",
    "NeoHookean",
    "NotConverged",
    "Ogden",
    "Paraboloid",
    "Periodic",
    "Problem",
    "Punch",
    "Result",
    "SequenceState",
    "Solution",
    "Sphere",
    "SurfaceResponse",
    "ThirdBodyError",
    "TooLarge",
    "UnsupportedProblem",
    "Yeoh",
    "contact_area_curve",
    "deepest_bulge",
    "elastic_energy",
    "energy_force",
    "interior_displacement",
    "read_heights",
    "solve",
    "solve_contact",
    "solve_height_field",
    "solve_point_load",
    "stress",
    "uniform_square_displacement",
    "vertical_stress",
]
