"""Drawing of a load step in three dimensions by VTK, off screen: layer and balls, whole or cut through the axes."""

from __future__ import annotations

import math
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Window:
    """The part of a scene that is drawn, along the line of the balls (from ``origin``) and across it, in m."""

    origin: Array
    along: Array
    across: Array
    length: tuple[float, float]
    width: float
    depth: float

    @classmethod
    def around(cls, step: WrittenStep) -> Window:
        """Return the window around all balls of a step: it is the same for every step of a run."""
        positions = np.array([ball.position for ball in step.balls])
        radius = max(ball.extent for ball in step.balls)
        origin, along, across = section_line(positions)
        nodes = step.points[:, :2] - origin
        reach = [nodes @ along, nodes @ across]
        at = (positions - origin) @ along
        margin = _BEYOND * radius
        length = (max(at.min() - margin, reach[0].min()), min(at.max() + margin, reach[0].max()))
        sideways = np.abs((positions - origin) @ across).max() + margin
        return cls(
            np.array([*origin, 0.0]), np.array([*along, 0.0]), np.array([*across, 0.0]), length,
            min(sideways, float(np.abs(reach[1]).max())), step.thickness,
        )  # fmt: skip

    def corners(self, cut: bool) -> Array:
        """Return the corners (8, 3) of the layer that is seen."""
        return np.array(
            [
                self.origin + a * self.along + b * self.across + np.array([0.0, 0.0, z])
                for a in self.length
                for b in (0.0 if cut else -self.width, self.width)
                for z in (-_DEEP * self.depth, 0.0)
            ]
        )

    def contains(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points (n, 3) lie in the drawn part of the layer."""
        a, b = (points - self.origin) @ self.along, (points - self.origin) @ self.across
        return (a >= self.length[0]) & (a <= self.length[1]) & (np.abs(b) <= self.width)


@dataclass(frozen=True)
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
        flat = math.sin(a) * window.along - math.cos(a) * window.across
        towards = math.cos(e) * flat + math.sin(e) * np.array([0.0, 0.0, 1.0])
        right = np.cross([0.0, 0.0, 1.0], towards)
        right /= np.linalg.norm(right)
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
    """Return the picture (height, width, 3) of a step coloured by ``values`` at its nodes."""
    import pyvista  # noqa: PLC0415

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
            _add_ball(plotter, ball, window, view)
        plotter.camera.parallel_projection = True
        plotter.camera.focal_point = camera.centre
        plotter.camera.position = camera.centre + 10.0 * camera.half_height * camera.towards
        plotter.camera.up = camera.up
        plotter.camera.parallel_scale = camera.half_height
        plotter.reset_camera_clipping_range()
        image = plotter.screenshot(return_img=True)
    finally:
        plotter.close()
    return _averaged(np.asarray(image)[..., :3])


def _grid(step: WrittenStep, values: Array, part: NDArray[np.bool_]) -> Any:
    import pyvista  # noqa: PLC0415

    kind = {8: pyvista.CellType.HEXAHEDRON, 4: pyvista.CellType.TETRA}[step.cells.shape[1]]
    grid = pyvista.UnstructuredGrid({kind: step.cells[part]}, step.points + step.displacement)
    grid.point_data["values"] = values
    return grid


def _clipped(grid: Any, window: Window, cut: bool) -> Any:
    """Return the visible part of the layer: within the window, and beyond the cut."""
    sides = [
        (window.along, window.origin + window.length[1] * window.along, True),
        (window.along, window.origin + window.length[0] * window.along, False),
        (window.across, window.origin + window.width * window.across, True),
        (window.across, window.origin + (_INSIDE * window.depth if cut else -window.width) * window.across, False),
        (np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -_DEEP * window.depth]), False),
    ]
    for normal, origin, below in sides:
        grid = grid.clip(normal=normal, origin=origin, invert=below)
    return grid


def _faces(grid: Any, window: Window) -> tuple[Any, Any, Any]:
    """Return the surface of the layer, the cut plane that faces the camera, and the other planes."""
    surface = grid.extract_surface(algorithm="dataset_surface").triangulate()
    centres = np.asarray(surface.cell_centers().points) - window.origin
    a, b = centres @ window.along, centres @ window.across
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
    slab = pyvista.Box((low, high, near, window.width, -_DEEP * window.depth, -1.0001 * window.depth))
    turn = np.eye(4)
    turn[:3, 0], turn[:3, 1], turn[:3, 3] = window.along, window.across, window.origin
    return slab.transform(turn, inplace=False)


def _add_ball(plotter: Any, ball: DrawnBall, window: Window, view: str) -> None:
    whole = _ball(ball)
    smooth = ball.shape == "sphere" and ball.outline is None  # others have edges, and their facets are small enough
    if view == "surface":
        plotter.add_mesh(
            whole, color=_BALL, opacity=0.35, smooth_shading=smooth, specular=0.6,
            specular_power=50, ambient=0.2,
        )  # fmt: skip
        return
    half = whole.clip(normal=window.across, origin=window.origin, invert=False)
    plotter.add_mesh(
        half, color=_BALL, smooth_shading=smooth, specular=0.35, specular_power=30, ambient=0.25,
    )  # fmt: skip
    section = whole.slice(normal=window.across, origin=window.origin)
    if section.n_points:
        plotter.add_mesh(_filled(section), color=_SECTION, lighting=False)
        plotter.add_mesh(section, color="#5c626b", line_width=1.5 * _SUPERSAMPLING)


def _filled(outline: Any) -> Any:
    """Return the convex polygon inside an outline."""
    import pyvista  # noqa: PLC0415

    points = np.asarray(outline.points)
    centre = points.mean(axis=0)
    offsets = points - centre
    first = offsets[0] / np.linalg.norm(offsets[0])
    normal = np.linalg.svd(offsets)[2][2]
    angle = np.arctan2(offsets @ np.cross(normal, first), offsets @ first)
    order = np.argsort(angle)
    return pyvista.PolyData(points[order], faces=[len(order), *range(len(order))]).triangulate()


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
        light.positional = False
        if number > 0:
            light.specular_color = "black"  # one highlight on a ball is enough
        plotter.add_light(light)


def _averaged(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the picture with each block of rendered pixels averaged to one pixel."""
    n = _SUPERSAMPLING
    height, width = image.shape[0] // n, image.shape[1] // n
    blocks = image[: height * n, : width * n].reshape(height, n, width, n, 3)
    return blocks.mean(axis=(1, 3)).round().astype(np.uint8)
