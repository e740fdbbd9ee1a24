"""Integrals over a model's state (energies, forces): parts of two compiled forms, over cells and top facets.

One form per part would take the compiler several times as long. All parts of a form are evaluated together, so no
part may be infinite when another one is requested.
"""

from collections.abc import Callable, Mapping
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from finite_strain.contact.contact_energy import Contact
from finite_strain.discretisation.regions import constant

Density = Callable[[Any, Any], Any]


class Readings:
    """Integrals by name, ``inside`` the solid and on the ``surface``, there for balls weighted by `Contact.choose`.

    Those inside are densities, functions of energy and displacement gradient, which ``integral`` integrates together:
    the form compiler compares equal expressions of two integrals as trees, which takes many minutes for sums over
    principal stretches. The caller compiles ``forms`` into ``compiled``.
    """

    def __init__(
        self, contact: Contact, integral: Callable[[Density], Any], inside: Mapping[str, Density],
        surface: Mapping[str, Any],
    ) -> None:  # fmt: skip
        self.contact, self.comm = contact, contact.mesh.comm
        self._switches = [{name: constant(contact.mesh, 0.0) for name in parts} for parts in (inside, surface)]
        within, above = self._switches
        self.forms = [
            integral(lambda psi, gradient: sum(within[name] * part(psi, gradient) for name, part in inside.items())),
            # a sum would search all terms so far for constants, again and again
            ufl.Form([above[name] * term for name, part in surface.items() for term in part.integrals()]),
        ]
        self.compiled: list[Any] = []

    def _own(self, names: tuple[str, ...]) -> float:
        total = 0.0
        for form, switches in zip(self.compiled, self._switches, strict=True):
            if switches.keys() & names:
                for name, switch in switches.items():
                    switch.value = float(name in names)
                total += float(dolfinx.fem.assemble_scalar(form))
        return total

    def __call__(self, *names: str) -> float:
        """Return the sum of parts (collective)."""
        return float(self.comm.allreduce(self._own(names), op=MPI.SUM))

    def per_ball(self, *names: str) -> np.ndarray:
        """Return parts (balls, names) of whole balls (collective)."""
        values = np.zeros((len(self.contact.balls), len(names)))
        for number, ball in enumerate(self.contact.balls):
            self.contact.choose(np.eye(len(values))[number])
            values[number] = [ball.copies * self._own((name,)) for name in names]
        return np.asarray(self.comm.allreduce(values, op=MPI.SUM))

    def mean_gaps(self) -> np.ndarray:
        """Return the pressure-weighted mean gap [m] under each ball (balls,); zero without pressure (collective)."""
        moment, force = self.per_ball("moment", "weight").T
        return np.divide(moment, force, out=np.zeros_like(moment), where=force > 0.0)
