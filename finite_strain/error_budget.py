"""How far off an answer may be: a few terms, each a function with its derivation. No constant is calibrated.

discretisation   what the paired answer changed by since the coarser discretisation
enforcement      what the surface still penetrates the balls, as an approach that the ball lacks
transfer         what of the pair's correction (mesh, contact, model's end) may not carry over to finite strain
solver           residual of Newton's method, and the error of linear_bem

The terms are independent in origin; the error of T is the root of the sum of their squares.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from finite_strain.states import ContactState, Discretisation

ORDER = 2.0
"""Order of convergence in the element size that the change between two meshes is turned into an error with.

Contact pressure falls to zero like a root at an edge that no mesh line follows: u lies in H^s for s < 5/2, and
functionals such as Q, D and T converge with twice the order of the energy norm, 2 (s - 1) < 3. A lower one is cautious.
"""


@dataclass(frozen=True)
class Terms:
    """The terms of the error budget (balls,), in one unit."""

    discretisation: np.ndarray
    enforcement: np.ndarray
    transfer: np.ndarray
    solver: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """The root of the sum of squares."""
        return np.asarray(np.sqrt(sum(getattr(self, f.name) ** 2 for f in fields(self))))

    @staticmethod
    def names() -> list[str]:
        """Return the names of the terms."""
        return [f.name for f in fields(Terms)]

    def largest(self, ball: int) -> str:
        """Return the name of the largest term of a ball."""
        return max(self.names(), key=lambda name: float(getattr(self, name)[ball]))


def gain(fine: Discretisation, coarse: Discretisation) -> float:
    """Return what the change from one discretisation to a finer one is multiplied with to bound the finer one's error.

    On meshes of sizes h and r h an error c h^q changes by c h^q (r^q - 1). Between orders on one mesh the change itself
    is taken, which is nearly the coarser one's error.
    """
    ratio = fine.fineness / coarse.fineness
    return 1.0 if ratio <= 1.0 or fine.order > coarse.order else 1.0 / (ratio**ORDER - 1.0)


def discretisation(
    now: np.ndarray, before: np.ndarray, factor: float, path: list[np.ndarray], size: np.ndarray
) -> np.ndarray:
    """Return the error of values (balls, k) whose coarser values are ``before``, (balls,).

    Two meshes may agree by chance at one load step, so it is at least the median of the path's relative errors (each
    (balls,), of ``size``).
    """
    error = factor * np.linalg.norm(now - before, axis=1)
    if not path:
        return error
    relative = np.divide(error, size, out=np.zeros_like(error), where=size > 0.0)
    return np.maximum(error, np.median([*path, relative], axis=0) * size)


def enforcement(own: ContactState, small: ContactState | None, weight: np.ndarray) -> np.ndarray:
    """Return by what share of itself the approach is uncertain through the contact's penetration (balls,).

    A surface that penetrates by a mean (weighted with the pressure) is that of a ball which is pressed in less deep by
    as much. The pair takes off what it does at small strain.
    """
    left = own.mean_gap if small is None else own.mean_gap - weight * small.mean_gap
    return np.divide(np.abs(left), own.approach, out=np.zeros_like(left), where=own.approach > 0.0)


def exponent(now: np.ndarray, before: np.ndarray | None, ratio: float, usual: float) -> np.ndarray:
    """Return d ln(value) / d ln(D) (balls,) along the path, or the usual one where it does not tell."""
    if before is None or not ratio > 1.0:
        return np.full(len(now), usual)
    share = np.divide(now, before, out=np.ones_like(now), where=(before > 0.0) & (now > 0.0))
    return np.maximum(np.log(np.maximum(share, 1.0)) / np.log(ratio), usual)
