r"""Square cells of constant pressure: patches, their FFT convolution, and the coupling of patches.

For contacts that no single smooth function describes: neighbours that merge, layers much thinner than the
contact. Each patch is centred on its ball (a ball off the centre of its grid has a spurious T); balls whose
patches come close share one. Within a patch the displacement at cell centres is a discrete
convolution: Love's rectangle for 1/r plus the smooth kernel averaged over the cell. Between patches
the kernel is smooth on the scale of their distance, so it is interpolated on q x q Chebyshev
nodes of either patch: sums over cells become sums over nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray
from scipy import fft

from linear_bem.arrays import Array, Indices, Mask, hypotenuse
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.layer.rectangle_load import graded_rule, love_rectangle, love_slopes
from linear_bem.report import Report, seldom, silent


@dataclass
class Patch:
    """A rectangle of nx x ny square cells of side ``cell`` [m] centred on ``centre`` [m], for the balls ``members``."""

    kernel: LayeredKernel
    centre: tuple[float, float]
    cell: float
    nx: int
    ny: int
    members: tuple[int, ...]
    nodes: int = field(default=8)

    @cached_property
    def x(self) -> Array:
        """Cell centres along x [m], shape (nx, 1)."""
        return (self.centre[0] + self.cell * (np.arange(self.nx) - 0.5 * (self.nx - 1)))[:, None]

    @cached_property
    def y(self) -> Array:
        """Cell centres along y [m], shape (1, ny)."""
        return (self.centre[1] + self.cell * (np.arange(self.ny) - 0.5 * (self.ny - 1)))[None, :]

    @cached_property
    def points(self) -> tuple[Array, Array]:
        """Cell centres x, y [m], shape (nx, ny) each."""
        x, y = np.broadcast_arrays(self.x, self.y)
        return x, y

    def cell_of(self, x: Array, y: Array) -> tuple[Indices, Indices, Mask]:
        """Return the indices of the cells that hold surface points [m], and whether these lie on the patch."""
        i = np.rint((x - self.x[0, 0]) / self.cell).astype(int)
        j = np.rint((y - self.y[0, 0]) / self.cell).astype(int)
        return i, j, (i >= 0) & (i < self.nx) & (j >= 0) & (j < self.ny)

    def averaged(self, pressure: Array, most: int) -> tuple[Patch, Array]:
        """Return a patch of up to about ``most`` cells along a side with the mean ``pressure`` of the cells in each."""
        of = -(-max(self.nx, self.ny) // most)
        padded = np.pad(pressure, ((0, -self.nx % of), (0, -self.ny % of)))
        nx, ny = padded.shape[0] // of, padded.shape[1] // of
        x, y = (
            c + 0.5 * self.cell * (n * of - m)
            for c, n, m in zip(self.centre, (nx, ny), (self.nx, self.ny), strict=True)
        )
        coarse = Patch(self.kernel, (x, y), of * self.cell, nx, ny, self.members, self.nodes)
        return coarse, padded.reshape(nx, of, ny, of).mean(axis=(1, 3))

    @property
    def reach(self) -> float:
        """Half diagonal [m]."""
        return 0.5 * self.cell * float(np.hypot(self.nx, self.ny))

    @cached_property
    def _size(self) -> tuple[int, int]:
        return fft.next_fast_len(2 * self.nx - 1, real=True), fft.next_fast_len(2 * self.ny - 1, real=True)

    @property
    def _offsets(self) -> tuple[Array, Array]:
        """Offsets (i, j) >= 0 of cells along x and y [m], shapes (nx, 1) and (1, ny)."""
        return self.cell * np.arange(self.nx)[:, None], self.cell * np.arange(self.ny)[None, :]

    @cached_property
    def influence(self) -> Array:
        """Displacement per pressure times ``singular`` [m] at offsets (i, j) >= 0 from a loaded cell, (nx, ny)."""
        d = self.cell
        x, y = self._offsets
        total = love_rectangle(x, y, 0.5 * d, 0.5 * d)
        if not self.kernel.homogeneous:
            # beyond some thicknesses K tends to the substrate's share of 1/r: the rest of 1/r is cancelled by the
            # smooth kernel, so both are integrated by the same rule
            rest = 1.0 - self.kernel.far_ratio
            far = np.hypot(x, y) > 6.0 * self.kernel.thickness
            total = np.where(far, self.kernel.far_ratio, 1.0) * total
            g = 0.5 * d / np.sqrt(3.0)
            for ex, ey in ((g, g), (-g, g), (g, -g), (-g, -g)):
                r = hypotenuse(x + ex, y + ey)
                total += 0.25 * d * d * (self.kernel.smooth(r) + np.where(far, rest / r, 0.0))
            near = int(np.ceil(1.5 + 12.0 * self.kernel.thickness / d))
            if d > 0.4 * self.kernel.thickness:
                self._integrate_near(total, min(near, self.nx), min(near, self.ny))
        return total

    def _integrate_near(self, total: Array, nx: int, ny: int) -> None:
        """Replace the influences at small offsets by graded quadrature, for cells that are wide against the layer."""
        d = self.cell
        rules = [graded_rule(d * (i - 0.5), d * (i + 0.5), 0.25 * self.kernel.thickness) for i in range(max(nx, ny))]
        for i in range(nx):
            for j in range(ny):
                (u, wu), (v, wv) = rules[i], rules[j]
                smooth = wu @ self.kernel.smooth(hypotenuse(u[:, None], v)) @ wv
                total[i, j] = float(love_rectangle(d * i, d * j, 0.5 * d, 0.5 * d)) + smooth

    def part(self, nx: int, ny: int) -> Patch:
        """Return a smaller patch with the same cells, sharing their influence."""
        small = Patch(self.kernel, self.centre, self.cell, nx, ny, self.members, self.nodes)
        small.__dict__["influence"] = self.influence[:nx, :ny]
        return small

    @cached_property
    def _spectrum(self) -> NDArray[np.complex128]:
        return np.asarray(fft.rfft2(_embed(self.influence, self._size, 1.0, 1.0)))

    @cached_property
    def _slope_spectra(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Transforms of d/dx and d/dy of the cells' influence (odd, so that a cell exerts no force on itself)."""
        d = self.cell
        x, y = self._offsets
        along_x, along_y = love_slopes(x, y, 0.5 * d)
        if not self.kernel.homogeneous:
            r = np.maximum(np.hypot(x, y), 1e-3 * d)
            far = r > 6.0 * self.kernel.thickness
            rest = np.where(far, 1.0 - self.kernel.far_ratio, 0.0)
            smooth = d * d * (self.kernel.smooth_slope(r) - rest / r**2) / r
            along_x, along_y = (1.0 - rest) * along_x + smooth * x, (1.0 - rest) * along_y + smooth * y
        odd_x, odd_y = _embed(along_x, self._size, -1.0, 1.0), _embed(along_y, self._size, 1.0, -1.0)
        return np.asarray(fft.rfft2(odd_x)), np.asarray(fft.rfft2(odd_y))

    def displacement(self, pressure: Array) -> Array:
        """Return the displacement [m] at the cells under a pressure times ``singular``."""
        return self._convolve(self._image(pressure) * self._spectrum)

    def slopes(self, pressure: Array) -> tuple[Array, Array]:
        """Return dw/dx and dw/dy at the cells (dimensionless)."""
        image = self._image(pressure)
        sx, sy = self._slope_spectra
        return self._convolve(image * sx), self._convolve(image * sy)

    def _image(self, field: Array) -> NDArray[np.complex128]:
        """Return the padded transform, one axis at a time so that padding rows are never transformed."""
        return np.asarray(fft.fft(fft.rfft(field, self._size[1], axis=1), self._size[0], axis=0))

    def _convolve(self, image: NDArray[np.complex128]) -> Array:
        rows = fft.ifft(image, axis=0, overwrite_x=True)[: self.nx]
        return np.asarray(fft.irfft(rows, self._size[1], axis=1)[:, : self.ny])

    @property
    def wave_numbers(self) -> Array:
        """Wave numbers [1/m] of `rfft2` on the periodically continued patch."""
        kx, ky = fft.fftfreq(self.nx, self.cell)[:, None], fft.rfftfreq(self.ny, self.cell)
        return np.asarray(2.0 * np.pi * np.hypot(kx, ky))

    @cached_property
    def _inverse_spectrum(self) -> Array:
        """Inverse of the layered half-space's symbol 2 pi G(k h)/k on the periodically continued patch."""
        k = np.hypot(self.wave_numbers, 1.0 / self.reach)
        return k / (2.0 * np.pi * self.kernel.response_at(k))

    def precondition(self, residual: Array) -> Array:
        """Return an approximate solution p of `displacement` (p) = residual."""
        return np.asarray(fft.irfft2(fft.rfft2(residual) * self._inverse_spectrum, residual.shape))

    @property
    def _chebyshev(self) -> Array:
        return np.cos((np.arange(self.nodes) + 0.5) * np.pi / self.nodes)

    @cached_property
    def node_points(self) -> tuple[Array, Array]:
        """Chebyshev nodes of the patch, x and y [m], flattened."""
        x, y = (c + 0.5 * self.cell * n * self._chebyshev for c, n in zip(self.centre, (self.nx, self.ny), strict=True))
        return np.repeat(x, self.nodes), np.tile(y, self.nodes)

    @cached_property
    def _lagrange(self) -> tuple[Array, Array]:
        fit = np.linalg.inv(chebvander(self._chebyshev, self.nodes - 1))
        cells = [(2.0 * np.arange(n) - (n - 1)) / n for n in (self.nx, self.ny)]
        x, y = (chebvander(z, self.nodes - 1) @ fit for z in cells)
        return x, y

    def gather(self, pressure: Array) -> Array:
        """Return the point loads at the nodes that replace a pressure in its effect on other patches."""
        lx, ly = self._lagrange
        return np.asarray(lx.T @ pressure @ ly).ravel() * self.cell**2

    def spread(self, values: Array) -> Array:
        """Interpolate a field from its values at the nodes to the cells."""
        lx, ly = self._lagrange
        return np.asarray(lx @ values.reshape(self.nodes, self.nodes) @ ly.T)


def _embed(quadrant: Array, size: tuple[int, int], sign_x: float, sign_y: float) -> Array:
    """Return the circulant array of a kernel known at non-negative offsets, even (+1) or odd (-1) in x and y."""
    out = np.zeros(size)
    nx, ny = quadrant.shape
    out[:nx, :ny] = quadrant
    out[size[0] - nx + 1 :] = sign_x * out[nx - 1 : 0 : -1]
    out[:, size[1] - ny + 1 :] = sign_y * out[:, ny - 1 : 0 : -1]
    return out


class Patches:
    """All patches together: displacement of every cell due to all pressures; ``report`` receives progress lines."""

    def __init__(self, kernel: LayeredKernel, patches: list[Patch], report: Report = silent) -> None:
        self.kernel = kernel
        self.patches = patches
        self.report = report
        self._mutual: Array | None = None
        if len(patches) > 1:
            self._mutual = self._between(lambda r, dx, dy: kernel.scaled(r), "influence of patches on each other: ")

    def _between(self, f: Callable[[Array, Array, Array], Array], what: str) -> Array:
        """Return a kernel f(r, dx, dy) between all nodes of different patches; ``what`` begins each progress line."""
        report = seldom(self.report, what)
        q2 = self.patches[0].nodes ** 2
        x = np.concatenate([p.node_points[0] for p in self.patches])
        y = np.concatenate([p.node_points[1] for p in self.patches])
        out = np.zeros((len(x), len(x)))
        for i in range(len(self.patches)):
            report(f"{i} of {len(self.patches)} patches")
            rows = slice(i * q2, (i + 1) * q2)
            dx, dy = x[rows, None] - x, y[rows, None] - y
            r = hypotenuse(dx, dy)
            r[:, rows] = 1.0
            out[rows] = f(r, dx, dy)
            out[rows, rows] = 0.0
        return out

    def displacement(self, pressures: list[Array]) -> list[Array]:
        """Return the displacement [m] of every patch."""
        own = [p.displacement(q) for p, q in zip(self.patches, pressures, strict=True)]
        return own if self._mutual is None else self._add(own, self._mutual, pressures)

    def _add(self, own: list[Array], mutual: Array, pressures: list[Array]) -> list[Array]:
        """Return ``own`` and the effect of the other patches' pressures by a kernel between nodes."""
        values = mutual @ np.concatenate([p.gather(q) for p, q in zip(self.patches, pressures, strict=True)])
        parts = np.split(values, len(self.patches))
        return [w + p.spread(part) for p, w, part in zip(self.patches, own, parts, strict=True)]

    def slopes(self, pressures: list[Array]) -> tuple[list[Array], list[Array]]:
        """Return dw/dx and dw/dy of every patch, for the force on every ball.

        The contribution of a ball's own pressure is omitted on a patch with one ball; on a patch with several balls,
        its integral over that pressure vanishes.
        """
        own = [
            p.slopes(q) if len(p.members) > 1 else (np.zeros_like(q), np.zeros_like(q))
            for p, q in zip(self.patches, pressures, strict=True)
        ]
        along_x, along_y = [x for x, _ in own], [y for _, y in own]
        if self._mutual is None:
            return along_x, along_y
        mutual_x = self._between(lambda r, dx, dy: self.kernel.scaled_slope(r) * dx / r, "T along x: ")
        along_x = self._add(along_x, mutual_x, pressures)
        mutual_y = self._between(lambda r, dx, dy: self.kernel.scaled_slope(r) * dy / r, "T along y: ")
        return along_x, self._add(along_y, mutual_y, pressures)
