"""An independent, slow solver of the contact problem, which shares only the problem's definition with `linear_bem`.

The paper's method: constant pressure on square cells, collocation at their centres, an active set, dense matrices. The
layer's response comes from its six boundary conditions at every wave number, the kernel from a plain Hankel integral, T
from a double sum over cells; the answer is extrapolated over cell sizes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import Chebyshev
from scipy.special import j0


def _mode(nu, shear, t):
    """U, W, s_zz, s_xz at depth t of the two decaying plane-strain modes, wave number 1: shape (4, 2, len(t)).

    u_x = U sin x, u_z = W cos x with (U, W) = (1, 1) e^-z and (z, 3 - 4 nu + z) e^-z satisfy Navier's equations.
    """
    e, one = np.exp(-t), np.ones_like(t)
    u = [one, t]
    w = [one, 3 - 4 * nu + t]
    normal = [-one, -(2 - 2 * nu + t)]
    shearing = [-one, -(1 - 2 * nu + t)]
    return np.array([u, w, 2 * shear * np.array(normal), 2 * shear * np.array(shearing)]) * e


def response(layer, substrate, t):
    """G(t): surface displacement under unit pressure over that of a half-space of the layer's material."""
    nu, shear, zero = layer.poisson, layer.young / (2 + 2 * layer.poisson), np.zeros_like(t)
    flip = np.array([1.0, -1.0, 1.0, -1.0])[:, None, None]
    # the growing modes are the decaying ones measured from the bond upwards
    top = np.concatenate([_mode(nu, shear, zero), flip * _mode(nu, shear, t)], axis=1)
    bond = np.concatenate([_mode(nu, shear, t), flip * _mode(nu, shear, zero)], axis=1)
    if substrate is None:
        rows = [top[2], top[3], bond[0], bond[1]]
    else:
        below = _mode(substrate.poisson, substrate.young / (2 + 2 * substrate.poisson), zero)
        matched = np.concatenate([bond, -below], axis=1)
        free = [np.concatenate([row, np.zeros((2, len(t)))]) for row in (top[2], top[3])]
        rows = [*free, *matched]
    matrix = np.moveaxis(np.array(rows), 2, 0)
    right = np.zeros(matrix.shape[:2])
    right[:, 0] = -1.0
    scale = np.max(np.abs(matrix), axis=2)
    amplitude = np.linalg.solve(matrix / scale[..., None], (right / scale)[..., None])[..., 0]
    w = np.einsum("mt,tm->t", top[1], amplitude[:, :4])
    return w * layer.young / (2 * (1 - nu**2))


class Kernel:
    """K(r) E1 pi/(1 - nu1^2) = 1/r + s(r), s by quadrature over wave numbers, interpolated up to ``reach`` [m]."""

    def __init__(self, layer, substrate, reach):
        self.compliance = (1 - layer.poisson**2) / (np.pi * layer.young)
        self.smooth = None
        if not np.isfinite(layer.thickness):
            return
        x, w = np.polynomial.legendre.leggauss(16)
        edges = np.concatenate([[0.0], np.geomspace(1e-5, 0.125, 18), np.arange(0.25, 22.1, 0.125)])
        half = 0.5 * np.diff(edges)[:, None]
        t, w = (edges[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()
        h = layer.thickness
        weighed = w * (response(layer, substrate, t) - 1.0)

        def s(r):
            return np.array([weighed @ j0(rho * t) for rho in np.atleast_1d(r) / h]) / h

        self.smooth = Chebyshev.interpolate(s, int(60 + 12 * reach / h), [0.0, reach])
        self.slope = self.smooth.deriv()

    def far(self, r):
        return 1 / r if self.smooth is None else 1 / r + self.smooth(r)

    def gradient(self, r):
        return -1 / r**2 if self.smooth is None else self.slope(r) - 1 / r**2


def love(x, y, c):
    """Integral of 1/r over a square of half side c at (x, y) from its centre [Love 1929]."""
    total = 0.0
    for sx in (1, -1):
        for sy in (1, -1):
            a, b = x + sx * c, y + sy * c
            r = np.hypot(a, b)
            total = total + sx * sy * (a * np.arcsinh(b / np.abs(a)) + b * np.arcsinh(a / np.abs(b))) + 0.0 * r
    return total


@dataclass
class Answer:
    """Normal forces, approaches, T (balls, 2), elastic energy; ``reach`` the half sides of the boxes that were used."""

    forces: np.ndarray
    approaches: np.ndarray
    tangential: np.ndarray
    energy: float
    reach: np.ndarray


def height(ball, x, y):
    """f(x, y) from the ball's axis."""
    if callable(ball.shape):
        return ball.shape(x, y)
    r2 = x * x + y * y
    return r2 / (2 * ball.radius) if ball.shape == "paraboloid" else ball.radius - np.sqrt(ball.radius**2 - r2)


def _blocks(kernel, grids):
    """Displacement over `compliance` at all cells under unit pressure on all cells."""
    blocks = []
    for i, (x, y, c) in enumerate(grids):
        row = []
        for j, (u, v, d) in enumerate(grids):
            dx, dy = x[:, None] - u, y[:, None] - v
            if i == j:
                side = int(np.rint(np.sqrt(len(x))))
                # offsets are whole cells: one table of them
                steps = np.arange(-side + 1, side) * 2 * c
                a, b = np.meshgrid(steps, steps, indexing="ij")
                table = love(a, b, c)
                if kernel.smooth is not None:
                    table = table + kernel.smooth(np.hypot(a, b)) * 4 * c * c
                m, n = np.divmod(np.arange(side * side), side)
                row.append(table[m[:, None] - m + side - 1, n[:, None] - n + side - 1])
            else:
                row.append(kernel.far(np.hypot(dx, dy)) * 4 * d * d)
        blocks.append(row)
    return np.block(blocks)


def solve_on(problem, kernel, cells, reach):
    """One grid of ``cells`` x ``cells`` on a square of half side ``reach[i]`` about every ball that carries load."""
    load = problem.load
    loaded = [i for i in range(problem.size) if load.kind == "total_force" or load.values[i] > 0.0]
    grids, heights = [], []
    for i in loaded:
        ball, c = problem.balls[i], reach[i] / cells
        side = (2 * np.arange(cells) + 1 - cells) * c
        x, y = (q.ravel() for q in np.meshgrid(side, side, indexing="ij"))
        grids.append((x + ball.position[0], y + ball.position[1], c))
        heights.append(height(ball, x, y))
    count = cells * cells
    area = np.concatenate([np.full(count, 4 * c * c) for *_, c in grids])
    f = np.concatenate(heights)
    matrix = kernel.compliance * _blocks(kernel, grids)
    owner = np.repeat(np.arange(len(loaded)), count)
    # columns of ones: which approach belongs to which cell
    groups = np.zeros((len(f), 1 if load.kind == "total_force" else len(loaded)))
    groups[np.arange(len(f)), 0 if load.kind == "total_force" else owner] = 1.0
    approach = np.array([load.values[i] for i in loaded]) if load.kind == "approach" else None
    wanted = np.array(load.values if load.kind == "total_force" else [load.values[i] for i in loaded])
    extent = np.array([reach[i] for i in loaded])[owner]
    radius = np.concatenate([np.hypot(x - x.mean(), y - y.mean()) for x, y, _ in grids])
    active = radius < 0.6 * extent
    for _ in range(60):
        k = np.flatnonzero(active)
        a = matrix[np.ix_(k, k)]
        both = np.linalg.solve(a, np.column_stack([groups[k], f[k]]))
        if approach is None:
            weighed = groups[k].T * area[k]
            level = np.linalg.solve(weighed @ both[:, :-1], wanted + weighed @ both[:, -1])
        else:
            level = approach
        p = np.zeros(len(f))
        p[k] = both[:, :-1] @ level - both[:, -1]
        gap = matrix[:, k] @ p[k] - groups @ level + f
        after = (active & (p > 0.0)) | (~active & (gap < 0.0))
        if np.array_equal(after, active):
            break
        active = after
    else:
        raise AssertionError("the active set does not settle")
    forces, approaches, tangential = np.zeros(problem.size), np.zeros(problem.size), np.zeros((problem.size, 2))
    used = np.zeros(problem.size)
    q = p * area
    for m, i in enumerate(loaded):
        mine = owner == m
        forces[i] = q[mine].sum()
        approaches[i] = level[0 if load.kind == "total_force" else m]
        x, y, _ = grids[m]
        used[i] = max(np.max(np.abs(x - x.mean())[p[mine] > 0]), np.max(np.abs(y - y.mean())[p[mine] > 0]))
        for n in range(len(loaded)):
            if n == m:
                continue
            u, v, _ = grids[n]
            here, there = p[mine] > 0, p[owner == n] > 0
            dx, dy = x[here][:, None] - u[there], y[here][:, None] - v[there]
            r = np.hypot(dx, dy)
            pull = kernel.compliance * kernel.gradient(r) / r * q[mine][here][:, None] * q[owner == n][there]
            tangential[i] += (pull * dx).sum(), (pull * dy).sum()
    energy = 0.5 * q @ (matrix[:, k] @ p[k])
    return Answer(forces, approaches, tangential, energy, used)


def fitted(problem):
    """Return the kernel, and half sides of boxes of which the contacts fill nine tenths."""
    xy = np.array([ball.position for ball in problem.balls])
    far = np.max(np.hypot(*(xy[:, None] - xy).transpose(2, 0, 1)))
    modulus = problem.layer.young / (1 - problem.layer.poisson**2)
    values = np.full(problem.size, problem.load.values[0] / problem.size)
    radii = np.array([ball.radius for ball in problem.balls])
    if problem.load.kind != "total_force":
        values = np.array(problem.load.values)
    hertz = np.sqrt(radii * values) if problem.load.kind == "approach" else np.cbrt(0.75 * values * radii / modulus)
    kernel = Kernel(problem.layer, problem.substrate, 1.1 * (far + 6 * np.max(hertz)))
    reach = 1.6 * np.maximum(hertz, 1e-3 * np.max(hertz))
    for _ in range(3):
        reach = 1.12 * (1 + 1 / 12) * np.maximum(solve_on(problem, kernel, 12, reach).reach, 1e-3 * np.max(reach))
    return kernel, reach


def solve_brute(problem, sizes=(18, 20, 22, 24, 26), phases=6):
    """Extrapolate to cell size 0 by a line in the cells' area; return the result and the standard error of T.

    Every size of grid is stretched in ``phases`` steps up to one more cell on either side: the steps along the
    contact's edge scatter T at random, and the mean removes this scatter.
    """
    kernel, reach = fitted(problem)
    runs = [(n, 1 + 2 * k / (n * phases)) for n in sizes for k in range(phases)]
    answers = [solve_on(problem, kernel, n, reach * stretch) for n, stretch in runs]
    fineness = np.array([n / stretch for n, stretch in runs])
    trust = fineness**1.5
    design = np.column_stack([trust, trust / fineness**2])

    def line(values):
        values = trust[:, None] * np.array(values).reshape(len(runs), -1)
        found = np.linalg.lstsq(design, values, rcond=None)[0]
        variance = np.sum((values - design @ found) ** 2, axis=0) / (len(runs) - 2)
        return found[0], np.sqrt(variance * np.linalg.inv(design.T @ design)[0, 0])

    tangential, scatter = line([a.tangential for a in answers])
    answer = Answer(
        line([a.forces for a in answers])[0],
        line([a.approaches for a in answers])[0],
        tangential.reshape(-1, 2),
        float(line([[a.energy] for a in answers])[0][0]),
        reach,
    )
    return answer, float(np.max(scatter))
