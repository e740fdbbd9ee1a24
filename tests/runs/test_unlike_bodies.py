"""A scene of unlike bodies: the answer of the Python interface and of the mirrored scene."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from linear_bem import Ball, Cone, Layer, Load, Problem, solve
from runs.models import Run, choose
from runs.scene.scene_file import read_scene

SCENE = """
[layer]
thickness = 1.16
young = 1
poisson = 0.3
[balls]
shape = ["sphere", "cone", "sphere"]
positions = [[-1, 0], [1, 0], [2.5, 0.5]]
radius = [1, 0.6]
slope = "20 deg"
tip_radius = 0.8
[load]
approach = [0.1, 0.08, 0.05]
"""
LAYER = Layer(1.0, 0.3, 1.16)
BALLS = (
    Ball((-1.0, 0.0), 1.0, "sphere"),
    Ball((1.0, 0.0), shape=Cone(math.radians(20.0), 0.8)),
    Ball((2.5, 0.5), 0.6, "sphere"),
)
LOAD = Load("approach", (0.1, 0.08, 0.05))


def mirrored(problem: Problem) -> Problem:
    """Return the problem as seen from behind, its balls in reverse order."""
    balls = tuple(dataclasses.replace(b, position=(-b.position[0], b.position[1])) for b in reversed(problem.balls))
    return dataclasses.replace(problem, balls=balls, load=Load(problem.load.kind, problem.load.values[::-1]))


def test_a_scene_of_unlike_bodies_has_the_answer_of_the_python_interface(tmp_path: Path) -> None:
    (path := tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    model, problem, _ = choose(read_scene(path))
    found = model.solve(problem, Run(1e-3)).balls
    assert model.name == "linear_bem"
    known = solve(Problem(LAYER, BALLS, LOAD), 1e-3).balls
    assert [(b.normal_force, b.tangential_force) for b in found] == [
        (b.normal_force, b.tangential_force) for b in known
    ]


def test_unlike_bodies_swap_their_answers_with_their_places() -> None:
    problem = Problem(LAYER, BALLS, LOAD)
    found, seen = solve(problem, 1e-4).balls, solve(mirrored(problem), 1e-4).balls[::-1]
    for ball, image in zip(found, seen, strict=True):
        assert image.normal_force == pytest.approx(ball.normal_force, rel=1e-6)
        x, y = ball.tangential_force
        assert image.tangential_force == pytest.approx((-x, y), abs=1e-5 * math.hypot(x, y))
    for axis in (0, 1):  # what the layer's base does not feel: forces between the bodies
        parts = [ball.tangential_force[axis] for ball in found]
        assert sum(parts) == pytest.approx(0.0, abs=1e-3 * max(map(abs, parts)))
