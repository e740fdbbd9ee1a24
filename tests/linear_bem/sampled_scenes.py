"""Small scenes of unlike balls that take every path of large ones.

More than a hundred contacts are judged by a sample, and the mesh is used from a few hundred.
"""

import numpy as np

from linear_bem import Ball, Elastic, Ellipsoid, Layer, Load, Problem

BASES = {"half-space": (np.inf, None), "rigid base": (6.0, None), "elastic base": (2.0, Elastic(10.0, 0.3))}


def scattered(count, side, seed=1, low=0.6, high=1.0):
    """Centres and radii of balls that do not overlap, at random."""
    rng = np.random.default_rng(seed)
    centres, radii = np.empty((0, 2)), np.sort(rng.uniform(low, high, count))[::-1]
    for k in range(count):
        while True:
            place = rng.uniform(0.0, side, 2)
            if np.all(np.hypot(*(centres - place).T) >= 1.001 * (radii[:k] + radii[k])):
                break
        centres = np.vstack([centres, place])
    return centres, radii


def scene(load, base="rigid base", count=105, seed=1):
    centres, radii = scattered(count, 2.4 * np.sqrt(count), seed)
    balls = tuple(
        Ball((x, y), r, ("sphere", "paraboloid")[k % 2]) if k % 15 else Ball((x, y), shape=Ellipsoid((r, 0.9 * r, r)))
        for k, ((x, y), r) in enumerate(zip(centres.tolist(), radii.tolist(), strict=True))
    )
    thickness, substrate = BASES[base]
    values = {"approach": (0.1,) * count, "total_force": (0.02 * count,)}
    values["force"] = tuple(np.linspace(0.01, 0.03, count).tolist())
    return Problem(Layer(1.0, 0.48, thickness), balls, Load(load, values[load]), substrate)


def thin(count, load="force", base=None, thickness=0.3, depth=0.03):
    """Balls on a layer so thin that T is a small part of what a half-space would transmit."""
    centres, radii = scattered(count, 2.4 * np.sqrt(count), 5)
    balls = tuple(Ball((x, y), r) for (x, y), r in zip(centres.tolist(), radii.tolist(), strict=True))
    depths = depth * radii
    weights = np.random.default_rng(2).uniform(0.5, 1.5, count)
    values = {"approach": depths, "force": np.sqrt(radii * depths**3) * weights}
    return Problem(Layer(1.0, 0.48, thickness), balls, Load(load, tuple(values[load].tolist())), base)


def forces(result):
    return np.array([b.tangential_force for b in result.balls])


def errors(result):
    return np.array([b.tangential_force_error for b in result.balls])
