"""Numbers too large or too small to be computed with: refused with key, rule and remedy."""

import math

import pytest

from linear_bem import (
    Ball,
    Cone,
    Elastic,
    Ellipsoid,
    InvalidProblem,
    Layer,
    Load,
    NotConverged,
    Periodic,
    Problem,
    Punch,
    solve,
    solve_contact,
)

LAYER, PLACES, LOAD = Layer(1.0, 0.3, 1.0), ((-1.0, 0.0), (1.0, 0.0)), Load("approach", (0.05, 0.05))
HUGE = 10**400


def pair(places=PLACES, radius=1.0, shape=None):
    return tuple(Ball(p, radius) if shape is None else Ball(p, shape=shape) for p in places)


def problem(**parts):
    return Problem(**({"layer": LAYER, "balls": pair(), "load": LOAD} | parts))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: problem(balls=pair(((-1.0, 0.0), (0.0, -1e200)))),
            r"^balls\.positions\[1\]: must be at most 1e\+09 m, 1e\+09 of the largest ball's radius, got 1e\+200 m;",
        ),
        (
            lambda: problem(balls=pair(radius=1e-300)),
            r"balls\.radius\[0\]: must be at least 1e-30 m, got 1e-300 m; check",
        ),
        (lambda: problem(balls=pair(radius=1e300)), r"balls\.radius\[1\]: must be at most 1e\+30 m, got 1e\+300 m"),
        (
            lambda: problem(balls=(Ball(PLACES[0], 1.0), Ball(PLACES[1], 1e-10))),
            r"balls\.radius\[1\]: must be at least 1e-09 m, 1e-09 of the largest ball's radius, got 1e-10 m",
        ),
        (
            lambda: problem(layer=Layer(1.0, 0.3, 1e300)),
            r"^layer\.thickness: must be at most 1e\+09 m, .*, or take inf for a half-space, 0 for the substrate.*$",
        ),
        (lambda: problem(layer=Layer(1.0, 0.3, 1e-300)), r"layer\.thickness: must be at least 1e-09 m"),
        (
            lambda: problem(layer=Layer(1e300, 0.3, 1.0)),
            r"^layer\.young: must be at most 1e\+30 Pa, got 1e\+300 Pa; check",
        ),
        (lambda: problem(layer=Layer(1e-300, 0.3, 1.0)), r"layer\.young: must be at least 1e-30 Pa, got 1e-300 Pa"),
        (
            lambda: problem(substrate=Elastic(1e-300, 0.3)),
            r"substrate\.young: must be at least 1e-09 Pa, 1e-09 of the layer's, got 1e-300 Pa; .*base is then rigid",
        ),
        (lambda: problem(substrate=Elastic(1e300, 0.3)), r"substrate\.young: must be at most 1e\+09 Pa"),
        (
            lambda: problem(periodic=Periodic((1e300, 5.0))),
            r"^periodic\.lengths\[0\]: must be at most 1e\+09 m, .*, or leave periodic out$",
        ),
        (lambda: problem(periodic=Periodic((5.0, 1e-300))), r"periodic\.lengths\[1\]: must be at least 1e-09 m"),
        (lambda: problem(load=Load("force", (1e300, 0.1))), r"load\.force\[0\]: must be at most 1e\+18, got 1e\+300"),
        (lambda: Cone(0.3, 1e300), r"balls\.tip_radius: must be at most 1e\+30 m"),
        (lambda: Cone(1e-300, 1.0), r"balls\.slope: must be at least 1e-30 rad"),
        (lambda: Punch(1.0, 1e-300), r"balls\.edge_radius: must be at least 1e-30 m"),
        (
            lambda: Ellipsoid((1.0, 1e-300, 1e300)),
            r"balls\.semi_axes: must be at least 1e-30 m[^|]*\n?.*at most 1e\+30 m",
        ),
        (
            lambda: problem(balls=pair(shape=Ellipsoid((1e25, 1e25, 1.0)))),
            r"balls\.radius\[0\]: must be at most 1e\+30 m",
        ),
        (lambda: problem(layer=Layer(HUGE, 0.3, 1.0)), r"layer\.young: must be a number, got 1000"),
        (lambda: problem(balls=pair(((HUGE, 0), (0, 0)))), r"balls\.positions\[0\]: must be two numbers, x and y, got"),
        (lambda: problem(load=Load("force", (HUGE, 1))), r"load: must be Load\(kind, values\)"),
        (lambda: problem(periodic=Periodic((HUGE, 1))), r"periodic\.lengths: must be two lengths"),
        (lambda: problem(balls=(), load=Load("total_force", (1.0,))), r"balls\.positions: at least one ball is needed"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_absurd_numbers_are_refused_with_key_rule_and_remedy(make, words):
    with pytest.raises(InvalidProblem, match=words):
        make()


def test_a_size_is_no_second_fault_of_a_number_that_is_none():
    with pytest.raises(InvalidProblem) as found:
        problem(layer=Layer(-1.0, 0.3, 1.0), substrate=Elastic(1e300, 0.3))
    assert found.value.faults == ("layer.young: must be greater than 0 and finite, got -1 Pa",)


@pytest.mark.parametrize(
    "parts",
    [
        {"layer": Layer(1.0, 0.3, 1e9)},
        {"layer": Layer(1.0, 0.3, 1e-9), "substrate": Elastic(1e3, 0.3)},
        {"substrate": Elastic(1e-9, 0.3)},
        {"substrate": Elastic(1e9, 0.3)},
        {"balls": pair(((-1e9, 0.0), (1e9, 0.0)))},
        {"periodic": Periodic((1e9, 1e9))},
        {"layer": Layer(1e30, 0.3, 1.0)},
        {"layer": Layer(1e-30, 0.3, 1.0)},
    ],
    ids=str,
)
def test_numbers_at_the_limits_are_solved(parts):
    assert all(
        math.isfinite(ball.normal_force) and ball.normal_force > 0.0 for ball in solve(problem(**parts), 1e-2).balls
    )


@pytest.mark.parametrize("size", [1e-30, 1e30])
def test_the_smallest_and_largest_balls_behave_as_those_of_1_m(size):
    usual = solve(problem(), 1e-2).balls[0]
    places = tuple((size * x, size * y) for x, y in PLACES)
    scaled = problem(
        layer=Layer(1.0, 0.3, size), balls=pair(places, size), load=Load("approach", (0.05 * size, 0.05 * size))
    )
    found = solve(scaled, 1e-2).balls[0]
    assert found.tangential_force[0] == pytest.approx(size**2 * usual.tangential_force[0], rel=1e-6)
    assert found.normal_force == pytest.approx(size**2 * usual.normal_force, rel=1e-6)


def test_a_total_force_beyond_point_loads_ends_in_a_named_error():
    """The first guess of the common approach is negative: the balls' forces lift each other's surface."""
    with pytest.raises(NotConverged, match="point loads: the effective approaches did not converge"):
        solve_contact(problem(load=Load("total_force", (1e6,))), 1e-2)
