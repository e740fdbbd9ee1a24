"""The error budget of an answer: a few terms, each a function with its derivation.

The solver's term is the residual of Newton's method and the error of linear_bem. The terms are independent in origin;
the error of T is the root of the sum of their squares.
"""

from collections.abc import Sequence

import numpy as np

from finite_strain.planning.records import ContactState, Discretisation
from finite_strain.planning.run_plan import ENOUGH

TERMS = ("discretisation", "enforcement", "transfer", "solver")
"""Names of the rows of an array (terms, balls) of error terms in one unit."""
SLOWEST, FASTEST = 2.0, 6.0
"""Orders of convergence of the paired Q, D and T / Q^2 in the resolution, order of the elements times fineness.

Contact pressure falls to zero like a root at a contact's edge: u lies in H^s for s < 5/2, and functionals converge with
twice the order of the energy norm, 2 (s - 1) = 3. Raising the order converges twice as fast where lines of the mesh
follow the edge, as they nearly do [Babuska Suri 1987, doi 10.1051/m2an/1987210201991]. The error that remains after
pairing oscillates with the edge's position in its element; its amplitude falls more slowly, about as the square:
`python -m tests.finite_strain.bars` measures it.
"""

LOOSE, SHARE = 1e-7, 0.01
"""Residual norm of Newton's method over the largest normal force: at most, and as a share of the accepted error of T.
T then changes by less than a tenth of the residual (`tests/finite_strain/test_multipliers.py`)."""
FEW = {1: 2.0, 2: 1.27}
"""Factors on the largest of one or two changes: they oscillate along the load, and the largest of n independent ones is
below sin(pi/2 3^(-1/n)) of the amplitude at a third of all loads."""


def gain(fine: Discretisation, coarse: Discretisation, order: float = SLOWEST) -> float:
    """Return the factor on the change from one discretisation to a finer one that bounds the finer one's error.

    If refinement reduces an error by a factor q, it changes by 1 - q of itself, and q / (1 - q) of that change remains.
    The ratio of two successive changes is no estimate of q: either may be small by chance.
    """
    ratio = fine.resolution / coarse.resolution
    if ratio <= 1.0:
        return 1.0
    q = ratio**-order
    return q / (1.0 - q)


def transfer(now: np.ndarray, before: np.ndarray, fine: Discretisation, coarse: Discretisation) -> np.ndarray:
    """Return the uncertain part of the pair's correction (balls,), from those of the two discretisations.

    A correction oscillates with the position of the contact edge in its element and may be small by chance: its lower
    bound is that of the coarser discretisation reduced by convergence, the fastest if the element order rises.
    """
    ratio = fine.resolution / coarse.resolution
    left = ratio ** -(FASTEST if fine.order > coarse.order else SLOWEST)
    return np.maximum(now, left * before) if ratio > 1.0 else now


def discretisation(
    path: Sequence[np.ndarray], fine: Discretisation, coarse: Discretisation, known: Sequence[np.ndarray] = ()
) -> np.ndarray:
    """Return the error of a value (balls,) from its changes at the nearby loads, (balls,) or (balls, 2).

    A change vanishes by chance at some loads, so the largest counts, times `FEW` if there are one or two.

    ``known``, (2, balls) or (2, balls, 2), are the errors of the small-strain problem on the finer and on the coarser
    discretisation at the first loads of the path; fewer than `ENOUGH` do not count. The changes have two parts. Their
    mean over the loads comes from elements away from the contact's edge: deformation is small there, so it converges
    as the mean of the known errors does, at least like `SLOWEST` and at most like `FASTEST`. The rest oscillates with
    the edge's position in its element and converges slowly. The mean takes one degree of freedom: n loads count as
    n - 1 in `FEW`, also in the upper bound: the largest change, as if nothing were known of the mean.
    """
    changes, slowest = _vectors(path, 2), gain(fine, coarse)
    largest = slowest * _size(changes).max(axis=0)
    if len(known) < ENOUGH:
        return np.asarray(FEW.get(len(path), 1.0) * largest)
    few, mean = FEW.get(len(known) - 1, 1.0), changes[: len(known)].mean(axis=0)
    now, before = _vectors(known, 3).mean(axis=0)
    whole, moved = _size(now), _size(now - before)
    left = np.divide(whole, moved, out=np.full(whole.shape, slowest), where=moved > 0.0)
    left = np.clip(left, gain(fine, coarse, FASTEST), slowest)
    return np.minimum(few * largest, left * _size(mean) + few * slowest * _size(changes - mean).max(axis=0))


def remaining(path: Sequence[np.ndarray], known: Sequence[np.ndarray]) -> np.ndarray:
    """Return how much of the known errors of Q or D may remain after pairing (balls,); see `discretisation`.

    The pair removes as much of the errors as of their changes between the discretisations. At low Poisson's ratios
    this is little: the surface moves inwards, by (1 - 2 nu)(1 + nu) Q / (2 pi E r) on a half-space. So at finite strain
    other material points lie at the contact's edge than at small strain, and the two errors oscillate out of phase.
    """
    now, before = np.moveaxis(_vectors(known, 3), 1, 0)
    whole, part = _size(now - before).max(axis=0), _size(_vectors(path, 2)).max(axis=0)
    share = np.divide(part, whole, out=np.ones_like(whole), where=whole > part)
    return np.asarray(FEW.get(len(known), 1.0) * share * _size(now).max(axis=0))


def enforcement(
    own: ContactState, small: ContactState | None, weight: np.ndarray, augmented: bool = True
) -> np.ndarray:
    """Return the relative uncertainty of the approach from penetration of the contact (balls,).

    A mean penetration (weighted with the pressure) is equivalent to an approach that is smaller by as much. The
    small-strain pair corrects for its effect at small strain.

    Without multipliers (not ``augmented``) the penalty k stores int p^2 / 2k. Its derivative by the approach D,
    int (p/k) dp/dD, is missing in the force: the penetration is weighted with dp/dD. On a thin film this is largest
    at the pole, so the largest penetration is used, without a correction by the pair.
    """
    left = own.mean_gap if small is None else own.mean_gap - weight * small.mean_gap
    if not augmented:
        left = np.maximum(np.abs(left), own.penetration)
    return np.divide(np.abs(left), own.approach, out=np.zeros_like(left), where=own.approach > 0.0)


def residual(coarse: ContactState, known: np.ndarray | None, accuracy: float, least: float) -> float:
    """Return the residual norm over the largest normal force that T allows.

    T is that of a coarser discretisation or, if less, the ``known`` one of `linear_bem` (balls, 2): without the pair's
    correction the mesh hides a weak T. The smallest T counts, but no less than 1 % of the largest.
    """
    pulls = np.linalg.norm(coarse.tangential_force, axis=1)
    if known is not None:
        pulls = np.minimum(pulls, np.linalg.norm(known, axis=1))
    counts = max(pulls.min(), 0.01 * pulls.max()) / coarse.normal_force.max()
    return float(np.clip(SHARE * accuracy * counts, least, LOOSE))


def _vectors(values: Sequence[np.ndarray], axes: int) -> np.ndarray:
    """Return the array of the values, with one axis for components after this many axes."""
    array = np.array(values)
    return array.reshape(*array.shape[:axes], -1)


def _size(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(vectors, axis=-1))
