"""Published formulas as printed in their sources, except those in `linear_bem.closed_forms`.

chi = sqrt(R D) / h is the contact size over the thickness; E* = E / (1 - nu^2); a factor multiplies the force on a
half-space. Where each formula was read is stated in `runs.studies.validation.sources`.
"""

import math

import numpy as np
from scipy.optimize import brentq
from scipy.special import gamma, j1

from linear_bem.closed_forms import hertz_force, sneddon_sphere
from linear_bem.problem import Layer


def sneddon_force(approach: float, radius: float, contact_modulus: float) -> float:
    """Return the force [N] on a sphere on a half-space at an approach [m] [Sneddon 1965]."""
    contact = brentq(lambda a: sneddon_sphere(a, radius, 1.0)[0] - approach, 1e-9 * radius, (1.0 - 1e-12) * radius)
    return sneddon_sphere(contact, radius, contact_modulus)[1]


def sneddon_factor(depth: float) -> float:
    """Return the force on a sphere over Hertz's at D / R."""
    return sneddon_force(depth, 1.0, 1.0) / hertz_force(depth, 1.0, 1.0)


def kontomaris_factor(depth: float) -> float:
    """Return the force on a sphere over Hertz's at D / R [Kontomaris 2021, eq. 17]."""
    fitted = (1.0100000, -0.0730300, -0.1357000, 0.0359800, -0.0040240, 0.0001653)
    powers = (0.0, 0.5, 1.5, 2.5, 3.5, 4.5)
    return sum(
        1.5 / (i + 1.0 if i else 1.5) * c * depth**n for i, (c, n) in enumerate(zip(fitted, powers, strict=True))
    )


def hyperboloid_force(approach: float, tip_radius: float, slope: float, contact_modulus: float) -> float:
    """Return the force [N] on a hyperboloid (cone of ``slope`` [rad] against the surface, tip rounded) on a half-space.

    [Sun, Akhremitchev and Walker], without adhesion.
    """
    tan = math.tan(slope)
    length = tip_radius * tan

    def angle(a: float) -> float:
        return 0.5 * math.pi + math.atan(0.5 * (a / length - length / a))

    a = brentq(lambda a: 0.5 * a * tan * angle(a) - approach, 1e-9 * tip_radius, 1e3 * (approach / tan + tip_radius))
    return contact_modulus * a * a * tan * (length / a + 0.5 * (1.0 - (length / a) ** 2) * angle(a))


def power_force(approach: float, exponent: float, contact_modulus: float) -> float:
    """Return the force [N] on a body of height r^exponent (r in m) on a half-space [Galin]."""
    n = exponent
    root = (gamma(0.5 * (1.0 + n)) / (math.sqrt(math.pi) * gamma(1.0 + 0.5 * n))) ** (1.0 / n)
    return float(contact_modulus * 2.0 * n / (n + 1.0) * root * approach ** (1.0 + 1.0 / n))


def series(coefficients: tuple[float, ...], chi: float) -> float:
    """Return 1 + c1 chi + c2 chi^2 + ..."""
    return 1.0 + sum(c * chi ** (i + 1) for i, c in enumerate(coefficients))


DIMITRIADIS = (1.133, 1.283, 0.769, 0.0975)
"""Factor of a bonded layer, nu = 0.5, paraboloid [Dimitriadis et al. 2002, eq. 12]."""
GARCIA = (1.133, 1.497, 1.469, 0.755)
"""The same [Garcia and Garcia 2018]."""
GARCIA_PUNCH = (1.133, 1.283, 0.598, -0.291)
"""Factor of a bonded layer, nu = 0.5, flat punch, in a / h [Garcia and Garcia 2018]."""


def dimitriadis_factor(chi: float, poisson: float) -> float:
    """Return the factor of a bonded layer, any nu, paraboloid [Dimitriadis et al. 2002]."""
    alpha = -(1.2876 - 1.4678 * poisson + 1.3442 * poisson**2) / (1.0 - poisson)
    beta = (0.6387 - 1.0277 * poisson + 1.5164 * poisson**2) / (1.0 - poisson)
    pi = math.pi
    terms = (
        -2.0 * alpha / pi, 4.0 * alpha**2 / pi**2, -8.0 / pi**3 * (alpha**3 + 4.0 * pi**2 * beta / 15.0),
        16.0 * alpha / pi**4 * (alpha**3 + 3.0 * pi**2 * beta / 5.0),
    )  # fmt: skip
    return series(terms, chi)


def lebedev_factor(chi: float) -> float:
    """Return the factor of a bonded layer, nu = 0.5, paraboloid (Lebedev and Ufliand's equation, fitted)."""
    x = chi**2
    if x < 0.4:
        return series((1.1053416390578608, 1.606749412034415, 1.6018294436819807), chi)
    terms = (0.6157882175705465, -3.1143156364867647, 6.692972504122468, -7.1702772387228935, 8.227673152332168)
    force = sum(c * chi**i for i, c in enumerate(terms)) + 0.5 * math.pi * x**3
    return 0.75 * force / chi**3


PUNCH_FITS: dict[float, tuple[float, tuple[float, ...], tuple[float, ...]]] = {
    0.0: (
        1.5, (0.770308111530346, 0.6165420289577782, -0.0384621101679078, -0.19394949807916162, 0.07260749644777371),
        (-0.33294442393732854, 1.5342411518628014, 0.005042851886799859, -0.000260182832698187, 4.362991470005079e-6),
    ),
    0.5: (
        1.2, (1.127294838473304, 1.2534743855684407, 0.7845575578931572, -0.8066500581952372, 0.25992549153472266),
        (-0.32200988000179354, 1.9372155069019295, 0.8542206369854419, 0.1474038965378127),
    ),
}  # fmt: skip
"""By nu: a / h up to which the first polynomial holds, its coefficients (from a / h on), the second's (from 1 on)."""


def punch_factor(slender: float, poisson: float) -> float:
    """Return the factor of a bonded layer, flat punch, at a / h (Lebedev and Ufliand's equation, fitted)."""
    limit, near, far = PUNCH_FITS[poisson]
    return series(near, slender) if slender <= limit else 1.0 + sum(c * slender**i for i, c in enumerate(far))


def carbone_response(t: np.ndarray, poisson: float) -> np.ndarray:
    """Return a bonded layer's compliance over a half-space's at t = k h [Carbone and Mangialardi 2008, eq. A.30]."""
    fac, off = 3.0 - 4.0 * poisson, 4.0 * poisson * (2.0 * poisson - 3.0) + 5.0
    return np.asarray((fac * np.sinh(2.0 * t) - 2.0 * t) / (fac * np.cosh(2.0 * t) + 2.0 * t**2 + off))


def carbone_force(normal_force: float, contact: float, distance: float, layer: Layer, uniform: bool) -> float:
    """Return the attraction [N] of two contacts of radius ``contact`` [m] under Hertz's or a uniform pressure.

    The interaction energy of p1 and p2 is the integral of the compliance times p1(k) p2(k) over the plane of k; its
    derivative by the distance gives T = Q^2 (1 - nu^2) / (pi E) times the integral of G(k h) k J1(k L) P(k)^2, with the
    response G of `carbone_response` and P, the transform of the pressure over Q.
    """
    # P^2 falls like k^-4 (uniform: k^-3), and J1 oscillates: the integral beyond the end is small
    end, least = 1e3 / contact, 1e-6 / contact
    edges = np.concatenate(([least], np.arange(4.0, end * distance, 4.0) / distance))
    points, weights = np.polynomial.legendre.leggauss(12)
    half = 0.5 * np.diff(edges)[:, None]
    k = edges[:-1, None] + half + half * points
    x = k * contact
    transform = 2.0 * j1(x) / x if uniform else 3.0 * (np.sin(x) - x * np.cos(x)) / x**3
    response = carbone_response(np.minimum(k * layer.thickness, 300.0), layer.poisson)
    total = np.sum(half * weights * response * k * j1(k * distance) * transform**2)
    return float(normal_force**2 / (math.pi * layer.contact_modulus) * total)


def gao_weight(x: float, poisson: float) -> float:
    """Return the layer's share of the contact modulus at x = a / h [Gao et al. 1992]."""
    inner = (1.0 - 2.0 * poisson) / x * math.log(1.0 + x * x) - x / (1.0 + x * x)
    return 2.0 / math.pi * math.atan(1.0 / x) + inner / (2.0 * math.pi * (1.0 - poisson))


def perriot_modulus(x: float, layer: float, substrate: float, power: float) -> float:
    """Return the effective contact modulus at x = a / h from layer's and substrate's [Perriot and Barthel 2004]."""
    log = math.log10(substrate / layer)
    k0 = 10.0 ** (-0.093 + 0.792 * log + 0.05 * log**2)
    return layer + (substrate - layer) / (1.0 + (k0 / x) ** power)


def lin_force(approach: float, radius: float, contact_modulus: float, exponent: float) -> float:
    """Return the force [N] on a sphere on an Ogden half-space [Lin et al. 2009]; exponent 2 is neo-Hookean."""
    a = math.sqrt(radius * approach)
    c, n = 1.0 - 0.2 * a / radius, exponent
    return 40.0 * a * a * contact_modulus / (9.0 * n) * (c ** (-0.5 * n - 1.0) - c ** (n - 1.0))
