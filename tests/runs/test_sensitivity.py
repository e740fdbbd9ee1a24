"""What the inputs do to T: exponents that dimensions and the point-load law know."""

from __future__ import annotations

import dataclasses
import math

import pytest

from linear_bem import Ball, Cone, Elastic, Ellipsoid, Indenter, Layer, Load, NotConverged, Problem, Punch, solve
from runs.comparison import sensitivity
from runs.comparison.sensitivity import beside, check, holds, ratio, record, rows
from runs.display.numbers import Scale

SUBSTRATE = Elastic(50.0, 0.3)


def pair(load: Load, *, thickness: float = 1.5, distance: float = 2.0, shape: str = "paraboloid") -> Problem:
    balls = tuple(Ball((x * distance, 0.0), 1.0, shape) for x in (-0.5, 0.5))
    substrate = SUBSTRATE if math.isfinite(thickness) else None
    return Problem(Layer(1.0, 0.45, thickness), balls, load, substrate)


@pytest.mark.parametrize(
    "load",
    [Load("force", (0.02, 0.02)), Load("approach", (0.1, 0.1)), Load("total_force", (0.04,))],
    ids=lambda v: v.kind,
)
def test_exponents_add_up_as_dimensions_demand(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    found = record(pair(load, distance=2.5))
    monkeypatch.setattr(sensitivity, "STEP", 2.0 * sensitivity.STEP)
    rough = record(pair(load, distance=2.5))
    assert found is not None
    assert rough is not None
    assert set(found["exponents"]) == {"h", "R", "L", "E1", "E2", "D" if load.kind == "approach" else "Q"}
    assert found["moduli"] == pytest.approx(1.0, abs=1e-3)
    assert found["lengths"] == pytest.approx(2.0, abs=1e-3)
    # what is missing is the error of the differences, of order 2
    order = math.log2((rough["lengths"] - 2.0) / (found["lengths"] - 2.0))
    assert order == pytest.approx(2.0, abs=0.1)


def test_the_sensitivity_may_be_that_of_another_ball_than_the_leading_one() -> None:
    scene = pair(Load("approach", (0.1, 0.1)), thickness=math.inf)
    first, second = record(scene), record(scene, 1)
    assert first is not None
    assert second is not None
    assert (first["ball"], second["ball"]) == (0, 1)
    assert second["exponents"] == pytest.approx(first["exponents"], abs=1e-6)


def test_touching_balls_are_only_moved_apart() -> None:
    found = record(pair(Load("approach", (0.15, 0.15)), thickness=3.0))
    assert found is not None
    assert found["moduli"] == pytest.approx(1.0, abs=1e-3)
    assert found["lengths"] == pytest.approx(2.0, abs=5e-3)


def test_small_contacts_on_a_half_space_follow_the_point_load_law() -> None:
    # T = Q^2 (1 - nu^2) / (pi E1 L^2), whatever the radius
    found = record(pair(Load("force", (1e-5, 1e-5)), thickness=math.inf, distance=4.0))
    assert found is not None
    expected = {"R": 0.0, "L": -2.0, "E1": -1.0, "Q": 2.0}
    assert found["exponents"] == pytest.approx(expected, abs=0.005)
    assert found["poisson"] == (0.45, 0.46)
    assert found["change"] == pytest.approx((1.0 - 0.46**2) / (1.0 - 0.45**2) - 1.0, abs=1e-4)


def test_one_per_cent_is_what_solving_again_says() -> None:
    scene = pair(Load("approach", (0.1, 0.1)))
    found = record(scene)
    assert found is not None
    thicker = dataclasses.replace(scene, layer=Layer(1.0, 0.45, 1.515))
    first, second = (solve(p, 1e-5).balls[0].tangential_force[0] for p in (scene, thicker))
    assert second / first - 1.0 == pytest.approx(
        0.01 * found["exponents"]["h"], abs=0.02 * abs(0.01 * found["exponents"]["h"])
    )


@dataclasses.dataclass(frozen=True)
class Blunt(Indenter):
    """A body with a field that is no length."""

    size: float
    power: float
    ratios = ("power",)

    @property
    def apex_radius(self) -> float:
        return self.size

    def height(self, x: float, y: float) -> float:
        r2 = (x**2 + y**2) / self.size**2
        return self.size * (0.5 * r2 + r2**self.power)


@pytest.mark.parametrize(
    "body", [Cone(math.radians(30.0), 0.5), Punch(0.5, 0.1), Ellipsoid((0.5, 0.4, 0.3)), Blunt(0.5, 2.0)]
)
def test_other_bodies_grow_as_a_whole(body: Indenter) -> None:
    scene = Problem(Layer(1.0, 0.4, 2.0), (Ball((0.0, 0.0), shape=body),), Load("approach", (0.1,)))
    grown = sensitivity._radius(scene, 1.2).balls[0]
    assert grown.radius == pytest.approx(1.2 * body.apex_radius)
    assert isinstance(grown.shape, Indenter)
    assert grown.shape.height(0.36, 0.12) == pytest.approx(1.2 * body.height(0.3, 0.1))
    assert grown.shape.reach == pytest.approx(1.2 * body.reach)
    assert grown.shape.edge == (body.edge and pytest.approx([1.2 * length for length in body.edge]))
    assert grown.shape.half_width(1.0, 0.0) == pytest.approx(1.2 * body.half_width(1.0, 0.0))


def test_an_own_profile_has_the_sensitivity_of_the_body_it_describes() -> None:
    scene = pair(Load("approach", (0.1, 0.1)), distance=2.5)
    described = tuple(Ball(ball.position, 1.0, lambda x, y: 0.5 * (x**2 + y**2)) for ball in scene.balls)
    found, known = record(dataclasses.replace(scene, balls=described)), record(scene)
    assert found is not None
    assert known is not None
    assert found["exponents"] == pytest.approx(known["exponents"], abs=2e-3)


def test_one_ball_has_no_sensitivity() -> None:
    one = Problem(Layer(1.0, 0.45, 1.5), (Ball((0.0, 0.0), 1.0),), Load("approach", (0.1,)))
    assert record(one) is None


def test_a_failure_of_the_linear_model_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise NotConverged("no such state")

    monkeypatch.setattr(sensitivity, "nearby_forces", refuse)
    said = record(pair(Load("approach", (0.1, 0.1))))
    assert said == {"failure": "no such state"}
    assert check(said).endswith("could not be computed: no such state")


def test_the_table_holds_what_the_record_holds() -> None:
    scene = pair(Load("force", (0.02, 0.02)))
    found = {
        "ball": 0, "exponents": {"h": -2.9, "Q": 0.0, "R": -3e-3}, "poisson": (0.45, 0.46), "change": 0.2,
        "moduli": 1.0, "lengths": 2.0,
    }  # fmt: skip
    nu, h, force, radius = rows(found, scene, Scale.of(scene), 0.01)
    assert nu["change of T"] == "0.45 \u2192 0.46: +20 %"
    assert nu["input change equal to T's error"] == "\u00b1 0.0005"
    assert (h["value"], h["change of T"]) == ("1.5 R", "1 % more: -2.9 %")
    assert h["input change equal to T's error"] == "\u00b1 0.34 %"
    assert force["input change equal to T's error"] == "-"
    assert radius["input change equal to T's error"] == "more than 100 %"
    assert "add up" not in check(found)  # the sums are in the JSON
    balls = tuple(Ball((6.0 * i, 0.0), 1.0 + 0.1 * i) for i in range(5))
    five = Problem(Layer(1.0, 0.45, 1.5), balls, Load("force", (0.02,) * 5))
    assert rows(found, five, Scale.of(five))[-1]["value"] == "1 R, 1.1 R, 1.2 R, 2 other(s)"
    unlike = dataclasses.replace(scene, balls=(scene.balls[0], dataclasses.replace(scene.balls[1], radius=0.5)))
    assert rows(found, unlike, Scale.of(unlike))[-1]["value"] == "1 R, 0.5 R"


def test_changes_of_a_linear_force_are_not_said_of_another_one() -> None:
    found = {"ball": 1, "exponents": {"h": -52.0, "D": -21.0}}
    steps = [
        {"ball": ball, "strengthening_at_approach": factor, "strengthening_at_force": 1.1}
        for ball, factor in ((0, 1.0), (1, 1.5), (0, 1.0), (1, 20.8))
    ]
    assert ratio(found, steps, "approach") == 20.8
    assert "is 20.8 times the linear model's: its sensitivity differs" in check(found, 20.8)
    assert [holds(value) for value in (20.8, -1.0, 0.4, 1.1, None)] == [False, False, False, True, True]
    assert ratio(found, steps, "force") == 1.1
    assert check(found, 1.1).endswith("+ makes T larger")
    assert "T nearly vanishes in the linear model" in check(found)
    assert check({"ball": 1, "exponents": {"h": -2.9, "D": 3.0}}).endswith("+ makes T larger")


def test_beside_a_comparison_the_error_is_that_of_the_ball_named() -> None:
    scene = pair(Load("approach", (0.1, 0.1)))
    found = {"ball": 1, "exponents": {"h": -2.0}, "poisson": (0.45, 0.46), "change": 0.2}
    balls = [  # the first has the largest T, at an error of 8 %
        {"tangential_force": [8.0, 6.0], "tangential_force_error": 0.8},
        {"tangential_force": [0.0, -5.0], "tangential_force_error": 0.01},
    ]
    steps = [{"ball": ball, "strengthening_at_approach": 1.1, "strengthening_at_force": 1.0} for ball in (0, 1)]
    document = {"sensitivity": found, "comparison": steps, "finite": {"balls": balls}}
    inputs, caption = beside(document, scene, Scale.of(scene))
    assert "on ball 1" in caption
    assert inputs[-1]["input change equal to T's error"] == "\u00b1 0.1 %"
    steps[1]["strengthening_at_approach"] = 3.0  # where the linear sensitivity does not hold, no input is weighed
    inputs, caption = beside(document, scene, Scale.of(scene))
    assert "3 times the linear model's" in caption
    assert not any("input change equal to T's error" in row for row in inputs)
    inputs, caption = beside(document | {"sensitivity": {"failure": "no parameter of size"}}, scene, Scale.of(scene))
    assert caption.endswith("no parameter of size")
