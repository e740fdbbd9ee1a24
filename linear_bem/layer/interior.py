r"""State inside a layer and its base under a pressure that varies like a cosine.

Under p = cos(k x) the displacement is (U sin kx, W cos kx) along x and down, the stress sigma_z = S cos kx and tau_xz =
T sin kx. The state y = (2 mu k U, 2 mu k W, S, T), mu the layer's shear modulus, obeys dy/d(k z) = A y: equilibrium and
Hooke's law in the plane of the wave. A has the eigenvalues 1 and -1, twice each. States that decay into a half-space
are those with (A + 1)^2 y = 0. The surface has S = -1, T = 0; at the bond the displacement follows the traction by the
base's compliance (none if rigid). For t = k h < 1 the state is carried down from the surface by exp(A x), which keeps
its accuracy for long waves; for larger t decaying and growing states are superposed, each scaled where it is largest.
"""

import numpy as np
from scipy.linalg import expm

from linear_bem.arrays import Array
from linear_bem.problem import Elastic

_IDENTITY = np.eye(4)
_PRESSURE = np.array([-1.0, 0.0])
"""S and T at the surface."""


def _matrix(solid: Elastic, shear: float) -> Array:
    """Return A of a solid for states scaled by ``shear`` [Pa]; finite for incompressible solids, too."""
    nu, s = solid.poisson, shear / solid.shear_modulus
    n, c = nu / (1.0 - nu), (1.0 - 2.0 * nu) / (1.0 - nu)
    return np.array(
        [[0.0, 1.0, 0.0, 2.0 * s], [-n, 0.0, c * s, 0.0], [0.0, 0.0, 0.0, -1.0], [1.0 / (1.0 - nu) / s, 0.0, n, 0.0]]
    )


def _waning(a: Array, x: Array, sign: float) -> Array:
    """Return exp(A x) on states of the eigenvalue -sign: exp(-sign x) (1 + (A + sign) x)."""
    x = x[..., None, None]
    return np.asarray(np.exp(-sign * x) * (_IDENTITY + (a + sign * _IDENTITY) * x))


def _compliance(a: Array, sign: float) -> Array:
    """Return the matrix from traction to displacement of states of the eigenvalue -sign, shape (2, 2)."""
    vanishes = (a + sign * _IDENTITY) @ (a + sign * _IDENTITY)
    return -np.asarray(np.linalg.lstsq(vanishes[:, :2], vanishes[:, 2:], rcond=None)[0])


def interior_state(layer: Elastic, substrate: Elastic | None, t: Array, depth: float) -> Array:
    """Return y at depth z = ``depth`` h under unit pressure, t = k h > 0, shape (4, len(t)).

    ``depth`` beyond 1 is in the substrate; None is a rigid base.
    """
    t = np.atleast_1d(np.asarray(t, dtype=float))
    a = _matrix(layer, layer.shear_modulus)
    bond = np.concatenate([np.eye(2), np.zeros((2, 2))], axis=1)  # displacement less compliance times traction
    below = a
    if substrate is not None:
        below = _matrix(substrate, layer.shear_modulus)
        bond[:, 2:] = -_compliance(below, 1.0)
    inside = min(depth, 1.0)
    out = np.empty((len(t), 4))
    long = t < 1.0
    out[long] = _from_surface(a, bond, t[long], inside)
    out[~long] = _superposed(a, bond, t[~long], inside)
    if depth > 1.0:
        out = (_waning(below, t * (depth - 1.0), 1.0) @ out[..., None])[..., 0]
    return out.T


def _from_surface(a: Array, bond: Array, t: Array, depth: float) -> Array:
    whole = bond @ expm(a * t[:, None, None])
    surface = np.tile(np.concatenate([np.zeros(2), _PRESSURE]), (len(t), 1))
    surface[:, :2] = np.linalg.solve(whole[..., :2], -(whole[..., 2:] @ _PRESSURE)[..., None])[..., 0]
    return np.asarray((expm(a * (depth * t)[:, None, None]) @ surface[..., None])[..., 0])


def _superposed(a: Array, bond: Array, t: Array, depth: float) -> Array:
    down, up = (np.concatenate([_compliance(a, sign), np.eye(2)]) for sign in (1.0, -1.0))
    system = np.empty((len(t), 4, 4))
    system[:, :2, :2] = np.eye(2)
    system[:, :2, 2:] = (_waning(a, -t, -1.0) @ up)[:, 2:]
    system[:, 2:, :2] = bond @ _waning(a, t, 1.0) @ down
    system[:, 2:, 2:] = bond @ up
    right = np.tile(np.concatenate([_PRESSURE, np.zeros(2)]), (len(t), 1))
    found = np.linalg.solve(system, right[..., None])
    decaying, growing = _waning(a, depth * t, 1.0) @ down, _waning(a, (depth - 1.0) * t, -1.0) @ up
    return np.asarray((decaying @ found[:, :2] + growing @ found[:, 2:])[..., 0])


def half_space_state(solid: Elastic, x: Array) -> Array:
    """Return y at k z = x in a half-space under unit pressure, shape (4, len(x))."""
    nu = solid.poisson
    surface = np.array([-(1.0 - 2.0 * nu), 2.0 * (1.0 - nu), *_PRESSURE])
    return np.asarray(_waning(_matrix(solid, solid.shear_modulus), np.asarray(x), 1.0) @ surface).T


def in_plane_stress(solid: Elastic, shear: float, state: Array) -> tuple[Array, Array]:
    """Return sum and difference of the in-plane stresses along and across the wave, from states scaled by ``shear``."""
    n = solid.poisson / (1.0 - solid.poisson)
    difference = solid.shear_modulus / shear * state[0]  # 2 mu times the strain along the wave
    across = n * (state[2] + difference)
    return 2.0 * across + difference, difference
