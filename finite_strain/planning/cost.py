"""Processor time and memory of a run before it starts, by powers of its unknowns.

All constants are fitted to what ``python -m runs.studies.scaling.plan_calibration`` prints: one process, meshes of 2 to
39 thousand unknowns, forms compiled before (the first run of its kind takes half a minute more). A solution by factors
costs about n^1.5 there and keeps about n^1.28: assembly and the elements' data grow as n, factors by nested dissection
as n^2 and n^(4/3).
"""

from dataclasses import dataclass

UNIT = 1e4
"""Unknowns that the constants refer to."""
STEP_SECONDS, STEP_POWER = 0.88, 1.5
"""An answered load step with order 3, which the coarser mesh's state predicts, without its pair."""
SEARCH_SECONDS = 2.3
"""A load step of the path finder, order 2, which finds the contact's edge by more iterations."""
START_SECONDS, MESH_SECONDS = 1.4, 0.25
"""Start of a run; mesh, spaces and output of each mesh, as the unknowns."""
BASE_BYTES, PAIRED_BYTES, MEMORY_POWER = 2.5e8, 2.37e8, 1.28
"""A process with its libraries; matrix, factors and elements' data of both models with order 3."""
ALONE = 0.48
"""Memory of small strain, which has no pair, over that of two models."""
ALONE_SECONDS = 0.5
"""A load step at small strain over one at finite strain: the bulk's tangent is constant (two scenes: 0.42, 0.54)."""
MIXED_SECONDS = 1.3
"""A load step with displacements and pressures over one with as many unknowns that are displacements alone."""
KRYLOV_SECONDS, KRYLOV_BYTES = 5.5, 1.85e8
"""An answered step and its pair, and the memory of both, by multigrid, above the range of the factors; as n.

A step takes 3.5 tangents of 9 Krylov iterations each (a whole run of 38 thousand unknowns); the pair is counted with 3.
With the cost of tangents and iterations by `thirdbody study scaling` that makes 5.3 s at 91 and 5.8 s at 462 thousand
unknowns. Whole runs kept 17.5 and 19 kB per unknown, with 38 thousand and 1.2 million unknowns."""
SPEEDUP = 1.6
"""Speed of two ranks over that of one: 1.3 to 2 by ``thirdbody study scaling``, on 51 thousand unknowns."""


@dataclass(frozen=True)
class Mesh:
    """A mesh of a run: unknowns, element order (2: path finder), number of load steps, of pairs, kind of solver.

    ``direct``: by factors; ``mixed``: elements with pressures.
    """

    unknowns: float
    order: int
    steps: int
    pairs: int
    direct: bool
    mixed: bool = False

    @property
    def seconds(self) -> float:
        """Processor time on one process."""
        share = self.unknowns / UNIT
        if not self.direct:
            return (self.steps + self.pairs) * 0.5 * KRYLOV_SECONDS * share
        each = SEARCH_SECONDS if self.order == 2 else STEP_SECONDS * self.order / 3.0
        steps = self.steps + self.pairs if self.pairs else ALONE_SECONDS * self.steps
        return MESH_SECONDS * share + (MIXED_SECONDS if self.mixed else 1.0) * steps * each * share**STEP_POWER

    def memory_bytes(self, ranks: int) -> float:
        """Return the memory of all processes."""
        share = self.unknowns / UNIT
        own = (1.0 if self.pairs else ALONE) * PAIRED_BYTES * share**MEMORY_POWER * (self.order / 3.0) ** MEMORY_POWER
        return ranks * BASE_BYTES + (own if self.direct else KRYLOV_BYTES * share)
