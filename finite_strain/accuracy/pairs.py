"""The small-strain problem on the same discretisation as control variate: its exact solution and error are known.

The errors due to mesh, contact enforcement and domain truncation are nearly the same in the small-strain and in the
finite-strain answer. `linear_bem` gives the exact small-strain solution; the small-strain error is subtracted:

    at given approach:  Q = Q_f (Q_l / Q_s)^c,  T / Q^2 = (T/Q^2)_f + c ((T/Q^2)_l - (T/Q^2)_s)
    at given force:     D = D_f + c (D_l - D_s),  T / Q^2 as above,
    contact areas and peak pressures of both:  A = A_f (A_l / A_s)^c,

f, s: finite and small strain on the discretisation, l: linear_bem. Differences of T / Q^2 are valid even where T passes
through zero. The weight c is 1 where T / Q^2 of the two problems is similar and falls to 0 where they differ strongly.
"""

from dataclasses import dataclass, replace

import numpy as np

from finite_strain.planning.records import ContactState, Row

ALIKE, UNLIKE = 1.0 / 3.0, 2.0 / 3.0
"""Difference of T / Q^2 between finite and small strain, over the larger of them: up to the first the weight is 1,
from the second on it is 0. Both are choices; the error budget covers their influence."""
UNSURE = 0.2
"""Largest fraction of the correction that always counts as uncertain. `python -m tests.finite_strain.pair_transfer`
measures it: up to D = 0.3 R at most 0.14, for T / Q^2 and for Q; on h = 6 R at D = R 0.24 for Q, and 1.3 for T / Q^2,
where the correction is no help and the change between discretisations has to cover the error."""
FIRST, SECOND = 0.15, 1.5
"""Growth of that fraction with the slope s of the surface, FIRST s + SECOND s^2: on a half-space s^2 = D / R. Largest
measured values: 0.001 at D = 1e-4 R, 0.003 at 1e-3 R, 0.005 at 0.01 R, 0.014 at 0.03 R, 0.08 at 0.1 R."""
MEASURED = {"contact_area": "area_transfer", "peak_pressure": "peak_transfer"}
"""Results that no other one follows from, and the names of the uncertain parts of their corrections."""


@dataclass(frozen=True, eq=False)
class LinearTruth:
    """The result of `linear_bem` for the balls of the model: Q [N], D [m] (balls,), T (balls, 2) and its error [N].

    Also ``contact_area`` [m^2] and ``peak_pressure`` [Pa] (balls,), with their errors.
    """

    normal_force: np.ndarray
    approach: np.ndarray
    tangential_force: np.ndarray
    error: np.ndarray
    contact_area: np.ndarray
    peak_pressure: np.ndarray
    contact_area_error: np.ndarray
    peak_pressure_error: np.ndarray


@dataclass(frozen=True, eq=False)
class Paired:
    """The answer of one discretisation (arrays per ball of the model).

    ``transfer`` (balls,) [1/N] is the uncertain part of the correction of T / Q^2; ``force_transfer`` (balls,) the
    same of Q or D, relative, as ``area_transfer`` and ``peak_transfer``; ``weight`` (balls,) is c. ``known`` (balls, 3)
    are the errors of T / Q^2 [1/N] and, relative, of Q or D at small strain; nan without a pair, and 0 of Q or D where
    only one of mesh and `linear_bem` has any.
    """

    normal_force: np.ndarray
    approach: np.ndarray
    per_squared_force: np.ndarray
    transfer: np.ndarray
    force_transfer: np.ndarray
    weight: np.ndarray
    contact_area: np.ndarray
    peak_pressure: np.ndarray
    area_transfer: np.ndarray
    peak_transfer: np.ndarray
    known: np.ndarray

    @property
    def tangential_force(self) -> np.ndarray:
        """T (balls, 2) [N]."""
        return self.per_squared_force * self.normal_force[:, None] ** 2


def unpaired(own: ContactState) -> Paired:
    """Return the uncorrected answer of the discretisation."""
    none, unknown = np.zeros(len(own.normal_force)), np.full((len(own.normal_force), 3), np.nan)
    forces, areas = (own.normal_force, own.approach, own.per_squared_force), (own.contact_area, own.peak_pressure)
    return Paired(*forces, none, none, none, *areas, none, own.peak_excess, unknown)


def unsure(slope: float) -> float:
    """Return the fraction of the correction that always counts as uncertain at this slope of the surface."""
    return min(FIRST * slope + SECOND * slope**2, UNSURE)


def paired(
    own: ContactState, small: ContactState, truth: LinearTruth, scale: np.ndarray, forces_given: bool, least: float
) -> Paired:
    """Return the answer for the finite-strain state ``own``.

    ``scale`` (balls,) [1/N] is the T / Q^2 below which T counts as near its zero. The uncertain part of the correction
    is the difference between applying it as a difference and as a ratio, or the fraction ``least`` of it.
    """
    linear = ratio(truth.tangential_force, truth.normal_force[:, None] ** 2)
    correction = linear - small.per_squared_force
    largest = np.maximum(
        np.maximum(_length(own.per_squared_force), _length(small.per_squared_force)), np.maximum(scale, 1e-300)
    )
    unlike = _length(own.per_squared_force - small.per_squared_force) / largest
    weight = np.clip((UNLIKE - unlike) / (UNLIKE - ALIKE), 0.0, 1.0)
    transfer = _length(correction) * np.clip(unlike / np.maximum(1.0 - unlike, 0.5), least, 1.0)
    parts = {"transfer": transfer, "weight": weight}
    parts["per_squared_force"] = own.per_squared_force + weight[:, None] * correction
    follows = "approach" if forces_given else "normal_force"
    off = ratio(getattr(small, follows), getattr(truth, follows)) - 1.0
    parts["known"] = np.column_stack([-correction, np.where(off > -1.0, off, 0.0)])
    for name, left in {follows: "force_transfer", **MEASURED}.items():
        known, own_value, small_value = (getattr(each, name) for each in (truth, own, small))
        factor = ratio(known, small_value, empty=1.0)
        apart = np.maximum(np.abs(ratio(own_value, small_value, empty=1.0) - 1.0), least)
        parts[name] = own_value + weight * (known - small_value) if name == "approach" else own_value * factor**weight
        parts[left] = np.abs(factor - 1.0) * apart
    return replace(unpaired(own), **parts)


def missed(fine: Row, truth: LinearTruth | None) -> tuple[np.ndarray, np.ndarray]:
    """Return Q and |T| (balls,) [N] of `linear_bem` where a ball presses in it, but in no model on the mesh."""
    small = fine.small or fine.own
    if truth is None:
        return np.zeros_like(small.normal_force), np.zeros_like(small.normal_force)
    untouched = (fine.own.normal_force <= 0.0) & (small.normal_force <= 0.0)
    return untouched * truth.normal_force, untouched * np.linalg.norm(truth.tangential_force, axis=1)


def pressed(now: Paired, before: Paired, name: str) -> np.ndarray:
    """Return a result (balls,), from the coarser discretisation for balls without load on the finer."""
    value = getattr(now, name)
    return np.where(now.normal_force > 0.0, value, getattr(before, name))


def ratio(part: np.ndarray, whole: np.ndarray, empty: float = 0.0) -> np.ndarray:
    """Return part over whole, ``empty`` where the whole is zero."""
    part, whole = np.broadcast_arrays(part, whole)
    return np.divide(part, whole, out=np.full(part.shape, empty), where=whole != 0.0)


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(vectors, axis=1))
