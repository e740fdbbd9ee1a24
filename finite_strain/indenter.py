"""Gap between a material point and a rigid ball, with first and second derivatives by the point's position.

Each function takes points (..., 3) relative to the ball's apex position at zero approach and the
approach D, and returns gap (...), gradient (..., 3) and Hessian (..., 3, 3). The contact pressure p
acts on the layer as p grad(gap).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

Gap = tuple[np.ndarray, np.ndarray, np.ndarray]


class Indenter(Protocol):
    """A rigid surface."""

    @property
    def reach(self) -> float:
        """Largest horizontal distance [m] of a touched point from the axis."""

    @property
    def deformed(self) -> bool:
        """Whether contact is met in the deformed configuration."""

    def gap(self, reference: np.ndarray, displacement: np.ndarray, approach: float) -> Gap:
        """Return gap [m], its gradient and its Hessian by the displacement."""

    def shift_gradient(self, reference: np.ndarray, displacement: np.ndarray, approach: float) -> np.ndarray:
        """Return the derivative (..., 2) of the gap by an in-plane shift of the material point."""


@dataclass(frozen=True)
class SphereInSpace:
    """The exact sphere in the deformed configuration: |x - c| - R, c = (0, 0, R - D)."""

    deformed: ClassVar[bool] = True
    radius: float

    @property
    def reach(self) -> float:
        """Largest horizontal distance [m] of a touched point from the axis."""
        return 1.5 * self.radius

    def gap(self, reference: np.ndarray, displacement: np.ndarray, approach: float) -> Gap:
        """Return the signed distance to the sphere and its derivatives."""
        offset = reference + displacement - np.array([0.0, 0.0, self.radius - approach])
        distance = np.linalg.norm(offset, axis=-1)
        normal = offset / distance[..., None]
        hessian = (np.eye(3) - normal[..., :, None] * normal[..., None, :]) / distance[..., None, None]
        return distance - self.radius, normal, hessian

    def shift_gradient(self, reference: np.ndarray, displacement: np.ndarray, approach: float) -> np.ndarray:
        """Return the in-plane part of the normal: shifting a point is displacing it."""
        return self.gap(reference, displacement, approach)[1][..., :2]


@dataclass(frozen=True)
class ParaboloidInSpace:
    """The paraboloid in the deformed configuration: r^2 / 2R - D - z, at the displaced point."""

    deformed: ClassVar[bool] = True
    radius: float

    @property
    def reach(self) -> float:
        """Largest horizontal distance [m] of a touched point from the axis."""
        return 2.5 * self.radius

    def gap(self, reference: np.ndarray, displacement: np.ndarray, approach: float) -> Gap:
        """Return the vertical distance to the paraboloid and its derivatives."""
        point = reference + displacement
        gradient = np.empty_like(point)
        gradient[..., :2] = point[..., :2] / self.radius
        gradient[..., 2] = -1.0
        hessian = np.zeros((*point.shape, 3))
        hessian[..., 0, 0] = hessian[..., 1, 1] = 1.0 / self.radius
        gap = np.sum(point[..., :2] ** 2, axis=-1) / (2.0 * self.radius) - approach - point[..., 2]
        return gap, gradient, hessian

    def shift_gradient(self, reference: np.ndarray, displacement: np.ndarray, approach: float) -> np.ndarray:
        """Return the slope of the paraboloid at the displaced point."""
        return self.gap(reference, displacement, approach)[1][..., :2]


@dataclass(frozen=True)
class LinearisedProfile:
    """Small-strain contact: the profile over the undeformed point minus the vertical displacement.

    The gap is f(X, Y) - D - u_z with f the paraboloid r^2 / 2R or the sphere R - sqrt(R^2 - r^2);
    pressure acts vertically, and an in-plane force arises only through the slope of f (the paper's eq. 13).
    """

    deformed: ClassVar[bool] = False
    radius: float
    shape: str

    @property
    def reach(self) -> float:
        """Largest horizontal distance [m] of a touched point from the axis."""
        return 0.999 * self.radius if self.shape == "sphere" else 2.5 * self.radius

    def gap(self, reference: np.ndarray, displacement: np.ndarray, approach: float) -> Gap:
        """Return the linearised gap; its Hessian vanishes."""
        profile, _ = self._profile(reference)
        gradient = np.zeros_like(displacement)
        gradient[..., 2] = -1.0
        return profile - approach - displacement[..., 2], gradient, np.zeros((*displacement.shape, 3))

    def shift_gradient(self, reference: np.ndarray, displacement: np.ndarray, approach: float) -> np.ndarray:
        """Return the slope of the profile at the undeformed point."""
        return self._profile(reference)[1]

    def _profile(self, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        plane = reference[..., :2]
        squared = np.sum(plane**2, axis=-1)
        if self.shape == "paraboloid":
            return squared / (2.0 * self.radius), plane / self.radius
        below = np.sqrt(np.maximum(self.radius**2 - squared, 1e-12 * self.radius**2))
        return self.radius - below, plane / below[..., None]
