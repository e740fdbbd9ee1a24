"""Drawing of a load step in three dimensions by VTK, off screen: layer and balls, whole or cut through the axes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runs.display.surface import section_line
from runs.pictures.coloring import Array, Coloring
from runs.pictures.written_step import DrawnBall, WrittenStep

VIEWS = {
    "cut": "cut through the axes of the balls: the dent from the side, the field inside the layer",
    "surface": "from above, with balls to look through: the field on the surface",
}
_BEYOND = 1.5
"""Distance of the edge of the drawn layer beyond the axes of the outermost balls, in their radii."""
_BALL, _SECTION, _BASE = "#b9c2cf", "#dde2e9", "#9aa1ab"
_SUPERSAMPLING = 2
_INSIDE = 1e-5
"""Distance of the cut behind the balls' axes, in layer thicknesses: a half model ends at the axes up to roundoff."""
_TALL = 1.0
"""Least height of a drawn body other than a sphere, in its half widths."""
_DEEP = 1.15
"""Depth of the drawing, base included, in layer thicknesses."""


def in_line(step: WrittenStep) -> WrittenStep:
    """Return a step in the frame of its picture: x along the line of the balls from ball 0 on, z up."""
    origin, along, across = section_line([ball.position for ball in step.balls])
    turn = np.eye(3)
    turn[:2, :2] = np.stack([along, across], axis=1)
    balls = tuple(
        replace(
            ball,
            position=tuple((ball.position - origin) @ turn[:2, :2]),
            outline=None if ball.outline is None else ball.outline @ turn,
        )
        for ball in step.balls
    )
    points, displacement = (step.points - [*origin, 0.0]) @ turn, step.displacement @ turn
    if not step.deformed:  # small strain: contact is at the undeformed place, moved straight down
        displacement[:, :2] = 0.0
    return replace(step, points=points, displacement=displacement, balls=balls)


@dataclass(frozen=True)
class Window:
    """The part of a step `in_line` that is drawn: ends along x, half width across, depth of the layer, in m."""

    length: tuple[float, float]
    width: float
    depth: float

    @classmethod
    def around(cls, step: WrittenStep) -> Window:
        """Return the window around all balls of a step: it is the same for every step of a run."""
        x, y = np.transpose([ball.position for ball in step.balls])
        margin = _BEYOND * max(ball.extent for ball in step.balls)
        low, high = step.points.min(axis=0), step.points.max(axis=0)
        length = (max(x.min() - margin, low[0]), min(x.max() + margin, high[0]))
        return cls(length, min(np.abs(y).max() + margin, max(-low[1], high[1])), step.thickness)

    def corners(self, cut: bool) -> Array:
        """Return the corners (8, 3) of the layer that is seen."""
        return np.array(list(product(self.length, (0.0 if cut else -self.width, self.width), (-_DEEP * self.depth, 0))))

    def contains(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points (n, 3) lie in the drawn part of the layer."""
        x, y, _ = points.T
        return (x >= self.length[0]) & (x <= self.length[1]) & (np.abs(y) <= self.width)


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera at infinity: directions to the right, up and towards it; centre and half height of the picture."""

    right: Array
    up: Array
    towards: Array
    centre: Array
    half_height: float

    @classmethod
    def on(cls, step: WrittenStep, view: str, aspect: float) -> Camera:
        """Return the camera of a view that shows the whole window and all balls; ``aspect`` is width over height."""
        window = Window.around(step)
        azimuth, elevation = {"cut": (-14.0, 20.0), "surface": (-28.0, 34.0)}[view]
        a, e = math.radians(azimuth), math.radians(elevation)
        towards = np.array([math.cos(e) * math.sin(a), -math.cos(e) * math.cos(a), math.sin(e)])
        right = np.array([math.cos(a), math.sin(a), 0.0])
        up = np.cross(towards, right)
        tops = [  # of the balls before they are pressed in: the same for every step of a run
            np.array([*ball.position, ball.extent]) + ball.extent * side
            for ball in step.balls
            for side in (right, -right, up)
        ]
        corners = np.concatenate([window.corners(view == "cut"), tops])
        x, y = corners @ right, corners @ up
        centre = 0.5 * ((x.max() + x.min()) * right + (y.max() + y.min()) * up)
        half = 0.5 * max(np.ptp(y), np.ptp(x) / aspect)
        return cls(right, up, towards, centre, 1.03 * float(half))


def draw(
    step: WrittenStep, values: Array, coloring: Coloring, limits: tuple[float, float], view: str, size: tuple[int, int]
) -> NDArray[np.uint8]:
    """Return the picture (height, width, 3) of a step `in_line`, coloured by ``values`` at its nodes."""
    import pyvista  # noqa: PLC0415
    from PIL import Image  # noqa: PLC0415  (comes with matplotlib)

    window = Window.around(step)
    camera = Camera.on(step, view, size[0] / size[1])
    plotter = pyvista.Plotter(off_screen=True, window_size=[_SUPERSAMPLING * n for n in size], lighting="none")
    try:
        plotter.set_background("white")
        _set_lights(plotter, camera)
        layer = _clipped(_grid(step, values, step.region == 1), window, cut=view == "cut")
        how: dict[str, Any] = {"cmap": coloring.color_map(), "clim": limits, "show_scalar_bar": False, "n_colors": 256}
        top, front, sides = _faces(layer, window)
        plotter.add_mesh(top, scalars="values", smooth_shading=True, ambient=0.5, diffuse=0.6, specular=0.03, **how)
        for plane, shade in ((front, 1.0 if view == "cut" else 0.88), (sides, 0.8)):  # flat: colours as in the bar
            if plane.n_cells:
                plotter.add_mesh(plane, scalars="values", ambient=shade, diffuse=0.0, specular=0.0, **how)
        base = _base(step, window, cut=view == "cut")
        plotter.add_mesh(base, color=_BASE, ambient=0.45, diffuse=0.6)
        for ball in step.balls:
            _add_ball(plotter, ball, view)
        plotter.camera.parallel_projection = True
        plotter.camera.focal_point = camera.centre
        plotter.camera.position = camera.centre + 10.0 * camera.half_height * camera.towards
        plotter.camera.up = camera.up
        plotter.camera.parallel_scale = camera.half_height
        plotter.reset_camera_clipping_range()
        image = plotter.screenshot(return_img=True)
    finally:
        plotter.close()
    return np.asarray(Image.fromarray(np.asarray(image)[..., :3]).reduce(_SUPERSAMPLING))


def _grid(step: WrittenStep, values: Array, part: NDArray[np.bool_]) -> Any:
    import pyvista  # noqa: PLC0415

    kind = {8: pyvista.CellType.HEXAHEDRON, 4: pyvista.CellType.TETRA}[step.cells.shape[1]]
    grid = pyvista.UnstructuredGrid({kind: step.cells[part]}, step.points + step.displacement)
    grid.point_data["values"] = values
    return grid


def _clipped(grid: Any, window: Window, cut: bool) -> Any:
    """Return the visible part of the layer: within the window, and beyond the cut."""
    near = _INSIDE * window.depth if cut else -window.width
    ends = (0, window.length[0]), (0, window.length[1]), (1, near), (1, window.width), (2, -_DEEP * window.depth)
    for (axis, end), below in zip(ends, (False, True, False, True, False), strict=True):
        normal = np.eye(3)[axis]
        grid = grid.clip(normal=normal, origin=end * normal, invert=below)
    return grid


def _faces(grid: Any, window: Window) -> tuple[Any, Any, Any]:
    """Return the surface of the layer, the cut plane that faces the camera, and the other planes."""
    surface = grid.extract_surface(algorithm="dataset_surface").triangulate()
    a, b, _ = np.asarray(surface.cell_centers().points).T
    near = 1e-6 * window.depth
    front = b < max(float(b.min()) + near, near - window.width)
    sides = (a < window.length[0] + near) | (a > window.length[1] - near) | (b > window.width - near)
    sides &= ~front
    return tuple(
        surface.extract_cells(np.flatnonzero(part)).extract_surface(algorithm="dataset_surface")
        for part in (~front & ~sides, front, sides)
    )


def _base(step: WrittenStep, window: Window, cut: bool) -> Any:
    """Return the upper part of the substrate as it was simulated, or a slab for the rigid base."""
    import pyvista  # noqa: PLC0415

    substrate = step.region != 1
    if substrate.any():
        grid = _clipped(_grid(step, np.zeros(len(step.points)), substrate), window, cut)
        return grid.extract_surface(algorithm="dataset_surface").compute_normals(split_vertices=True)
    low, high = window.length
    near = 0.0 if cut else -window.width
    return pyvista.Box((low, high, near, window.width, -_DEEP * window.depth, -1.0001 * window.depth))


def _add_ball(plotter: Any, ball: DrawnBall, view: str) -> None:
    whole = _ball(ball)
    smooth = ball.shape == "sphere" and ball.outline is None  # others have edges, and their facets are small enough
    if view == "surface":
        plotter.add_mesh(
            whole, color=_BALL, opacity=0.35, smooth_shading=smooth, specular=0.6,
            specular_power=50, ambient=0.2,
        )  # fmt: skip
        return
    half = whole.clip(normal="y", origin=(0.0, 0.0, 0.0), invert=False)
    plotter.add_mesh(
        half, color=_BALL, smooth_shading=smooth, specular=0.35, specular_power=30, ambient=0.25,
    )  # fmt: skip
    section = whole.slice(normal="y", origin=(0.0, 0.0, 0.0))
    if section.n_points:
        plotter.add_mesh(section.triangulate_contours(), color=_SECTION, lighting=False)
        plotter.add_mesh(section, color="#5c626b", line_width=1.5 * _SUPERSAMPLING)


def _ball(ball: DrawnBall) -> Any:
    import pyvista  # noqa: PLC0415

    x, y = ball.position
    if ball.shape == "sphere" and ball.outline is None:
        center = (x, y, ball.radius - ball.approach)
        return pyvista.Icosphere(radius=ball.radius, center=center, nsub=6)
    outline = _paraboloid(ball.radius) if ball.outline is None else ball.outline
    outline = np.concatenate([outline[:-1], outline[:1]])  # its ends are one line, to the last digit
    top = max(outline[..., 2].max(), _TALL * ball.extent)
    wall, lid = outline[:, -1:].copy(), np.zeros_like(outline[:, -1:])
    wall[..., 2] = lid[..., 2] = top
    u, v, w = np.moveaxis(np.concatenate([outline, wall, lid], axis=1), 2, 0)
    body = pyvista.StructuredGrid(x + u, y + v, w - ball.approach)
    closed = body.extract_surface(algorithm="dataset_surface").clean().triangulate()
    return closed.compute_normals(consistent_normals=True, auto_orient_normals=True, point_normals=False)


def _paraboloid(radius: float) -> Array:
    r, angle = np.meshgrid(np.linspace(0.0, radius, 60), np.linspace(0.0, 2.0 * math.pi, 181))
    return np.stack([r * np.cos(angle), r * np.sin(angle), r**2 / (2.0 * radius)], axis=2)


def _set_lights(plotter: Any, camera: Camera) -> None:
    """Set a key light from the upper left, a fill light from the right and a weak one from behind."""
    import pyvista  # noqa: PLC0415

    for number, ((x, y, z), strength) in enumerate(
        (((-0.5, 0.9, 0.9), 0.7), ((0.8, 0.2, 1.0), 0.45), ((-0.9, -0.2, 0.5), 0.25))
    ):
        direction = x * camera.right + y * camera.up + z * camera.towards
        light = pyvista.Light(
            position=camera.centre + direction, focal_point=camera.centre, intensity=strength, light_type="scene light"
        )
        if number > 0:
            light.specular_color = "black"  # one highlight on a ball is enough
        plotter.add_light(light)
