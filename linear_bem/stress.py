r"""The vertical stress sigma_z inside the layer, computed from a solution.

Under p cos(k x) the layer's stress is -p cos(k x) S(k h, z/h). S follows from Love's strain function
with its four exponentials in the layer and two in the substrate, fixed by the six conditions of the boundary-value
problem (pressure and no shear at the surface; continuity, or no displacement, at the bond). In real space
Boussinesq's kernel 3 z^3/(2 pi (r^2 + z^2)^(5/2)) is the singular part. The part due to the bond, S minus
(1 + k z) exp(-k z), decays like exp(-k (2 h - z)) and is transformed by `linear_bem.layer.kernel.hankel`.
Fields from Love's function: [Timoshenko and Goodier 1970, Theory of Elasticity, section 133].
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, make_interp_spline

from linear_bem.arrays import Array
from linear_bem.errors import InvalidProblem
from linear_bem.layer.kernel import even_spline, hankel
from linear_bem.problem import Elastic
from linear_bem.solver import Solution


def _fields(solid: Elastic, sign: float, power: int, z: Array) -> Array:
    """Return sigma_z, tau, w and u of Love's function z^power e^(sign z) at wave number 1, shape (4, *z.shape)."""
    nu = solid.poisson
    e = np.exp(sign * z)
    d = [z**power * e] + [e * (sign**k * z**power + k * power * sign ** (k - 1)) for k in (1, 2, 3)]
    return np.array(
        [
            (1.0 - nu) * d[3] - (2.0 - nu) * d[1],
            nu * d[2] + (1.0 - nu) * d[0],
            ((1.0 - 2.0 * nu) * d[2] - 2.0 * (1.0 - nu) * d[0]) / (2.0 * solid.shear_modulus),
            d[1] / (2.0 * solid.shear_modulus),
        ]
    )


def stress_response(layer: Elastic, substrate: Elastic | None, t: Array, depth: float) -> Array:
    """Return S(t, depth): -sigma_z at depth z = depth h per unit pressure, for 0 <= depth <= 1, t = k h > 0."""
    t = np.atleast_1d(np.asarray(t, dtype=float))
    kinds = [(-1.0, 0), (-1.0, 1), (1.0, 0), (1.0, 1)]
    count = 6 if substrate is not None else 4
    # scaled to order 1: displacements by the layer's modulus, growing exponentials by their value at the bond
    unit = np.array([1.0, 1.0, layer.shear_modulus, layer.shear_modulus])[:, None]
    matrix = np.zeros((len(t), count, count))
    inside = np.zeros((len(t), count))
    for c, (sign, power) in enumerate(kinds):
        damp = np.exp(-t) if sign > 0.0 else 1.0
        top = _fields(layer, sign, power, np.zeros_like(t)) * unit * damp
        bond = _fields(layer, sign, power, t) * unit * damp
        matrix[:, :2, c] = top[:2].T
        matrix[:, 2:, c] = (bond if count == 6 else bond[2:]).T
        inside[:, c] = (_fields(layer, sign, power, depth * t) * damp)[0]
    if substrate is not None:
        for c, (sign, power) in enumerate(kinds[:2], start=4):
            matrix[:, 2:, c] = -(_fields(substrate, sign, power, np.zeros_like(t)) * unit).T
    right = np.zeros((len(t), count, 1))
    right[:, 0] = -1.0
    size = np.max(np.abs(matrix), axis=1, keepdims=True)
    answer = np.linalg.solve(matrix / size, right)[:, :, 0] / size[:, 0]
    return np.asarray(-np.sum(inside * answer, axis=1))


@lru_cache(maxsize=16)
def _bond_kernel(layer: Elastic, substrate: Elastic | None, depth: float) -> tuple[BSpline, float]:
    """Return the bond's part of h^2 times the stress kernel as a spline over asinh(r/h), and its range."""
    log_t = np.linspace(np.log(1e-9), np.log(60.0), 900)
    t = np.exp(log_t)
    boussinesq = (1.0 + depth * t) * np.exp(-depth * t)
    added = make_interp_spline(log_t, stress_response(layer, substrate, t, depth) - boussinesq, k=5)

    def extra(t: Array) -> Array:
        return np.where(t < 60.0, added(np.clip(np.log(t), log_t[0], log_t[-1])), 0.0)

    y = np.arange(0.0, np.arcsinh(300.0), 0.03)
    values = hankel(lambda t: extra(t) * t, np.sinh(y)) / (2.0 * np.pi)
    return even_spline(y, values, 10), float(y[-1])


def vertical_stress(solution: Solution, x: ArrayLike, y: ArrayLike, depth: float) -> Array:
    """Return sigma_z [Pa] (compression negative) at points x, y [m] of the plane ``depth`` [m] below the surface.

    0 <= depth <= layer thickness; at depth 0 it is minus the contact pressure. Points nearer to the surface than a
    tenth of the contact radius take proportionally more quadrature nodes. Error below 1e-6 of the peak pressure for
    depth > 0.03 contact radii. On grids the pressure is constant per cell: the error is 1 to 3 % of the peak pressure
    at a depth of one cell, and smaller depths except 0 raise `InvalidProblem`.
    """
    layer, substrate = solution.problem.layer, solution.problem.substrate
    if not 0.0 <= depth <= layer.thickness:
        raise InvalidProblem(f"vertical_stress: depth must lie between 0 and {layer.thickness:g} m, got {depth:g} m")
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    if depth == 0.0:
        return -solution.pressure(x, y)
    coarsest = solution.contacts.resolution
    if depth < coarsest:
        raise InvalidProblem(
            f"vertical_stress: depth must be 0 or at least one cell of the pressure, {coarsest:g} m,"
            f" got {depth:g} m; go deeper, or solve again with a smaller tangential_force, which makes smaller cells"
        )
    px, py, load = solution.contacts.point_loads(depth)
    bond = None
    if np.isfinite(layer.thickness):
        elastic = Elastic(layer.young, layer.poisson)
        bond, end = _bond_kernel(elastic, substrate, depth / layer.thickness)
    total = np.zeros(x.size)
    for part in np.array_split(np.arange(x.size), x.size * px.size // 2_000_000 + 1):
        r2 = (x.ravel()[part, None] - px) ** 2 + (y.ravel()[part, None] - py) ** 2
        kernel = 1.5 * depth**3 / np.pi / (r2 + depth**2) ** 2.5
        if bond is not None:
            far = np.arcsinh(np.sqrt(r2) / layer.thickness)
            kernel += np.where(far < end, bond(np.minimum(far, end)), 0.0) / layer.thickness**2
        total[part] = -kernel @ load
    return total.reshape(x.shape)
