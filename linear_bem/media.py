"""Materials: elastic solids, the layer, and media given by the response of their surface."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real

from linear_bem.arrays import Array


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
    at the surface (0 over a rigid base); None: measured by G at 1e-6. In a `Periodic` cell, if it is not 0, approaches
    are measured from the mean level of the surface, as no layer is known. Derivation: linear_bem/README.md.
    """

    response: Callable[[Array], Array]
    far_ratio: float | None = None


def without_empty_layer(layer: Layer, substrate: Elastic | None) -> tuple[Layer, Elastic | None]:
    """Return the substrate alone, as a half-space, if the layer has no thickness; else both unchanged."""
    if layer.thickness > 0.0 or substrate is None:
        return layer, substrate
    return Layer(substrate.young, substrate.poisson, math.inf), None


def medium_faults(layer: Layer, substrate: Elastic | None) -> list[str]:
    """Return a message per fault of layer and substrate."""
    if not isinstance(layer, Layer):
        return [f"layer: must be a Layer or a SurfaceResponse, got {layer!r}"]
    if not isinstance(substrate, Elastic | None):
        return [f"substrate: must be Elastic or None, got {substrate!r}"]
    faults = [
        f"{name}.{key}: must be a number, got {value!r}"
        for name, solid in (("layer", layer), ("substrate", substrate))
        for key in ("young", "poisson", "thickness")
        if not isinstance(value := getattr(solid, key, 0.0), Real)
    ]
    return faults or material_faults(layer, substrate)


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
            alone = name == "layer" and substrate is None
            auxetic = "; linear_bem takes less as a SurfaceResponse" if alone and -1.0 < solid.poisson < 0.0 else ""
            faults.append(f"{name}.poisson: must lie between {least:g} and 0.5, got {solid.poisson:g}{auxetic}")
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
