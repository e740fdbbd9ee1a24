"""A fit of the change of the tangential force by finite strain, for plans before a run, not for results.

S_Q, T at finite strain over T at small strain and equal normal force, of two exact spheres (nu = 0.48, substrate 1000
times as stiff) next to each other. Source: the study ``strengthening``, cases headline-thin and headline-thick.
"""

CURVES = {1.16: (0.351, 2.725, -8.364, 15.392), 6.0: (-0.074, 0.133)}
"""Thickness over R: coefficients of D/R, (D/R)^2, ... in S_Q - 1."""
ERROR, ERROR_GROWTH = 0.005, 0.06
"""Largest deviation of S_Q from the fit: at zero load, and its growth per (D/R)^2."""
LARGEST_APPROACH = 0.5
"""Largest approach over R that the fits cover."""
THICKNESSES = {1.16: (1.0, 1.3), 6.0: (5.0, 8.0)}
"""Range of thickness over R in which each curve is used; between the ranges, T changes sign."""
DISTANCES = (2.0, 2.1)
"""Distances of neighbours over R: at 3 R the same layers have S_Q = 0.97 and 0.98 at the largest approach."""
POISSONS = (0.47, 0.49)
"""At nu = 0.4999 S_Q is smaller by 0.17 at the largest approach; at 0.4 and below T of the thin layer changes sign."""


def strengthening_at_force(approach: float, thickness: float) -> float:
    """Return S_Q for an approach and a thickness, both over R, by the nearer curve."""
    x = min(max(approach, 0.0), LARGEST_APPROACH)
    coefficients = CURVES[_nearest(thickness)]
    return 1.0 + sum(c * x**power for power, c in enumerate(coefficients, start=1))


def fit_error(approach: float) -> float:
    """Return the largest deviation of S_Q from the fit at an approach over R, inside its range."""
    return ERROR + ERROR_GROWTH * min(approach, LARGEST_APPROACH) ** 2


def outside(approach: float, thickness: float, distance: float, poisson: float) -> list[str]:
    """Return which parameters of a scene are outside the range of the fits, in words; lengths are over R."""
    faults = []
    if approach > LARGEST_APPROACH * (1.0 + 1e-9):
        faults.append(f"D = {approach:.2g} R is more than {LARGEST_APPROACH:g} R")
    if not any(low <= thickness <= high for low, high in THICKNESSES.values()):
        ranges = " or ".join(f"{low:g} to {high:g} R" for low, high in THICKNESSES.values())
        faults.append(f"h = {thickness:.3g} R is not {ranges}")
    if not DISTANCES[0] * (1.0 - 1e-9) <= distance <= DISTANCES[1]:
        faults.append(f"L = {distance:.3g} R is not {DISTANCES[0]:g} to {DISTANCES[1]:g} R")
    if not POISSONS[0] <= poisson <= POISSONS[1]:
        faults.append(f"nu = {poisson:g} is not {POISSONS[0]:g} to {POISSONS[1]:g}")
    return faults


def _nearest(thickness: float) -> float:
    return min(CURVES, key=lambda known: abs(1.0 / known - 1.0 / thickness))
