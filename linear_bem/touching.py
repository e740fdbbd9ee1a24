"""How near two rigid bodies may stand that rest on one plane."""

import math

from linear_bem.indenter import Indenter, Paraboloid, Sphere


def largest_half_width(body: object, radius: float) -> float:
    """Return a bound [m] of half the touching distance to an equal body."""
    if not isinstance(body, Indenter):
        return radius
    reach = body.reach if math.isfinite(body.reach) else 0.0
    return max(radius, reach, body.half_width(1.0, 0.0), body.half_width(0.0, 1.0))


def touching_distance(bodies: tuple[object, object], radii: tuple[float, float], between: tuple[float, float]) -> float:
    """Return the distance [m] of the axes of two touching bodies that rest on one plane; 0 if one is unbounded.

    ``between`` is the vector from one axis to the other. Exact for balls, for punches and for equal ellipsoids. Cones
    are unbounded: they may merge above the layer.
    """
    if not any(isinstance(body, Indenter) and not isinstance(body, Sphere | Paraboloid) for body in bodies):
        return 2.0 * math.sqrt(radii[0] * radii[1])
    length = math.hypot(*between) or 1.0
    x, y = between[0] / length, between[1] / length
    widths = [
        body.half_width(x, y) if isinstance(body, Indenter) else radius
        for body, radius in zip(bodies, radii, strict=True)
    ]
    return sum(widths) if min(widths) > 0.0 else 0.0
