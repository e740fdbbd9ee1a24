"""Plan-view figures of results and solutions; matplotlib is imported only to draw them."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from linear_bem.errors import MissingDependency

UNITS = {"m": 1.0, "mm": 1e-3, "µm": 1e-6}
"""Units of the axes: the largest that is at most ten times the figure's extent is used; the drawn data are in m."""
NUMBERED = 100
"""Largest number of balls that are numbered."""
CELLS = 200
"""Points across the map of the pressure."""


def plan_of_balls(balls: Sequence[Any], pressure: Callable[[Array, Array], Array] | None = None) -> Any:
    """Return a figure of numbered balls: contacts as circles of their areas, T as arrows, the largest T in the title.

    ``balls`` are `BallResult`s. A ``pressure`` [Pa] as a function of surface points [m] is drawn as a map.
    """
    new_figure = _figures()
    from matplotlib.patches import Circle  # noqa: PLC0415

    x, y = (np.array([ball.position[k] for ball in balls]) for k in (0, 1))
    radii = np.sqrt(np.array([ball.contact_area for ball in balls]) / np.pi)
    force = np.array([ball.tangential_force for ball in balls])
    sizes = np.hypot(*force.T)
    margin = 2.5 * float(np.max(radii))
    left, right, low, high = np.min(x) - margin, np.max(x) + margin, np.min(y) - margin, np.max(y) + margin
    shape = float(np.clip(5.4 * (high - low) / (right - left), 1.8, 8.0))
    figure = new_figure(figsize=(6.4, shape + 1.1), layout="constrained")  # room for title and labels
    axes = figure.subplots()
    if pressure is not None:
        u, v = np.meshgrid(np.linspace(left, right, CELLS), np.linspace(low, high, CELLS))
        drawn = axes.imshow(pressure(u, v), extent=(left, right, low, high), origin="lower", cmap="Blues")
        figure.colorbar(drawn, ax=axes, label="contact pressure [Pa]")
    largest = float(np.max(sizes))
    for i, (centre, radius) in enumerate(zip(np.stack([x, y], axis=1), radii, strict=True)):
        axes.add_patch(Circle(tuple(centre), radius, fill=False, color="0.3", lw=0.8))
        if len(balls) <= NUMBERED:
            away = -force[i] / sizes[i] if sizes[i] > 1e-3 * largest else np.array([0.0, 1.0])  # clear of the arrow
            axes.annotate(
                f"{i}", tuple(centre + radius * away), tuple(7.0 * away), textcoords="offset points",
                ha="center", va="center", fontsize="small",
            )  # fmt: skip
    if largest > 0.0:
        length = 2.0 * float(np.max(radii)) / largest
        axes.quiver(
            x, y, length * force[:, 0], length * force[:, 1], angles="xy", scale_units="xy", scale=1.0,
            color="tab:red", width=0.006, zorder=3,
        )  # fmt: skip
        axes.set_title(f"contacts and tangential forces, the longest arrow {largest:.3g} N", fontsize="medium")
    _label(axes, max(right - left, high - low))
    axes.set(xlim=(left, right), ylim=(low, high), aspect="equal")
    return figure


def map_of_pressure(pressure: Array, cell: float) -> Any:
    """Return a figure of the pressures [Pa] of square cells of side ``cell`` [m]; the first index is along x."""
    across, along = (cell * count for count in pressure.shape)
    figure = _figures()(figsize=(6.4, float(np.clip(5.4 * along / across, 1.8, 8.0)) + 0.6), layout="constrained")
    axes = figure.subplots()
    drawn = axes.imshow(pressure.T, extent=(0.0, across, 0.0, along), origin="lower", cmap="Blues")
    figure.colorbar(drawn, ax=axes, label="contact pressure [Pa]")
    _label(axes, max(across, along))
    return figure


def _figures() -> Any:
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise MissingDependency(f"plot: needs matplotlib ({error}); install it: pip install matplotlib") from error
    return Figure


def _label(axes: Any, extent: float) -> None:
    unit, size = next((name, size) for name, size in UNITS.items() if extent > 0.1 * size or name == "µm")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda value, _: f"{value / size:.6g}")
    axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
