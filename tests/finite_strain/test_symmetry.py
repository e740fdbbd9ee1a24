"""Mirror planes of a scene, and forces on all its balls from those on the simulated ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from finite_strain.geometry import symmetry
from finite_strain.geometry.estimates import with_expressions
from finite_strain.geometry.load_control import prescribed
from finite_strain.geometry.symmetry import _is_even, reduce_scene
from linear_bem import Ball, Cone, Elastic, Ellipsoid, Indenter, Load, Problem, Punch
from linear_bem.problem import Profile
from tests.finite_strain.scenes import balls_at, on_layer, pair

ROUNDOFF = 1e-12


def scene(balls: tuple[Ball, ...], load: Load | None = None) -> Problem:
    return on_layer(balls, load or Load("approach", (0.1,) * len(balls)))


def turned(balls: tuple[Ball, ...], angle: float, shift: tuple[float, float] = (0.0, 0.0)) -> tuple[Ball, ...]:
    c, s = math.cos(angle), math.sin(angle)
    return tuple(
        Ball((c * b.position[0] - s * b.position[1] + shift[0], s * b.position[0] + c * b.position[1] + shift[1]),
             b.radius, b.shape)
        for b in balls
    )  # fmt: skip


SQUARE = balls_at((-1.2, -1.2), (1.2, -1.2), (1.2, 1.2), (-1.2, 1.2))
LOPSIDED = balls_at((0.0, 0.0), (2.2, 0.0), (0.0, 3.0))
EQUAL_ARMS = balls_at((0.0, 0.0), (2.4, 0.0), (0.0, 2.4))
ROW = balls_at((-2.5, 0.0), (0.0, 0.0), (2.5, 0.0))
TRIANGLE = balls_at(*((1.5 * math.cos(a), 1.5 * math.sin(a)) for a in (0.3, 0.3 + math.tau / 3, 0.3 - math.tau / 3)))
UNEQUAL = (Ball((-1.0, 0.0), 1.0, "sphere"), Ball((1.0, 0.0), 0.7, "sphere"))
MIXED = (Ball((-1.0, 0.0), 1.0, "sphere"), Ball((1.0, 0.0), 1.0, "paraboloid"))

SCENES = {
    # balls, mirror planes, simulated balls
    "pair on x": (balls_at((-1.0, 0.0), (1.0, 0.0)), 2, 1),
    "pair on y": (balls_at((0.0, -1.0), (0.0, 1.0)), 2, 1),
    "pair at 30 degrees": (turned(balls_at((-1.0, 0.0), (1.0, 0.0)), math.pi / 6), 2, 1),
    "pair off the origin": (turned(balls_at((-1.0, 0.0), (1.0, 0.0)), 1.0, (5.0, -3.0)), 2, 1),
    "square": (SQUARE, 2, 1),
    "square at 20 degrees": (turned(SQUARE, math.radians(20.0)), 2, 1),
    "row of three": (ROW, 2, 2),
    "one ball": (balls_at((0.3, 0.4)), 2, 1),
    "L with equal arms": (EQUAL_ARMS, 1, 2),
    "triangle": (TRIANGLE, 1, 2),
    "L with unequal arms": (LOPSIDED, 0, 3),
    "unequal radii": (UNEQUAL, 1, 2),
    "unequal radii at 75 degrees": (turned(UNEQUAL, math.radians(75.0)), 1, 2),
    "unequal shapes": (MIXED, 1, 2),
}


@pytest.mark.parametrize("name", SCENES)
def test_every_mirror_plane_is_found_and_used(name: str) -> None:
    balls, planes, simulated = SCENES[name]
    reduction = reduce_scene(scene(balls))
    assert len(reduction.planes) == planes
    assert len(reduction.balls) == simulated
    for ball in reduction.balls:
        assert all(ball.position[axis] >= 0.0 for axis in reduction.planes)
        assert ball.fixed_axes == tuple(axis for axis in reduction.planes if ball.position[axis] == 0.0)
        assert ball.copies == 2 ** len(ball.fixed_axes)


@pytest.mark.parametrize("kind", ["approach", "force"])
def test_unequal_loads_leave_only_the_plane_along_the_line_of_balls(kind: str) -> None:
    balls = balls_at((-1.0, 0.0), (1.0, 0.0))
    assert reduce_scene(scene(balls, Load(kind, (0.1, 0.1)))).planes == (0, 1)
    reduction = reduce_scene(scene(balls, Load(kind, (0.1, 0.2))))
    assert reduction.planes == (1,)
    assert [ball.index for ball in reduction.balls] == [0, 1]


@dataclass(frozen=True)
class Flank(Indenter):
    """A ball of radius 1 m that is steeper on one side, from 0.31 m on."""

    apex_radius = 1.0

    def height(self, x: Any, y: Any) -> Any:
        return 0.5 * (x**2 + y**2) + 4.0 * np.maximum(0.0, x - 0.31) ** 2


@dataclass(frozen=True)
class TurnedPunch(Indenter):
    """A flat elliptical punch whose axes are turned by 0.5 rad."""

    apex_radius = reach = 1.0

    def height(self, x: Any, y: Any) -> Any:
        along, across = np.cos(0.5) * x + np.sin(0.5) * y, np.cos(0.5) * y - np.sin(0.5) * x
        return 2.0 * np.maximum(0.0, along**2 / 0.8**2 + across**2 / 0.5**2 - 1.0) ** 2


@pytest.mark.parametrize(
    ("body", "planes"),
    [
        (Flank(), (1,)),
        (TurnedPunch(), ()),
        (Cone(math.radians(20.0), 0.1), (0, 1)),
        (Ellipsoid((1.0, 0.7, 0.8)), (0, 1)),
        (Punch(0.5, 0.01), (0, 1)),
    ],
)
def test_a_plane_mirrors_whole_bodies_not_only_what_is_near_their_apex(body: Indenter, planes: tuple[int, ...]) -> None:
    balls = balls_at((-1.3, 0.0), (1.3, 0.0), shape=body)
    assert reduce_scene(scene(balls, Load("approach", (0.5, 0.5)))).planes == planes
    is_round = isinstance(body, Cone | Punch)
    assert reduce_scene(scene(turned(balls, 0.3))).planes == ((0, 1) if is_round else ())


def roller(angle: float, radius: float = 0.25) -> Profile:
    """Return a cylinder with a radius [m] that ends 3 m from its middle, turned by an angle."""
    c, s = math.cos(angle), math.sin(angle)
    return lambda x, y: ((c * x + s * y) / 4.0) ** 8 + (c * y - s * x) ** 2 / (2.0 * radius)


def test_a_long_body_may_touch_up_to_its_ends_and_is_expected_to_touch_alike_in_all_directions() -> None:
    half_length, radii = 4.0 * 0.08 ** (1.0 / 8.0), []
    for angle in (0.0, 0.3, math.pi / 4.0, math.pi / 2.0):
        problem = with_expressions(scene((Ball((0.0, 0.0), 0.25, roller(angle)),), Load("approach", (0.08,))))
        assert 1.0 <= reduce_scene(problem).balls[0].reach / half_length < 1.2
        radii.append(prescribed(problem).expected()[0].contact_radius)
    assert radii == pytest.approx([radii[0]] * 4, rel=1e-9)
    needle = scene((Ball((0.0, 0.0), 0.25, roller(0.0123, 0.0025)),), Load("approach", (0.08,)))
    assert 1.0 <= reduce_scene(with_expressions(needle)).balls[0].reach / half_length < 1.2
    thin = scene(balls_at((0.0, 0.0), shape=Ellipsoid((3.0, 0.15, 1.5))), Load("approach", (0.4,)))
    assert reduce_scene(thin).balls[0].reach > 3.0 * math.sqrt(1.0 - (1.0 - 0.4 / 1.5) ** 2)


def test_a_plane_does_not_mirror_a_small_bump_near_the_axis_of_a_long_body() -> None:
    def bumped(x: Any, y: Any) -> Any:
        return roller(0.0)(x, y) + 0.02 * np.maximum(0.0, 1.0 - ((x - 0.5) ** 2 + (y - 0.1) ** 2) / 0.01) ** 2

    for profile, planes in ((bumped, ()), (roller(0.0), (0, 1))):
        problem = scene((Ball((0.0, 0.0), 0.25, profile),), Load("approach", (0.08,)))
        assert reduce_scene(with_expressions(problem)).planes == planes


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_bodies_in_a_row_are_compared_with_their_images_in_one_frame(
    angle: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    compared = []

    def counted(*given: Any) -> bool:
        compared.append(given)
        return _is_even(*given)

    monkeypatch.setattr(symmetry, "_is_even", counted)
    row = tuple(Ball((5.0 * k, 0.0), shape=Cone(math.radians(30.0 + k), 0.5)) for k in range(12))
    assert len(reduce_scene(scene(turned(row, angle))).planes) == 1
    assert len(compared) <= 2 * len(row)


def test_a_round_body_may_touch_up_to_twice_its_expected_contact_on_a_soft_base_too() -> None:
    cone = balls_at((0.0, 0.0), shape=Cone(math.radians(20.0), 0.1))
    problem = on_layer(cone, Load("approach", (0.5,)), substrate=Elastic(0.05, 0.3))
    assert reduce_scene(problem).balls[0].reach == 2.0 * prescribed(problem).expected()[0].contact_radius


def test_one_total_force_on_a_pair_keeps_both_planes() -> None:
    assert reduce_scene(pair(Load("total_force", (0.01,)))).planes == (0, 1)


def attraction(balls: tuple[Ball, ...]) -> np.ndarray:
    """Return made-up in-plane forces that depend on all balls as the real ones do: on distances, radii and shapes."""
    forces = np.zeros((len(balls), 2))
    for i, a in enumerate(balls):
        for j, b in enumerate(balls):
            if i != j:
                line = np.subtract(b.position, a.position)
                strength = a.radius * b.radius * (1.0 if b.shape == "sphere" else 1.3)
                forces[i] += strength * line / np.linalg.norm(line) ** 3
    return forces


@pytest.mark.parametrize("name", SCENES)
def test_forces_of_all_balls_follow_from_the_simulated_ones_by_mirror_and_turn(name: str) -> None:
    balls = SCENES[name][0]
    reduction = reduce_scene(scene(balls))
    truth = attraction(balls)
    c, s = math.cos(reduction.angle), math.sin(reduction.angle)
    into_frame = np.array([[c, s], [-s, c]])
    for number, ball in enumerate(balls):
        simulated = reduction.balls[reduction.images[number].model_ball]
        assert simulated.radius == ball.radius
        assert simulated.shape == ball.shape
        local = into_frame @ truth[simulated.index]
        assert np.abs(local[list(simulated.fixed_axes)]).max(initial=0.0) < ROUNDOFF
        assert reduction.to_scene(number, tuple(local)) == pytest.approx(truth[number], abs=ROUNDOFF)


@pytest.mark.parametrize("name", SCENES)
def test_a_vector_of_the_scene_taken_to_the_model_and_back_is_itself(name: str) -> None:
    balls = SCENES[name][0]
    reduction, truth = reduce_scene(scene(balls)), attraction(balls)
    for number in range(len(balls)):
        local = reduction.to_model(number, tuple(truth[number]))
        assert reduction.to_scene(number, local) == pytest.approx(truth[number], abs=ROUNDOFF)
        # every image of a ball feels what that ball feels
        simulated = reduction.balls[reduction.images[number].model_ball]
        assert local == pytest.approx(reduction.to_model(simulated.index, tuple(truth[simulated.index])), abs=ROUNDOFF)


@pytest.mark.parametrize("name", SCENES)
def test_simulated_balls_stand_where_the_scene_has_them(name: str) -> None:
    balls = SCENES[name][0]
    reduction = reduce_scene(scene(balls))
    for ball in reduction.balls:
        x, y = ball.position
        c, s = math.cos(reduction.angle), math.sin(reduction.angle)
        placed = (c * x - s * y + reduction.origin[0], s * x + c * y + reduction.origin[1])
        assert placed == pytest.approx(balls[ball.index].position, abs=ROUNDOFF)
