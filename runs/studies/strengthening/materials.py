"""The laws that studies compare, with equal moduli at small strain. Their parameters are not of real materials."""

from linear_bem.law import Gent, Hyperfoam, Law, MooneyRivlin, NeoHookean, Ogden, Yeoh

POISSON, FOAM = 0.48, 0.3
"""Poisson's ratio of the rubbers, and of the foam."""
LAWS: tuple[tuple[Law, float], ...] = (
    (NeoHookean(), POISSON),
    (Gent(10.0), POISSON),
    (MooneyRivlin(0.3), POISSON),
    (Yeoh((-0.1, 0.01)), POISSON),
    (Ogden((1.3, 5.0, -2.0), (0.9692, 0.0071, 0.0237)), POISSON),
    (NeoHookean(), FOAM),
    (Hyperfoam((8.0,), (1.0,)), FOAM),
)
"""Laws with Poisson's ratio: a limit of stretch below that of most rubbers, a large part of I2, softening before
stiffening, three terms that stiffen late, and a foam that yields in compression, with a neo-Hookean solid of the same
Poisson's ratio."""
LAW_BY_NAME = {f"{law.name}-{poisson:g}": (law, poisson) for law, poisson in LAWS}
"""The same by name and Poisson's ratio."""
FOAMS: tuple[tuple[Law, float], ...] = tuple(
    (law, nu) for nu in (FOAM, 0.0) for law in (NeoHookean(), Hyperfoam((8.0,), (1.0,)), Hyperfoam((20.0,), (1.0,)))
)
"""A solid and two foams: at nu = 0 they bear 1.5, 0.5 and 0.2 times the force of linear elasticity when compressed to
half their height, and 0.9, 1.7 and 7.8 times when stretched by a fifth. The last foam has a yield plateau."""
