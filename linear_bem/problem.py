"""The contact problem that every model accepts: bodies, materials and load, without discretisation and tolerances.

SI units; z points up out of the layer, whose free surface is z = 0; an approach is positive into the layer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from linear_bem.arrays import Array
from linear_bem.dual import height_faults
from linear_bem.effects import FiniteStrain, Periodic
from linear_bem.errors import InvalidProblem
from linear_bem.indenter import Indenter, Paraboloid, Sphere
from linear_bem.magnitudes import are_numbers, is_number, load_faults, range_faults
from linear_bem.media import Elastic, Layer, SurfaceResponse, material_faults, without_empty_layer
from linear_bem.touching import axis_faults, overlap_faults, wrapped

LoadKind = Literal["approach", "force", "total_force"]
Profile = Callable[..., object]
"""f(x, y): height [m] of a rigid surface above its lowest point, x and y [m] from the ball's axis."""
NAMED_SHAPES: dict[str, Callable[[float], Indenter]] = {"sphere": Sphere, "paraboloid": Paraboloid}


def _as_tuple(given: Any) -> Any:
    """Return a list or an array as a tuple, anything else as it is."""
    return tuple(given) if isinstance(given, list) or (isinstance(given, np.ndarray) and given.ndim) else given


@dataclass(frozen=True)
class Ball:
    """A rigid indenter: axis position (x, y) [m], radius of curvature at its apex [m], and shape.

    ``shape`` is "sphere", "paraboloid" (the paper's r^2 / 2R), an `Indenter` such as ``Cone(slope, tip_radius)``, which
    sets the radius, or a convex profile ``f(x, y)`` with f(0, 0) = 0 that takes and returns numpy arrays; for finite
    elements it must be an expression such as `Indenter` describes.

    A body is whole by default: it must not overlap others. An ``asperity`` is a cap on a rigid surface, of which
    only the part near its apex exists: it may stand closer to others than their radii, and where two surfaces cross,
    the lower one counts. Linear model only.
    """

    position: tuple[float, float]
    radius: float = math.nan
    shape: str | Indenter | Profile = "sphere"
    asperity: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", _as_tuple(self.position))
        if isinstance(self.shape, Indenter) and math.isnan(self.radius):
            object.__setattr__(self, "radius", self.shape.apex_radius)

    @property
    def indenter(self) -> Indenter | Profile:
        """The body, an `Indenter` or the profile as given."""
        if isinstance(self.shape, str):
            return NAMED_SHAPES[self.shape](self.radius)
        return self.shape


@dataclass(frozen=True)
class Load:
    """The prescribed quantity: one approach [m] or force [N] per ball, or one total force [N] on all.

    ``total_force`` is the paper's problem 1 (one rigid holder, common approach), ``force`` its
    problem 2; the paper's experiments prescribe the ``approach``. Values are positive where a ball is pressed in.
    """

    kind: LoadKind
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", _as_tuple(self.values))


@dataclass(frozen=True)
class Elements:
    """The finite-element formulation of the layer; by default the model chooses.

    ``form`` is "displacement", or "mixed" with the pressure as an additional unknown.
    """

    form: str


PARTS: dict[str, tuple[type, str]] = {
    "layer": (Layer, "Layer(1e6, 0.48, 3e-3)"),
    "load": (Load, 'Load("force", (0.5, 0.5))'),
    "substrate": (Elastic, "Elastic(1e9, 0.3)"),
    "finite_strain": (FiniteStrain, "FiniteStrain()"),
    "elements": (Elements, 'Elements("mixed")'),
    "periodic": (Periodic, "Periodic((10.0, 10.0))"),
}
"""Type and example of the parts of a problem other than its balls; only the first two are required."""


@dataclass(frozen=True)
class Problem:
    """Rigid balls pressed into a layer on an elastic half-space (``substrate``) or a rigid base.

    ``finite_strain`` and ``periodic`` are effects, absent if None; ``elements`` sets the form of the finite elements.
    Raises `InvalidProblem` with every fault found.
    """

    layer: Layer
    balls: tuple[Ball, ...]
    load: Load
    substrate: Elastic | None = None
    finite_strain: FiniteStrain | None = None
    elements: Elements | None = None
    periodic: Periodic | None = None

    def __post_init__(self) -> None:
        faults = self._type_faults()
        if faults:
            raise InvalidProblem(*faults)
        materials, balls = material_faults(self.layer, self.substrate), self._ball_faults()
        sizes = [] if balls else self._size_faults()
        faults = [*materials, *balls, *sizes]
        if not balls and not sizes:
            faults += height_faults(ball.shape for ball in self.balls) or self._overlaps()
        if not sizes:
            kind, values, radii = self.load.kind, self.load.values, [ball.radius for ball in self.balls]
            faults += load_faults(kind, values, radii, self.layer.young)
        if self.elements is not None and self.elements.form not in ("displacement", "mixed"):
            faults.append(f'elements.form: must be "displacement" or "mixed", got "{self.elements.form}"')
        if self.finite_strain is not None and isinstance(self.layer, SurfaceResponse):
            faults.append("finite_strain: needs a layer of a material, got the response of its surface; use linear_bem")
        elif self.finite_strain is not None:
            faults += self.finite_strain.faults(self.layer.poisson)
        if self.periodic is not None and self.finite_strain is not None:
            faults.append("periodic: the finite elements have no cell that repeats; leave out one of the two effects")
        if self.finite_strain is not None and any(ball.asperity for ball in self.balls):
            faults.append("finite_strain: bodies must be whole, some balls are asperities; leave out the effect")
        if faults:
            raise InvalidProblem(*faults)

    @property
    def size(self) -> int:
        """Number of balls."""
        return len(self.balls)

    @property
    def positions(self) -> Array:
        """Positions of all axes [m], shape (balls, 2)."""
        return np.array([ball.position for ball in self.balls], dtype=float)

    @property
    def cell(self) -> Array | None:
        """Lengths of the periodic cell [m]; None without one."""
        return None if self.periodic is None else np.array(self.periodic.lengths, dtype=float)

    def in_cell(self) -> Problem:
        """Return the problem with every ball at its image inside the periodic cell; unchanged without one."""
        positions = self.positions
        places = wrapped(positions, self.cell)
        return self if np.array_equal(places, positions) else self.at(places)

    def at(self, positions: Array | Sequence[Sequence[float]]) -> Problem:
        """Return the same bodies under the same load with their axes at ``positions``, shape (balls, 2) [m].

        Raises `InvalidProblem`.
        """
        if np.shape(positions) != (self.size, 2):
            raise InvalidProblem(
                f"positions: must have shape ({self.size}, 2), x and y of every ball, got shape {np.shape(positions)}"
            )
        placed = zip(self.balls, positions, strict=True)
        return replace(self, balls=tuple(replace(ball, position=(float(x), float(y))) for ball, (x, y) in placed))

    def with_load(self, kind: LoadKind, values: Sequence[float]) -> Problem:
        """Return the same bodies under another load."""
        return replace(self, load=Load(kind, tuple(values)))

    def without_empty_layer(self) -> Problem:
        """Return the problem on the substrate alone if the layer has no thickness, else the problem itself."""
        if self.layer.thickness > 0.0:
            return self
        layer, substrate = without_empty_layer(self.layer, self.substrate)
        return replace(self, layer=layer, substrate=substrate)

    def _type_faults(self) -> list[str]:
        """Return a message per value of a wrong type; strings with units are accepted in scene files only."""
        if not isinstance(self.balls, Sequence) or not all(isinstance(ball, Ball) for ball in self.balls):
            return [f"balls: must be a tuple of Ball, a single one as (Ball(...),), got {self.balls!r:.80}"]
        faults = [
            f"{key}: must be {kind.__name__} such as {example}, got {getattr(self, key)!r:.80}"
            for key, (kind, example) in PARTS.items()
            if not isinstance(getattr(self, key), kind) and (key in ("layer", "load") or getattr(self, key) is not None)
        ]
        if isinstance(self.substrate, Layer):
            faults.append(
                f"substrate: must be a half-space, Elastic(young, poisson), got a layer {self.substrate.thickness:g} m "
                "thick; a SurfaceResponse describes a stack of layers"
            )
        if faults:
            return faults
        numbers: dict[str, object] = {"layer.thickness": self.layer.thickness}
        for name, solid in (("layer", self.layer), ("substrate", self.substrate)):
            if solid is not None:
                numbers |= {f"{name}.young": solid.young, f"{name}.poisson": solid.poisson}
        numbers |= {f"balls.radius[{i}]": ball.radius for i, ball in enumerate(self.balls)}
        faults = [f"{key}: must be a number, got {v!r:.80}" for key, v in numbers.items() if not is_number(v)]
        for i, ball in enumerate(self.balls):
            if not are_numbers(ball.position) or len(ball.position) != 2:
                faults.append(f"balls.positions[{i}]: must be two numbers, x and y, got {ball.position!r:.80}")
        if self.periodic is not None:
            faults += self.periodic.faults()
        if not are_numbers(self.load.values):
            example = '("total_force", (1.0,))' if self.load.kind == "total_force" else '("approach", (1e-4, 1e-4))'
            wanted = f"must be Load(kind, values) with a tuple of numbers, such as Load{example}"
            faults.append(f"load: {wanted}, got {self.load.kind!r:.40}, {self.load.values!r:.80}")
        return faults

    def _ball_faults(self) -> list[str]:
        if not self.balls:
            return ["balls.positions: at least one ball is needed, got none"]
        faults = []
        for i, ball in enumerate(self.balls):
            if not (ball.radius > 0.0 and math.isfinite(ball.radius)):
                faults.append(f"balls.radius[{i}]: must be greater than 0 and finite, got {ball.radius:g} m")
            if not all(math.isfinite(c) for c in ball.position):
                faults.append(f"balls.positions[{i}]: must be finite, got {ball.position}")
            if isinstance(ball.shape, str) and ball.shape not in NAMED_SHAPES:
                faults.append(f'balls.shape: must be "paraboloid" or "sphere", got "{ball.shape}"')
            elif not isinstance(ball.shape, str | Indenter) and not callable(ball.shape):
                faults.append(f"balls.shape: must be a name, an indenter or a profile f(x, y), got {ball.shape!r}")
            elif isinstance(ball.shape, type):
                got = f"got the class {ball.shape.__name__}; give an object, such as {ball.shape.__name__}(...)"
                faults.append(f"balls.shape: must be a name, an indenter or a profile f(x, y), {got}")
            if isinstance(ball.shape, Indenter):
                faults += self._faults_of_body(f"balls.radius[{i}]", ball.radius, ball.shape)
        return list(dict.fromkeys(faults))

    @staticmethod
    def _faults_of_body(key: str, radius: float, body: Indenter) -> list[str]:
        stated = {name: getattr(body, name) for name in ("apex_radius", "reach")}
        wrong = {name: value for name, value in stated.items() if not (is_number(value) and value > 0.0)}
        if wrong:
            rule = f"balls.shape: {type(body).__name__}"
            return [f"{rule}.{name} must be a length greater than 0, got {value!r}" for name, value in wrong.items()]
        if math.isclose(radius, body.apex_radius):
            return []
        return [f"{key}: must be {body.apex_radius:g} m, which the shape states, got {radius:g} m; leave it out"]

    def _overlaps(self) -> list[str]:
        whole = {i: (ball.indenter, ball.radius) for i, ball in enumerate(self.balls) if not ball.asperity}
        radii = np.array([ball.radius for ball in self.balls])
        return overlap_faults(whole, self.positions, self.cell) or axis_faults(radii, self.positions, self.cell)

    def _size_faults(self) -> list[str]:
        """Return a message per number that is too large or too small, in itself or relative to others."""
        radii = {f"balls.radius[{i}]": ball.radius for i, ball in enumerate(self.balls)}
        young, thickness, largest = self.layer.young, self.layer.thickness, max(radii.values())
        faults = [*range_faults(radii, "m"), *range_faults({"layer.young": young}, "Pa")]
        if faults:
            return faults
        # a coordinate may be 0
        lengths = radii | {
            f"balls.positions[{i}]": max(largest, *map(abs, ball.position)) for i, ball in enumerate(self.balls)
        }
        if 0.0 < thickness < math.inf:
            lengths["layer.thickness"] = thickness
        for axis, length in enumerate(() if self.periodic is None else self.periodic.lengths):
            lengths[f"periodic.lengths[{axis}]"] = length
        moduli = {} if self.substrate is None else {"substrate.young": self.substrate.young}
        return [
            *range_faults(lengths, "m", largest, "the largest ball's radius"),
            *range_faults(moduli, "Pa", young, "the layer's"),
        ]
