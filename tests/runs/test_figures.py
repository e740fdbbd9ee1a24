"""Figures: what is drawn is the data, and gaps in it are gaps."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

from linear_bem import Ball, Layer, Load, Problem, solve_contact
from linear_bem.indenter import Punch
from linear_bem.smooth.contacts import SmoothContacts
from runs.commands.solve import solve_scene
from runs.display import figures, surface
from runs.display.contact_patch import contact_patch
from runs.display.numbers import Scale, number
from runs.display.style import error_bars, minus
from runs.scene.scene_file import read_scene
from runs.session.session import Options
from runs.studies.figures.map_materials import _continued
from runs.studies.figures.pair import line_through

PAIR = Problem(
    Layer(1.0, 0.48, 2.0),
    (Ball((-1.0, 0.0), 1.0, "paraboloid"), Ball((1.0, 0.0), 1.0, "paraboloid")),
    Load("approach", (0.3, 0.3)),
)


def bowl(count: int = 61) -> SimpleNamespace:
    """Return the surface z = -exp(-(|x| - 1)^2 - y^2) over the square of side 6."""
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(-3.0, 3.0, count), np.linspace(-3.0, 3.0, count)))
    z = -np.exp(-((np.abs(x) - 1.0) ** 2) - y**2)
    a = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    triangles = np.concatenate([np.stack([a, a + 1, a + count + 1], 1), np.stack([a, a + count + 1, a + count], 1)])
    return SimpleNamespace(points=np.stack([x, y, z], 1), triangles=triangles, pressure=-z)


def test_the_section_follows_the_surface(tmp_path: Path) -> None:
    surface.keep(tmp_path, bowl())
    top = surface.load(tmp_path)
    assert top is not None
    line, heights = surface.section(top, [(-1.0, 0.0), (1.0, 0.0)])
    assert line[0] == pytest.approx(-3.0)
    assert line[-1] == pytest.approx(3.0)
    assert np.all(np.diff(line) >= 0.0)
    # discretisation: chords of a spacing of 0.1 lie within its square over 8 of the curve
    assert heights == pytest.approx(-np.exp(-((np.abs(line) - 1.0) ** 2)), abs=0.1**2 / 2.0)


def test_the_section_shows_the_bodies_that_it_cuts_as_it_cuts_them(tmp_path: Path) -> None:
    from matplotlib.figure import Figure  # noqa: PLC0415

    surface.keep(tmp_path, bowl())
    top = surface.load(tmp_path)
    assert top is not None
    # the line runs from the first ball to the farthest; it passes 0.6 beside the third, and misses the fourth
    balls = (Ball((0.0, 0.0), 1.0), Ball((4.0, 0.0), 1.0), Ball((2.0, 0.6), 1.0), Ball((2.0, -1.5), 1.0))
    states = [{"position": list(ball.position), "radius": ball.radius, "approach": 0.3} for ball in balls]
    axes = Figure().subplots()
    cut = surface.section(top, [ball.position for ball in balls])
    figures._draw_section(axes, cut, SimpleNamespace(balls=balls), states, Scale(1.0, 1.0))  # type: ignore[arg-type]
    circles = [line for line in axes.lines if line.get_color() == "0.25"]
    assert [np.ptp(circle.get_xdata()) for circle in circles] == pytest.approx([2.0, 2.0, 1.6])
    assert axes.get_title().startswith("Section along the axes of balls 0 and 1")


def test_the_picture_shows_the_pressure(tmp_path: Path) -> None:
    from matplotlib import image  # noqa: PLC0415

    balls = [
        {"position": list(b.position), "radius": 1.0, "approach": 0.3, "contact_area": 1.0, "normal_force": 1.0}
        for b in PAIR.balls
    ]
    figures.draw_surface(tmp_path, PAIR, balls, Scale.of(PAIR))
    assert not (tmp_path / "surface.png").exists()  # nothing to draw without a surface
    surface.keep(tmp_path, bowl())
    figures.draw_surface(tmp_path, PAIR, balls, Scale.of(PAIR))
    pixels = image.imread(tmp_path / "surface.png")[..., :3]
    assert pixels.shape[0] > 500
    assert np.unique(pixels.reshape(-1, 3), axis=0).shape[0] > 200


def test_a_contact_has_its_own_edge_and_not_that_of_the_elements() -> None:
    x, y = (c.ravel() for c in np.meshgrid(np.arange(-1.5, 1.5, 0.13), np.arange(-1.5, 1.5, 0.13)))
    points = np.stack([x, y], 1)
    semi_axes = 1.0, 0.8
    squared = 1.0 - (x / semi_axes[0]) ** 2 - (y / semi_axes[1]) ** 2
    pressure = 3.0 * np.sqrt(np.maximum(squared * (1.0 + 0.1 * x), 0.0))  # Hertz's, a little to one side
    pressure[squared < 0.05] *= 0.5  # what averages over the cells at a node do at the edge
    patch = contact_patch(points, pressure)
    assert patch is not None
    assert (patch.x[-1] / semi_axes[0]) ** 2 + (patch.y[-1] / semi_axes[1]) ** 2 == pytest.approx(
        np.ones(180), abs=0.02
    )
    assert np.all(patch.pressure[-1] == 0.0)
    assert patch.area == pytest.approx(np.pi * 0.8, rel=0.03)
    assert patch.force == pytest.approx(2.0 / 3.0 * 3.0 * np.pi * 0.8, rel=0.05)
    inside = 3.0 * np.sqrt(1.0 - patch.x[:-4] ** 2 - (patch.y[:-4] / 0.8) ** 2) * np.sqrt(1.0 + 0.1 * patch.x[:-4])
    assert patch.pressure[:-4] == pytest.approx(inside, abs=0.03 * 3.0)
    # a flat punch's pressure has no zero line, and three nodes are no contact to fit
    assert contact_patch(points, np.where(squared > 0.0, 1.0 / np.sqrt(np.maximum(squared, 0.01)), 0.0)) is None
    assert contact_patch(points[:3], np.ones(3)) is None


def test_a_contact_under_a_rounded_tip_has_an_edge_too() -> None:
    x, y = (c.ravel() for c in np.meshgrid(np.arange(-1.5, 1.5, 0.13), np.arange(-1.5, 1.5, 0.13)))

    def under_tip(radius: np.ndarray) -> np.ndarray:  # a cone's pressure is arcosh(1 / r)
        return np.arccosh(np.maximum(1.0 / np.sqrt(0.94 * radius**2 + 0.06), 1.0))

    r = np.linspace(0.0, 1.0, 1001)
    known = {"contact_area": np.pi, "normal_force": float(np.sum(2.0 * np.pi * r * under_tip(r)) * r[1])}
    assert contact_patch(np.stack([x, y], 1), under_tip(np.hypot(x, y))).area < 0.75 * np.pi  # type: ignore[union-attr]
    patch = figures._patch(np.stack([x, y], 1), under_tip(np.hypot(x, y)), known, pointed=True)
    assert patch is not None
    edge = np.hypot(patch.x[-1], patch.y[-1])
    assert np.ptp(edge) < 0.05
    assert np.mean(edge) == pytest.approx(1.0, abs=0.1)
    assert patch.force == pytest.approx(known["normal_force"], rel=0.1)


def test_a_contact_on_a_coarse_mesh_has_a_smooth_edge_too() -> None:
    radius, angle = (c.ravel() for c in np.meshgrid(np.linspace(0.05, 1.5, 30), np.linspace(-np.pi, np.pi, 24)[:-1]))
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
    pressure = 3.0 * np.sqrt(np.maximum(1.0 - radius**2, 0.0))
    pressure *= 1.0 - 0.5 * radius**3 * (np.cos(8.0 * angle) > 0.0)  # as averages over eight elements around have it
    patch = contact_patch(points, pressure)
    assert patch is not None
    edge = np.hypot(patch.x[-1], patch.y[-1])
    assert np.ptp(edge) < 0.1
    assert np.mean(edge) == pytest.approx(1.0, abs=0.1)


def rattling() -> surface.Surface:
    """Return two contacts of radius 0.8 whose nodes open along lines of elements and press too much between them."""
    fields = bowl(121)
    x, y = np.abs(fields.points[:, 0]) - 1.0, fields.points[:, 1]
    pressure = 3.0 * np.sqrt(np.maximum(1.0 - (x**2 + y**2) / 0.64, 0.0))
    column = np.rint(fields.points[:, 0] / 0.05).astype(int) % 3
    return surface.Surface(fields.points, fields.triangles, pressure * np.where(column == 0, 0.0, 1.5))


def test_averages_of_nodes_that_open_and_press_keep_the_force() -> None:
    top = rattling()
    rounds = list(surface.smoothed(top))
    assert np.array_equal(rounds[0], top.pressure)
    forces = [pressure[top.triangles].sum() for pressure in rounds]  # of triangles of one size
    assert forces == pytest.approx(np.full(len(rounds), forces[0]), rel=1e-12)
    middle = np.hypot(np.abs(top.points[:, 0]) - 1.0, top.points[:, 1]) < 0.2
    assert np.ptp(rounds[0][middle]) > 4.0
    assert rounds[-1][middle] == pytest.approx(3.0, rel=0.1)


def test_a_contact_whose_nodes_rattle_is_drawn_with_its_edge_and_the_scale_of_its_averages() -> None:
    from matplotlib.figure import Figure  # noqa: PLC0415

    top, figure = rattling(), Figure()
    area = np.pi * 0.64
    known = {"radius": 1.0, "approach": 0.3, "contact_area": area, "normal_force": 2.0 * area}
    balls: list[dict[str, Any]] = [{"position": list(b.position), **known} for b in PAIR.balls]
    figures._draw_pressure(figure, figure.subplots(), top, balls, Scale.of(PAIR))
    axes = figure.axes[0]
    edges = [line.get_xydata() for line in axes.lines if len(line.get_xydata()) > 1]
    assert len(edges) == len(balls)
    for edge, ball in zip(edges, balls, strict=True):
        assert np.hypot(*(np.asarray(edge) - ball["position"]).T) == pytest.approx(np.full(len(edge), 0.8), rel=0.15)
    assert axes.collections[-1].get_clim()[1] == pytest.approx(3.0, rel=0.15)  # not 4.5, of single nodes


@pytest.mark.parametrize(("shape", "smooth"), [("paraboloid", True), (Punch(1.0, 0.3), False)])
def test_a_linear_solution_is_drawn_with_its_own_contacts_and_surface(
    shape: Any, smooth: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    balls = tuple(Ball((x, 0.0), Punch(1.0, 0.3).apex_radius if not smooth else 1.0, shape) for x in (-1.5, 1.5))
    solution = solve_contact(Problem(Layer(1.0, 0.3, 2.0), balls, Load("approach", (0.1, 0.1))), 1e-2)
    assert isinstance(solution.contacts, SmoothContacts) == smooth
    states = [ball.to_dict() for ball in solution.result().balls]
    drawn: list[Any] = []
    monkeypatch.setattr(figures, "save_figure", lambda figure, *_: drawn.append(figure))
    figures.draw_contacts(tmp_path, solution, states, Scale.of(solution.problem))
    above, below, _ = drawn[0].axes
    edges = [np.asarray(line.get_xydata()) for line in above.lines if len(line.get_xydata()) > 1]
    for edge, state in zip(edges, states, strict=True):
        x, y = edge.T
        area = 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
        assert area == pytest.approx(state["contact_area"], rel=0.05)
    assert above.collections[0].get_clim()[1] == pytest.approx(states[0]["peak_pressure"], rel=0.03)
    (line,) = (line for line in below.lines if line.get_label() == "surface")
    at, heights = line.get_data()
    assert np.interp([-1.5, 1.5], at, heights) == pytest.approx([-0.1, -0.1], abs=2e-3)


def solve_two(out: Path, places: list[list[float]], more: str = "") -> None:
    file = out.with_name("two.toml")
    file.write_text(
        "[layer]\nyoung = 1.0\npoisson = 0.3\nthickness = 2.0\n[balls]\nradius = 1.0\n"
        f"positions = {places}\n[load]\napproach = 0.1\n{more}",
        encoding="utf-8",
    )
    solve_scene(read_scene(file), None, Options(False, out, False))


@pytest.mark.parametrize("forces", ["as they are", "zero"])
def test_many_balls_are_drawn_from_above(forces: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr(figures, "save_figure", lambda figure, *_: drawn.append(figure))
    balls = tuple(Ball((3.0 * i, 2.5 * (i % 2)), radius=1.0) for i in range(7))
    problem = Problem(Layer(1.0, 0.3, 2.0), balls, Load("approach", (0.1,) * 7))
    states = [ball.to_dict() for ball in solve_contact(problem, 1e-2).result().balls]
    if forces == "zero":
        states = [{**state, "tangential_force": [0.0, 0.0]} for state in states]
    figures.draw_many(tmp_path, states, Scale.of(problem))
    axes, _ = drawn[0].axes
    _, contacts, *arrows = axes.collections
    assert np.asarray(contacts.get_array()) == pytest.approx([state["peak_pressure"] for state in states])
    assert len(arrows) == (forces != "zero")
    assert "T is zero" in axes.get_title("left") or arrows
    low, high = axes.get_xlim()
    assert low < -1.0
    assert high > 19.0
    for arrow in arrows:
        tips = arrow.XY + np.column_stack([arrow.U, arrow.V])
        assert low < tips[:, 0].min() < tips[:, 0].max() < high


def test_a_picture_that_is_stopped_leaves_the_result_and_the_same_command_draws_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, places = tmp_path / "out", [[-1.5, 0], [1.5, 0]]

    def stopped(*given: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(figures, "draw_contacts", stopped)
        with pytest.raises(KeyboardInterrupt):
            solve_two(out, places)
    assert json.loads((out / "result.json").read_text(encoding="utf-8"))["solved"]["converged"]
    assert not (out / "surface.png").exists()
    solve_two(out, places)
    assert (out / "surface.png").exists()


def test_the_contacts_of_a_cell_are_drawn_where_the_balls_are_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr(figures, "save_figure", lambda figure, *_: drawn.append(figure))
    solve_two(tmp_path / "out", [[0, 0], [7.5, 0]], "[periodic]\nlengths = [5, 4]\n")
    above, below, _ = drawn[0].axes
    middles = [np.mean(line.get_xydata()[1:], axis=0) for line in above.lines if len(line.get_xydata()) > 1]
    assert np.array(middles) == pytest.approx(np.array([[0.0, 0.0], [7.5, 0.0]]), abs=1e-3)
    assert all("without images" in axes.get_title("left") for axes in (above, below))


@pytest.mark.parametrize(("data", "label"), [({"layer": {"young": "1 kPa"}}, "$p$ [kPa]"), (None, "$p$ / E")])
def test_pressure_is_shown_in_the_scenes_unit(data: Any, label: str, tmp_path: Path) -> None:
    from matplotlib.figure import Figure  # noqa: PLC0415

    surface.keep(tmp_path, bowl())
    top = surface.load(tmp_path)
    assert top is not None
    balls = [
        {"position": list(b.position), "radius": 1.0, "approach": 0.3, "contact_area": 1.0, "normal_force": 1.0}
        for b in PAIR.balls
    ]
    figure = Figure()
    figures._draw_pressure(figure, figure.subplots(), top, balls, Scale.of(PAIR, data))
    assert label in figure.axes[1].get_ylabel()
    assert [text.get_text() for text in figure.axes[0].texts] == ["0", "1"]


def test_missing_ratios_leave_gaps_and_not_errors(tmp_path: Path) -> None:
    balls = [{"position": list(b.position), "tangential_force": [0.0, 0.0]} for b in PAIR.balls]
    row = {
        "ball": 0, "normal_force": 0.1, "approach": 0.2,
        "tangential_linear": [1e-3, 0.0], "tangential_linear_error": 1e-7,
        "tangential_finite": [2e-3, 0.0], "tangential_finite_error": 1e-5, "strengthening_at_force": 2.0,
        "strengthening_at_force_error": 0.1, "strengthening_at_approach": 1.9, "strengthening_at_approach_error": 0.1,
    }  # fmt: skip
    gap = {**row, "normal_force": 0.2, "approach": 0.3, "tangential_linear": [None, None]}
    gap |= dict.fromkeys([k for k in row if k.startswith("strengthening") or k == "tangential_linear_error"])
    figures.draw_comparison(tmp_path, [row, gap], balls, Scale.of(PAIR))
    assert (tmp_path / "tangential_force.png").stat().st_size > 10_000
    assert "<svg" in (tmp_path / "tangential_force.svg").read_text(encoding="utf-8")[:1000]


def test_one_ball_has_no_ratio_to_draw(tmp_path: Path) -> None:
    balls = [{"position": [0.0, 0.0], "tangential_force": [0.0, 0.0]}]
    row = {
        "ball": 0, "normal_force": 0.1, "approach": 0.2,
        "tangential_linear": [0.0, 0.0], "tangential_linear_error": 0.0,
        "tangential_finite": [0.0, 0.0], "tangential_finite_error": 1e-12,
    }  # fmt: skip
    row |= {f"strengthening_at_{kind}{end}": None for kind in ("force", "approach") for end in ("", "_error")}
    figures.draw_comparison(tmp_path, [row, {**row, "approach": 0.3}], balls, Scale.of(PAIR))
    assert "no tangential force to compare" in (tmp_path / "tangential_force.svg").read_text(encoding="utf-8")


def test_a_line_goes_through_samples_and_zeros_without_corners() -> None:
    at = np.geomspace(2.0, 300.0, 25)
    zero = 13.43
    x, y = line_through(at, (zero - at) / at**3, [zero], power=2.0)
    assert np.interp(at, x, y) == pytest.approx((zero - at) / at**3, rel=5e-3, abs=1e-9)
    assert y[x == zero] == pytest.approx(0.0, abs=1e-12)
    assert np.all(((y > 0.0) == (x < zero)) | (np.abs(y) < 1e-12))
    # so near to the zero that a logarithmic axis shows it
    assert np.min(np.abs(y[x != zero])) < 1e-4 * np.max(np.abs(y[x > zero]))
    turn = np.abs(np.diff(np.diff(y * x**2) / np.diff(x)))
    assert np.max(turn) < 0.05 * np.max(np.abs(np.diff(y * x**2) / np.diff(x)))


def test_a_jump_of_samples_makes_no_bump() -> None:
    at = np.geomspace(1e-3, 1.0, 12)
    _, y = line_through(at, np.where(at < 0.1, 5e-4, -1.0), [])
    assert np.max(y) < 2e-3


def test_a_ratio_is_not_drawn_across_the_pole_where_its_denominator_changes_sign() -> None:
    figure, axes = plt.subplots()
    # T and its linear part change sign one after the other between the third point and the fourth
    points, forces = [(0.2, 1.1, 0.1), (0.3, 1.3, 0.1), (0.4, 9.4, 0.9), (0.6, 0.57, 0.1)], [-1.0, -2.0, -3.0, 4.0]
    error_bars(axes, points, forces)
    error_bars(axes, points)
    broken, whole = (line.get_ydata() for line in axes.lines if len(line.get_ydata()) >= 4 and line.get_ls() == "-")
    plt.close(figure)
    np.testing.assert_array_equal(broken, [1.1, 1.3, 9.4, np.nan, 0.57])
    np.testing.assert_array_equal(whole, [1.1, 1.3, 9.4, 0.57])


def test_numbers_have_minus_signs_and_words_hyphens() -> None:
    assert minus("minimum -0.0478 at h = -2e-3, half-space, x-1") == "minimum −0.0478 at h = −2e−3, half-space, x-1"


def test_large_numbers_have_no_power_of_ten_below_a_million() -> None:
    values = (1000.0, 1234.5, -12_345.0, 999_000.0, 1.5e6, 0.00123)
    assert [number(value, 3) for value in values] == ["1000", "1230", "-12300", "999000", "1.5e+06", "0.00123"]


def test_contours_are_continued_up_to_the_limit() -> None:
    nan, inf = np.nan, np.inf
    found = _continued(np.array([[1.0, inf], [2.0, 4.0], [nan, 5.0], [nan, nan]]))
    assert found == pytest.approx(np.array([[1.0, 1e3], [2.0, 4.0], [2.0, 5.0], [2.0, 5.0]]))
