"""From the model's frame, turned and cut at the mirror planes, back to the scene's own coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finite_strain.geometry.symmetry import Reduction


@dataclass(frozen=True)
class SceneFrame:
    """``turn`` (3, 3) and ``origin`` (3,) [m] take a point x of the model to turn x + origin of the scene.

    ``mirrors`` are the model's mirror planes through the origin, as normals (k, 3) in the model's frame.
    """

    turn: np.ndarray
    origin: np.ndarray
    mirrors: np.ndarray

    @classmethod
    def of(cls, reduction: Reduction) -> SceneFrame:
        """Return the frame of a reduced scene."""
        c, s = np.cos(reduction.angle), np.sin(reduction.angle)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        mirrors = np.eye(3)[list(reduction.planes)].reshape(-1, 3)
        return cls(turn, np.array([*reduction.origin, 0.0]), mirrors)

    @property
    def scene_mirrors(self) -> np.ndarray:
        """Normals (k, 3) of the mirror planes in the scene's frame."""
        return self.mirrors @ self.turn.T

    def points(self, points: np.ndarray) -> np.ndarray:
        """Return points (n, 3) [m] in the scene's frame."""
        return points @ self.turn.T + self.origin

    def vectors(self, vectors: np.ndarray) -> np.ndarray:
        """Return vectors (n, 3) in the scene's frame."""
        return vectors @ self.turn.T

    def tensors(self, tensors: np.ndarray) -> np.ndarray:
        """Return tensors (n, 3, 3) in the scene's frame."""
        return np.einsum("ik,nkl,jl->nij", self.turn, tensors, self.turn)

    def mirror_signs(self) -> list[np.ndarray]:
        """Return the signs (3,) of the model's coordinates in each of its mirror images, itself first."""
        signs = [np.ones(3)]
        for normal in self.mirrors:
            signs += [known * (1.0 - 2.0 * normal) for known in signs]
        return signs
