"""What `plan` says of many balls: advice is about the one with the largest T and its nearest neighbours."""

import dataclasses
import math

import numpy as np
import pytest

from linear_bem import Ball, Layer, Load, Periodic, Problem, solve
from runs.commands import plan

COUNT = 14
PLACES = [(2.2 * k + 0.08 * (k % 3), 0.4 * (k % 2)) for k in range(COUNT)]
ROW = Problem(Layer(1.0, 0.48, 2.0), tuple(Ball(p, 1.0) for p in PLACES), Load("approach", (0.1,) * COUNT))


@pytest.mark.parametrize("kind", ["approach", "total_force"])
def test_advice_is_about_the_leading_ball_and_its_nearest_ones(kind: str) -> None:
    problem = ROW if kind == "approach" else ROW.with_load(kind, (0.05 * COUNT,))
    ahead = solve(problem, plan.ROUGH)
    part, near = plan._closest(problem, ahead)
    sizes = [math.hypot(*ball.tangential_force) for ball in ahead.balls]
    leading = int(np.argmax(sizes))
    assert part.size == len(near.balls) == plan.CLOSE
    assert part.balls[0] == problem.balls[leading]
    apart = sorted(math.dist(ball.position, PLACES[leading]) for ball in problem.balls)
    assert math.dist(part.balls[-1].position, PLACES[leading]) == pytest.approx(apart[plan.CLOSE - 1])
    # the same load on the same balls: what is farther changes T little
    assert math.hypot(*near.balls[0].tangential_force) == pytest.approx(sizes[leading], rel=0.15)
    assert near.balls[0].normal_force == pytest.approx(ahead.balls[leading].normal_force, rel=0.05)


def test_few_balls_and_cells_are_judged_whole() -> None:
    few = dataclasses.replace(ROW, balls=ROW.balls[:3], load=Load("approach", (0.1,) * 3))
    ahead = solve(few, plan.ROUGH)
    assert plan._closest(few, ahead) == (few, ahead)
    cell = dataclasses.replace(ROW, periodic=Periodic((40.0, 10.0)))
    assert plan._closest(cell, ahead) == (cell, ahead)
