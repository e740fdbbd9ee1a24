"""Which part of a scene is simulated: mirror symmetries, the box to be meshed, and what it costs.

No DOLFINx here: `thirdbody plan` answers from this file on any machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from finite_strain.extent import Extent, choose_extent
from linear_bem.closed_forms import indentation_of_layer
from linear_bem.errors import UnsupportedProblem
from linear_bem.problem import Ball, Problem
from meshes.box import Box, Zone

LEAST_SHARE = 0.1
"""Part of the deepest approach below which a ball's own approach no longer sets mesh size and penalty."""
USUAL_ACCURACY = 0.02
"""Relative accuracy of T that a box's extent is chosen for where none is given."""
FAR_CONTACTS, FAR_NEIGHBOURS = 4.0, 1.5
"""Contact radii, and distances of the nearest neighbour, beyond which elements grow faster: fields are smooth there."""
FAR_GROWTH = 2.0
"""How much faster."""
_SAME = 1e-9
"""Relative tolerance within which positions and values count as mirror images."""


@dataclass(frozen=True)
class ModelBall:
    """A ball of the reduced model, in the model's frame (see `Reduction`).

    ``copies`` is by how much its contact force in the model must be multiplied (a ball on a symmetry
    plane is cut in half); ``fixed_axes`` are the in-plane axes along which its force vanishes.
    """

    index: int
    position: tuple[float, float]
    radius: float
    shape: str
    copies: int
    fixed_axes: tuple[int, ...]


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

    def to_scene(self, ball: int, vector: tuple[float, float]) -> tuple[float, float]:
        """Return an in-plane vector of the scene's ball from that of its model ball."""
        x, y = (s * v for s, v in zip(self.images[ball].signs, vector, strict=True))
        c, s = math.cos(self.angle), math.sin(self.angle)
        return (c * x - s * y, s * x + c * y)

    def neighbours(self) -> list[list[tuple[float, float]]]:
        """Return for each model ball the positions of all other balls of the scene, in the model's frame."""
        everyone = [
            tuple(s * c for s, c in zip(image.signs, self.balls[image.model_ball].position, strict=True))
            for image in self.images
        ]
        return [[p for p in everyone if math.dist(p, ball.position) > _SAME * ball.radius] for ball in self.balls]  # type: ignore[misc]


def reduce_scene(problem: Problem) -> Reduction:
    """Find the frame with the most mirror planes, and the balls that remain in the cut scene."""
    values = problem.load.values if problem.load.kind != "total_force" else (0.0,) * problem.size
    positions = np.array([ball.position for ball in problem.balls])
    angles = [0.0]
    for a, b in combinations(positions[: min(len(positions), 12)], 2):
        angles.append(math.remainder(math.atan2(b[1] - a[1], b[0] - a[0]), math.pi / 2))
    best: tuple[float, float, np.ndarray, tuple[int, ...], np.ndarray] | None = None
    for angle in angles:
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        local = positions @ turn.T
        centre = 0.5 * (local.min(axis=0) + local.max(axis=0))
        local = local - centre
        planes = tuple(axis for axis in (0, 1) if _is_mirror(problem, values, local, axis))
        score = len(planes) + (0.5 if np.ptp(local[:, 1]) <= _SAME * np.ptp(local) else 0.0)
        if best is None or score > best[0]:
            best = (score, angle, turn.T @ centre, planes, local)
    assert best is not None  # the angle 0 always counts
    _, angle, origin, planes, local = best
    return _cut(problem, angle, origin, planes, local)


def _is_mirror(problem: Problem, values: tuple[float, ...], local: np.ndarray, axis: int) -> bool:
    size = max(float(np.ptp(local)), *(ball.radius for ball in problem.balls))
    for ball, value, position in zip(problem.balls, values, local, strict=True):
        image = position.copy()
        image[axis] *= -1.0
        partners = [
            other
            for other, v, p in zip(problem.balls, values, local, strict=True)
            if np.max(np.abs(p - image)) <= _SAME * size and v == value and other.radius == ball.radius
        ]
        if not any(other.shape == ball.shape for other in partners):
            return False
    return True


def _cut(problem: Problem, angle: float, origin: np.ndarray, planes: tuple[int, ...], local: np.ndarray) -> Reduction:
    size = max(float(np.ptp(local)), *(ball.radius for ball in problem.balls))
    local = np.where(np.abs(local) <= _SAME * size, 0.0, local)
    balls: list[ModelBall] = []
    for index, (ball, position) in enumerate(zip(problem.balls, local, strict=True)):
        if all(position[axis] >= 0.0 for axis in planes):
            fixed = tuple(axis for axis in planes if position[axis] == 0.0)
            x, y = (float(c) for c in position)
            balls.append(ModelBall(index, (x, y), ball.radius, _named_shape(ball), 2 ** len(fixed), fixed))
    images = []
    for position in local:
        signs = [-1 if axis in planes and position[axis] < 0.0 else 1 for axis in (0, 1)]
        distances = [np.max(np.abs(np.array(signs) * position - np.array(b.position))) for b in balls]
        images.append(Image(int(np.argmin(distances)), (signs[0], signs[1])))
    return Reduction((float(origin[0]), float(origin[1])), angle, planes, tuple(balls), tuple(images))


def _named_shape(ball: Ball) -> str:
    if not isinstance(ball.shape, str):
        raise UnsupportedProblem("balls.shape: the finite-element models know paraboloid and sphere, got a callable")
    return ball.shape


@dataclass(frozen=True)
class Resolution:
    """How finely a model is meshed: element size per distance inside the contact and outside, and the finest size.

    ``inner`` is the element size per distance from the ball's axis; ``finest`` the size at the axis
    relative to the smallest contact radius of the load path.
    """

    inner: float
    outer: float
    finest: float

    @classmethod
    def for_accuracy(cls, tangential_force: float) -> Resolution:
        """Return the resolution that experience gives for a relative accuracy of T."""
        share = tangential_force / USUAL_ACCURACY
        scale = float(np.clip(share ** (0.4 if share > 1.0 else 0.25), 0.5, 1.6))
        return cls(inner=0.21 * scale, outer=0.17 * scale, finest=0.21 * scale)

    def at_edge(self, contact_radius: float, smallest_contact: float) -> float:
        """Return how element sizes grow with the distance at a contact's edge, over the contact radius [m]; at most 1.

        ``inner`` for a contact that the mesh was made for; more for one that is smaller than ``smallest_contact`` [m].
        """
        return min(self.inner * max(1.0, smallest_contact / contact_radius), 1.0)

    def coarser(self, ratio: float) -> Resolution:
        """Return the resolution whose elements are larger by a ratio everywhere."""
        return Resolution(self.inner * ratio, self.outer * ratio, self.finest * ratio)


def expected_indentation(problem: Problem) -> list[tuple[float, float, float]]:
    """Return per ball the expected (approach, force, contact radius) at full load, each ball alone [m, N, m].

    An estimate to size meshes and first guesses; no result depends on its accuracy.
    """
    kind, values = problem.load.kind, problem.load.values
    if kind == "total_force":
        values = tuple(values[0] / problem.size for _ in problem.balls)
    name = "approach" if kind == "approach" else "normal_force"
    answer = []
    for ball, value in zip(problem.balls, values, strict=True):
        if value <= 0.0:
            answer.append((0.0, 0.0, 0.0))
            continue
        state = indentation_of_layer(problem.layer, problem.substrate, ball.radius, **{name: value})
        answer.append((state.approach, state.normal_force, state.contact_radius))
    return answer


def scene_positions(reduction: Reduction) -> np.ndarray:
    """Return the positions (n, 2) [m] of all balls of the scene in the model's frame."""
    return np.array([np.array(i.signs) * np.array(reduction.balls[i.model_ball].position) for i in reduction.images])


def box_to_mesh(
    problem: Problem,
    reduction: Reduction,
    resolution: Resolution,
    smallest_contact: float,
    extent: Extent | None = None,
) -> Box:
    """Return the box for the reduced scene; ``smallest_contact`` is the contact radius at the first load step [m].

    Without an extent, the box reaches as far as an accuracy of `USUAL_ACCURACY` needs.
    """
    layer = problem.layer
    expected = expected_indentation(problem)
    if extent is None:
        extent = choose_extent(problem, scene_positions(reduction), reduction.planes, expected, USUAL_ACCURACY)
    margin, depth = extent.margin, extent.depth
    zones = []
    for ball, others in zip(reduction.balls, reduction.neighbours(), strict=True):
        gaps = [max(abs(p[0] - ball.position[0]), abs(p[1] - ball.position[1])) for p in others]
        contact = max(expected[ball.index][2], smallest_contact)
        mirror = min([0.48 * g for g in gaps], default=2.0 * contact)
        nearest = min((math.dist(p, ball.position) for p in others), default=0.0)
        zones.append(
            Zone(
                position=ball.position,
                finest=resolution.finest * smallest_contact,
                growth=resolution.inner,
                radius=1.3 * contact,
                outer_growth=resolution.outer,
                mirror=min(mirror, 0.8 * margin),
                far_radius=max(FAR_CONTACTS * contact, FAR_NEIGHBOURS * nearest),
                far_growth=FAR_GROWTH * resolution.outer,
            )
        )
    low, high = [], []
    for axis in (0, 1):
        coordinates = [ball.position[axis] for ball in reduction.balls]
        low.append(0.0 if axis in reduction.planes else min(coordinates) - margin)
        high.append(max(coordinates) + margin)
    return Box(
        (low[0], high[0]),
        (low[1], high[1]),
        layer.thickness,
        depth,
        tuple(zones),
        coarsest=max(0.35 * margin, layer.thickness),
    )
