"""The merit function of the mixed form's line search: it falls along Newton steps and suffices for deep balls."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from finite_strain.equilibrium.line_search import KAPPA, Merit
from linear_bem import Elastic
from tests.finite_strain.scenes import STIFF_SUBSTRATE, coarse_plan, coarse_rig, pair, relatively

if TYPE_CHECKING:
    from pathlib import Path

    from petsc4py import PETSc

    from tests.finite_strain.scenes import Rig


def pressed(poisson: float, substrate: Elastic, folder: Path) -> Rig:
    """Return a pair on a coarse mesh, far from equilibrium: solved at half the load, then set to the full approach."""
    rig = coarse_rig(coarse_plan(pair(0.1, poisson=poisson, substrate=substrate)), folder)
    rig.press([0.5])
    rig.model.contact.set_approaches(np.array([0.1]))
    return rig


def newton_step(rig: Rig, residual: PETSc.Vec, step: PETSc.Vec) -> None:
    """Solve with the tangent at the present state."""
    rig.model.tangent()
    factors = rig.solver.linear.factors()
    factors.solve(residual, step)
    factors.destroy()


@pytest.mark.parametrize(("poisson", "below"), [(0.4999, STIFF_SUBSTRATE), (0.5, Elastic(2.0, 0.5))])
def test_its_slope_along_a_newton_step_is_minus_the_stiffness_of_the_step(
    poisson: float, below: Elastic, tmp_path: Path
) -> None:
    rig = pressed(poisson, below, tmp_path)
    model = rig.model
    x, step, change, product = (model.matrix.createVecRight() for _ in range(4))
    merit = Merit(model, x)
    model.fields.get(x)
    model.residual(product)
    newton_step(rig, product, step)  # as PETSc has it: the new state is x - step
    merit.aim(x, step)
    tangent = model.matrix
    first = model.fields.ranges[0]
    change.array[:] = 0.0
    change.array[first] = step.array_r[first]
    tangent.mult(change, product)
    volumes = product.array_r[first.stop :]
    slope = -float(change.dot(product)) - float(model.volume_weights(KAPPA) @ volumes**2)
    assert slope < 0.0
    t = 1e-5
    at = []
    for side in (-t, t):
        x.copy(change)
        change.axpy(-side, step)
        at.append(merit(change))
    assert (at[1] - at[0]) / (2.0 * t) == relatively(slope, 1e-5)  # the contact's edge moves: second order in t


def test_an_inverted_displacement_is_rejected(tmp_path: Path) -> None:
    rig = pressed(0.4999, STIFF_SUBSTRATE, tmp_path)
    x, step = rig.model.matrix.createVecs()
    merit = Merit(rig.model, x)
    rig.model.fields.get(x)
    step.set(0.0)
    merit.aim(x, step)
    assert math.isfinite(merit(x))
    nodal = x.array[rig.model.fields.ranges[0]].reshape(-1, 3)
    nodal[:, 2] -= 3.0 * rig.model.fields.points[0][: len(nodal), 2]  # the layer turned upside down
    assert math.isnan(merit(x))


def test_a_nearly_incompressible_pair_is_pressed_to_half_its_layer_without_a_cut_back(tmp_path: Path) -> None:
    fractions = list(np.linspace(0.1, 1.0, 10))
    rig = coarse_rig(coarse_plan(pair(0.55, poisson=0.4999, substrate=STIFF_SUBSTRATE)), tmp_path)
    records = rig.press(fractions)
    assert [record.fraction for record in records] == relatively(fractions, 1e-12)
    assert sum(record.cuts for record in records) == 0
    assert max(record.newton_iterations for record in records) <= 40
