"""Hyperelastic laws of the layer, with dimensionless parameters.

The layer's Young's modulus and Poisson's ratio set shear modulus mu and Lame's constant lambda of every law at small
strain; the law's parameters set its response at finite strain. With I1, I2 and the stretches l of F, and J = det F:
A = I1 - 3 - 2 ln J and B = I2 - 3 - 4 ln J, the published I1 - 3 and I2 - 3 at constant volume (Ciarlet and Geymonat's
extension to compressible solids), and U = lambda/2 (J - 1)^2 or its mixed form. This module needs no DOLFINx.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from difflib import get_close_matches
from numbers import Real
from typing import Any, ClassVar

FOAM_LIMIT = 0.45
"""Largest Poisson's ratio of `Hyperfoam`: its volume term is J^(-a nu / (1 - 2 nu)) and has no incompressible limit."""


@dataclass(frozen=True)
class Law:
    """A hyperelastic law; the fields of a subclass are its dimensionless parameters."""

    name: ClassVar[str]
    takes_pressure: ClassVar[bool] = True
    """Whether the volumetric energy is U, which has a mixed form up to Poisson's ratio 0.5."""

    def faults(self, poisson: float) -> list[str]:
        """Return a message "key: rule, got value" per faulty parameter, for a layer with this Poisson's ratio."""
        texts = []
        for f in fields(self):
            value = getattr(self, f.name)
            if f.type in ("float", float):
                texts += [] if _finite(value) else [f"{f.name}: must be a finite number, got {value!r}"]
            elif not (isinstance(value, Sequence) and not isinstance(value, str) and all(map(_finite, value))):
                texts.append(f"{f.name}: must be a tuple of finite numbers, got {value!r}")
        return texts or self._out_of_range(poisson)

    def _out_of_range(self, poisson: float) -> list[str]:
        return []

    def doubts(self, poisson: float) -> list[str]:
        """Return a sentence per range where the energy is not known to be polyconvex; empty if it is everywhere."""
        return []


@dataclass(frozen=True)
class NeoHookean(Law):
    """mu/2 A + U; polyconvex for every Poisson's ratio."""

    name: ClassVar[str] = "neo_hookean"


@dataclass(frozen=True)
class MooneyRivlin(Law):
    """mu/2 [(1 - s) A + s B] - s mu (J - 1)^2 + U with the ``share`` s = C2 / (C1 + C2), 0 to 1.

    [Mooney 1940, doi 10.1063/1.1712836; Rivlin 1948, doi 10.1098/rsta.1948.0024; compressible: Ciarlet Geymonat 1982].
    mu = 2 (C1 + C2).
    """

    share: float
    name: ClassVar[str] = "mooney_rivlin"

    def _out_of_range(self, poisson: float) -> list[str]:
        return [] if 0.0 <= self.share <= 1.0 else [f"share: must lie between 0 and 1, got {self.share:g}"]

    def doubts(self, poisson: float) -> list[str]:
        """Polyconvex where lambda >= 2 s mu."""
        least = self.share / (1.0 + 2.0 * self.share)
        return [f"not known to be polyconvex below Poisson's ratio {least:.3g}"] if poisson < least else []


@dataclass(frozen=True)
class Yeoh(Law):
    """mu/2 (A + c A^2 + d A^3) + U with ``ratios`` (c, d) = (C2 / C1, C3 / C1).

    [Yeoh 1993, doi 10.5254/1.3538343]. mu = 2 C1.
    """

    ratios: tuple[float, float]
    name: ClassVar[str] = "yeoh"

    def _out_of_range(self, poisson: float) -> list[str]:
        if len(self.ratios) != 2:
            return [f"ratios: must be two numbers, C2 / C1 and C3 / C1, got {self.ratios}"]
        c, d = self.ratios
        if d < 0.0 or (c < 0.0 and c * c >= 3.0 * d):
            rule = "must give an energy that grows with I1: C3 / C1 >= 0, and above (C2 / C1)^2 / 3 where C2 < 0"
            return [f"ratios: {rule}, got {self.ratios}"]
        return []

    def doubts(self, poisson: float) -> list[str]:
        """Polyconvex where the energy is convex in A: c + 3 d A >= 0."""
        c, d = self.ratios
        return [f"not convex in I1 up to I1 - 3 = {-c / (3.0 * d):.3g}, where it softens"] if c < 0.0 else []


@dataclass(frozen=True)
class Gent(Law):
    """-mu/2 J_m ln(1 - A / J_m) + U with the ``limit`` J_m of I1 - 3; polyconvex up to it.

    [Gent 1996, doi 10.5254/1.3538357].
    """

    limit: float
    name: ClassVar[str] = "gent"

    def _out_of_range(self, poisson: float) -> list[str]:
        return [] if self.limit > 0.0 else [f"limit: must be greater than 0, got {self.limit:g}"]


@dataclass(frozen=True)
class _Stretches(Law):
    """A sum over terms with exponent a and weight w, the term's share of mu."""

    exponents: tuple[float, ...]
    weights: tuple[float, ...]

    def _out_of_range(self, poisson: float) -> list[str]:
        a, w = self.exponents, self.weights
        texts = []
        if not a or len(a) != len(w):
            texts.append(f"weights: needs one for each exponent, got {len(w)} for {len(a)}")
        if 0.0 in a:
            texts.append(f"exponents: must not be zero, got {a}")
        if min(w, default=1.0) <= 0.0 or not math.isclose(sum(w), 1.0, abs_tol=1e-6):
            texts.append(f"weights: must be greater than 0 and add up to 1, got {w} (sum {sum(w):g})")
        return texts

    def doubts(self, poisson: float) -> list[str]:
        """Polyconvex for exponents from 1 on; with positive weights convex in the logarithms of the stretches."""
        few = [f"{a:g}" for a in self.exponents if a < 1.0]
        return [f"not known to be polyconvex with exponents below 1 ({', '.join(few)})"] if few else []


@dataclass(frozen=True)
class Ogden(_Stretches):
    """sum of 2 mu w / a^2 (l1^a + l2^a + l3^a - 3 - a ln J), plus U.

    ``exponents`` a and ``weights`` w, which add up to 1: w = mu_a a / (2 mu) with the published mu_a
    [Ogden 1972, doi 10.1098/rspa.1972.0026].
    """

    name: ClassVar[str] = "ogden"


@dataclass(frozen=True)
class Hyperfoam(_Stretches):
    """sum of 2 mu w / a^2 [l1^a + l2^a + l3^a - 3 + (J^(-a b) - 1) / b], b = nu / (1 - 2 nu), for foams.

    ``exponents`` a and ``weights`` w, which add up to 1: w = mu_a / mu with the published mu_a
    [Storakers 1986, doi 10.1016/0022-5096(86)90033-5]. Poisson's ratio up to 0.45.
    """

    name: ClassVar[str] = "hyperfoam"
    takes_pressure: ClassVar[bool] = False

    def _out_of_range(self, poisson: float) -> list[str]:
        texts = super()._out_of_range(poisson)
        if poisson > FOAM_LIMIT:
            texts.append(
                f'law: hyperfoam takes layer.poisson up to {FOAM_LIMIT:g}, got {poisson:g}; use "ogden", whose limit '
                "is incompressible"
            )
        return texts


LAWS: dict[str, type[Law]] = {law.name: law for law in (NeoHookean, MooneyRivlin, Yeoh, Gent, Ogden, Hyperfoam)}
"""Every law by its name."""
Energy = Callable[[Any], Any]
"""psi(F): user-defined strain energy per reference volume [Pa], a form-language (UFL) expression in F (3, 3)."""


def law_of(name: str, numbers: Mapping[str, Any]) -> tuple[Law | None, list[str]]:
    """Return the law of this name with its parameters, or None and a message "key: rule, got value" per fault."""
    if name not in LAWS:
        close = get_close_matches(name.lower().replace("-", "_").replace(" ", "_"), LAWS, n=1)
        meant = f'; did you mean "{close[0]}"?' if close else ""
        return None, [f'law: must be one of {", ".join(LAWS)}, got "{name}"{meant}']
    takes = [f.name for f in fields(LAWS[name])]
    known = f'law "{name}", which takes {" and ".join(takes) or "no numbers"}'
    texts = []
    for key in (key for key in numbers if key not in takes):
        owners = " or ".join(f'"{law.name}"' for law in LAWS.values() if key in [f.name for f in fields(law)])
        texts.append(f"{key}: is not a number of {known}; leave it out" + (f", or take {owners}" if owners else ""))
    texts += [f"{key}: is missing for {known}" for key in takes if key not in numbers]
    return (None, texts) if texts else (LAWS[name](**numbers), [])


def _finite(value: object) -> bool:
    return isinstance(value, Real) and math.isfinite(value)
