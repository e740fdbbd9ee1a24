"""Pictures of a layer with many balls follow its shape."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from runs.evolution import layer_pictures, showing
from runs.evolution.hard_balls import HardBalls
from runs.scene.units import Unit

PLACES = 1e-3 * np.array([[6.0, 8.0], [18.0, 8.0], [6.0, 24.0], [18.0, 24.0]])


def drawn(monkeypatch: pytest.MonkeyPatch, paths: Any, cell: Any = None) -> Any:
    """Return the figure of a path with radii of 5 mm."""
    figures: list[Any] = []
    monkeypatch.setattr(layer_pictures, "save_figure", lambda figure, *_: figures.append(figure))
    moments = [SimpleNamespace(positions=x, sigma=float(k)) for k, x in enumerate(paths)]
    balls = HardBalls(np.full(len(paths[0]), 5e-3), cell)
    layer_pictures.draw_top_views(Path(), moments, balls, lambda sigma: 12345.6 * sigma, Unit("mm", 1e-3))
    return figures[0]


def test_a_ball_that_leaves_does_not_empty_the_pictures_before(monkeypatch: pytest.MonkeyPatch) -> None:
    away = PLACES + np.array([[10.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    first, last = drawn(monkeypatch, [PLACES, away]).axes
    assert np.ptp(first.get_xlim()) < 30.0
    assert last.get_xlim()[1] > 1e4


def test_the_ends_of_an_ensemble_in_a_cell_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Any] = []
    monkeypatch.setattr(layer_pictures, "save_figure", lambda figure, *_: figures.append(figure))
    monkeypatch.setattr(layer_pictures, "draw_structure", lambda *_: None)
    sliding = SimpleNamespace(direction=(1.0, 0.0), cycles_after=lambda sigma: sigma)
    session: Any = SimpleNamespace(
        out=tmp_path, scene=SimpleNamespace(sliding=sliding),
        scale=SimpleNamespace(units=SimpleNamespace(length=Unit("mm", 1e-3))),
    )  # fmt: skip
    members = [{"seed": seed, "contacts": seed, "positions": PLACES.tolist()} for seed in range(11)]
    moments: list[Any] = [SimpleNamespace(positions=PLACES, sigma=0.0)]
    balls = HardBalls(np.full(4, 5e-3), np.array([30e-3, 40e-3]))
    showing.draw(session, {"ensemble": members}, moments, balls, [{}])
    ends, _ = figures
    assert [axis.get_title("left") for axis in ends.axes] == [
        f"seed {seed}: {seed} contact{'s' * (seed != 1)}" for seed in range(9)
    ]
    assert [text.get_text() for text in ends.axes[0].texts] == ["0", "1", "2", "3"]
    figures.clear()
    (tmp_path / "ensemble.svg").touch()
    showing.draw(session, {"ensemble": members[:1]}, moments, balls, [{}])
    assert len(figures) == 1
    assert not (tmp_path / "ensemble.svg").exists()


@pytest.mark.parametrize("cell", [(100e-3, 30e-3), (30e-3, 100e-3)])
def test_a_long_cell_fills_its_figure(monkeypatch: pytest.MonkeyPatch, cell: tuple[float, float]) -> None:
    figure = drawn(monkeypatch, [PLACES] * 6, np.array(cell))
    figure.draw_without_rendering()
    covered = sum(axis.get_tightbbox().width * axis.get_tightbbox().height for axis in figure.axes)
    assert covered > 0.75 * figure.bbox.width * figure.bbox.height


@pytest.mark.parametrize("stretch", [1.0, 4.0, 20.0])
def test_titles_of_tall_and_of_wide_views_are_whole(monkeypatch: pytest.MonkeyPatch, stretch: float) -> None:
    for shape in ((1.0, stretch), (stretch, 1.0)):
        figure = drawn(monkeypatch, [PLACES * np.array(shape)] * 6)
        figure.draw_without_rendering()
        for axis in figure.axes:
            title = next(text for text in (axis.title, axis._left_title) if text.get_text())
            assert title.get_window_extent().x1 <= figure.bbox.width
            assert title.get_window_extent().x0 >= 0.0


def test_few_balls_carry_their_numbers_and_many_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    (axis,) = drawn(monkeypatch, [PLACES], np.array([30e-3, 40e-3])).axes
    assert [text.get_text() for text in axis.texts] == ["0", "1", "2", "3"]
    assert [text.get_position() for text in axis.texts] == [tuple(place) for place in PLACES / 1e-3]
    (axis,) = drawn(monkeypatch, [10.0 * PLACES]).axes  # small in a wide view
    assert not axis.texts


def test_the_structure_of_a_layer_at_rest_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Any] = []
    monkeypatch.setattr(layer_pictures, "save_figure", lambda figure, *_: figures.append(figure))
    row = {"cycle": 0.0, "cluster_mean": 1.0, "coordination": 0.0, "hexatic_local": 0.3, "hexatic_global": 0.1}
    layer_pictures.draw_structure(Path(), [row])
    assert [line.get_marker() for axis in figures[0].axes for line in axis.lines] == ["o"] * 4
