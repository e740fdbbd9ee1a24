"""The scene's table [balls]: the keys that each shape takes, and the balls that they describe."""

from typing import Literal

from linear_bem.errors import InvalidProblem
from linear_bem.indenter import Cone, Ellipsoid, Indenter, Punch
from linear_bem.problem import Ball
from runs.scene.units import Angle, Length, Lengths, OneOrMany, Positions, Table, ThreeLengths

SHAPE_KEYS = {
    "sphere": ("radius",),
    "paraboloid": ("radius",),
    "ellipsoid": ("semi_axes",),
    "cone": ("slope", "tip_radius"),
    "punch": ("radius", "edge_radius"),
}
"""Keys that each shape needs, besides positions; it takes no others."""


class BallsTable(Table):
    """[balls]: axis positions, shape, and the keys that the shape takes; one radius or one per ball."""

    positions: Positions
    """Where the balls' axes stand, [x, y] of each."""
    shape: Literal["sphere", "paraboloid", "ellipsoid", "cone", "punch"] = "sphere"
    """The body of all balls (unlike bodies: in Python); it decides which of the keys below are needed."""
    radius: Lengths | None = None
    """Of a sphere or a punch; of a paraboloid at its apex."""
    semi_axes: ThreeLengths | None = None
    """Of an ellipsoid, along x, y and z."""
    slope: Angle | None = None
    """Angle between a cone's flank and the surface."""
    tip_radius: Length | None = None
    """Of a cone's rounded tip."""
    edge_radius: Length | None = None
    """Of a punch's rounded edge."""

    def balls(self) -> tuple[Ball, ...]:
        """Return the balls; raises `InvalidProblem` where the keys are not those of the shape."""
        needed = SHAPE_KEYS[self.shape]
        texts = []
        for key in dict.fromkeys(k for keys in SHAPE_KEYS.values() for k in keys):
            value = getattr(self, key)
            if value is None and key in needed:
                texts.append(f"balls.{key}: is missing")
            elif value is not None and key not in needed:
                others = " or ".join(f'"{name}"' for name, keys in SHAPE_KEYS.items() if key in keys)
                texts.append(
                    f'balls.{key}: is not for shape = "{self.shape}", which takes {" and ".join(needed)}, got {value}; '
                    f"leave it out, or take shape = {others}"
                )
        size = len(self.positions)
        radii = per_ball(self.radius or 0.0, size)
        if len(radii) != size:
            texts.append(f"balls.radius: needs one value or one per ball ({size}), got {len(radii)}")
        if texts:
            raise InvalidProblem(*texts)
        return tuple(Ball(place, *self._body(radius)) for place, radius in zip(self.positions, radii, strict=True))

    def _body(self, radius: float) -> tuple[float, str | Indenter]:
        """Return radius [m] and shape of a `Ball`."""
        body: Indenter
        match self.shape:
            case "ellipsoid":
                assert self.semi_axes is not None
                body = Ellipsoid(self.semi_axes)
            case "cone":
                assert self.slope is not None
                assert self.tip_radius is not None
                body = Cone(self.slope, self.tip_radius)
            case "punch":
                assert self.edge_radius is not None
                body = Punch(radius, self.edge_radius)
            case _:
                return radius, self.shape
        return body.apex_radius, body


def per_ball(value: OneOrMany, size: int) -> tuple[float, ...]:
    """Return one value per ball."""
    return value if isinstance(value, tuple) else (value,) * size
