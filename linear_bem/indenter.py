"""Rigid indenters: each is one expression for the height of its surface above its lowest point.

``height(x, y)`` and ``gap(x, y, z)`` take lengths [m] from the lowest point, x and y in the surface plane and z up.
They use + - * / **, abs and functions of numpy in `linear_bem.dual.SLOPES` only, so that one expression serves numpy
arrays, the form language of finite elements (UFL, which differentiates symbolically) and dual numbers. No expression
divides by zero or takes a root of zero, on the axis or at an edge: `TINY` times the body's length is added under each
root.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from linear_bem.errors import InvalidProblem
from linear_bem.magnitudes import is_number, range_faults

TINY = 1e-9
"""Relative length added under roots; its square is below roundoff."""
WALL = 1e3
"""Slope of the profile beyond a punch's edge, where the punch has no surface."""


def positive(v: Any) -> Any:
    """Return v where it is positive, else 0."""
    return 0.5 * (v + abs(v))


def _cap(squared: Any, steep: float = 1.0) -> Any:
    """Return 1 - sqrt(1 - s) for s = (r/R)^2 without cancellation; beyond the equator 1 + steep (s - 1)."""
    beyond = positive(squared - 1.0)
    return (squared - beyond) / (1.0 + (positive(1.0 - squared) + TINY**2) ** 0.5) + steep * beyond


@dataclass(frozen=True)
class Indenter:
    """A rigid surface with its lowest point at the origin; lengths in m.

    A user-defined body is a function f(x, y) or, if it has an edge (``reach``) or sides (``gap``), a frozen dataclass
    derived from this one with the property ``apex_radius`` and the method ``height(x, y)``. All models accept an
    expression of ``+ - * / **``, abs and numpy's sqrt, exp, log, sin, cos, tan, sinh, cosh, tanh, maximum and minimum
    that is 0 at the origin. Its slope must be finite: ``np.sqrt(x**2 + y**2)`` has none on the axis.

    A kink inside a contact, for example from ``np.maximum``, costs accuracy: both models need more unknowns. Forces
    converge; error estimates with polynomials (`linear_bem`) are enlarged by a measured factor, except under a plain
    function f(x, y). The peak pressure at a convex kink (maximum) has no limit: it grows as grids and meshes are
    refined. At a concave kink (minimum) the surface may lift off the body.
    """

    ratios: ClassVar[tuple[str, ...]] = ()
    """Fields that are no lengths, such as angles: any finite number. Other fields are lengths, greater than 0."""

    def __init_subclass__(cls) -> None:
        # a dataclass would use the property as the default of a field with this name, and fail to set it
        hidden = [key for key in ("apex_radius", "reach") if key in inspect.get_annotations(cls)]
        if any(key not in cls.__dict__ for key in hidden):
            raise TypeError(f"{cls.__name__}: make {hidden[0]} a property or a constant, and name the field otherwise")

    def __post_init__(self) -> None:
        faults = [fault for f in fields(self) for fault in self._faults_of(f.name, getattr(self, f.name))]
        if faults:
            raise InvalidProblem(*faults)

    def _faults_of(self, key: str, value: Any) -> list[str]:
        if key in self.ratios:
            is_finite = is_number(value) and math.isfinite(value)
            return [] if is_finite else [f"balls.{key}: must be a finite number, got {value!r}"]
        if _positive_and_finite(value):
            return range_faults({f"balls.{key}": value}, "m")
        remedy = "" if type(self).__module__ == __name__ else "; name a field that is no length in `ratios`"
        return [f"balls.{key}: must be greater than 0 and finite, got {value} m{remedy}"]

    @property
    def apex_radius(self) -> float:
        """Radius of curvature [m] at the lowest point, the length scale of estimates."""
        raise InvalidProblem(
            f"balls.shape: {type(self).__name__} must define apex_radius, its radius of curvature [m] at the apex, got "
            "none; add a constant or property of this name, such as apex_radius = 2.5e-3"
        )

    @property
    def reach(self) -> float:
        """Largest horizontal distance [m] from the axis of a point that can be touched; infinite without an edge."""
        return math.inf

    @property
    def edge(self) -> tuple[float, float] | None:
        """Radius [m] of a flat end and of the rounding about it, where the pressure peaks; None without a flat end."""
        return None

    def half_width(self, x: float, y: float) -> float:
        """Return the extent [m] of the body from its axis along the unit vector (x, y); 0 if it is unbounded."""
        return self.reach if math.isfinite(self.reach) else 0.0

    def height(self, x: Any, y: Any) -> Any:
        """Return the height [m] of the surface above its lowest point."""
        raise InvalidProblem(
            f"balls.shape: {type(self).__name__} must define height(x, y), its surface [m] above the apex, got none; "
            "add a method of this name, such as return (x**2 + y**2) / (2 * self.apex_radius)"
        )

    def gap(self, x: Any, y: Any, z: Any) -> Any:
        """Return a distance [m] of points from the body, negative inside, with gradient (0, 0, -1) at its apex.

        By default the vertical distance; bodies with a closed surface override it with one that also holds sideways.
        """
        return self.height(x, y) - z


@dataclass(frozen=True)
class _OfRadius(Indenter):
    """A body whose size is given by ``radius`` [m]."""

    radius: float

    @property
    def apex_radius(self) -> float:
        """The radius [m]."""
        return self.radius


@dataclass(frozen=True)
class HeightFunction(_OfRadius):
    """The body of a function f(x, y), an expression as described in `Indenter`; ``radius`` is that of its `Ball`."""

    function: Callable[..., Any]

    def _faults_of(self, key: str, value: Any) -> list[str]:
        return [] if key == "function" else super()._faults_of(key, value)

    def height(self, x: Any, y: Any) -> Any:
        """Return the height [m]."""
        return self.function(x, y)


@dataclass(frozen=True)
class Paraboloid(_OfRadius):
    """r^2 / 2R, the paper's ball."""

    def half_width(self, x: float, y: float) -> float:
        """Return R [m], the half width of the ball that the paraboloid approximates."""
        return self.radius

    def height(self, x: Any, y: Any) -> Any:
        """Return the height [m]."""
        return (x**2 + y**2) / (2.0 * self.radius)


@dataclass(frozen=True)
class Sphere(_OfRadius):
    """R - sqrt(R^2 - r^2); beyond the equator, where there is no surface, ``height`` rises steeply."""

    @property
    def reach(self) -> float:
        """R [m]."""
        return self.radius

    def height(self, x: Any, y: Any) -> Any:
        """Return the height [m]."""
        return self.radius * _cap((x**2 + y**2) / self.radius**2)

    def gap(self, x: Any, y: Any, z: Any) -> Any:
        """Return the distance [m] from the whole sphere."""
        return (x**2 + y**2 + (z - self.radius) ** 2 + (TINY * self.radius) ** 2) ** 0.5 - self.radius


@dataclass(frozen=True)
class Ellipsoid(Indenter):
    """Semi-axes (a, b, c) [m] along x, y and z: apex radii of curvature a^2/c and b^2/c."""

    semi_axes: tuple[float, float, float]

    def __post_init__(self) -> None:
        if isinstance(self.semi_axes, list):  # a list is not hashable
            object.__setattr__(self, "semi_axes", tuple(self.semi_axes))
        super().__post_init__()

    def _faults_of(self, key: str, value: Any) -> list[str]:
        if isinstance(value, tuple) and len(value) == 3 and all(map(_positive_and_finite, value)):
            return [fault for v in (min(value), max(value)) for fault in range_faults({f"balls.{key}": v}, "m")]
        return [f"balls.{key}: must be three lengths along x, y and z, each greater than 0 and finite, got {value} m"]

    @property
    def apex_radius(self) -> float:
        """Geometric mean a b / c [m] of the two apex radii of curvature."""
        a, b, c = self.semi_axes
        return a * b / c

    @property
    def reach(self) -> float:
        """Larger horizontal semi-axis [m]."""
        return max(self.semi_axes[:2])

    def half_width(self, x: float, y: float) -> float:
        """Return the distance [m] of the equator from the axis along (x, y)."""
        a, b, _ = self.semi_axes
        return 1.0 / math.hypot(x / a, y / b)

    def height(self, x: Any, y: Any) -> Any:
        """Return the height [m]; it rises steeply beyond the equator."""
        a, b, c = self.semi_axes
        return c * _cap(x**2 / a**2 + y**2 / b**2)

    def gap(self, x: Any, y: Any, z: Any) -> Any:
        """Return c (s - 1) [m], s = 1 on the whole ellipsoid; for a sphere this is the distance."""
        a, b, c = self.semi_axes
        return c * ((x**2 / a**2 + y**2 / b**2 + (z - c) ** 2 / c**2 + TINY**2) ** 0.5 - 1.0)


@dataclass(frozen=True)
class Cone(Indenter):
    """A cone of ``slope`` [rad] against the surface plane with a rounded tip: a hyperboloid of revolution."""

    slope: float
    tip_radius: float
    ratios = ("slope",)

    def _faults_of(self, key: str, value: Any) -> list[str]:
        if key != "slope":
            sharp = "a sharp tip has no finite pressure: take a small one, such as a tenth of the contact's radius"
            return (
                super()._faults_of(key, value)
                if value != 0.0
                else [f"balls.{key}: must be greater than 0, got 0 m; {sharp}"]
            )
        if _positive_and_finite(value) and value < 0.5 * math.pi:
            return range_faults({f"balls.{key}": value}, "rad")
        return [
            f"balls.{key}: must lie between 0 and 90 deg, the angle between flank and surface, got {value} rad; "
            'write degrees as "20 deg" in a scene, math.radians(20) in Python'
        ]

    @property
    def apex_radius(self) -> float:
        """Radius of the tip [m]."""
        return self.tip_radius

    def height(self, x: Any, y: Any) -> Any:
        """Return sqrt(s^2 r^2 + t^2) - t [m], s = tan(slope), t = s^2 times the tip's radius, without cancellation."""
        square = math.tan(self.slope) ** 2
        t, rise = square * self.tip_radius, square * (x**2 + y**2)
        return rise / ((rise + t**2) ** 0.5 + t)


@dataclass(frozen=True)
class Punch(_OfRadius):
    """A flat-ended cylinder whose edge is rounded by a quarter circle of ``edge_radius`` [m].

    Its end has no curvature: ``apex_radius``, the length scale of estimates, is the radius of the cylinder.
    """

    edge_radius: float

    def _faults_of(self, key: str, value: Any) -> list[str]:
        faults = super()._faults_of(key, value)
        if key != "edge_radius":
            return faults
        if faults:
            return [f"{faults[0]}; a sharp edge has no finite pressure: take a small one, such as radius / 100"]
        if _positive_and_finite(self.radius) and value > self.radius:
            return [f"balls.{key}: must not be larger than the punch, got {value} m at balls.radius {self.radius} m"]
        return []

    @property
    def reach(self) -> float:
        """Radius of the punch [m]."""
        return self.radius

    @property
    def edge(self) -> tuple[float, float]:
        """Radii [m] of the flat end and of its rounding."""
        return self.radius - self.edge_radius, self.edge_radius

    def _beyond_flat(self, x: Any, y: Any) -> Any:
        """Return the distance r [m] from the axis less the flat end's radius."""
        return (x**2 + y**2 + (TINY * self.radius) ** 2) ** 0.5 - (self.radius - self.edge_radius)

    def height(self, x: Any, y: Any) -> Any:
        """Return the height [m]; beyond the edge it rises with slope `WALL`."""
        e = self.edge_radius
        return e * _cap((positive(self._beyond_flat(x, y)) / e) ** 2, 0.5 * WALL)

    def gap(self, x: Any, y: Any, z: Any) -> Any:
        """Return the distance [m] from end, edge and side."""
        e = self.edge_radius
        side, end = self._beyond_flat(x, y), e - z
        corner = (positive(side) ** 2 + positive(end) ** 2 + (TINY * e) ** 2) ** 0.5
        inside = -positive(-0.5 * (side + end + abs(side - end)))
        return corner + inside - e


def _positive_and_finite(value: Any) -> bool:
    return is_number(value) and 0.0 < float(value) < math.inf
