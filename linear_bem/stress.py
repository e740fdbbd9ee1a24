r"""Stresses and displacements inside layer and substrate, computed from a solution.

A unit force on the surface makes six fields of r and z, transforms of the states of `linear_bem.layer.interior`:

    u_r = 1/(4 pi mu) int U' J1(k r) dk,   u_z = 1/(4 pi mu) int W' J0(k r) dk   (U', W' = 2 mu k U, 2 mu k W),
    sigma_z, tau_rz, sigma_r + sigma_theta, sigma_r - sigma_theta = 1/(2 pi) int (S J0, T J1, M J0, -N J2) k dk,

M and N sum and difference of the stresses along and across the wave. In the layer Boussinesq's closed forms [Johnson
1985, eqs. 3.18, 3.19] are the singular part; the bond's part decays like exp(-k (2 h - z)) and is tabulated, as is the
whole field in the substrate. Point loads that resolve the pressure on the scale of the depth are summed.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly, make_interp_spline

from linear_bem.arrays import Array
from linear_bem.errors import InvalidProblem, UnsupportedProblem
from linear_bem.layer.interior import half_space_state, in_plane_stress, interior_state
from linear_bem.layer.kernel import even_spline, hankel
from linear_bem.problem import Elastic, SurfaceResponse
from linear_bem.solution import Solution, solved

FIELDS = {"u_r": 1, "u_z": 0, "sigma_z": 0, "tau_rz": 1, "sum": 0, "difference": 2}
"""Fields of a unit force by their names, and the orders of their Bessel functions; z points down."""
PLANAR = ("u_r", "u_z")
STRESSES = ("sigma_z", "tau_rz", "sum", "difference")
LOG_T = np.linspace(np.log(1e-9), np.log(60.0), 900)
"""Logarithms of the t = k h at which the transforms are tabulated."""
SHALLOWEST = 0.02
"""Least depth over the widest contact's radius; nearer to the surface, the quadrature is too coarse for 1/r."""


def _transformed(solid: Elastic, shear: float, state: Array, t: Array) -> dict[str, Array]:
    """Return the integrands of the fields' Hankel transforms at t = k h."""
    total, difference = in_plane_stress(solid, shear, state)
    return {
        "u_r": state[0], "u_z": state[1], "sigma_z": t * state[2], "tau_rz": t * state[3],
        "sum": t * total, "difference": -t * difference,
    }  # fmt: skip


@lru_cache(maxsize=1)
def _tabulated(layer: Elastic, substrate: Elastic | None, depth: float) -> dict[str, Array]:
    """Return the integrands at `LOG_T` of the fields' tabulated parts."""
    t = np.exp(LOG_T)
    solid = layer if depth <= 1.0 or substrate is None else substrate
    found = _transformed(solid, layer.shear_modulus, interior_state(layer, substrate, t, depth), t)
    if depth > 1.0:
        return found
    singular = _transformed(layer, layer.shear_modulus, half_space_state(layer, depth * t), t)
    return {name: value - singular[name] for name, value in found.items()}


@lru_cache(maxsize=32)
def _table(layer: Elastic, substrate: Elastic | None, depth: float, name: str) -> tuple[PPoly, float]:
    """Return a field's tabulated part times 1 + rho^2 (stresses) or its root, as a spline over asinh(r/h), and its end.

    At h = 1: in the layer the bond's part, in the substrate the whole field. It ends 3000 longest lengths away.
    """
    spline = make_interp_spline(LOG_T, _tabulated(layer, substrate, depth)[name], k=5)

    def tabulated(t: Array) -> Array:
        return np.where(t < 60.0, spline(np.clip(np.log(t), LOG_T[0], LOG_T[-1])), 0.0)

    # a stiff film carries radial displacements over h E1/E2; in a soft one Boussinesq's part is E2/E1 times too large
    contrast = 1.0 if substrate is None else layer.young / substrate.young
    longest = max(1.0, depth, contrast, 1.0 / contrast)
    y = np.arange(0.0, np.arcsinh(3e3 * longest), 0.03)
    found = hankel(tabulated, np.sinh(y), FIELDS[name]) * np.cosh(y) ** (1 if name in PLANAR else 2)
    return PPoly.from_spline(even_spline(y, found, 10, odd=FIELDS[name] == 1)), float(y[-1])


def _boussinesq(nu: float, r: Array, z: float, name: str) -> Array:
    """Return a field of a unit force on a half-space: displacements times 4 pi mu, stresses times 2 pi; z down."""
    big = np.hypot(r, z)
    flat = (1.0 - 2.0 * nu) / (big * (big + z))
    if name == "u_r":
        return np.asarray(r * z / big**3 - r * flat)
    if name == "u_z":
        return np.asarray(z**2 / big**3 + 2.0 * (1.0 - nu) / big)
    if name == "sigma_z":
        return np.asarray(-3.0 * z**3 / big**5)
    if name == "tau_rz":
        return np.asarray(-3.0 * r * z**2 / big**5)
    radial, hoop = flat - 3.0 * z * r**2 / big**5, (1.0 - 2.0 * nu) * z / big**3 - flat
    return np.asarray(radial + hoop if name == "sum" else radial - hoop)


def _of_unit_force(solution: Solution, r: Array, depth: float, name: str) -> Array:
    """Return one of `FIELDS` at distances r [m] from a unit force: displacements [m/N], stresses [1/m^2]."""
    layer, substrate = solution.problem.layer, solution.problem.substrate
    h, elastic = layer.thickness, Elastic(layer.young, layer.poisson)
    total = _boussinesq(layer.poisson, r, depth, name) if depth <= h else np.zeros(r.shape)
    if np.isfinite(h):
        spline, end = _table(elastic, substrate, depth / h, name)
        power = 1 if name in PLANAR else 2
        y = np.arcsinh(r / h)
        total = total + spline(np.minimum(y, end)) / (1.0 + (r / h) ** 2) ** (0.5 * power) / h**power
    return total / (4.0 * np.pi * elastic.shear_modulus) if name in PLANAR else total / (2.0 * np.pi)


def _check_depth(solution: Solution, depth: float, what: str) -> None:
    problem = solved(solution, what).problem
    if isinstance(problem.layer, SurfaceResponse):
        raise UnsupportedProblem(
            f"{what}: needs the materials inside; only the response of the surface is given (for one coating on a "
            "half-space give Layer and substrate)"
        )
    if problem.periodic is not None:
        raise UnsupportedProblem(f"{what}: is available on an infinite layer, not in a cell that repeats")
    if np.ndim(depth) != 0:
        raise InvalidProblem(f"{what}: depth must be one number, got an array of {np.size(depth)}; ask depth by depth")
    widest = float(np.sqrt(np.max(solution.contacts.contact_areas) / np.pi))
    least = max(SHALLOWEST * widest, solution.contacts.resolution)
    if not depth >= least:
        raise InvalidProblem(
            f"{what}: depth must be at least {least:.3g} m, {SHALLOWEST:g} of the widest contact's radius or one cell "
            f"of the pressure, got {depth:g} m; go deeper, or solve again with a smaller accuracy for smaller cells"
        )
    if depth > problem.layer.thickness and problem.substrate is None:
        raise InvalidProblem(
            f"{what}: depth must be at most {problem.layer.thickness:g} m, the base is rigid, got {depth:g} m"
        )


def _summed(solution: Solution, x: ArrayLike, y: ArrayLike, depth: float, names: tuple[str, ...]) -> Array:
    """Return sums over all point loads: per name one row (order 0) or two (x, y; of order 2: xx - yy, 2 xy)."""
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    px, py, load = solution.contacts.point_loads(depth)
    out = np.zeros((sum(min(FIELDS[name], 1) + 1 for name in names), x.size))
    for part in np.array_split(np.arange(x.size), x.size * px.size // 1_000_000 + 1):
        dx, dy = x.ravel()[part, None] - px, y.ravel()[part, None] - py
        r = np.hypot(dx, dy)
        safe = np.maximum(r, 1e-300)
        turn = {0: (np.ones_like(r),), 1: (dx / safe, dy / safe), 2: ((dx**2 - dy**2) / safe**2, 2 * dx * dy / safe**2)}
        row = 0
        for name in names:
            kernel = _of_unit_force(solution, r, depth, name)
            for factor in turn[FIELDS[name]]:
                out[row, part] = (kernel * factor) @ load
                row += 1
    return out.reshape(len(out), *x.shape)


def stress(solution: Solution, x: ArrayLike, y: ArrayLike, depth: float) -> Array:
    """Return the stress tensor [Pa] at points x, y [m] of the plane ``depth`` [m] below the surface.

    Shape (3, 3) plus that of the points, axes x, y, z with z up, tension positive; in the layer and in the substrate
    (at the bond: of the layer). Error below 3e-6 of the peak pressure at depths from half the widest contact's radius,
    5e-5 at 0.05 radii; on grids, whose cells have one pressure each, 1 to 3 % at a depth of one cell. Raises
    `InvalidProblem` for depths that are too small or in a rigid base, and `UnsupportedProblem` for a `SurfaceResponse`
    or a periodic cell.
    """
    _check_depth(solution, depth, "stress")
    sigma, tau_x, tau_y, total, difference, shear = _summed(solution, x, y, depth, STRESSES)
    out = np.empty((3, 3, *sigma.shape))
    out[0, 0], out[1, 1], out[2, 2] = 0.5 * (total + difference), 0.5 * (total - difference), sigma
    out[0, 1] = out[1, 0] = 0.5 * shear
    out[0, 2] = out[2, 0] = -tau_x  # z points up here
    out[1, 2] = out[2, 1] = -tau_y
    return out


def interior_displacement(solution: Solution, x: ArrayLike, y: ArrayLike, depth: float) -> Array:
    """Return the displacement [m] at points x, y [m] of the plane ``depth`` [m] below the surface.

    Shape (3,) plus that of the points, along x, y and z with z up: under a ball the third component is negative, the
    opposite sign of `Solution.displacement`. Errors and limits as for `stress`.
    """
    _check_depth(solution, depth, "interior_displacement")
    along_x, along_y, down = _summed(solution, x, y, depth, PLANAR)
    return np.array([along_x, along_y, -down])


def vertical_stress(solution: Solution, x: ArrayLike, y: ArrayLike, depth: float) -> Array:
    """Return sigma_z [Pa] alone, as `stress` does; at depth 0 it is minus the contact pressure."""
    if isinstance(solution, Solution) and np.ndim(depth) == 0 and depth == 0.0:
        return -solution.pressure(*np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float)))
    _check_depth(solution, depth, "vertical_stress")
    return _summed(solution, x, y, depth, ("sigma_z",))[0]
