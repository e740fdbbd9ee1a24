"""Closed forms of contact mechanics for one ball, in SI units, each with its source.

Forces [N] and approaches [m] are positive when the ball is pressed in; E* = E/(1 - nu^2) is
`Elastic.contact_modulus` of a body under a rigid ball.
"""

import math
import warnings

from linear_bem.layer.ritz_indentation import Indentation, indentation_of_layer
from linear_bem.problem import Elastic, Layer

__all__ = [
    "Indentation",
    "bonded_compressible_force",
    "bonded_incompressible_force",
    "hertz_approach",
    "hertz_contact_radius",
    "hertz_force",
    "hertz_peak_pressure",
    "indentation_of_layer",
    "long_force",
    "sneddon_sphere",
]


def hertz_force(approach: float, radius: float, contact_modulus: float) -> float:
    """Return the force [N] on a paraboloid r^2/2R: Q = 4/3 E* sqrt(R) D^(3/2) [Johnson 1985, eq. 4.23]."""
    return 4.0 / 3.0 * contact_modulus * math.sqrt(radius) * max(approach, 0.0) ** 1.5


def hertz_approach(normal_force: float, radius: float, contact_modulus: float) -> float:
    """Return the approach [m] under a force: the inverse of `hertz_force`."""
    return float((0.75 * normal_force / (contact_modulus * math.sqrt(radius))) ** (2.0 / 3.0))


def hertz_contact_radius(approach: float, radius: float) -> float:
    """Return the contact radius [m] of a paraboloid on a half-space: a = sqrt(R D) [Johnson 1985, eq. 4.22]."""
    return math.sqrt(radius * max(approach, 0.0))


def hertz_peak_pressure(normal_force: float, contact_radius: float) -> float:
    """Return the peak pressure [Pa], 3 Q/(2 pi a^2) [Johnson 1985, eq. 4.24]."""
    return 1.5 * normal_force / (math.pi * contact_radius**2)


def sneddon_sphere(contact_radius: float, radius: float, contact_modulus: float) -> tuple[float, float]:
    """Return approach [m] and force [N] of a frictionless sphere R - sqrt(R^2 - r^2) on a half-space, small strain.

    [Sneddon 1965, Int. J. Eng. Sci. 3, 47, doi 10.1016/0020-7225(65)90019-4].
    """
    a, big = contact_radius, radius
    log = math.log((big + a) / (big - a))
    return 0.5 * a * log, contact_modulus * (0.5 * (a * a + big * big) * log - a * big)


def bonded_compressible_force(approach: float, radius: float, layer: Layer) -> float:
    """Return the force [N] on a paraboloid on a thin compressible layer, rigid base: pi M R D^2/h, a^2 = 2 R D.

    M = E (1 - nu)/((1 + nu)(1 - 2 nu)): the layer acts as independent columns (Winkler). Limit a >> h,
    (1 - 2 nu) a >> h [Johnson 1985, section 5.8].
    """
    nu = layer.poisson
    if nu == 0.5:
        return math.inf
    oedometric = layer.young * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
    return math.pi * oedometric * radius * max(approach, 0.0) ** 2 / layer.thickness


def bonded_incompressible_force(approach: float, radius: float, layer: Layer) -> float:
    """Return the force [N] on a paraboloid on a thin incompressible layer, rigid base: 2 pi G R^2 D^3/h^3, a^2 = 4 R D.

    Limit a >> h, nu = 0.5 [Jaffar 1989, Int. J. Mech. Sci. 31, 229, doi 10.1016/0020-7403(89)90113-4],
    [Chadwick 2002, SIAM J. Appl. Math. 62, 1520, doi 10.1137/S0036139901388222].
    """
    return 2.0 * math.pi * layer.shear_modulus * radius**2 * max(approach, 0.0) ** 3 / layer.thickness**3


def long_force(approach: float, radius: float, layer: Elastic, thickness: float) -> float:
    """Return the force [N] on a sphere on a bonded incompressible neo-Hookean layer at finite strain.

    [Long, Hall, Wu and Hui 2011, Biophys. J. 101, 643, doi 10.1016/j.bpj.2011.06.049]: a fit for
    0.3 <= R/h <= 12.7, D/h <= min(0.6, R/h); warns outside. Within 1 % of an independent axisymmetric
    finite-element solution at R/h = 0.5 and 1, D <= 0.5 R. E* is that of nu = 1/2 for every layer.
    """
    slender = radius / thickness
    if not (0.3 <= slender <= 12.7 and approach / thickness <= min(0.6, slender) * (1.0 + 1e-12)):
        warnings.warn(
            f"long_force: fitted for 0.3 <= R/h <= 12.7 and D/h <= min(0.6, R/h); got R/h = {slender:g}, "
            f"D/h = {approach / thickness:g}",
            stacklevel=2,
        )
    w = (radius * approach / thickness**2) ** 1.5
    alpha, beta = 9.5, 4.212
    if slender <= 2.0:
        flat = thickness / radius
        alpha = 10.05 - 0.63 * math.sqrt(flat) * (3.1 + flat**2)
        beta = 4.8 - 4.23 * flat**2
    ratio = (1.0 + 1.15 * w ** (1.0 / 3.0) + alpha * w + beta * w * w) / (1.0 + 2.3 * w)
    return hertz_force(approach, radius, layer.young / 0.75) * ratio
