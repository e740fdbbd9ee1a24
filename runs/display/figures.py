"""Figures of a run: T over the load in both models, and the deformed surface under its contact pressure."""

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from linear_bem.arrays import Array
from linear_bem.indenter import Indenter, Sphere
from linear_bem.problem import Problem
from linear_bem.smooth.contacts import SmoothContacts
from linear_bem.solution import Solution
from runs.display import surface
from runs.display.contact_patch import Patch, contact_patch, patch_within
from runs.display.numbers import Scale, leading_ball, line_of
from runs.display.rows import LEGEND, compared_line, legend_of_line
from runs.display.style import BLUE, GREEN, ORANGE, blank, dark_on_white, look, save_figure

LINEAR, FINITE, APPROACH = BLUE, ORANGE, GREEN
BARS: dict[str, Any] = {"ms": 4, "capsize": 3}
"""Markers and error bars of every curve."""
SAME = 0.25
"""Largest relative deviation of a drawn contact's area and force from the result."""
NUMBERED = 40
"""Largest number of balls that are numbered from above."""
OF_A_CELL = "; without images"
NAMES = {"finite_strain": "finite strain", "small_strain": "small strain (finite elements)"}


@look()
def draw_comparison(
    folder: Path, rows: Sequence[Mapping[str, Any]], balls: Sequence[Mapping[str, Any]], scale: Scale,
    between: Sequence[Mapping[str, float]] = (),
) -> None:  # fmt: skip
    """Write tangential_force.png and .svg: T(Q) of both models, and both strengthening factors over the approach.

    ``between`` are rows of `runs.comparison.interpolant.table`, drawn as curves.
    """
    ball = leading_ball(balls)
    path = [row for row in rows if row["ball"] == ball]
    along, kind = compared_line(path, balls, ball)
    figure = blank(9.6, 4.0)
    forces, factors = figure.subplots(1, 2)
    unit = scale.units.force.size
    load = _column(path, "normal_force") / unit
    for model, label, color, marker in (
        ("linear", "linear (small strain)", LINEAR, "s"), ("finite", "finite strain", FINITE, "o"),
    ):  # fmt: skip
        force = _column(path, f"tangential_{model}") @ along / unit
        error = _column(path, f"tangential_{model}_error") / unit
        forces.errorbar(load, force, error, color=color, marker=marker, label=label, **BARS)
    _label_forces(forces, scale, legend_of_line(balls, kind, "T linear"))
    length = scale.units.length
    depth = _column(path, "approach") / length.size
    beside = 0.006 * depth.max()  # the two curves often coincide: separate their error bars
    for key, color, marker, label in (
        ("force", FINITE, "o", "$S_Q$: at equal normal force"),
        ("approach", APPROACH, "^", "$S_D$: at equal approach"),
    ):
        ratio, error = (_column(path, f"strengthening_at_{key}{part}") for part in ("", "_error"))
        if not np.any(np.isfinite(ratio)):
            continue  # one ball, or no tangential force above its error
        at, line = depth + (beside if key == "approach" else 0.0), "none" if between else "-"
        factors.errorbar(at, ratio, error, color=color, marker=marker, ls=line, label=label, **BARS)
        x, y = _column(between, "approach") / length.size, _column(between, f"strengthening_at_{key}")
        factors.plot(x, y, color=color, lw=1.0)
    factors.axhline(1.0, color="0.5", lw=0.8, zorder=0)
    factors.set_xlabel(f"{length.heading('approach $D$')} ($S_D$ is drawn a little to the right)")
    factors.set_ylabel("T finite / T linear")
    factors.set_xlim(left=0.0)
    factors.set_title("Finite over small strain")
    if factors.get_legend_handles_labels()[0]:
        factors.legend()
    else:
        factors.text(0.5, 0.5, "no tangential force to compare", transform=factors.transAxes, ha="center")
    save_figure(figure, folder, "tangential_force")


@look()
def draw_path(folder: Path, steps: Sequence[Mapping[str, Any]], scale: Scale, model: str) -> None:
    """Write tangential_force.png and .svg: T(Q) of one model."""
    last = steps[-1]["balls"]
    ball = leading_ball(last)
    along, kind = line_of(last, ball, last[ball]["tangential_force"], periodic=scale.periodic)
    states = [step["balls"][ball] for step in steps]
    figure = blank(4.8, 4.0)
    forces = figure.subplots()
    unit = scale.units.force.size
    force = _column(states, "tangential_force") @ along / unit
    error, load = (_column(states, key) / unit for key in ("tangential_force_error", "normal_force"))
    forces.errorbar(load, force, error, color=FINITE, marker="o", label=NAMES.get(model, model), **BARS)
    _label_forces(forces, scale, legend_of_line(last, kind))
    save_figure(figure, folder, "tangential_force")


@look()
def draw_surface(folder: Path, problem: Problem, balls: Sequence[Mapping[str, Any]], scale: Scale) -> None:
    """Write surface.png: contact pressure from above and a section through the balls; nothing without a surface."""
    top = surface.load(folder)
    if top is None:
        return
    figure, above, below = _sheet(balls, scale)
    _draw_pressure(figure, above, top, balls, scale)
    _draw_section(below, surface.section(top, [ball["position"] for ball in balls]), problem, balls, scale)
    save_figure(figure, folder, "surface", ("png",))


@look()
def draw_contacts(folder: Path, solution: Solution, balls: Sequence[Mapping[str, Any]], scale: Scale) -> None:
    """Write surface.png as `draw_surface`, for a solution of the linear model."""
    figure, above, below = _sheet(balls, scale)
    patches = [_solved_patch(solution, i, ball) for i, ball in enumerate(balls) if ball["contact_area"] > 0.0]
    _draw_patches(figure, above, patches, max(float(patch.pressure.max()) for patch in patches), balls, scale)
    origin, along, _ = surface.section_line([ball["position"] for ball in balls])
    line = np.linspace(*_span(balls, along), 801)
    x, y = (origin + np.outer(line - along @ origin, along)).T
    contacts = solution.contacts
    depth = contacts.displacement(x, y) if isinstance(contacts, SmoothContacts) else contacts.drawn_displacement(x, y)
    _draw_section(below, (line, -depth), solution.problem, balls, scale)
    save_figure(figure, folder, "surface", ("png",))


@look()
def draw_many(folder: Path, balls: Sequence[Mapping[str, Any]], scale: Scale) -> None:
    """Write forces.png: many balls from above, their contacts coloured by peak pressure, T as arrows."""
    from matplotlib.collections import EllipseCollection  # noqa: PLC0415

    length, pressure = scale.units.length, scale.units.pressure
    window, x = _window(balls, scale), _column(balls, "position") / length.size
    extent = np.ptp(window, axis=1)
    window += np.outer(np.maximum(0.2 * extent.max() - extent, 0.0), (-0.5, 0.5))  # of a row
    force, bodies = _column(balls, "tangential_force"), 2.0 * _column(balls, "radius") / length.size
    largest = float(np.max(np.hypot(*force.T)))
    arrows = force / (largest or 1.0) * bodies.max()
    tips = x + 1.05 * arrows
    window[:, 0], window[:, 1] = np.minimum(window[:, 0], tips.min(axis=0)), np.maximum(window[:, 1], tips.max(axis=0))
    figure = blank(8.0, min(6.2 * float(np.divide(*np.ptp(window, axis=1)[::-1])), 12.0) + 0.9)
    axes = figure.subplots()
    contact = 2.0 * np.sqrt(_column(balls, "contact_area") / math.pi) / length.size
    peak = _column(balls, "peak_pressure") / pressure.size
    shared: dict[str, Any] = {"angles": np.zeros(len(x)), "units": "x", "offsets": x, "transOffset": axes.transData}
    axes.add_collection(EllipseCollection(bodies, bodies, facecolors="none", edgecolors="0.7", lw=0.5, **shared))
    drawn = axes.add_collection(EllipseCollection(contact, contact, array=peak, cmap=dark_on_white(), **shared))
    drawn.set_clim(0.0)
    figure.colorbar(drawn, ax=axes, label=pressure.heading("peak pressure"), shrink=0.7)
    words = "T is zero"
    if largest > 0.0:
        axes.quiver(*x.T, *arrows.T, angles="xy", scale_units="xy", scale=1.0, color=ORANGE, width=2e-3)
        words = f"T as arrows, the longest {scale.units.force(largest, 3)}"
    axes.set(xlim=window[0], ylim=window[1], aspect="equal", xlabel=length.heading("$x$"), ylabel=length.heading("$y$"))
    axes.set_title(f"Contacts from above; {words}{OF_A_CELL * scale.periodic}")
    save_figure(figure, folder, "forces", ("png",))


def _solved_patch(solution: Solution, index: int, ball: Mapping[str, Any]) -> Patch:
    """Return the contact of a ball; the edge of one on a grid of cells is fitted if the fit is good."""
    patch = patch_within(*solution.outline(index), solution.pressure)
    if isinstance(solution.contacts, SmoothContacts):
        return patch
    points = np.stack([patch.x.ravel(), patch.y.ravel()], axis=1)
    return _patch(points, patch.pressure.ravel(), ball) or patch


def _sheet(balls: Sequence[Mapping[str, Any]], scale: Scale) -> tuple[Any, Any, Any]:
    """Return an empty figure with its axes for the view from above and for the section."""
    (x0, x1), (y0, y1) = _window(balls, scale)
    width, ratio = 6.6, min(max((y1 - y0) / (x1 - x0), 0.3), 1.2)
    figure = blank(width, 0.8 * width * (ratio + 0.35) + 1.6)
    above, below = figure.subplots(2, 1, height_ratios=(ratio, 0.35))
    return figure, above, below


def _draw_pressure(
    figure: Any, axes: Any, top: surface.Surface, balls: Sequence[Mapping[str, Any]], scale: Scale
) -> None:
    length, unit = scale.units.length, scale.units.pressure
    points, positions = top.points[:, :2], np.array([ball["position"] for ball in balls])
    nearest = np.argmin(np.linalg.norm(points[:, None] - positions, axis=2), axis=1)
    patches: list[Patch | None] = [None] * len(balls)
    for pointed, pressure in itertools.product((False, True), surface.smoothed(top)):
        for i, ball in enumerate(balls):
            patches[i] = patches[i] or _patch(points[nearest == i], pressure[nearest == i], ball, pointed)
        if all(patches):
            break
    raw = np.where(np.isin(nearest, [i for i, patch in enumerate(patches) if patch is None]), pressure, 0.0)
    largest = max([raw.max(), *(patch.pressure.max() for patch in patches if patch is not None)])
    axes.tripcolor(*points.T / length.size, top.triangles, raw / unit.size, **_shades(largest / unit.size))
    _draw_patches(figure, axes, [patch for patch in patches if patch is not None], float(largest), balls, scale)


def _shades(largest: float) -> dict[str, Any]:
    return {"shading": "gouraud", "cmap": dark_on_white(), "vmin": 0.0, "vmax": float(largest)}


def _draw_patches(
    figure: Any, axes: Any, patches: Sequence[Patch], largest: float, balls: Sequence[Mapping[str, Any]], scale: Scale
) -> None:
    """Draw contacts with their edges, colours up to the ``largest`` pressure [Pa], and all that is around them."""
    from matplotlib.patheffects import withStroke  # noqa: PLC0415

    length, unit = scale.units.length, scale.units.pressure
    for patch in patches:
        x, y = patch.x / length.size, patch.y / length.size
        axes.pcolormesh(x, y, patch.pressure / unit.size, rasterized=True, **_shades(largest / unit.size))
        axes.plot(x[-1], y[-1], color="0.15", lw=1.2)
    mesh = axes.collections[-1]
    figure.colorbar(mesh, ax=axes, label=unit.heading("contact pressure $p$"), shrink=0.9)
    for i, ball in enumerate(balls):
        x, y = (c / length.size for c in ball["position"])
        axes.plot(x, y, "+", color="white", ms=10, mew=1.8)
        if 1 < len(balls) <= NUMBERED:
            above = y + math.sqrt(ball["contact_area"] / math.pi) / length.size
            words = axes.annotate(f"{i}", (x, above), (0, 3), textcoords="offset points", ha="center", fontsize=9)
            words.set_path_effects([withStroke(linewidth=2.5, foreground="white")])  # inside a long contact, too
    (x0, x1), (y0, y1) = _window(balls, scale)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xlabel=length.heading("$x$"), ylabel=length.heading("$y$"))
    axes.set_title(f"Contact pressure from above (+: axes of the balls{OF_A_CELL * scale.periodic})")


def _patch(points: Array, pressure: Array, ball: Mapping[str, Any], pointed: bool = False) -> Patch | None:
    """Return the contact of a ball or of a pointed body if its area and force are about those of the result."""
    patch = contact_patch(points, pressure, pointed)
    if patch is None:
        return None
    pairs = (patch.area, ball["contact_area"]), (patch.force, ball["normal_force"])
    return patch if all(abs(drawn - known) <= SAME * known for drawn, known in pairs) else None


def _draw_section(
    axes: Any, crossing: tuple[Array, Array], problem: Problem, balls: Sequence[Mapping[str, Any]], scale: Scale
) -> None:
    """Draw a section: ``crossing`` holds coordinates along it and heights of the surface [m]."""
    size = scale.units.length.size
    line, heights = crossing
    axes.plot(line / size, heights / size, color=FINITE, lw=2.2, label="surface", zorder=3)
    axes.axhline(0.0, color="0.3", lw=1.0, ls="--", zorder=4)
    origin, along, normal = surface.section_line([ball["position"] for ball in balls])
    lowest = min(float(np.nanmin(heights)), 0.0)
    angle = np.linspace(-math.pi, 0.0, 181)
    for shape, ball in zip(problem.balls, balls, strict=True):
        center, aside = along @ ball["position"], normal @ (ball["position"] - origin)
        radius, body = shape.radius, shape.indenter
        if abs(aside) > (0.99 if isinstance(body, Sphere) else 1e-6) * radius:
            continue  # the section misses this ball, or does not show its profile
        if isinstance(body, Sphere):
            cut = math.sqrt(radius**2 - aside**2)
            x, z = center + cut * np.cos(angle), radius + cut * np.sin(angle) - ball["approach"]
        else:
            half, profile = (body.half_width(*along), body.height) if isinstance(body, Indenter) else (radius, body)
            half = half or 3.0 * math.sqrt(ball["contact_area"] / math.pi)
            t = np.linspace(-half, half, 181)
            x, z = center + t, profile(t * along[0], t * along[1]) - ball["approach"]
        axes.fill(x / size, z / size, color="#dde2e9", zorder=1)
        axes.plot(x / size, z / size, color="0.25", lw=1.2, zorder=2)
    axes.set(xlim=tuple(end / size for end in _span(balls, along)), aspect="equal")
    length = scale.units.length
    axes.set(xlabel=length.heading("along the section"), ylabel=length.heading("$z$"))
    axes.set_ylim((1.6 * lowest - 0.1 * scale.radius) / size, scale.radius / size)
    axes.set_title(f"{_section_words(balls)} (dashed: undeformed{OF_A_CELL * scale.periodic})")


def _section_words(balls: Sequence[Mapping[str, Any]]) -> str:
    if len(balls) == 1:
        return "Section along x through the ball"
    if len(balls) == 2:
        return "Section through the balls"
    return f"Section along the axes of balls 0 and {surface.farthest([ball['position'] for ball in balls])}"


def _span(balls: Sequence[Mapping[str, Any]], along: Array) -> tuple[float, float]:
    """Return the ends [m] of what is drawn along a line."""
    centers = [float(along @ ball["position"]) for ball in balls]
    margin = 1.3 * max(ball["radius"] for ball in balls)
    return min(centers) - margin, max(centers) + margin


def _window(balls: Sequence[Mapping[str, Any]], scale: Scale) -> Array:
    return np.array([_span(balls, axis) for axis in np.eye(2)]) / scale.units.length.size


def _label_forces(axes: Any, scale: Scale, legend: str) -> None:
    axes.axhline(0.0, color="0.5", lw=0.8, zorder=0)
    axes.set_xlabel(scale.units.force.heading("normal force $Q$"))
    axes.set_ylabel(scale.units.force.heading("tangential force $T$"))
    axes.set_xlim(left=0.0)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
    axes.set_title("T > 0: attraction, T < 0: separation" if LEGEND in legend else legend)
    axes.legend()


def _column(rows: Sequence[Mapping[str, Any]], key: str) -> Array:
    """Return the numbers or vectors with a key, nan for numbers that are None."""
    return np.array([row[key] for row in rows], dtype=float)
