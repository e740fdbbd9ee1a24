"""The elastic regions of a mesh: layer and substrate, each with its constants and the form of its elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import dolfinx
import numpy as np
from petsc4py import PETSc

from finite_strain import compat
from finite_strain.discretisation.unknowns import idle_dofs
from finite_strain.mechanics.volumetric import Compressible, Mixed, Volumetric, describe_forms, volume_stiffness
from linear_bem.law import Energy, Law, NeoHookean
from linear_bem.problem import Elastic, Problem
from meshes.box import TAGS


@dataclass(frozen=True)
class Bulk:
    """A region of the mesh, its elastic constants and law (None: small strain), mu and the volumetric energy in forms.

    In mixed form it has a ``pressure`` unknown [m], to be multiplied by ``unit`` [Pa/m]; ``idle`` are its local dofs
    that no cell of the region touches; they are held at zero.
    """

    tag: int
    solid: Elastic
    law: Law | Energy | None
    shear: Any
    volumetric: Volumetric
    pressure: Any = None
    unit: float = 0.0
    idle: Any = None


def make_bulks(problem: Problem, mesh: Any, cell_tags: Any, order: int, length: float, stiffened: Any) -> list[Bulk]:
    """Return the regions; in mixed form each has its own pressure of this ``order``, which jumps between regions.

    At finite strain the layer has the scene's law, and a substrate, which hardly strains, is neo-Hookean. Lame's
    constants are constant in each cell. ``length`` [m] scales the pressure unknown; ``stiffened`` is 1 where the mixed
    form needs its stiffness against changes of volume, else 0.
    """
    space = compat.function_space(mesh, 0, discontinuous=True)
    shear, lame = dolfinx.fem.Function(space, name="mu"), dolfinx.fem.Function(space, name="lambda")
    bulks, effect = [], problem.finite_strain
    for name, form in describe_forms(problem).items():
        tag, solid = TAGS[name], getattr(problem, name)
        mu, cells = solid.shear_modulus, cell_tags.find(tag)
        shear.x.array[cells] = mu
        chosen = NeoHookean() if effect is None or name == "substrate" else with_constants(effect.chosen, mesh)
        law = None if effect is None else chosen
        if form == "displacement":
            lame.x.array[cells] = solid.lame_first
            bulks.append(Bulk(tag, solid, law, shear, Compressible(lame)))
            continue
        # on a separate space, to which its constraints belong
        pressure, unit = dolfinx.fem.Function(compat.function_space(mesh, order), name=f"{name}_pressure"), mu / length
        compliance, stiffness = 1.0 / solid.lame_first, volume_stiffness(mu, solid.lame_first)
        volumetric = Mixed(
            constant(mesh, unit) * pressure, constant(mesh, compliance), stiffened * constant(mesh, stiffness)
        )
        bulks.append(Bulk(tag, solid, law, shear, volumetric, pressure, unit, idle_dofs(pressure, cells)))
    return bulks


def with_constants(law: Law | Energy, mesh: Any) -> Any:
    """Return a law whose parameters are constants of the mesh, so that one compiled form serves every value."""
    if not isinstance(law, Law):
        return law
    parts = {
        name: tuple(constant(mesh, v) for v in value) if isinstance(value, Sequence) else constant(mesh, value)
        for name, value in vars(law).items()
    }
    return replace(law, **parts)


def constant(mesh: Any, value: float | tuple[float, ...]) -> Any:
    """Return a constant of the mesh, so that one compiled form serves every value."""
    return dolfinx.fem.Constant(mesh, np.asarray(value, dtype=PETSc.ScalarType))


def pressures(bulks: list[Bulk]) -> dict[str, Any]:
    """Return the pressures [Pa] of mixed regions as new functions, by name."""
    found = {}
    for bulk in bulks:
        if bulk.pressure is not None:
            found[bulk.pressure.name] = pressure = bulk.pressure.copy()
            pressure.x.array[:] *= bulk.unit
    return found


def nothing_where_idle(bulks: list[Bulk], measure: Any) -> Any:
    """Return a zero form that gives idle pressure unknowns outside their region an entry in the matrix."""
    return sum(
        constant(bulk.pressure.function_space.mesh, 0.0) * bulk.pressure**2 * measure(other.tag, degree=0)
        for bulk in bulks
        for other in bulks
        if bulk.pressure is not None and bulk is not other
    )
