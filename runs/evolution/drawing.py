"""Pictures of an evolution: top views at chosen cycles, distances over cycles, animation."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from linear_bem.touching import nearest_distances
from runs.display.style import BLUE, GREY, ORANGE, blank, dot_lines, grid, look, save_figure
from runs.evolution.hard_balls import HardBalls
from runs.evolution.record import positions_at, starting_neighbours
from runs.pictures.sheet import save_gif
from runs.scene.units import Unit

Document = Mapping[str, Any]

STEEL, EDGE = "#c9d3dc", "#3a4650"
FRAMES, SECONDS, LAST_SECONDS, COLORS = 60, 6.0, 0.9, 32
"""Frames of an animation, its time, that of its last frame, and its colours, of which 256 would take a quarter more."""
ALIKE = 0.03
"""Displacement over that of the whole path below which two configurations look the same."""
NAMED = 8
"""Largest number of curves that a legend names."""
CURVES = 40
"""Largest number of pairs whose distances are drawn one by one: more hide each other."""
LETTER = 0.072
"""Mean width of a letter of 10 points [inch]."""
APART = 0.06
"""Distance of two horizontal lines over the height of the curves from which each has a label."""
NEIGHBOURS = 1.5
"""Starting distance over the smallest one up to which a pair's distance is drawn."""


def chosen_cycles(path: Sequence[Mapping[str, Any]], count: int, balls: HardBalls) -> list[float]:
    """Return ``count`` cycles from start to end: those where groups form, and between them equal path lengths.

    If more groups form than ``count`` allows, the cycles are at equal path lengths only.
    """
    cycle, x = (np.array([m[key] for m in path]) for key in ("cycle", "positions"))
    moved = np.concatenate([[0.0], np.cumsum(np.max(np.hypot(*np.moveaxis(np.diff(x, axis=0), -1, 0)), axis=1))])
    if moved[-1] == 0.0:
        return [float(cycle[0])]
    sizes = [sorted(len(group) for group in balls.groups(place)) for place in x]
    changed = [k for k in range(1, len(path)) if sizes[k] != sizes[k - 1] and moved[k] < (1.0 - ALIKE) * moved[-1]]
    formed = [0.0]
    for at in moved[changed].tolist():
        if at - formed[-1] > ALIKE * moved[-1]:
            formed.append(at)
        elif len(formed) > 1:  # groups that form almost at once count as one event
            formed[-1] = at
    wanted = [*(formed if len(formed) < count else formed[:1]), float(moved[-1])]
    while len(wanted) < count:
        widest = int(np.argmax(np.diff(wanted)))
        wanted.insert(widest + 1, 0.5 * (wanted[widest] + wanted[widest + 1]))
    rising = np.concatenate([[True], np.diff(moved) > 0.0])
    return [float(c) for c in np.interp(wanted, moved[rising], cycle[rising])]


@look()
def draw_top_views(
    folder: Path,
    document: Document,
    balls: HardBalls,
    direction: Sequence[float],
    length: Unit,
    stem: str = "top_views",
) -> None:
    """Write STEM.png and .svg: six configurations from above, balls in touch joined, T as arrows."""
    path = document["path"]
    cycles, seen = chosen_cycles(path, 6, balls), window(np.array([m["positions"] for m in path]), balls.radii)
    figure, axes = grid(len(cycles), *_size(seen, 2.0))
    largest = max(float(np.max(np.hypot(*np.array(m["tangential_force"]).T))) for m in path)
    force = 1.6 * min(balls.radii) / largest if largest > 0.0 else 0.0  # metres of arrow per newton
    for axis, cycle in zip(axes, cycles, strict=True):
        nearest = min(path, key=lambda m: abs(m["cycle"] - cycle))
        _draw_balls(axis, np.array(nearest["positions"]), balls, length, nearest, force)
        set_window(axis, seen, length)
        axis.set_title(f"{nearest['cycle']:.3g} cycles")
    _draw_direction(axes[0], direction)
    words = "From above: balls in contact are joined, arrows are T, the grey arrow is the main motion"
    lines = textwrap.wrap(words, int(figure.get_figwidth() / LETTER))
    figure.suptitle("\n".join(lines), fontsize=10, x=0.01, ha="left")
    save_figure(figure, folder, stem)


@look()
def draw_distances(folder: Path, document: Document, balls: HardBalls, length: Unit) -> None:
    """Write distances.png and .svg: distances of neighbours over cycles, as in the source's figures 2b and 7b.

    Neighbours are pairs that start close to each other, and pairs that come into contact later. Of more than `CURVES`
    pairs, how far away the nearest other ball of each is: least, median, quartiles, largest.
    """
    from matplotlib import colormaps  # noqa: PLC0415

    path = document["path"]
    cycle = np.array([m["cycle"] for m in path])
    beside = starting_neighbours(np.array(path[0]["positions"]), balls, NEIGHBOURS)
    touching = [balls.number(i, j) for moment in path for i, j in moment["contacts"]]
    pairs = np.union1d(beside, np.array(touching, dtype=np.intp))
    each = len(pairs) <= CURVES
    places = [np.array(m["positions"]) for m in path]
    figure = blank(5.6, 3.8)
    axis = figure.subplots()
    if each:
        distance = np.array([np.hypot(*balls.between(x, pairs).T) for x in places]) / length.size
        colors = colormaps["viridis"](np.linspace(0.0, 0.88, len(pairs)))
        for (i, j), away, color in zip(balls.pairs(pairs), distance.T, colors, strict=True):
            axis.plot(cycle, away, color=color, label=f"{i} - {j}")
    else:
        nearest = np.array([nearest_distances(x, None) for x in places]) / length.size
        distance = np.quantile(nearest, (0.0, 0.25, 0.5, 0.75, 1.0), axis=1).T
        axis.fill_between(cycle, *distance[:, [1, 3]].T, color=BLUE, alpha=0.25, lw=0.0, label="half of all balls")
        for k, style, words in ((4, "--", "largest"), (2, "-", "median"), (0, ":", "least")):
            axis.plot(cycle, distance[:, k], color=BLUE, ls=style, label=words)
    dot_lines(axis)
    top, bottom = float(np.max(distance)), balls.smallest / length.size
    height = max(top - bottom, 0.1 * bottom)
    touching = np.unique(np.round(balls.distances(pairs) / balls.smallest, 9))  # unlike pairs, unlike distances
    below = -math.inf
    for at in bottom * (touching if each and len(touching) <= NAMED else np.ones(1)):
        axis.axhline(at, color="0.55", lw=0.8, ls=":", zorder=0)
        if at - below > APART * height:
            axis.annotate(
                "touching", (1.0, at), xycoords=("axes fraction", "data"),
                xytext=(-2, -9), textcoords="offset points", ha="right", fontsize=8, color="0.4",
            )  # fmt: skip
        below = at
    axis.set(xlabel="cycles", ylabel=length.heading("distance of the axes"))
    axis.set_xlim(0.0, float(cycle[-1]) or 1.0)
    axis.set_ylim(bottom - 0.12 * height, top + 0.08 * height)
    if not each:
        axis.legend(fontsize=8, loc="best")
        axis.set_title("distance of each ball to the nearest other one", fontsize=9)
    elif len(pairs) <= NAMED:
        axis.legend(title="balls", fontsize=8, title_fontsize=8, ncols=2 if len(pairs) > 4 else 1, loc="best")
    else:
        axis.set_title(f"{len(pairs)} pairs that start as neighbours or touch later", fontsize=9)
    save_figure(figure, folder, "distances")


@look()
def draw_animation(
    folder: Path, document: Document, balls: HardBalls, direction: Sequence[float], length: Unit
) -> None:
    """Write evolution.gif: the path in equal steps of cycles."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415

    path = document["path"]
    last = path[-1]["cycle"]
    digits = max(0, 1 - math.floor(math.log10(max(last, 1e-9))))
    cycles = np.linspace(0.0, last, FRAMES)
    known = np.array([m["positions"] for m in path])
    x, seen = positions_at(cycles, np.array([m["cycle"] for m in path]), known), window(known, balls.radii)
    figure = blank(*_size(seen, 3.6))
    figure.set_dpi(80)
    canvas, axis = FigureCanvasAgg(figure), figure.subplots()
    set_window(axis, seen, length)
    _draw_direction(axis, direction)
    _draw_balls(axis, x[0], balls, length)
    title = axis.set_title(" ", fontsize=9)
    circles, numbers = list(axis.patches), axis.texts[-len(balls.radii) :]
    moving = [*circles, *numbers, title]
    for artist in moving:
        artist.set_animated(True)
    canvas.draw()  # what does not move, once
    still, frames = canvas.copy_from_bbox(figure.bbox), []
    for places, cycle in zip(x / length.size, cycles, strict=True):
        title.set_text(f"{cycle:.{digits}f} cycles")
        for place, circle, number in zip(places, circles, numbers, strict=True):
            circle.set_center(place)
            number.set_position(place)
        canvas.restore_region(still)
        for artist in moving:
            axis.draw_artist(artist)
        frames.append(np.array(canvas.buffer_rgba())[..., :3])
    save_gif(frames, folder / "evolution.gif", SECONDS / FRAMES, LAST_SECONDS, COLORS)


def _draw_balls(
    axis: Any, x: Array, balls: HardBalls, length: Unit, moment: Mapping[str, Any] | None = None,
    force: float = 0.0,
) -> None:  # fmt: skip
    from matplotlib.patches import Circle  # noqa: PLC0415

    x, radii, force = x / length.size, balls.radii / length.size, force / length.size
    force_at = np.zeros(x.shape) if moment is None else force * np.array(moment["tangential_force"])
    long = np.hypot(*force_at.T) > 0.08 * min(radii)
    for number, (place, radius) in enumerate(zip(x, radii, strict=True)):
        axis.add_patch(Circle(place, radius, facecolor=STEEL, edgecolor=EDGE, lw=0.8))
        # behind the tail of the arrow, where no arrow covers it
        behind = -0.55 * radius * force_at[number] / np.hypot(*force_at[number]) if long[number] else np.zeros(2)
        axis.text(*(place + behind), str(number), ha="center", va="center", fontsize=8.5, color=EDGE, zorder=5)
    if moment is None:
        return
    for i, j in moment["contacts"]:
        axis.plot(*x[[i, j]].T, color=ORANGE, lw=1.2, alpha=0.7, zorder=3)
    if np.any(long):
        axis.quiver(
            *x[long].T, *force_at[long].T, color=BLUE, angles="xy", scale_units="xy", scale=1.0,
            width=0.008, zorder=4,
        )  # fmt: skip


def _draw_direction(axis: Any, direction: Sequence[float]) -> None:
    """Draw the two-headed arrow of the main motion beside the title, clear of the balls."""
    from matplotlib.transforms import offset_copy  # noqa: PLC0415

    head, tail = (
        offset_copy(axis.transAxes, axis.figure, *(np.array([-14.0, 9.0]) + side * np.array(direction)), units="points")
        for side in (11.0, -11.0)
    )
    axis.annotate(
        "", (1.0, 1.0), (1.0, 1.0), xycoords=head, textcoords=tail, annotation_clip=False,
        arrowprops={"arrowstyle": "<->", "color": GREY, "lw": 1.0, "shrinkA": 0.0, "shrinkB": 0.0},
    )  # fmt: skip


def window(x: Array, radii: Array) -> Array:
    """Return the lowest and highest x, y of a picture of balls (..., 2) [m], at least a third as high as wide."""
    margin = 1.35 * max(radii)
    low, high = x.reshape(-1, 2).min(axis=0) - margin, x.reshape(-1, 2).max(axis=0) + margin
    spare = np.maximum(0.34 * float(np.max(high - low)) - (high - low), 0.0) / 2.0
    return np.array([low - spare, high + spare])


def set_window(axis: Any, seen: Array, length: Unit) -> None:
    """Set the limits and headings of an axis that shows a `window`."""
    xlim, ylim = seen.T / length.size
    axis.set(xlim=xlim, ylim=ylim, aspect="equal", xlabel=length.heading("x"), ylabel=length.heading("y"))


def _size(seen: Array, width: float) -> tuple[float, float]:
    extent = seen[1] - seen[0]
    wide, tall = width * extent / math.sqrt(np.prod(extent))
    return float(wide) + 0.6, float(tall) + 0.7
