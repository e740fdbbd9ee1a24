"""Finite or small strain: the strain energy per reference volume of a displacement gradient du_i/dX_J.

Its derivative by the gradient is the first Piola-Kirchhoff stress (at small strain: the stress).
"""

from dataclasses import dataclass, field
from typing import Any

import ufl

from finite_strain.mechanics.materials import ENERGIES
from finite_strain.mechanics.volumetric import Volumetric
from linear_bem.law import Energy, Law, NeoHookean


@dataclass(frozen=True)
class Finite:
    """Finite strain with a hyperelastic law or a user-defined energy psi(F): F = I + grad u."""

    law: Law | Energy = field(default_factory=NeoHookean)

    def energy_density(self, gradient: Any, shear: Any, volumetric: Volumetric, still: Any) -> Any:
        """Return the law's strain energy, nan where an element is inverted; ``still`` is the gradient's value."""
        if isinstance(self.law, Law):
            return ENERGIES[type(self.law)](self.law, gradient, shear, volumetric, still)
        return self.law(ufl.Identity(3) + gradient)

    def cauchy_stress(self, gradient: Any, stress: Any) -> Any:
        """Return the Cauchy stress P F^T / J [Pa]."""
        F = ufl.Identity(3) + gradient
        return stress * F.T / ufl.det(F)

    def surface_stretch(self, gradient: Any) -> Any:
        """Return the deformed over the undeformed area of a horizontal surface."""
        F = ufl.Identity(3) + gradient
        normal = ufl.cross(F[:, 0], F[:, 1])
        return ufl.sqrt(ufl.dot(normal, normal))


@dataclass(frozen=True)
class Small:
    """Small strain, linear isotropic elasticity: mu e:e + volumetric(tr e)."""

    def energy_density(self, gradient: Any, shear: Any, volumetric: Volumetric, still: Any) -> Any:
        """Return Hooke's strain energy of the symmetric gradient."""
        strain = ufl.sym(gradient)
        return shear * ufl.inner(strain, strain) + volumetric(ufl.tr(strain))

    def cauchy_stress(self, gradient: Any, stress: Any) -> Any:
        """Return the stress itself: at small strain the configurations coincide."""
        return stress

    def surface_stretch(self, gradient: Any) -> int:
        """Return 1, as the configurations coincide."""
        return 1


Kinematics = Finite | Small
