"""The simulated part of a scene: the frame with the most mirror planes, its balls, and the map back to the scene."""

import cmath
import math
from dataclasses import KW_ONLY, dataclass
from itertools import combinations, product

import numpy as np
from scipy.spatial.distance import cdist

from finite_strain.geometry.estimates import body_of, reach_of
from finite_strain.geometry.load_control import prescribed
from linear_bem.indenter import Indenter
from linear_bem.problem import Ball, Problem

WIDEST = 2.0
"""Largest distance from the axis at which a round body without an edge may touch, over its radius or contact radius."""
_SAME = 1e-9
"""Relative tolerance within which positions and values count as mirror images."""
_MIRRORED = 1.0 - 2.0 * np.eye(2)
"""Signs of the coordinates of mirror images along each axis."""
_SAMPLES, _GOLDEN = np.arange(5000), math.pi * (3.0 - math.sqrt(5.0))
"""Numbers of the points where a body is compared with its mirror image, and the angle between two."""


@dataclass(frozen=True)
class ModelBall(Ball):
    """A ball of the reduced model, in the model's frame (see `Reduction`).

    ``copies`` is the factor from its contact force in the model to that of the whole ball (a ball on a symmetry
    plane is cut in half); ``fixed_axes`` are the in-plane axes along which its force vanishes; ``reach`` [m] is the
    horizontal distance from its axis at which it may touch.
    """

    shape: str | Indenter = "sphere"
    _: KW_ONLY
    index: int
    copies: int
    fixed_axes: tuple[int, ...]
    reach: float = math.inf


@dataclass(frozen=True)
class Image:
    """How a ball of the scene follows from a ball of the model: mirror signs of x and y."""

    model_ball: int
    signs: tuple[int, int]


@dataclass(frozen=True)
class Reduction:
    """The scene in the model's frame: turned by -``angle`` about ``origin``, cut at its mirror planes.

    ``planes`` holds the axes (0: the plane x = 0, 1: y = 0) about which the scene is symmetric; the
    model is the part with x >= 0 and y >= 0 respectively. ``images`` has one entry per ball of the scene.
    """

    origin: tuple[float, float]
    angle: float
    planes: tuple[int, ...]
    balls: tuple[ModelBall, ...]
    images: tuple[Image, ...]

    @property
    def turn(self) -> np.ndarray:
        """The rotation (3, 3) of the model's frame into the scene's axes."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    @property
    def mirrors(self) -> np.ndarray:
        """Normals (k, 3) of the mirror planes, which hold the origin, in the model's frame."""
        return np.eye(3)[list(self.planes)].reshape(-1, 3)

    def scene_vectors(self, vectors: np.ndarray) -> np.ndarray:
        """Return vectors (n, 3) of the model in the scene's frame."""
        return vectors @ self.turn.T

    def scene_points(self, points: np.ndarray) -> np.ndarray:
        """Return points (n, 3) [m] of the model in the scene's frame."""
        return self.scene_vectors(points) + np.array([*self.origin, 0.0])

    def scene_tensors(self, tensors: np.ndarray) -> np.ndarray:
        """Return tensors (n, 3, 3) of the model in the scene's frame."""
        return np.einsum("ik,nkl,jl->nij", self.turn, tensors, self.turn)

    def mirror_signs(self) -> list[np.ndarray]:
        """Return the signs (3,) of the model's coordinates in each of its mirror images, itself first."""
        signs = product(*((1.0, -1.0) if axis in self.planes else (1.0,) for axis in range(3)))
        return [np.array(each) for each in signs]

    def to_scene(self, ball: int, vector: tuple[float, float]) -> tuple[float, float]:
        """Return the in-plane vector of a ball of the scene from that of its model ball."""
        turned = complex(*np.multiply(self.images[ball].signs, vector)) * cmath.rect(1.0, self.angle)
        return turned.real, turned.imag

    def to_model(self, ball: int, vector: tuple[float, float]) -> tuple[float, float]:
        """Return the in-plane vector of the model's ball from that of a ball of the scene."""
        turned = complex(*vector) * cmath.rect(1.0, -self.angle)
        signs = self.images[ball].signs
        return signs[0] * turned.real, signs[1] * turned.imag


def reduce_scene(problem: Problem, planes: tuple[int, ...] | None = None) -> Reduction:
    """Find the frame with the most mirror planes, and the balls that remain in the cut scene.

    With ``planes``, the frame is the scene's own, cut at those of the ``planes`` that are mirror planes.
    """
    load, positions = prescribed(problem), problem.positions
    bodies = [
        (body_of(ball), reach_of(body_of(ball), alone.approach, WIDEST * max(ball.radius, alone.contact_radius)))
        for ball, alone in zip(problem.balls, load.expected(), strict=True)
    ]
    kinds = [(value, ball.radius, ball.shape) for value, ball in zip(load.values, problem.balls, strict=True)]
    alike = np.array([[one == other for other in kinds] for one in kinds])

    def mirrors(local: np.ndarray, angle: float, axes: tuple[int, ...]) -> tuple[int, ...]:
        near = _SAME * _size(problem, local)
        return tuple(
            axis
            for axis in axes
            if np.all(np.any(alike & (cdist(local * _MIRRORED[axis], local, "chebyshev") <= near), axis=1))
            and all(_is_even(body, reach, axis, angle) for body, reach in set(bodies))
        )

    reaches = [reach for _, reach in bodies]
    if planes is not None:
        return _cut(problem, reaches, 0.0, np.zeros(2), mirrors(positions, 0.0, planes), positions)
    angles = {0.0: 0.0}
    for a, b in combinations(positions[:12], 2):
        angle = math.remainder(math.atan2(b[1] - a[1], b[0] - a[0]), math.pi / 2)
        angles.setdefault(round(angle, 12), angle)

    def framed(angle: float) -> tuple[float, float, np.ndarray, tuple[int, ...], np.ndarray]:
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        local = positions @ turn.T
        centre = 0.5 * (local.min(axis=0) + local.max(axis=0))
        local = local - centre
        planes = mirrors(local, angle, (0, 1))
        score = len(planes) + (0.5 if np.ptp(local[:, 1]) <= _SAME * np.ptp(local) else 0.0)
        return score, angle, turn.T @ centre, planes, local

    _, angle, origin, planes, local = max(map(framed, angles.values()), key=lambda frame: frame[0])
    return _cut(problem, reaches, angle, origin, planes, local)


def _size(problem: Problem, local: np.ndarray) -> float:
    return max(float(np.ptp(local)), *(ball.radius for ball in problem.balls))


def _is_even(body: Indenter, reach: float, axis: int, angle: float) -> bool:
    """Return whether a body within its reach is its own mirror image along an axis of a frame turned by ``angle``."""
    # densest near the axis: a long body reaches far beyond the details of its contact
    spiral = reach * ((_SAMPLES + 0.5) / len(_SAMPLES)) ** 2 * np.exp(1j * _GOLDEN * _SAMPLES)
    image = spiral.conj() if axis == 1 else -spiral.conj()
    points = (where * cmath.rect(1.0, angle) for where in (spiral, image))
    with np.errstate(all="ignore"):  # nan where a body has no height
        here, there = (np.asarray(body.height(point.real, point.imag)) for point in points)
    return bool(np.allclose(here, there, rtol=1e-9, atol=1e-12 * reach, equal_nan=True))


def _cut(
    problem: Problem, reaches: list[float], angle: float, origin: np.ndarray, planes: tuple[int, ...],
    local: np.ndarray,
) -> Reduction:  # fmt: skip
    local = np.where(np.abs(local) <= _SAME * _size(problem, local), 0.0, local)
    balls: list[ModelBall] = []
    for index, (ball, position) in enumerate(zip(problem.balls, local, strict=True)):
        if all(position[axis] >= 0.0 for axis in planes):
            fixed = tuple(axis for axis in planes if position[axis] == 0.0)
            there = vars(ball) | {"position": tuple(map(float, position))}
            copies = 2 ** len(fixed)
            balls.append(ModelBall(**there, index=index, copies=copies, fixed_axes=fixed, reach=reaches[index]))
    images = []
    for position in local:
        signs = [-1 if axis in planes and position[axis] < 0.0 else 1 for axis in (0, 1)]
        nearest = cdist([signs * position], [ball.position for ball in balls]).argmin()
        images.append(Image(int(nearest), (signs[0], signs[1])))
    return Reduction((float(origin[0]), float(origin[1])), angle, planes, tuple(balls), tuple(images))
