"""Pictures of many balls, or of balls in a periodic cell: the layer from above, and its structure over cycles."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from runs.display.numbers import count
from runs.display.style import BLUE, GREEN, ORANGE, PURPLE, dot_lines, grid, look, panels, save_figure
from runs.evolution.drawing import set_window, window
from runs.evolution.drift import Moment
from runs.evolution.hard_balls import HardBalls
from runs.evolution.pair_list import images
from runs.scene.units import Unit

SHOWN = 6
"""Moments in a picture."""
NARROW = 1.5
"""Width of a view [inch] up to which its title takes two lines."""
NUMBERED = 0.07
"""Smallest radius over the longer side of a view with which a ball carries its number."""


def some(moments: Sequence[Moment]) -> list[Moment]:
    """Return at most `SHOWN` moments from first to last, at equal numbers of kept moments: about equal paths."""
    at = np.unique(np.round(np.linspace(0, len(moments) - 1, SHOWN)).astype(int))
    return [moments[k] for k in at]


@look()
def draw_top_views(folder: Path, moments: Sequence[Moment], balls: HardBalls, cycles: Any, length: Unit) -> None:
    """Write top_views.png and .svg: the layer from above at some moments, clusters coloured by their size.

    Without a cell each view has its own scale: it shows all balls.
    """
    views = [(f"{cycles(m.sigma):.3g}", "cycles", m.positions) for m in some(moments)]
    _draw_views(folder, "top_views", views, balls, length)


@look()
def draw_ensemble(folder: Path, members: Sequence[Mapping[str, Any]], balls: HardBalls, length: Unit) -> None:
    """Write ensemble.png and .svg: how the first nine members ended, as `draw_top_views`; of a single one none."""
    for suffix in ("png", "svg"):  # which a larger ensemble left
        (folder / f"ensemble.{suffix}").unlink(missing_ok=True)
    if len(members) > 1:
        ends = [(f"seed {m['seed']}:", count(m["contacts"], "contact"), np.array(m["positions"])) for m in members[:9]]
        _draw_views(folder, "ensemble", ends, balls, length)


def _draw_views(
    folder: Path, stem: str, views: Sequence[tuple[str, str, Array]], balls: HardBalls, length: Unit
) -> None:
    """Write STEM.png and .svg: the layer at each of ``views``, which hold two parts of a title and positions."""
    aspects = [height / width for width, height in (np.ptp(_window(x, balls), axis=0) for *_, x in views)]
    wide, tall = 2.3 * min(1.0, 1.5 / min(aspects)), 2.3 * min(1.5, max(aspects))  # [inch]
    figure, axes = grid(len(views), 0.8 + max(wide, 0.8), 0.9 + max(tall, 0.2))
    for axis, (first, second, x) in zip(axes, views, strict=True):
        draw_layer(axis, x, balls, length)
        axis.set_title(f"{first}{' ' if wide > NARROW else chr(10)}{second}")
    save_figure(figure, folder, stem)


def draw_layer(axis: Any, x: Array, balls: HardBalls, length: Unit) -> None:
    """Draw all balls from above: grey alone, then from light to dark by the number of balls in contact."""
    from matplotlib import colormaps  # noqa: PLC0415
    from matplotlib.collections import EllipseCollection  # noqa: PLC0415

    size = np.ones(len(x))
    for group in balls.groups(x):
        size[group] = len(group)
    shade = np.log(size) / np.log(max(len(x), 2))
    colors = np.where((size > 1)[:, None], colormaps["viridis_r"](0.1 + 0.9 * shade), (0.82, 0.85, 0.88, 1.0))
    radii = balls.radii
    seen, own = _window(x, balls), np.arange(len(x))
    if balls.cell is not None:
        own, x = np.tile(own, 9), images(x, balls.cell)
        inside = np.all((x > -radii[own][:, None]) & (x < balls.cell + radii[own][:, None]), axis=1)
        own, x = own[inside], x[inside]
    colors, radii = colors[own], radii[own]
    width = 2.0 * radii / length.size
    axis.add_collection(
        EllipseCollection(
            width, width, np.zeros(len(x)), units="x", offsets=x / length.size, transOffset=axis.transData,
            facecolors=colors, edgecolors="white", linewidths=0.2,
        )
    )  # fmt: skip
    for k in np.flatnonzero(radii >= NUMBERED * np.ptp(seen, axis=0).max()):
        ink = "white" if colors[k, :3].mean() < 0.5 else "black"
        axis.text(*(x[k] / length.size), str(own[k]), ha="center", va="center", fontsize=7, color=ink, clip_on=True)
    set_window(axis, seen, length)


def _window(x: Array, balls: HardBalls) -> Array:
    return window(x, balls.radii) if balls.cell is None else np.array([np.zeros(2), balls.cell])


@look()
def draw_structure(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write structure.png and .svg: cluster size and coordination, and hexatic order, over cycles."""
    from matplotlib.ticker import LogFormatter  # noqa: PLC0415  (slow to load)

    cycle = np.array([row["cycle"] for row in rows])

    def column(name: str) -> Array:
        return np.array([row[name] for row in rows])

    figure, (clusters, order) = panels(4.6, 4.6, height=3.4)
    clusters.plot(cycle, column("cluster_mean"), color=BLUE, label="balls in the cluster of a ball, mean")
    clusters.plot(cycle, 1.0 + column("coordination"), color=ORANGE, label="1 + contacts of a ball, mean")
    clusters.set(xlabel="cycles", ylabel="number", yscale="log")
    clusters.yaxis.set_major_formatter(LogFormatter())
    clusters.yaxis.set_minor_formatter(LogFormatter())
    order.plot(cycle, column("hexatic_local"), color=GREEN, label="mean of |psi_6|")
    order.plot(cycle, column("hexatic_global"), color=PURPLE, label="|mean of psi_6|")
    order.set(xlabel="cycles", ylim=(0.0, 1.0))
    for axis in (clusters, order):
        dot_lines(axis)
        axis.legend()
    save_figure(figure, folder, "structure")
