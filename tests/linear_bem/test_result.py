"""What a user does with a result: short in a terminal, a table in a notebook, JSON and back, a figure."""

import math
import sys
from dataclasses import replace

import pytest

from linear_bem import (
    Ball,
    InvalidProblem,
    Layer,
    Load,
    Problem,
    Result,
    elastic_energy,
    energy_force,
    interior_displacement,
    solve,
    solve_contact,
    stress,
    vertical_stress,
)
from linear_bem.errors import MissingDependency

PAIR = (Ball((-1.0, 0.0), 1.0), Ball((1.0, 0.25), 1.0))


@pytest.fixture(scope="module")
def solution():
    return solve_contact(Problem(Layer(1.0, 0.45, 2.0), PAIR, Load("approach", (0.1, 0.2))), 1e-3)


def test_the_short_forms_name_model_balls_and_the_largest_force(solution):
    result = solution.result()
    largest = max(math.hypot(*ball.tangential_force) for ball in result.balls)
    assert repr(result).startswith(f"Result(linear_bem: 2 balls, largest T {largest:.4g} ± ")
    assert len(repr(result)) < 100
    assert repr(result) in repr(solution)
    assert len(repr(solution)) < 160


def test_the_summary_shows_every_number_of_few_balls_and_the_notes(solution):
    text = solution.summary()
    for ball in solution.result().balls:
        for value in (ball.approach, ball.normal_force, *ball.tangential_force):
            assert f"{value:.6g}" in text
    deep = solve_contact(Problem(Layer(1.0, 0.45, 0.2), PAIR, Load("approach", (0.15, 0.15))), 1e-2)
    assert "note: the largest approach is" in deep.summary()


def test_roundoff_is_shown_as_nothing(solution):
    result = solution.result()
    aligned = Result(result.model, (replace(result.balls[0], tangential_force=(-5e-5, -7e-21)),), result.solved)
    assert "-5e-05  " in aligned.summary()
    assert "e-21" not in aligned.summary()


def test_many_balls_are_summarised_by_those_with_the_largest_force(solution):
    result = solution.result()
    many = Result(result.model, (result.balls[0],) * 29 + (result.balls[1],), result.solved)
    assert len(many.summary().splitlines()) < 26
    assert "10 more balls" in many.summary()
    assert many._repr_html_().count("<tr>") == 21


def test_a_notebook_shows_a_table(solution):
    shown = solution._repr_html_()
    assert shown.count("<tr>") == 3
    assert f"{solution.result().balls[1].normal_force:.6g}" in shown
    assert shown == solution.result()._repr_html_()


def test_json_gives_back_every_bit(solution):
    result = solution.result()
    again = Result.from_json(result.to_json(scene={"title": "µ"}))
    assert again == result
    assert again.balls[0].errors == result.balls[0].errors
    assert again.to_json() == result.to_json()


@pytest.mark.parametrize("text", ["{}", "[]", '{"finite": {}, "linear": {}, "comparison": []}'])
def test_json_of_something_else_is_refused_with_what_a_result_has(text):
    with pytest.raises(InvalidProblem, match=r"must have the keys model, balls and solved, .*\[\"finite\"\]"):
        Result.from_json(text)


def test_what_is_no_text_is_no_json():
    with pytest.raises(InvalidProblem, match=r"from_json: must be the text that to_json wrote, got None: .*read_text"):
        Result.from_json(None)


def test_a_ball_without_a_number_is_refused_with_its_name(solution):
    data = solution.result().to_dict()
    del data["balls"][0]["approach"]
    with pytest.raises(InvalidProblem, match="a key is missing or wrong: 'approach'"):
        Result.from_dict(data)


def test_fields_of_a_result_without_them_name_the_function_that_has_them(solution):
    for function in (stress, interior_displacement, vertical_stress):
        with pytest.raises(InvalidProblem, match=f"{function.__name__}: needs the fields that solve_contact returns"):
            function(solution.result(), 0.0, 0.0, 0.0)
    for function, rest in ((elastic_energy, ()), (energy_force, (0,))):
        with pytest.raises(InvalidProblem, match=f"{function.__name__}: needs the fields that solve_contact returns"):
            function(solution.result(), *rest)


def test_figures_show_contacts_and_forces(solution):
    from matplotlib.patches import Circle  # noqa: PLC0415

    for figure, maps in ((solution.plot(), 1), (solution.result().plot(), 0)):
        axes = figure.axes[0]
        circles = [patch for patch in axes.patches if isinstance(patch, Circle)]
        areas = [math.pi * circle.radius**2 for circle in circles]
        assert areas == pytest.approx([ball.contact_area for ball in solution.result().balls])
        assert len(axes.images) == maps
        largest = max(math.hypot(*ball.tangential_force) for ball in solution.result().balls)
        assert f"{largest:.3g} N" in axes.get_title()
        assert [text.get_text() for text in axes.texts] == ["0", "1"]
        assert axes.get_xlabel() == "x [m]"


def test_a_figure_without_matplotlib_is_one_message_with_its_remedy(solution, monkeypatch):
    for name in ("matplotlib", "matplotlib.figure", "matplotlib.patches"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingDependency, match=r"plot: needs matplotlib .*pip install matplotlib"):
        solution.plot()


@pytest.mark.parametrize(("size", "unit"), [(1e-3, "mm"), (1e-7, "µm")])
def test_a_figure_of_small_balls_has_small_units_and_all_of_its_labels(size, unit):
    pair = tuple(Ball((x * size, 0.0), size) for x in (-1.5, 1.5))
    figure = solve(Problem(Layer(1.0, 0.45, 2.0 * size), pair, Load("approach", (1e-3 * size,) * 2)), 1e-2).plot()
    axes = figure.axes[0]
    assert axes.get_xlabel() == f"x [{unit}]"
    figure.draw_without_rendering()
    ticks = {f"{1e3 * tick:.6g}" if unit == "mm" else f"{1e6 * tick:.6g}" for tick in axes.get_xticks()}
    assert {label.get_text() for label in axes.get_xticklabels()} <= ticks
    box = figure.bbox
    for text in (axes.title, axes.xaxis.label, axes.yaxis.label):
        shown = text.get_window_extent()
        assert box.x0 <= shown.x0 < shown.x1 <= box.x1
        assert box.y0 <= shown.y0 < shown.y1 <= box.y1
