"""Gaps of own bodies: they and the lengths that a body states agree with its height, or are refused."""

import numpy as np
import pytest

from linear_bem import (
    Ball,
    Ellipsoid,
    Indenter,
    InvalidProblem,
    Layer,
    Load,
    Problem,
    Sphere,
)
from linear_bem.dual import has_kinks

HALF_SPACE = Layer(1.0, 0.3, np.inf)


class Bowl(Indenter):
    apex_radius = 1.0

    def height(self, x, y):
        return (x**2 + y**2) / 2.0


def gap_of(function):
    return type("Gapped", (Bowl,), {"gap": lambda self, x, y, z: function(x**2 + y**2, z)})()


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            gap_of(lambda r2, z: z - r2 / 2.0),
            r"Gapped\.gap must be the distance .* below, got -0\.0001 m",
        ),
        (
            gap_of(lambda r2, z: r2 - 2.0 * z),
            r"Gapped\.gap must be the distance .* got 0\.0002 m at 0\.0001 m",
        ),
        (gap_of(lambda r2, z: r2 / 2.2 - z), r"Gapped\.gap must be 0 on the surface .* or leave gap out"),
        (type("Endless", (Bowl,), {"reach": -1.0})(), r"^balls\.shape: Endless\.reach must be a .* than 0, got -1\.0$"),
        (type("Worded", (Bowl,), {"apex_radius": "1"})(), r"^balls\.shape: Worded\.apex_radius must be .*, got '1'$"),
    ],
)
def test_an_own_body_that_contradicts_itself_is_refused_once(body, words):
    balls = tuple(Ball((x, 0.0), 1.0, body) for x in (-2.0, 2.0))
    with pytest.raises(InvalidProblem, match=words) as found:
        Problem(HALF_SPACE, balls, Load("approach", (0.1, 0.1)))
    assert len(found.value.faults) == 1


@pytest.mark.parametrize("name", ["sphere", "closest point", "flat"])
def test_an_own_gap_may_be_any_distance_from_the_surface_of_the_height(name):
    gaps = {
        "sphere": lambda r2, z: (r2 + (z - 1.0) ** 2) ** 0.5 - 1.0 + 0.0 * z,
        "flat": lambda r2, z: 0.05 * (r2 + (10.0 * z - 1.0) ** 2 - 1.0),
        "closest point": lambda r2, z: (r2 / 2.0 - z) / (1.0 + r2) ** 0.5,
    }
    body = gap_of(gaps[name])
    if name == "flat":  # of a flat ellipsoid, to first order
        body = type("Own", (type(body),), {"height": Ellipsoid((1.0, 1.0, 0.1)).height, "reach": 1.0})()
    if name == "sphere":
        body = type("Own", (type(body),), {"height": Sphere(1.0).height})()
    Problem(HALF_SPACE, (Ball((0.0, 0.0), shape=body),), Load("approach", (0.1,)))


@pytest.mark.filterwarnings("error")
def test_a_body_that_ends_next_to_its_apex_is_checked_within_its_edge():
    ended = {"height": lambda self, x, y: 5e-3 - (5e-3**2 - x**2 - y**2) ** 0.5, "reach": 5e-3}
    body = type("Ended", (Bowl,), ended)()
    Problem(HALF_SPACE, (Ball((0.0, 0.0), shape=body),), Load("approach", (1e-4,)))
    assert not has_kinks(body)
