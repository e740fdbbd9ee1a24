"""Frictionless contact of the layer's top with rigid indenters, as an energy of the form language.

Per area the contact potential is k/2 (<s - g>^2 - s^2), with the gap g, the penalty k, <.> the positive part,
and s = <-g> of an earlier equilibrium, or zero: the augmented Lagrangian with multiplier k s [Alart Curnier 1991,
doi 10.1016/0045-7825(91)90022-X; frictionless]. The multiplier is an expression in the displacement of that earlier
state, so nothing is stored at quadrature points. Residual, tangent and the forces on the balls follow by
differentiation: the force on a ball is the derivative of the potential with respect to the ball's position.

The area is the undeformed one, or the deformed one that faces the indenter. In the second case the potential is, to
first order in the gap over the indenter's radius, the integral of k <-g> over the volume in which layer and indenter
overlap: the contact exerts a pressure. In the first case it exerts a load of fixed direction, for which Newton's method
converges in longer steps, but which makes deep contacts unstable (`finite_strain.geometry.estimates.is_stable`).

One compiled form serves any number of balls: which ball a facet may touch, and that ball's position, radius and
approach, are constants of the cells below the facets. A facet has two candidates of each kind of indenter, because
between two balls either may come into contact first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from finite_strain import compat
from finite_strain.contact.symbolic import Symbolic
from finite_strain.geometry.symmetry import Reduction
from linear_bem.indenter import Indenter
from linear_bem.problem import NAMED_SHAPES
from meshes.box import TAGS

CANDIDATES = 2
"""Balls of one kind that one facet may touch."""
REACH = 1.5
"""Horizontal distance of a facet from a ball's axis, over the ball's reach, up to which it may touch (undeformed)."""
_NONE = 1e300
"""Height [m] that stands for none, in the order of a facet's candidates."""


def positive(value: Any) -> Any:
    """Return the positive part of an expression."""
    return ufl.conditional(ufl.gt(value, 0), value, 0)


@dataclass(frozen=True, eq=False)
class Penalised:
    """A state whose penetration is the contact pressure over the penalty: the source of the multipliers.

    Nodal displacement (nodes, 3) [m], and of each ball (balls,) the approach [m] and the penalty [Pa/m]. ``turning`` is
    that of `Contact`: a pressure is per deformed area if the potential is.
    """

    displacement: np.ndarray
    approaches: np.ndarray
    penalties: np.ndarray
    turning: float


class _Slot:
    """A candidate ball of every cell: its number ``balls`` (cells,), -1 for none, its constants, and derived fields."""

    def __init__(self, contact: Contact, kind: Any, space: Any, balls: np.ndarray) -> None:
        self.kind, self.balls = kind, balls
        names = ("x", "y", "radius", "approach", "earlier", "penalty", "chosen")
        self.fields = {name: dolfinx.fem.Function(space, name=name) for name in names}
        self.x, self.y, self.approach = (ufl.variable(self.fields[name]) for name in ("x", "y", "approach"))
        displacement = ufl.variable(contact.displacement)
        self.gap = self._gap(contact, displacement, self.approach)
        self.gradient = ufl.variable(ufl.grad(contact.displacement))
        area = self.steepness = 1
        if contact.finite:
            slope = ufl.diff(self.gap, displacement)
            area += contact.turning * (facing(slope, self.gradient) - 1)
            self.steepness = ufl.sqrt(ufl.dot(slope, slope))  # 1 where the gap is a distance
        earlier = positive(-self._gap(contact, contact.earlier, self.fields["earlier"]))
        self.overlap = earlier * contact.augmented
        self.pressed = positive(self.overlap - self.gap)
        self.pressure = self.fields["penalty"] * self.pressed * area
        self.density = self.fields["penalty"] / 2 * (self.pressed**2 - self.overlap**2) * area

    def where_pressed(self, value: Any) -> Any:
        """Return an expression, zero where there is no pressure: there the gap may have no value."""
        return ufl.conditional(ufl.gt(self.pressed, 0), value, 0)

    def _gap(self, contact: Contact, displacement: Any, approach: Any) -> Any:
        X = ufl.SpatialCoordinate(contact.mesh)
        offset = (X[0] - self.x, X[1] - self.y, X[2])
        return gap(self.kind, self.fields["radius"], offset, displacement, approach, contact.finite, contact.angle)


class Contact:
    """The contact energy of all balls of a reduced scene and its derivatives."""

    def __init__(self, displacement: Any, facet_tags: Any, reduction: Reduction, finite: bool, degree: int) -> None:
        space, balls = displacement.function_space, reduction.balls
        self.mesh, self.balls, self.angle, self.finite = space.mesh, balls, reduction.angle, finite
        self.displacement, self.earlier = displacement, dolfinx.fem.Function(space, name="earlier_displacement")
        self.augmented = dolfinx.fem.Constant(self.mesh, PETSc.ScalarType(0.0))
        self.turning = dolfinx.fem.Constant(self.mesh, PETSc.ScalarType(0.0))
        """1 where the potential is per deformed area, 0 where it is per undeformed area."""
        self.facets, self.cells = _top_cells(self.mesh, facet_tags.find(TAGS["top"]))
        self.slots = self._make_slots()
        near = np.any([slot.balls[self.cells] >= 0 for slot in self.slots], axis=0)
        self.touchable = np.unique(self.cells[near]).astype(np.int32)
        """The cells below the top that may touch a ball."""
        marked = np.sort(self.facets[near]).astype(np.int32)
        tags = dolfinx.mesh.meshtags(self.mesh, 2, marked, np.ones(len(marked), dtype=np.int32))
        measure = ufl.Measure("ds", domain=self.mesh, subdomain_data=tags, metadata={"quadrature_degree": degree})
        self.measure = measure(1)
        self.set("x", [ball.position[0] for ball in balls])
        self.set("y", [ball.position[1] for ball in balls])
        self.set("radius", [ball.radius for ball in balls], default=1.0)
        self.approaches = self.penalties = np.zeros(len(balls))

    def _make_slots(self) -> list[_Slot]:
        """Assign to every cell below the top the balls that it may touch, of each kind the smallest gap first."""
        index_map = self.mesh.topology.index_map(3)
        constants = compat.function_space(self.mesh, 0, discontinuous=True)
        corners = self.mesh.geometry.x[compat.geometry_dofs(self.mesh)[self.cells, :8]]
        slots = []
        for kind in dict.fromkeys(ball.shape for ball in self.balls):
            numbers = np.array([n for n, ball in enumerate(self.balls) if ball.shape == kind])
            alike = [self.balls[n] for n in numbers]
            away = corners[:, None, :, :2] - np.array([ball.position for ball in alike])[None, :, None]
            x, y, _ = _turned((away[..., 0], away[..., 1], 0.0), self.angle)
            indenter, unit = _body(kind, np.array([ball.radius for ball in alike])[:, None])
            with np.errstate(all="ignore"):  # of a body that has no height there
                heights = np.mean(unit * np.fmin(indenter.height(x / unit, y / unit), _NONE), axis=2)
            reach = np.array([ball.reach for ball in alike])
            heights[np.linalg.norm(away, axis=-1).min(axis=2) > REACH * reach] = np.inf
            order = np.argsort(heights, axis=1)
            for rank in range(min(CANDIDATES, len(numbers))):
                chosen = order[:, rank]
                touched = np.isfinite(heights[np.arange(len(chosen)), chosen])
                balls = np.full(index_map.size_local + index_map.num_ghosts, -1)
                balls[self.cells[touched]] = numbers[chosen[touched]]
                slots.append(_Slot(self, kind, constants, balls))
        return slots

    def set(self, name: str, per_ball: np.ndarray | list[float], default: float = 0.0) -> None:
        """Set every cell to the value of its candidate balls, ``default`` where it has none."""
        for slot in self.slots:
            slot.fields[name].x.array[:] = np.append(np.asarray(per_ball, dtype=float), default)[slot.balls]

    @property
    def energy(self) -> Any:
        """The contact potential [J] as a form."""
        return sum(slot.density * self.measure for slot in self.slots)

    def set_approaches(self, approaches: np.ndarray) -> None:
        """Move the balls to approaches (balls,) [m]."""
        self.approaches = np.array(approaches, dtype=float)
        self.set("approach", self.approaches)

    def set_penalties(self, penalties: np.ndarray) -> None:
        """Give each ball its penalty (balls,) [Pa/m]."""
        self.penalties = np.array(penalties, dtype=float)
        self.set("penalty", self.penalties)

    @property
    def penalised(self) -> Penalised:
        """The present penalised state, for `augment`."""
        nodal = self.displacement.x.array.reshape(-1, 3).copy()
        return Penalised(nodal, self.approaches.copy(), self.penalties.copy(), float(self.turning.value))

    def augment(self, source: Penalised, stiffer: float) -> None:
        """Take the multipliers from a state without multipliers; multiply its penalties by the factor ``stiffer``.

        That state stays an equilibrium until `close_gaps` is called.
        """
        self.earlier.x.array[:] = source.displacement.ravel()
        self.set_penalties(stiffer * source.penalties)
        self.turning.value = float(source.turning)
        self.set("earlier", source.approaches)
        self.augmented.value = 1.0 / stiffer - 1.0

    def close_gaps(self, share: float) -> None:
        """Change the equilibrium condition so that a share of the source state's penetration vanishes."""
        self.augmented.value += share

    def stiffen(self, factor: float) -> None:
        """Multiply the penalties by a factor; the multipliers stay as they are."""
        self.set_penalties(factor * self.penalties)
        self.augmented.value /= factor

    def forget_multipliers(self) -> None:
        """Set the multipliers to zero."""
        self.augmented.value = 0.0

    def choose(self, balls: np.ndarray) -> None:
        """Set the weights (balls,) of the balls in `readings`, `configurational_form`, `pressure` and `penetration`."""
        self.set("chosen", balls)

    def readings(self) -> dict[str, Any]:
        """Return forms of the chosen balls by name.

        The force along "x", "y" and "normal" [N], its "stiffness" [N/m], and over the undeformed surface "moment",
        int p g [N m], and "weight", int p [N]. Forces are the derivative of the potential by the ball's position, with
        the sign of the force on the ball; the stiffness is the second derivative by its approach.
        """
        sums: dict[str, Any] = {}
        for slot in self.slots:
            normal = ufl.diff(slot.density, slot.approach)
            values = {
                "x": -ufl.diff(slot.density, slot.x), "y": -ufl.diff(slot.density, slot.y), "normal": normal,
                "stiffness": ufl.diff(normal, slot.approach),
                "moment": slot.where_pressed(slot.pressure * slot.gap), "weight": slot.pressure,
            }  # fmt: skip
            for name, value in values.items():
                sums[name] = sums.get(name, 0) + slot.fields["chosen"] * value * self.measure
        return sums

    def configurational_form(self, weight: Any, axis: Any) -> Any:
        """Return the surface terms of the domain integral for the chosen ball's force along ``axis`` (3,) [N].

        With the weight q they are -int (w delta_kJ - u_i,k dw/du_i,J) q,J - int (c - q) dw/dx_k, where c is 1 for the
        chosen ball, 0 for others, and x_k the ball's position; all vanish where q = c on the contacts.
        """
        total = 0
        for slot in self.slots:
            slope = axis[0] * ufl.diff(slot.density, slot.x) + axis[1] * ufl.diff(slot.density, slot.y)
            total += -slot.density * ufl.dot(axis, ufl.grad(weight)) * self.measure
            if self.finite:
                moved = ufl.outer(ufl.dot(slot.gradient, axis), ufl.grad(weight))
                total += ufl.inner(ufl.diff(slot.density, slot.gradient), moved) * self.measure
            total += -(slot.fields["chosen"] - weight) * slope * self.measure
        return total

    def pressure(self) -> Any:
        """Return the chosen balls' pressure per undeformed area [Pa], an expression in the cells below the top."""
        return sum(slot.fields["chosen"] * slot.where_pressed(slot.pressure * slot.steepness) for slot in self.slots)

    def penetration(self) -> Any:
        """Return the distance of the surface inside a chosen ball in contact [m], also an expression."""
        return sum(
            ufl.conditional(ufl.gt(slot.fields["chosen"] * slot.pressure, 0), positive(-slot.gap) / slot.steepness, 0)
            for slot in self.slots
        )


def facing(slope: Any, gradient: Any) -> Any:
    """Return the deformed over the undeformed area of the top that faces the indenter, never negative.

    ``slope`` is the gap's gradient (3,): over the square of its length, because a gap need not be a distance.
    """
    F = ufl.Identity(3) + gradient
    return positive(-ufl.dot(slope, ufl.cross(F[:, 0], F[:, 1])) / ufl.dot(slope, slope))


@np.errstate(all="ignore")  # a body may have no height beyond its reach
def gap(
    shape: str | Indenter, radius: Any, offset: Any, displacement: Any, approach: Any, finite: bool, angle: float = 0.0
) -> Any:
    """Return the gap [m] of points ``offset`` (3,) [m] from the ball's axis at the undeformed surface.

    ``angle`` is that of the model's frame in the scene, in which a user's body keeps its orientation.

    At finite strain it is the distance of the displaced point from the indenter. At small strain it is the profile over
    the undeformed point minus the vertical displacement: pressure acts vertically, and an in-plane force arises only
    through the profile's slope (the paper's eq. 13).
    """
    indenter, unit = _body(shape, radius)
    if angle and not isinstance(shape, str):
        offset, displacement = (_turned(vector, angle) for vector in (offset, displacement))
    if finite:
        x, y, z = ((offset[i] + displacement[i]) / unit for i in range(3))
        return unit * indenter.gap(Symbolic(x), Symbolic(y), Symbolic(z + approach / unit)).expression
    x, y = (Symbolic(offset[i] / unit) for i in range(2))
    return unit * indenter.height(x, y).expression - approach - displacement[2]


def _body(shape: str | Indenter, radius: Any) -> tuple[Indenter, Any]:
    """Return a ball's body and its unit of length [m]."""
    return (NAMED_SHAPES[shape](1.0), radius) if isinstance(shape, str) else (shape, 1.0)


def _turned(vector: Any, angle: float) -> tuple[Any, Any, Any]:
    """Return a vector of the model's frame in the scene's axes."""
    c, s = math.cos(angle), math.sin(angle)
    return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]


def _top_cells(mesh: Any, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the top facets whose cell this rank owns, and these cells."""
    mesh.topology.create_connectivity(2, 3)
    links = mesh.topology.connectivity(2, 3)
    cells = np.array([links.links(facet)[0] for facet in facets], dtype=np.int32)
    owned = cells < mesh.topology.index_map(3).size_local
    return np.asarray(facets)[owned], cells[owned]
