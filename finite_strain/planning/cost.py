"""Estimates of processor time and memory of a run before it starts, as powers of its number of unknowns n.

Times are fitted to each mesh of 45 runs by one process, those of ``python -m tests.runs.plan_calibration``
and similar ones (2 to 45 thousand unknowns, 0.05 R to 0.4 R deep); they are met within a factor 1.7, whole runs within
1.45. Forms are assumed compiled (the first run of a kind takes half a minute more). Memory is that of the calibration's
cases: elements' data grow as n, factors by nested dissection as n^(4/3).
"""

import math
from dataclasses import dataclass

UNIT = 1e4
"""Number of unknowns to which the constants refer."""
SECONDS, ACROSS = {2: 0.82, 3: 0.74, 4: 1.1}, 50.0
"""Time [s] of a load step, or its pair, by order on `ACROSS` elements in the plane: it grows as n and as the fourth
root of these elements. Order 2 finds the contact's edge; the others begin with the state of the coarser mesh."""
DEPTH, DEEPEST = 0.85, 0.3
"""Growth of the logarithm of `SECONDS` with the approach over the radius, for each order beyond 2; approach over the
radius from which on it does not grow, by the runs of the study `strengthening`."""
START_SECONDS = 0.8
"""Time [s] to start a run."""
BASE_BYTES, PAIRED_BYTES, MEMORY_POWER = 2.5e8, 2.37e8, 1.28
"""Memory [bytes] of a process with libraries; of matrix, factors and elements of both models at order 3; its power."""
ALONE = 0.48
"""Memory of a small-strain run, which has no pair, over that of two models."""
ALONE_SECONDS = 0.85
"""Time of a small-strain load step over a finite-strain one: constant bulk tangent (three scenes: 0.83 to 1.13)."""
MIXED_SECONDS, STRETCHES_SECONDS, FORCE_SECONDS = 1.24, 1.5, 0.1
"""Factors on a load step's time: for displacements and pressures instead of equally many displacement unknowns; for a
law in principal stretches (cases ogden and approach of the calibration: 1.2 to 1.6); and, added to one, for each
unknown approach."""
KRYLOV_SECONDS, KRYLOV_BYTES = 5.5, 1.85e8
"""Time [s] of a step with results and its pair, and memory [bytes] of both, by multigrid; they grow as n.

A step takes 3.5 tangents of 9 Krylov iterations each (a whole run of 38 thousand unknowns); the pair is counted with 3.
With the cost of tangents and iterations by `thirdbody study scaling` that makes 5.3 s at 91 and 5.8 s at 462 thousand
unknowns. Whole runs kept 17.5 and 19 kB per unknown, with 38 thousand and 1.2 million unknowns."""
MIXED_KRYLOV_SECONDS, MIXED_KRYLOV_BYTES = 4.0, 2.0
"""Factors on both in the mixed form: steps of the thin pair at nu = 0.4999 took 51 s on 22 773 unknowns of order 3 and
123 s on 55 193 of order 4 (``PETSC_OPTIONS="-thirdbody_direct_up_to 0"``). `thirdbody study scaling`: 19 kB per
unknown of one model, where displacements take 9."""
GAIN, HALF_GAIN = 0.9, 11e3
"""Gain by the second of two ranks on large meshes, and the unknowns of a mesh with half of it. Measured speeds of two
ranks: 1.12 with 5 thousand unknowns, 1.74 with 17 (mixed form 1.36), 1.96 with 39; 1.3 to 2 with 51 (study scaling)."""


def speedup(unknowns: float, ranks: int) -> float:
    """Return the speed of some ranks on a mesh over that of one."""
    return float(ranks ** math.log2(1.0 + GAIN * unknowns**2 / (unknowns**2 + HALF_GAIN**2)))


@dataclass(frozen=True)
class Mesh:
    """A mesh of a run: unknowns, order (2: path finder), elements through the thickness, load steps, pairs, solver.

    ``direct``: by factors; ``free``: number of unknown approaches; ``depth``: largest approach over the radius.
    """

    unknowns: float
    order: int
    layers: int
    steps: int
    pairs: int
    direct: bool
    mixed: bool = False
    stretches: bool = False
    free: int = 0
    depth: float = 0.1

    @property
    def seconds(self) -> float:
        """Processor time [s] on one process."""
        share = self.unknowns / UNIT
        if not self.direct:
            each = KRYLOV_SECONDS * (MIXED_KRYLOV_SECONDS if self.mixed else 1.0) * share
            return (self.steps + self.pairs) * 0.5 * each
        p, depth = self.order, min(self.depth, DEEPEST)
        across = self.unknowns / (3.0 * p**2 * (p * self.layers + 1.0) * ACROSS)
        each = SECONDS[p] * share * across**0.25 * math.exp(DEPTH * (p - 2) * depth)
        steps = self.steps + self.pairs if self.pairs else ALONE_SECONDS * self.steps
        steps *= (MIXED_SECONDS if self.mixed else 1.0) * (STRETCHES_SECONDS if self.stretches else 1.0)
        return steps * (1.0 + FORCE_SECONDS * self.free) * each

    def memory_bytes(self, ranks: int) -> float:
        """Return the memory [bytes] of all processes."""
        share = self.unknowns / UNIT
        own = (1.0 if self.pairs else ALONE) * PAIRED_BYTES * share**MEMORY_POWER * (self.order / 3.0) ** MEMORY_POWER
        iterative = KRYLOV_BYTES * share * (MIXED_KRYLOV_BYTES if self.mixed else 1.0)
        return ranks * BASE_BYTES + (own if self.direct else iterative)
