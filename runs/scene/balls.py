"""The scene's table [balls]: the keys of each shape, and the balls that they describe."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Annotated, Any, TypeVar

from pydantic import PlainValidator

from linear_bem.errors import InvalidProblem
from linear_bem.indenter import Cone, Ellipsoid, Indenter, Punch
from linear_bem.problem import Ball
from runs.scene.units import Angles, Lengths, Positions, SemiAxes, Table, named, one_or_many

T = TypeVar("T")
SHAPE_KEYS = {
    "sphere": ("radius",),
    "paraboloid": ("radius",),
    "ellipsoid": ("semi_axes",),
    "cone": ("slope", "tip_radius"),
    "punch": ("radius", "edge_radius"),
}
"""Keys that each shape needs, besides positions; it takes no others."""
Shapes = Annotated[
    str | tuple[str, ...], PlainValidator(partial(one_or_many, parse=partial(named, names=tuple(SHAPE_KEYS))))
]
BODIES: dict[str, Callable[..., Indenter]] = {"ellipsoid": Ellipsoid, "cone": Cone, "punch": Punch}
"""Bodies that set the radius of their `Ball` themselves; their arguments are the values of `SHAPE_KEYS`, in order."""


class BallsTable(Table):
    """[balls]: positions, shapes and dimensions of the rigid bodies, called balls whatever their shape.

    ``shape`` decides which further keys are required; all others are refused. A key holds one value, for all balls
    whose shape takes the key, or a list with one value for each of these balls, in the order of their positions.
    """

    positions: Positions
    """Position [x, y] of each ball's vertical axis.

    Bodies must not overlap. Spheres and paraboloids touch as balls on one plane do, at a distance of 2 sqrt(R1 R2).
    Beside ellipsoids and punches the widths on the line between the axes add up. A cone has no width: any body may
    stand next to it, but at finite strain not if they overlap, when pressed in, at the level of the undeformed surface.
    """
    shape: Shapes = "sphere"
    """Shape of all balls, or a list with one per ball."""
    radius: Lengths | None = None
    """Radius of a sphere or a punch; radius of curvature at the apex of a paraboloid."""
    semi_axes: SemiAxes | None = None
    """Semi-axes a, b, c of an ellipsoid along x, y and z. R in tables is a b / c, the mean radius at its apex."""
    slope: Angles | None = None
    """Angle between a cone's flank and the undeformed surface."""
    tip_radius: Lengths | None = None
    """Radius of curvature at the apex of a cone's rounded tip, greater than 0: the cone is the hyperboloid of height
    sqrt(s^2 r^2 + t^2) - t, s = tan(slope), t = s^2 tip_radius. A spherical cap on the flank is another body."""
    edge_radius: Lengths | None = None
    """Radius of a punch's edge, rounded by a quarter circle; ``radius`` is that of the cylinder, edge included."""

    @property
    def shapes(self) -> tuple[str, ...]:
        """One name per ball."""
        return per_ball(self.shape, len(self.positions))

    def balls(self) -> tuple[Ball, ...]:
        """Return the balls; raises `InvalidProblem` where keys and shapes do not match."""
        size, shapes = len(self.positions), self.shapes
        if not size:
            return ()  # which `Problem` refuses
        if len(shapes) != size:
            raise InvalidProblem(f"balls.shape: needs one name or one per ball ({size}), got {len(shapes)}")
        values: list[dict[str, Any]] = [{} for _ in shapes]
        texts = []
        for key in dict.fromkeys(k for keys in SHAPE_KEYS.values() for k in keys):
            takers = [i for i, shape in enumerate(shapes) if key in SHAPE_KEYS[shape]]
            value = getattr(self, key)
            if value is None or not takers:
                texts += self._without_value_or_taker(key)
                continue
            single = not isinstance(value[0], tuple) if key == "semi_axes" else not isinstance(value, tuple)
            each = (value,) * len(takers) if single else value
            if len(each) != len(takers):
                which = "" if len(takers) == size else f" of {_or(shapes[i] for i in takers)}"
                texts.append(f"balls.{key}: needs one value or one per ball{which} ({len(takers)}), got {len(each)}")
            for i, own in zip(takers, each, strict=False):
                values[i][key] = own
        if texts:
            raise InvalidProblem(*texts)
        balls = []
        for i, (place, shape) in enumerate(zip(self.positions, shapes, strict=True)):
            try:
                own = [values[i][key] for key in SHAPE_KEYS[shape]]
                body = BODIES.get(shape)
                balls.append(Ball(place, own[0], shape) if body is None else Ball(place, shape=body(*own)))
            except InvalidProblem as error:
                texts += [text.replace(":", f"[{i}]:", 1) for text in error.faults]
        if texts:
            raise InvalidProblem(*texts)
        return tuple(balls)

    def _without_value_or_taker(self, key: str) -> list[str]:
        """Return the fault of a key that the scene's shapes need and that is missing, or that none of them has."""
        value, taking = getattr(self, key), [name for name, keys in SHAPE_KEYS.items() if key in keys]
        present = dict.fromkeys(self.shapes)
        if value is None:
            needing = [name for name in present if name in taking]
            return [f"balls.{key}: is missing, which shape = {_or(needing)} takes"] if needing else []
        taken = dict.fromkeys(k for name in present for k in SHAPE_KEYS[name])
        return [
            f"balls.{key}: is not for shape = {_or(present)}, which takes {' and '.join(taken)}, got {value}; "
            f"leave it out, or take shape = {_or(taking)}"
        ]


def _or(names: Iterable[str]) -> str:
    return " or ".join(f'"{name}"' for name in dict.fromkeys(names))


def per_ball(value: T | tuple[T, ...], size: int) -> tuple[T, ...]:
    """Return one value per ball."""
    return value if isinstance(value, tuple) else (value,) * size
