"""How much finite strain changes the tangential force, as a fit: to look ahead with, not to report.

Provisional: fitted to the thin pair (h = 1.16 R, L = 2 R, nu = 0.48, exact spheres, D = 0.011 to 0.32 R) and held
against the thick one (h = 6 R). Source: `thirdbody compare` on runs/scenes/paper_thin_pair.toml and
paper_thick_pair.toml; the study ``strengthening`` renews the coefficients.
"""

from __future__ import annotations

import math

COEFFICIENTS = (-0.213, 1.259)
"""Of sqrt(D/h) and of D/h in S_Q - 1."""
ERROR, ERROR_SLOPE = 0.03, 0.13
"""Largest distance of S_Q from the fit where it is known, and how steeply it vanishes with sqrt(D/h)."""
LARGEST_APPROACH = 0.28
"""Approach over thickness up to which the fit has been held against anything."""
DISTANCES = (2.0, 2.5)
"""Distances of neighbours over the radius for which it holds."""
POISSONS = (0.45, 0.49)


def strengthening_at_force(approach: float, thickness: float) -> float:
    """Return S_Q, T at finite strain over T at small strain and equal normal force, for spheres next to each other."""
    x = approach / thickness
    return 1.0 + COEFFICIENTS[0] * math.sqrt(x) + COEFFICIENTS[1] * x


def fit_error(approach: float, thickness: float) -> float:
    """Return how far S_Q may be from the fit, inside its range."""
    return min(ERROR, ERROR_SLOPE * math.sqrt(approach / thickness))


def outside(approach: float, thickness: float, distance: float, poisson: float) -> list[str]:
    """Return what about a scene lies outside the fit's range, in words; ``distance`` of neighbours is over R."""
    faults = []
    if approach > LARGEST_APPROACH * thickness:
        faults.append(f"D = {approach / thickness:.2g} h is more than {LARGEST_APPROACH:g} h")
    if not DISTANCES[0] * (1.0 - 1e-9) <= distance <= DISTANCES[1]:
        faults.append(f"L = {distance:.3g} R is not {DISTANCES[0]:g} to {DISTANCES[1]:g} R")
    if not POISSONS[0] <= poisson <= POISSONS[1]:
        faults.append(f"nu = {poisson:g} is not {POISSONS[0]:g} to {POISSONS[1]:g}")
    return faults
