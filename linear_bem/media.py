"""Materials: elastic solids, the layer, and media given by the response of their surface."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from linear_bem.arrays import Array

LINEAR_UP_TO = 0.5
"""Approach over the layer's thickness above which a note is given, if only the layer is deformed.

At 0.43 finite strain already makes T of touching balls 1.8 times as large (study `strengthening`, h = 1.16 R).
"""
COMPARED_UP_TO = 1.2
"""Approach over a sphere's radius up to which T is compared with finite strain (study `strengthening`, foam)."""
UNSURE = 0.25
"""Share of an approach that `dent` may miss: where it leaves the layer less, nothing is said."""
LARGE_STRAIN, MEANINGLESS = "the largest approach is", "deeper than layer and base can give"
"""How the note begins that says so, and what it says of a depth that no small strain could explain."""
CHECK_UNITS = "check the load's unit, bare numbers are in metres and newtons"


@dataclass(frozen=True)
class Elastic:
    """Isotropic elastic constants: Young's modulus [Pa] and Poisson's ratio [-]."""

    young: float
    poisson: float

    @property
    def shear_modulus(self) -> float:
        """Shear modulus [Pa]."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def lame_first(self) -> float:
        """First Lame constant [Pa]; infinite for an incompressible material."""
        if self.poisson == 0.5:
            return math.inf
        return self.young * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))

    @property
    def contact_modulus(self) -> float:
        """E / (1 - nu^2) [Pa], the modulus of frictionless contact with a rigid indenter."""
        return self.young / (1.0 - self.poisson**2)


@dataclass(frozen=True)
class Layer(Elastic):
    """The elastic layer: elastic constants and thickness [m] (``inf``: a half-space; 0: the substrate alone)."""

    thickness: float


@dataclass(frozen=True)
class SurfaceResponse(Layer):
    """A medium given by the response G of its surface, in place of layer and substrate; linear model only.

    A pressure p cos(k x) displaces the surface down by 2 (1 - poisson^2)/(young k) G(k thickness) p cos(k x): ``young``
    and ``poisson`` (-1 to 0.5) are those at the surface; ``thickness`` [m] is the unit of length in G's argument.
    ``response`` accepts and returns arrays; G > 0 must tend to 1 exponentially at large arguments, as if the material
    next to the surface is homogeneous. ``far_ratio`` is G(0), the compliance far from a load over that of the material
    at the surface (0 over a rigid base); None: measured by G at 1e-6. Derivation: linear_bem/README.md.
    """

    response: Callable[[Array], Array]
    far_ratio: float | None = None


def without_empty_layer(layer: Layer, substrate: Elastic | None) -> tuple[Layer, Elastic | None]:
    """Return the substrate alone, as a half-space, if the layer has no thickness; else both unchanged."""
    if layer.thickness > 0.0 or substrate is None:
        return layer, substrate
    return Layer(substrate.young, substrate.poisson, math.inf), None


def material_faults(layer: Layer, substrate: Elastic | None) -> list[str]:
    """Return a message per fault of a layer and its substrate, with key, rule and value."""
    faults = []
    thickness = layer.thickness
    if not (thickness > 0.0 or (thickness == 0.0 and substrate is not None)):
        rule = "must be greater than 0" if substrate is None else "must not be negative"
        faults.append(f"layer.thickness: {rule}, got {thickness:g} m")
    for name, solid in (("layer", layer), ("substrate", substrate)):
        if solid is None:
            continue
        if not (solid.young > 0.0 and math.isfinite(solid.young)):
            faults.append(f"{name}.young: must be greater than 0 and finite, got {solid.young:g} Pa")
        least = -1.0 if isinstance(solid, SurfaceResponse) else 0.0
        if not least <= solid.poisson <= 0.5 or solid.poisson == -1.0:
            faults.append(f"{name}.poisson: must lie between {least:g} and 0.5, got {solid.poisson:g}")
    return faults + _response_faults(layer, substrate) if isinstance(layer, SurfaceResponse) else faults


def _response_faults(own: SurfaceResponse, substrate: Elastic | None) -> list[str]:
    faults = []
    if not callable(own.response):
        faults.append(f"layer.response: must be a function of k times thickness, got {own.response!r}")
    if not math.isfinite(own.thickness):
        faults.append(f"layer.thickness: must be finite where the response is given, got {own.thickness:g} m")
    if own.far_ratio is not None and not 0.0 <= own.far_ratio < math.inf:
        faults.append(f"layer.far_ratio: must not be negative, and finite, got {own.far_ratio}")
    if substrate is not None:
        faults.append("substrate: is part of the response of the layer, got a separate one; leave it out")
    return faults


def depth_faults(layer: Layer, substrate: Elastic | None, approaches: Sequence[float]) -> list[str]:
    """Return the fault of given approaches [m] that a layer on a rigid base cannot give: it ends at the base.

    A found approach, or one beyond the given ones in a table, may be larger: `large_strain_note` says so.
    """
    deepest, thickness = max(approaches, default=0.0), layer.thickness
    if isinstance(layer, SurfaceResponse) or substrate is not None or not deepest >= thickness > 0.0:
        return []
    ball = list(approaches).index(deepest)
    return [
        f"load.approach[{ball}]: must be less than the thickness of a layer on a rigid base, "
        f"{thickness:g} m, got {deepest:g} m; press less deep, or add the substrate that gives way"
    ]


def dent(substrate: Elastic | None, thickness: float, force: float, contact_area: float) -> float:
    """Return about how deep [m] a substrate gives way under a layer: Hertz's dent of a force [N], spread by the layer.

    The contact [m^2] is taken to be at least as wide as the layer is thick [m].
    """
    if substrate is None or not math.isfinite(thickness):
        return 0.0
    return 0.75 * force / (substrate.contact_modulus * max(math.sqrt(contact_area / math.pi), thickness))


def large_strain_note(layer: Layer, deepest: float, base: float = 0.0) -> tuple[str, ...]:
    """Return a note where small strain does not hold, given the largest approach and what the base gives of it [m]."""
    if isinstance(layer, SurfaceResponse):  # it may deform to any depth
        return ()
    own = deepest - base
    share = own / layer.thickness
    if not share > LINEAR_UP_TO or own < UNSURE * deepest:
        return ()
    said = f"{LARGE_STRAIN} {deepest / layer.thickness:.2g} of the layer's thickness"
    if share >= 1.0:
        return (f"{said}, {MEANINGLESS}: {CHECK_UNITS}",)
    taken = f", of which the layer takes {share:.2g}" if base > 0.05 * deepest else ""
    return (f"{said}{taken}: strains are of that size, and a small-strain model is valid up to about {LINEAR_UP_TO:g}",)


def ball_depth_note(share: float) -> tuple[str, ...]:
    """Return a note where the largest approach of a round ball over its radius exceeds 1.25 times `COMPARED_UP_TO`."""
    if not share > 1.25 * COMPARED_UP_TO:
        return ()
    return (
        f"{LARGE_STRAIN} {share:.2g} of its ball's radius: small strain is compared with finite strain up to "
        f"{COMPARED_UP_TO:g} of it; {CHECK_UNITS}",
    )
