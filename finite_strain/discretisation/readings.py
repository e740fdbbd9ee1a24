"""Numbers by which a model's state is read, as the parts of one compiled form.

The compiler takes a form of its own for each part several times as long; a part that is switched off costs little.
"""

from collections.abc import Mapping
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI

from finite_strain.contact.contact_energy import Contact
from finite_strain.discretisation.regions import constant


class Readings:
    """The integrals ``parts`` by name, of the balls that the contact's `choose` weights; ``form`` is to be compiled."""

    def __init__(self, contact: Contact, parts: Mapping[str, Any]) -> None:
        self.contact, self.comm = contact, contact.mesh.comm
        self._switches = {name: constant(contact.mesh, 0.0) for name in parts}
        self.form = sum(self._switches[name] * part for name, part in parts.items())
        self.compiled: Any = None

    def _own(self, names: tuple[str, ...]) -> float:
        for name, switch in self._switches.items():
            switch.value = float(name in names)
        return float(dolfinx.fem.assemble_scalar(self.compiled))

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

    def contact_areas(self) -> np.ndarray:
        """Return the contact area (balls,) [m^2] of whole balls (collective)."""
        return self.per_ball("area")[:, 0]

    def mean_gaps(self) -> np.ndarray:
        """Return the gap [m] under each ball (balls,), weighted with the pressure; zero without (collective)."""
        moment, force = self.per_ball("moment", "weight").T
        return np.divide(moment, force, out=np.zeros_like(moment), where=force > 0.0)
