"""A fit of the change of the tangential force by finite strain, for plans before a run, not for results.

S_Q, T at finite strain over T at small strain and equal normal force, of two exact spheres next to each other. Source:
the study ``strengthening``, cases headline-thin and headline-thick for `CURVES` (nu = 0.48, substrate 1000 times as
stiff); the study ``fit_range`` for what changes with thickness and nu (corners of the range, rigid base).
"""

import math
from typing import Any

THIN = 1.16
CURVES = {THIN: (0.366, 2.619, -8.051, 15.138), 6.0: (-0.074, 0.136)}
"""Thickness over R: coefficients of D/R, (D/R)^2, ... in S_Q - 1."""
ERROR, ERROR_GROWTH = 0.005, 0.06
"""Largest deviation of S_Q from the fit where it was made: at zero load, and its growth per (D/R)^2."""
FITTED_POISSON, FITTED_LAW = 0.48, "neo_hookean"
BY_THICKNESS, BY_POISSON, BY_DISTANCE = 3.7, -10.0, -3.7
"""Slopes of ln(S_Q - 1) of the thin layer over h/R, nu and L/R; at 0.16 R and 0.5 R: 2.9 to 4.5, -4 to -15, -4.1."""
UNSURE_THICKNESS, UNSURE_POISSON, UNSURE_DISTANCE = 1.0, 3.0, 1.0
"""Growth of the relative error of S_Q - 1 per distance in h/R, nu and L/R from where the thin curve was fitted."""
STIFF = 1e3
"""Least modulus of a substrate over the layer's: that of the fits; the range was measured on a rigid base."""
ROUNDOFF = 1e-9
"""Relative tolerance of the limits of the range."""
LARGEST_APPROACH = 0.5
"""Largest approach over R that the fits cover."""
THICKNESSES = {THIN: (1.0, 1.2), 6.0: (5.0, 8.0)}
"""Range of thickness over R in which each curve is used; between the ranges, T changes sign.

At 1.3 R, nu = 0.47 and 0.5 R T of small strain is near its zero already, and S_Q = 3.6.
"""
DISTANCES = (2.0, 2.1)
"""Distances of neighbours over R: at 3 R the same layers have S_Q = 0.97 and 0.98 at the largest approach."""
POISSONS = (0.47, 0.49)
"""At nu = 0.4999 S_Q is smaller by 0.17 at the largest approach; at 0.4 and below T of the thin layer changes sign."""


def strengthening_at_force(
    approach: float, thickness: float, poisson: float = FITTED_POISSON, distance: float = DISTANCES[0]
) -> float:
    """Return S_Q for an approach, a thickness and a distance, all over R, and Poisson's ratio, by the nearer curve."""
    x, known = min(max(approach, 0.0), LARGEST_APPROACH), _nearest(thickness)
    change = sum(c * x**power for power, c in enumerate(CURVES[known], start=1))
    if known != THIN:
        return 1.0 + change
    h, nu, length = thickness - THIN, poisson - FITTED_POISSON, distance - DISTANCES[0]
    return 1.0 + change * math.exp(BY_THICKNESS * h + BY_POISSON * nu + BY_DISTANCE * length)


def fit_error(
    approach: float, thickness: float = THIN, poisson: float = FITTED_POISSON, distance: float = DISTANCES[0]
) -> float:
    """Return the largest deviation of S_Q from the fit inside its range; it grows away from where the fit was made."""
    error = ERROR + ERROR_GROWTH * min(approach, LARGEST_APPROACH) ** 2
    if _nearest(thickness) != THIN:
        return error
    h, nu, length = abs(thickness - THIN), abs(poisson - FITTED_POISSON), abs(distance - DISTANCES[0])
    away = UNSURE_THICKNESS * h + UNSURE_POISSON * nu + UNSURE_DISTANCE * length
    return error + away * abs(strengthening_at_force(approach, thickness, poisson, distance) - 1.0)


def as_data() -> dict[str, Any]:
    """Return the constants of the fit and its range, for a program in another language."""
    return {
        "curves": [
            {"thickness": h, "range": THICKNESSES[h], "coefficients": c, "varies": h == THIN} for h, c in CURVES.items()
        ],
        "distances": DISTANCES, "poissons": POISSONS, "poisson": FITTED_POISSON, "approach": LARGEST_APPROACH,
        "error": ERROR, "growth": ERROR_GROWTH,
        "slopes": (BY_THICKNESS, BY_POISSON, BY_DISTANCE),
        "unsure": (UNSURE_THICKNESS, UNSURE_POISSON, UNSURE_DISTANCE),
    }  # fmt: skip


def outside(
    approach: float, thickness: float, distance: float, poisson: float, stiffness: float = math.inf
) -> list[str]:
    """Return the ranges of the fits that exclude a scene, each with the scene's value: "D up to 0.5 R (here 1 R)".

    Lengths are over R, ``stiffness`` is the substrate's modulus over the layer's.
    """
    faults = []
    if approach > LARGEST_APPROACH * (1.0 + ROUNDOFF):
        faults.append(f"D up to {LARGEST_APPROACH:g} R (here {approach:.2g} R)")
    least, most = 1.0 - ROUNDOFF, 1.0 + ROUNDOFF
    if not any(low * least <= thickness <= high * most for low, high in THICKNESSES.values()):
        ranges = " or ".join(f"{low:g} to {high:g} R" for low, high in THICKNESSES.values())
        faults.append(f"h = {ranges} (here {thickness:.3g} R)")
    if not DISTANCES[0] * least <= distance <= DISTANCES[1] * most:
        faults.append(f"L = {DISTANCES[0]:g} to {DISTANCES[1]:g} R (here {distance:.3g} R)")
    if not POISSONS[0] * least <= poisson <= POISSONS[1] * most:
        faults.append(f"nu = {POISSONS[0]:g} to {POISSONS[1]:g} (here {poisson:g})")
    if stiffness < STIFF * least:
        faults.append(f"a substrate {STIFF:g} times as stiff as the layer or more (here {stiffness:.3g})")
    return faults


def _nearest(thickness: float) -> float:
    return min(CURVES, key=lambda known: abs(1.0 / known - 1.0 / max(thickness, ROUNDOFF)))
