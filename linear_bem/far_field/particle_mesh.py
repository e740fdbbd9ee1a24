r"""Convolution of point loads with a smooth radial kernel on a mesh.

Loads are spread to the nodes of a square mesh by B-splines, convolved there by FFT (on twice the mesh's size, so that
nothing wraps around, except in a `PeriodicMesh`), and the field is interpolated by the same splines: a symmetric
operator. Its transform is that of the kernel, divided in each direction by b(k), the transform of the spline of order
2 p at integers; p is the splines' order, H the spacing. This factor has the least mean square error [Hockney and
Eastwood 1988, Computer Simulation Using Particles, section 8-3] up to waves near pi/H. It is smooth and periodic in k,
so the end of the mesh affects few nodes. The relative error of a wave k = x pi/H is about (x/(2 - x))^p; waves of the
kernel beyond pi/H are lost.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft2, next_fast_len, rfft2
from scipy.interpolate import BSpline, PPoly
from scipy.sparse import csr_matrix

from linear_bem.arrays import Array, Indices
from linear_bem.errors import NotConverged

ORDER = 8
"""Order of the B-splines (degree 7): 64 nodes per point."""
SPLINE = PPoly.from_spline(BSpline.basis_element(np.arange(ORDER + 1.0)))


@dataclass(frozen=True)
class Points:
    """Splines at points: `value` and, on request, the derivatives `dx`, `dy` [1/m], of shape (points, nodes)."""

    value: csr_matrix
    dx: csr_matrix | None = None
    dy: csr_matrix | None = None


def mesh_shape(low: Array, high: Array, spacing: float) -> tuple[Indices, Indices]:
    """Return the numbers of nodes that cover rectangles (k, 2), and those of the meshes of twice the size."""
    nodes = np.ceil((np.atleast_2d(high) - np.atleast_2d(low)) / spacing).astype(int) + ORDER + 2
    lengths = {int(n): int(next_fast_len(2 * (int(n) + ORDER), real=True)) for n in np.unique(nodes)}
    return nodes, np.array([[lengths[int(n)] for n in row] for row in nodes])


class ParticleMesh:
    """Meshes over rectangles from ``low`` to ``high`` [m], one (2,) or several (k, 2), apart from each other.

    ``radial`` is the kernel as a function of r [m]. With several meshes, ``owners`` (balls,) holds the mesh of each
    ball; points are then sorted by ball, with equally many per ball.
    """

    def __init__(
        self, low: Array, high: Array, spacing: float, radial: Callable[[Array], Array], owners: Indices | None = None
    ) -> None:
        self.spacing = np.full(2, spacing)
        self.nodes, self.doubled = mesh_shape(low, high, spacing)
        self.origin = np.atleast_2d(np.asarray(low, dtype=float)) - spacing * (ORDER // 2)
        self.owners = np.zeros(1, dtype=np.intp) if owners is None else owners
        shapes = {(int(rows), int(columns)) for rows, columns in self.doubled}
        self.transforms = {shape: _transform(shape, spacing, radial) for shape in shapes}

    def _columns(self, base: Array, axis: int, owner: Indices) -> Array:
        """Return the nodes whose splines reach points that lie in cells ``base`` of an axis, shape (points, order)."""
        if not (np.all(base >= ORDER // 2 - 1) and np.all(base + ORDER // 2 < self.nodes[owner, axis])):
            raise NotConverged(
                "far field: a contact grew or moved out of the mesh of its first guess; press the balls less deep"
            )
        return np.asarray(base[:, None].astype(np.int32) + ORDER // 2 - np.arange(ORDER, dtype=np.int32))

    def at(self, x: Array, y: Array, slopes: bool = False) -> Points:
        """Return the splines at points [m]; raises `NotConverged` for points outside the mesh."""
        count = np.size(x)
        owner = np.repeat(self.owners, count // len(self.owners)) if len(self.nodes) > 1 else np.zeros(1, dtype=np.intp)
        weights, derivatives, indices = [], [], []
        for axis, at in enumerate((x, y)):
            scaled = (np.ravel(at) - self.origin[owner, axis]) / self.spacing[axis]
            base = np.floor(scaled)
            offsets = (scaled - base)[:, None] + np.arange(ORDER)
            weights.append(SPLINE(offsets))
            indices.append(self._columns(base, axis, owner))
            if slopes:
                derivatives.append(SPLINE(offsets, 1) / self.spacing[axis])
        ends = np.cumsum(np.prod(self.nodes, axis=1))
        first = (ends - np.prod(self.nodes, axis=1))[owner].astype(np.int32)
        of_rows = first[:, None] + indices[0] * self.nodes[owner, 1].astype(np.int32)[:, None]
        columns = (of_rows[:, :, None] + indices[1][:, None, :]).ravel()
        rows = np.arange(0, count * ORDER**2 + 1, ORDER**2, dtype=np.int32)
        shape = (count, int(ends[-1]))

        def matrix(u: Array, v: Array) -> csr_matrix:
            return csr_matrix(((u[:, :, None] * v[:, None, :]).ravel(), columns, rows), shape=shape)

        if not slopes:
            return Points(matrix(*weights))
        return Points(matrix(*weights), matrix(derivatives[0], weights[1]), matrix(weights[0], derivatives[1]))

    def field(self, points: Points, loads: Array) -> Array:
        """Return the field at the mesh's nodes from loads at points; a `Points` matrix interpolates it."""
        return self._convolved(points.value.T @ loads.ravel())

    def potential(self, points: Points, loads: Array) -> Array:
        """Return the field at points from the loads at these points."""
        return np.asarray(points.value @ self.field(points, loads))

    def slope(self, points: Points, loads: Array) -> Array:
        """Return the field's gradient (points, 2) at points with slopes from the loads at these points.

        Half is the derivative at the points, half that at the loads. The forces of any two loads on each other are then
        opposite, and a load exerts none on itself: the sum of load times gradient vanishes.
        """
        field, out = self.field(points, loads), np.empty((points.value.shape[0], 2))
        for axis, splines in enumerate((points.dx, points.dy)):
            assert splines is not None
            dipoles = self._convolved(splines.T @ loads.ravel())
            out[:, axis] = 0.5 * (splines @ field - points.value @ dipoles)
        return out

    def _convolved(self, spread: Array) -> Array:
        out, end = np.empty(spread.size), 0
        for nodes, doubled in zip(self.nodes.tolist(), self.doubled.tolist(), strict=True):
            begin, end = end, end + nodes[0] * nodes[1]
            transform = self.transforms[doubled[0], doubled[1]]
            wide = irfft2(rfft2(spread[begin:end].reshape(nodes), doubled) * transform, doubled)
            out[begin:end] = wide[: nodes[0], : nodes[1]].ravel()
        return out


def _transform(shape: tuple[int, int], spacing: float, radial: Callable[[Array], Array]) -> Array:
    """Return the transform of a radial kernel on a doubled mesh, divided by the splines' factor."""
    along = [np.minimum(np.arange(n), n - np.arange(n)) * spacing for n in shape]
    kernel = np.empty(shape)
    half = shape[0] // 2 + 1
    for rows in np.array_split(np.arange(half), max(1, half * shape[1] // 500_000)):
        kernel[rows] = radial(np.hypot(along[0][rows, None], along[1]))
    kernel[half:] = kernel[shape[0] - np.arange(half, shape[0])]
    transform = rfft2(kernel).real
    first, second = np.fft.fftfreq(shape[0], 1.0), np.fft.rfftfreq(shape[1], 1.0)
    return np.asarray(transform * _factor(first)[:, None] * _factor(second))


@dataclass(frozen=True)
class NestedMesh:
    """Meshes whose fields add up; coarse meshes cover larger regions than fine ones."""

    meshes: tuple[ParticleMesh, ...]

    def at(self, x: Array, y: Array) -> tuple[Points, ...]:
        """Return the splines of every mesh at points [m]."""
        return tuple(mesh.at(x, y) for mesh in self.meshes)

    def potential(self, points: tuple[Points, ...], loads: Array) -> Array:
        """Return the field at points from the loads at these points."""
        return np.sum([m.potential(p, loads) for m, p in zip(self.meshes, points, strict=True)], axis=0)

    def potential_at(self, x: Array, y: Array, loads: Array) -> Array:
        """Return the field at points [m] from the loads there, without keeping the splines."""
        return np.sum([mesh.potential(mesh.at(x, y), loads) for mesh in self.meshes], axis=0)

    def slope_at(self, x: Array, y: Array, loads: Array) -> Array:
        """Return the field's gradient (points, 2) at points [m] as `ParticleMesh.slope` does."""
        return np.sum([mesh.slope(mesh.at(x, y, slopes=True), loads) for mesh in self.meshes], axis=0)


class PeriodicMesh(ParticleMesh):
    """A mesh over a periodic cell of ``lengths`` (2,) [m]; the kernel is given by its transform at wave numbers [1/m].

    The transform is exact at the waves of the cell. Those beyond pi/``spacing`` [m] are lost.
    """

    def __init__(self, lengths: Array, spacing: float, transform: Callable[[Array], Array]) -> None:
        self.lengths = lengths
        shape = periodic_shape(lengths, spacing)
        self.nodes = self.doubled = np.array([shape])
        self.spacing = lengths / shape
        self.origin, self.owners = np.zeros((1, 2)), np.zeros(1, dtype=np.intp)
        waves = np.fft.fftfreq(shape[0], 1.0), np.fft.rfftfreq(shape[1], 1.0)
        kx, ky = (2.0 * np.pi * w / s for w, s in zip(waves, self.spacing, strict=True))
        symbol = transform(np.hypot(kx[:, None], ky)) / float(np.prod(self.spacing))
        self.transforms = {shape: symbol * _factor(waves[0])[:, None] * _factor(waves[1])}

    def _columns(self, base: Array, axis: int, owner: Indices) -> Array:
        return np.asarray(
            (base[:, None].astype(np.int32) + ORDER // 2 - np.arange(ORDER)) % self.nodes[owner, axis][:, None],
            np.int32,
        )


def periodic_shape(lengths: Array, spacing: float) -> tuple[int, int]:
    """Return the numbers of nodes of a `PeriodicMesh` along x and y."""
    first, second = (int(next_fast_len(int(np.ceil(length / spacing)), real=True)) for length in lengths)
    return first, second


def _factor(waves: Array) -> Array:
    """Return 1/b at wave numbers in cycles per spacing."""
    at_whole = BSpline.basis_element(np.arange(2 * ORDER + 1.0))(np.arange(2 * ORDER))
    b = at_whole[ORDER] + 2.0 * sum(at_whole[ORDER + j] * np.cos(2.0 * np.pi * j * waves) for j in range(1, ORDER))
    return np.asarray(1.0 / b)
