"""Scenes: shapes of the balls, the keys that each takes, and bodies that overlap."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from linear_bem import Cone, Ellipsoid, Indenter, Punch
from runs.scene.scene_file import read_scene
from tests.runs.scene_texts import PAIR, faults, write


@pytest.mark.parametrize(
    ("keys", "shape", "radius"),
    [
        ('shape = "ellipsoid"\nsemi_axes = ["8 mm", "6 mm", "16 mm"]', Ellipsoid((0.008, 0.006, 0.016)), 0.003),
        ('shape = "cone"\nslope = "20 deg"\ntip_radius = "1 mm"', Cone(math.radians(20.0), 0.001), 0.001),
        ('shape = "punch"\nradius = "8 mm"\nedge_radius = "0.5 mm"', Punch(0.008, 0.0005), 0.008),
    ],
)
def test_a_shape_brings_its_own_keys(keys: str, shape: Indenter, radius: float, tmp_path: Path) -> None:
    text = PAIR.replace('radius = "8 mm"', keys)
    ball = read_scene(write(tmp_path, text)).problem.balls[0]
    assert ball.shape == shape
    assert ball.radius == pytest.approx(radius)
    sliding = '[reciprocation]\namplitude = "80 mm"\ncycles = 5\nfriction = 0.1\n'
    if isinstance(shape, Punch):
        read_scene(write(tmp_path, text + sliding))
    else:
        (fault,) = faults(tmp_path, text + sliding)
        assert "[balls] shape: must be a shape that can drift, got" in fault


@pytest.mark.parametrize("shapes", ['"punch"', '["sphere", "punch"]'])
def test_punches_that_drift_are_as_wide_as_the_bodies_beside_them(shapes: str, tmp_path: Path) -> None:
    keys = f'shape = {shapes}\nedge_radius = "0.5 mm"\nradius = ["8 mm", "4 mm"]'
    sliding = '[reciprocation]\namplitude = "80 mm"\ncycles = 5\nfriction = 0.1\n'
    text = PAIR.replace('radius = "8 mm"', keys) + sliding
    (fault,) = faults(tmp_path, text)
    assert fault.startswith("[balls] radius: a drifting punch and all other bodies must have equal radii, got")
    read_scene(write(tmp_path, text.replace('"4 mm"', '"8 mm"')))


def test_every_punch_of_a_list_is_as_wide_as_stated(tmp_path: Path) -> None:
    keys = 'shape = "punch"\nradius = ["8 mm", "4 mm"]\nedge_radius = "0.5 mm"'
    problem = read_scene(write(tmp_path, PAIR.replace('radius = "8 mm"', keys))).problem
    assert [ball.shape for ball in problem.balls] == [Punch(0.008, 0.0005), Punch(0.004, 0.0005)]


def test_unlike_bodies_take_the_keys_of_their_own_shapes_in_the_order_of_the_balls(tmp_path: Path) -> None:
    keys = """
shape = ["ellipsoid", "sphere", "cone", "ellipsoid", "punch"]
semi_axes = [["8 mm", "6 mm", "8 mm"], ["4 mm", "4 mm", "2 mm"]]
radius = ["7 mm", "5 mm"]
slope = "20 deg"
tip_radius = ["1 mm"]
edge_radius = "0.5 mm"
positions = [[0, 0], ["20 mm", 0], ["40 mm", 0], ["60 mm", 0], ["80 mm", 0]]
"""
    text = PAIR.replace('radius = "8 mm"\npositions = [["-8 mm", 0], ["0.8 cm", 0]]', keys)
    found = read_scene(write(tmp_path, text)).problem.balls
    assert [(ball.position[0], ball.radius, ball.shape) for ball in found] == [
        (0.0, pytest.approx(0.006), Ellipsoid((0.008, 0.006, 0.008))),
        (0.02, 0.007, "sphere"),
        (0.04, 0.001, Cone(math.radians(20.0), 0.001)),
        (0.06, pytest.approx(0.008), Ellipsoid((0.004, 0.004, 0.002))),
        (0.08, 0.005, Punch(0.005, 0.0005)),
    ]
    one = keys.replace('[["8 mm", "6 mm", "8 mm"], ["4 mm", "4 mm", "2 mm"]]', '["8 mm", "6 mm", "8 mm"]')
    balls = read_scene(write(tmp_path, text.replace(keys, one))).problem.balls
    assert balls[0].shape == balls[3].shape == Ellipsoid((0.008, 0.006, 0.008))


def test_overlaps_are_one_fault_with_the_worst_pair_in_the_unit_of_the_scene(tmp_path: Path) -> None:
    row = '[["-8 mm", 0], ["8 mm", 0], ["20 mm", 0], ["35 mm", 0]]'
    (fault,) = faults(tmp_path, PAIR.replace('[["-8 mm", 0], ["0.8 cm", 0]]', row))
    assert "balls 1 and 2 overlap by 4 mm, the most of 2 pairs that do: their axes are 12 mm apart" in fault
    assert "radii 8 mm and 8 mm need at least 16 mm; move them apart" in fault


def test_an_overlap_of_unlike_bodies_does_not_explain_the_distance_by_their_radii(tmp_path: Path) -> None:
    keys = 'shape = ["sphere", "ellipsoid"]\nsemi_axes = ["8 mm", "6 mm", "8 mm"]\n'
    (fault,) = faults(tmp_path, PAIR.replace('radius = "8 mm"', keys + 'radius = "8 mm"').replace("0.8 cm", "2 mm"))
    assert "their axes are 10 mm apart, their shapes need at least 16 mm; move them apart" in fault
